"""A report's page as a reader, or a browser, has it."""

import base64
from html.parser import HTMLParser


class Page(HTMLParser):
    """What a page shows: its text, its pictures, and everything that it refers to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.words: list[str] = []
        self.pictures: dict[str, str] = {}
        self.references: list[str] = []
        self.tags: list[str] = []
        self.feed(text)
        self.text = " ".join(" ".join(self.words).split())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep pictures and references."""
        values = {k: v or "" for k, v in attrs}
        self.tags.append(tag)
        self.references += [v for k, v in values.items() if k in ("src", "href", "srcset")]
        if tag == "img":
            self.pictures[values["alt"]] = values["src"]

    def handle_data(self, data: str) -> None:
        """Keep text that is shown."""
        if self.tags[-1:] != ["style"]:
            self.words.append(data)


def svg_of(page: Page, alt: str) -> str:
    """Return the SVG text of the figure whose description has `alt` in it."""
    uri = next(src for name, src in page.pictures.items() if alt in name)
    head, _, data = uri.partition(",")
    assert head == "data:image/svg+xml;base64"
    return base64.b64decode(data).decode()
