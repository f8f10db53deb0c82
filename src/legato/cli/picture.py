"""Picture files and picks as the offline commands read them."""

import csv
import io
import json
import math
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from legato.cli.exits import Exit, Failure

if TYPE_CHECKING:
    from legato.config.schema import CameraTable
    from legato.hal.camera import Image

LARGEST_FILE = 200_000_000  # bytes of a picture file; what it holds is limited at decoding
LARGEST_PICKS = 100_000


picks_option = click.option(
    "--picks",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Marks picked by a person: JSON or TOML with P1 = [u, v], or CSV lines of name,u,v.",
)


def read_picture(path: Path, camera: "CameraTable | None" = None) -> "Image":
    """Return a picture file's grey picture; of the camera's size, where one is given.

    Raises PictureError for a file that is no usable picture, Failure for another size or file.
    """
    from legato.vision.picture import decode

    image = decode(_bytes(path, LARGEST_FILE))
    if camera is not None and image.shape != (camera.height, camera.width):
        raise Failure(
            f"{path} has {image.shape[1]}x{image.shape[0]} px, "
            f"the configured camera {camera.width}x{camera.height}",
            Exit.USAGE,
            "give a picture of that camera, or set camera.width and camera.height",
        )
    return image


def read_picks(path: Path, names: Iterable[str] | None = None) -> dict[str, tuple[float, float]]:
    """Return marks that a person picked, {name: (u, v)} in px, of a JSON, TOML or CSV file.

    JSON and TOML: a table of `P1 = [u, v]`, or one named `marks`. CSV: lines of name,u,v. Raises
    Failure for anything else, and for other names than `names`, where those are known here.
    """
    try:
        text = _bytes(path, LARGEST_PICKS).decode("utf-8")
        picks = dict(_pairs(path, text))
    except (ValueError, TypeError, RecursionError) as error:
        hint = "give JSON or TOML with P1 = [u, v], or CSV lines of name,u,v"
        raise Failure(f"{path}: no picks: {error}", Exit.USAGE, hint) from error
    known = set(names if names is not None else picks)
    for name in picks:
        if name not in known:
            hint = f"the leg's marks are {', '.join(sorted(known))}"
            raise Failure(f"{path}: the leg has no mark {name!r}", Exit.USAGE, hint)
    if not picks:
        raise Failure(f"{path}: no picks in it", Exit.USAGE)
    return picks


def _pairs(path: Path, text: str) -> Iterable[tuple[str, tuple[float, float]]]:
    """Yield each name with its place; raises ValueError or TypeError."""
    kind = path.suffix.lower()
    if kind == ".csv":
        yield from _csv_pairs(text)
        return
    table: Any = (
        json.loads(text, object_pairs_hook=_once) if kind == ".json" else (tomllib.loads(text))
    )
    table = table.get("marks", table) if isinstance(table, Mapping) else table
    if not isinstance(table, Mapping):
        raise TypeError("expected a table of names")
    for name, place in table.items():
        if not isinstance(place, list) or len(place) != 2:
            raise ValueError(f"{name} is {place!r}, expected [u, v]")
        yield str(name), _place(name, place[0], place[1])


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a JSON table; raises ValueError for a name that it has twice."""
    table = dict(pairs)
    if len(table) < len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"{next(n for n in names if names.count(n) > 1)} stands twice")
    return table


def _csv_pairs(text: str) -> Iterable[tuple[str, tuple[float, float]]]:
    """Yield the pairs of CSV lines; a first line of words is a heading."""
    seen = set()
    for number, row in enumerate(csv.reader(io.StringIO(text)), start=1):
        cells = [cell.strip() for cell in row]
        if not any(cells) or (number == 1 and cells[1:3] == ["u", "v"]):
            continue
        if len(cells) != 3:
            raise ValueError(f"line {number} has {len(cells)} fields, expected name,u,v")
        if cells[0] in seen:
            raise ValueError(f"line {number} names {cells[0]} again")
        seen.add(cells[0])
        yield cells[0], _place(cells[0], float(cells[1]), float(cells[2]))


def _place(name: str, u: Any, v: Any) -> tuple[float, float]:
    """Return a place in px; raises ValueError for what is no finite number."""
    for value in (u, v):
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"{name} has {value!r}, expected a number")
        if not math.isfinite(value):
            raise ValueError(f"{name} has {value!r}, expected a finite number")
    return float(u), float(v)


def _bytes(path: Path, most: int) -> bytes:
    """Return a file's bytes; raises OSError, and Failure where it is not there or too large."""
    try:
        with path.open("rb") as stream:
            data = stream.read(most + 1)
    except FileNotFoundError as error:
        raise Failure(f"there is no file {path}", Exit.USAGE) from error
    if len(data) > most:
        raise Failure(f"{path} is larger than {most} bytes", Exit.USAGE)
    return data
