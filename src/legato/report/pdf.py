"""The report of a session as PDF: what the HTML page says, set for paper.

Typst sets it from a template of its own, filled with the page's content. Every value reaches it
as a string literal, so that nothing in a record is read as markup. Fonts are matplotlib's own:
the same on every host.
"""

import base64
import tempfile
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from legato.records.errors import told as told_error
from legato.records.files import make_folder, replace_file
from legato.records.record import SessionRecord
from legato.report.html import content, environment

TEMPLATE = "session.typ.j2"
ENDINGS = {"data:image/svg+xml": "svg", "data:image/jpeg": "jpg"}


class NeedsTypst(RuntimeError):
    """The typesetter is not installed."""


def write_pdf(record: SessionRecord, path: Path | None = None) -> Path:
    """Write the report of a session as PDF, by default report.pdf in its folder.

    Raises NeedsTypst without the typesetter, RecordError where the file cannot be written.
    """
    target = path if path is not None else record.path / "report.pdf"
    typesetter()  # seen to be there before anything is drawn
    page = typeset(content(record))
    make_folder(target.parent)
    with told_error("write", target):
        replace_file(target, page)
    return target


def typeset(shown: Mapping[str, Any]) -> bytes:
    """Return the PDF of a page's content."""
    from matplotlib import get_data_path

    typst = typesetter()
    with tempfile.TemporaryDirectory(prefix="legato-") as name:
        folder = Path(name)
        text = source({key: _laid_down(value, key, folder) for key, value in shown.items()})
        file = folder / "session.typ"
        file.write_text(text, encoding="utf-8")
        page: bytes = typst.compile(
            str(file),
            root=name,
            font_paths=[str(Path(get_data_path()) / "fonts" / "ttf")],
            ignore_system_fonts=True,
            timestamp=moment(shown["meta"]),
        )
    return page


def typesetter() -> Any:
    """Return Typst's module; raises NeedsTypst where it is not installed."""
    try:
        import typst
    except ModuleNotFoundError as error:
        raise NeedsTypst("a PDF needs typst: install legato[pdf]") from error
    return typst


def source(shown: Mapping[str, Any]) -> str:
    """Return the page in Typst's markup."""
    from markupsafe import Markup

    made = environment(finalize=in_markup)
    made.filters["code"] = lambda value: Markup(literal(value))
    return made.get_template(TEMPLATE).render(**shown)


def literal(value: Any) -> str:
    """Return a value as a literal of Typst's: a truth, a number, or a string of it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return f"{float(value):.6f}"
    text = "".join(c for c in str(value) if c.isprintable() or c == "\n")
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def in_markup(value: Any) -> Any:
    """Return a value as it stands in markup: a string literal, but for what is code already."""
    from markupsafe import Markup

    if isinstance(value, Markup):
        return value
    return Markup(f"#{literal(str(value))};")


def moment(meta: Mapping[str, Any]) -> datetime:
    """Return when the session ended, or began: the same record gives the same file."""
    for key in ("ended", "started"):
        try:
            found = datetime.fromisoformat(str(meta.get(key))).replace(microsecond=0)
        except ValueError:
            continue
        return found if found.tzinfo is not None else found.replace(tzinfo=UTC)
    return datetime(1970, 1, 1, tzinfo=UTC)


def _laid_down(value: Any, key: str, folder: Path) -> Any:
    """Return a picture's file name, its data URI written to a file; anything else as it is."""
    head, comma, data = value.partition(",") if isinstance(value, str) else ("", "", "")
    ending = ENDINGS.get(head.removesuffix(";base64"))
    if not comma or ending is None:
        return value
    name = f"{key}.{ending}"
    (folder / name).write_bytes(base64.b64decode(data))
    return name
