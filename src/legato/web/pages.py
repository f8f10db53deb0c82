"""What every open page is sent: named sections, each as it stands last, encoded once for all.

Nothing queues: a page that is slow skips to the latest of each section, and slows nobody.
"""

import asyncio
from typing import Any

import msgspec

REST_S = 0.015  # between two messages to one page: what comes meanwhile goes together


class Page:
    """One open page: the sections that it has not been sent yet."""

    def __init__(self, sections: dict[str, bytes]) -> None:
        self._sections = sections
        self._due = dict.fromkeys(sections)
        self._changed = asyncio.Event()
        if sections:
            self._changed.set()

    def want(self, name: str) -> None:
        """Note that a section has changed."""
        self._due[name] = None
        self._changed.set()

    async def message(self) -> bytes:
        """Return all that this page lacks as one JSON object by section, once there is any."""
        await self._changed.wait()
        due, self._due = self._due, {}
        self._changed.clear()
        members = (b'"%s":%s' % (name.encode(), self._sections[name]) for name in due)
        return b"{" + b",".join(members) + b"}"


class Pages:
    """All open pages and the sections that they share; one event loop uses it."""

    def __init__(self) -> None:
        self._sections: dict[str, bytes] = {}
        self._open: set[Page] = set()

    def __len__(self) -> int:
        return len(self._open)

    def publish(self, name: str, value: Any) -> None:
        """Replace a section; pages are told where it says something new."""
        body = msgspec.json.encode(value)
        if self._sections.get(name) == body:
            return
        self._sections[name] = body
        for page in self._open:
            page.want(name)

    def join(self) -> Page:
        """Return a new page, which lacks everything."""
        page = Page(self._sections)
        self._open.add(page)
        return page

    def leave(self, page: Page) -> None:
        """Forget a page that was closed."""
        self._open.discard(page)
