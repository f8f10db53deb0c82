"""Tables and words in Markdown, for generated pages."""

import re
from collections.abc import Iterable

CODE = re.compile(r"(`[^`]*`)")


def table(head: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return a table; pipes and line breaks in cells are made harmless."""
    names = list(head)
    lines = ["| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
    lines += ["| " + " | ".join(_cell(c) for c in row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def words(items: Iterable[object]) -> str:
    """Return items in code, separated by commas."""
    return ", ".join(f"`{i}`" for i in items)


def plain(text: str) -> str:
    """Return text whose signs mean nothing in Markdown or HTML, outside of code."""
    parts = CODE.split(text)
    return "".join(p if p.startswith("`") else _harmless(p) for p in parts)


def _harmless(text: str) -> str:
    text = text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return re.sub(r"([*_\[\]$\\])", r"\\\1", text)


def _cell(value: object) -> str:
    return " ".join(str(value).split()).replace("|", "\\|")
