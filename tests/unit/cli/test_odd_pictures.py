"""Files that are no pictures, or odd ones, at `detect` and `solve`: one line, never a traceback."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from legato.cli.exits import Exit
from legato.drivers.sim.render import Renderer, paste_marks
from legato.drivers.sim.settings import SimSettings
from legato.drivers.sim.world import drawn_pose
from legato.geometry.leg import Leg
from legato.geometry.projection import Intrinsics
from legato.geometry.transforms import invert, look_at
from legato.hal.camera import Image
from tests.unit.cli.samples import document, run


@pytest.fixture(scope="module")
def leg() -> Image:
    """Return a picture of the leg."""
    s, rng = SimSettings(), np.random.default_rng(4)
    from_world = invert(look_at(s.camera_at_mm, s.camera_looks_at_mm))
    camera = Intrinsics(s.alpha_u, s.alpha_v, s.u0, s.v0, s.k1, s.k2)
    renderer = Renderer(Leg(), camera, paste_marks(Leg(), 8.0, rng))
    return renderer.render(from_world @ drawn_pose(s, rng), from_world, rng)


def _file(kind: str, image: np.ndarray) -> bytes:
    return bytes(cv2.imencode(kind, image)[1].tobytes())


@pytest.mark.parametrize("command", ["detect", "solve"])
def test_files_that_are_no_pictures_end_with_one_line(
    cell: Path, leg: Image, tmp_path: Path, command: str
) -> None:
    """Empty, cut off, text, and fifty megapixels: code 1, one line that names the cause."""
    huge = np.zeros((7000, 7200), dtype=np.uint8)
    files = {
        "empty.png": (b"", "empty"),
        "text.png": (b"leg = 1\n" * 50, "no picture"),
        "cut.png": (_file(".png", leg)[:9000], "cut off"),
        "cut.jpg": (_file(".jpg", leg)[:9000], "cut off"),
        "cut.bmp": (_file(".bmp", leg)[:9000], "cut off"),
        "cut.tiff": (_file(".tiff", leg)[:9000], "damaged"),
        "huge.png": (_file(".png", huge), "50 megapixels"),
        "huge.jpg": (_file(".jpg", huge), "50 megapixels"),
    }
    for name, (data, why) in files.items():
        (tmp_path / name).write_bytes(data)
        result = run(command, tmp_path / name, "--config", cell)
        assert result.exit_code == Exit.FAILED, name
        assert isinstance(result.exception, SystemExit), name
        assert why in result.stderr, name
        assert len(result.stderr.splitlines()) == 1, result.stderr


def test_odd_pictures_of_the_leg_give_its_marks(cell: Path, leg: Image, tmp_path: Path) -> None:
    """Sixteen bits, and colour with alpha, give the marks that the plain picture gives."""
    alpha = np.full_like(leg, 9)
    pictures = {
        "plain.png": leg,
        "wide.png": leg.astype(np.uint16) * 257,
        "twelve.png": leg.astype(np.uint16) << 4,
        "alpha.png": cv2.merge([leg, leg, leg, alpha]),
    }
    places = {}
    for name, image in pictures.items():
        (tmp_path / name).write_bytes(_file(".png", np.asarray(image)))
        result = run("detect", tmp_path / name, "--config", cell, "--json")
        assert result.exit_code == Exit.DONE, result.output
        places[name] = document(result)["marks"]
    plain = places.pop("plain.png")
    for marks in places.values():
        assert set(marks) == set(plain)
        assert np.abs(np.array(list(marks.values())) - list(plain.values())).max() < 0.05


@pytest.mark.parametrize("command", ["detect", "solve"])
def test_a_file_that_is_not_there_is_a_slip_of_the_pen(
    cell: Path, tmp_path: Path, command: str
) -> None:
    """Code 2, as for every wrong word on the command line, and the file's name."""
    result = run(command, tmp_path / "none.png", "--config", cell)
    assert result.exit_code == Exit.USAGE
    assert f"there is no file {tmp_path / 'none.png'}" in result.stderr
