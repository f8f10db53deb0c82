"""Fan-out to pages: what each lacks, together, and never a queue."""

import asyncio

import msgspec

from legato.web.pages import Pages


def test_a_new_page_gets_everything_and_then_only_what_changes() -> None:
    """Equal values are not sent again."""

    async def look() -> None:
        pages = Pages()
        pages.publish("a", 1)
        pages.publish("b", [2])
        page = pages.join()
        assert msgspec.json.decode(await page.message()) == {"a": 1, "b": [2]}
        pages.publish("a", 1)
        pages.publish("b", [3])
        assert msgspec.json.decode(await page.message()) == {"b": [3]}

    asyncio.run(look())


def test_a_slow_page_skips_to_the_latest() -> None:
    """A thousand changes while it slept are one message, and hold nobody up."""

    async def look() -> None:
        pages = Pages()
        slow, gone = pages.join(), pages.join()
        pages.leave(gone)
        for number in range(1000):
            pages.publish("arm", number)
        assert msgspec.json.decode(await slow.message()) == {"arm": 999}
        assert len(pages) == 1

    asyncio.run(look())
