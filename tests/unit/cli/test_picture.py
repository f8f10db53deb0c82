"""Pictures and picks as a person gives them."""

from pathlib import Path

import numpy as np
import pytest

from legato.cli.exits import Exit, Failure
from legato.cli.picture import read_picks, read_picture
from legato.config.schema import CameraTable
from legato.vision.picture import PictureError, encode_png

NAMES = ("P1", "P2", "P10")
WANTED = {"P1": (10.5, 20.0), "P10": (3.0, 4.0)}


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.json", '{"P1": [10.5, 20], "P10": [3, 4]}'),
        ("a.json", '{"marks": {"P1": [10.5, 20], "P10": [3, 4]}, "missing": []}'),
        ("a.toml", "P1 = [10.5, 20]\nP10 = [3.0, 4.0]\n"),
        ("a.toml", "[marks]\nP1 = [10.5, 20]\nP10 = [3.0, 4.0]\n"),
        ("a.csv", "name,u,v\nP1,10.5,20\n\nP10, 3, 4\n"),
        ("a.CSV", "P1,10.5,20\nP10,3,4"),
    ],
)
def test_picks_are_read_from_each_format(tmp_path: Path, name: str, text: str) -> None:
    """JSON, TOML and CSV give the same picks; detect's own document is one of them."""
    (tmp_path / name).write_text(text)
    assert read_picks(tmp_path / name, NAMES) == WANTED


@pytest.mark.parametrize(
    ("name", "text", "why"),
    [
        ("a.json", "[1, 2]", "a table of names"),
        ("a.json", '{"P1": [1]}', "expected [u, v]"),
        ("a.json", '{"P1": [1, "2"]}', "expected a number"),
        ("a.json", '{"P1": [1, NaN]}', "finite"),
        ("a.json", '{"P1": [true, 1]}', "expected a number"),
        ("a.json", '{"P7": [1, 2]}', "no mark 'P7'"),
        ("a.json", "{}", "no picks"),
        ("a.json", '{"P1": [1, 2], "P1": [3, 4]}', "P1 stands twice"),
        ("a.json", "{", "no picks"),
        ("a.json", "[" * 100_000, "no picks"),
        ("a.toml", "P1 = ", "no picks"),
        ("a.csv", "P1,1\n", "line 1 has 2 fields"),
        ("a.csv", "P1,1,2\nP1,1,2\n", "line 2 names P1 again"),
        ("a.csv", "P1,1,two\n", "two"),
        ("a.csv", "P1,1,inf\n", "finite"),
        ("a.csv", "x" * 100_001, "larger"),
    ],
)
def test_picks_that_cannot_be_used_are_refused(
    tmp_path: Path, name: str, text: str, why: str
) -> None:
    """Wrong shapes, numbers, names and sizes end with 2 and say what is wrong."""
    (tmp_path / name).write_text(text)
    with pytest.raises(Failure) as caught:
        read_picks(tmp_path / name, NAMES)
    assert caught.value.code == Exit.USAGE
    assert why in f"{caught.value.text} {caught.value.hint}"


def test_a_picture_of_another_size_is_refused(tmp_path: Path) -> None:
    """Intrinsics belong to a picture size; another one is named with both sizes."""
    file = tmp_path / "a.png"
    file.write_bytes(encode_png(np.zeros((480, 640), dtype=np.uint8)))
    assert read_picture(file).shape == (480, 640)
    with pytest.raises(Failure, match="640x480 px, the configured camera 768x576"):
        read_picture(file, CameraTable())


def test_what_is_no_picture_is_refused(tmp_path: Path) -> None:
    """A text file, and a folder, are an error of their own, not a traceback."""
    file = tmp_path / "a.png"
    file.write_text("no picture")
    with pytest.raises(PictureError):
        read_picture(file)
    with pytest.raises(OSError, match="Is a directory"):
        read_picture(tmp_path)
