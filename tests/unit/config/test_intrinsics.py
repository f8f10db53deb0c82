"""The intrinsics file: what is written reads back; what cannot be a camera is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from legato.calibration.problem import KnownIntrinsics
from legato.config.errors import ConfigError
from legato.config.intrinsics import read_intrinsics, write_intrinsics
from tests.unit.config.samples import known


def test_what_is_written_reads_back(tmp_path: Path) -> None:
    """Values and covariance come back to the last bit, with views, residual and date."""
    camera = known()
    file = tmp_path / "lens.toml"
    written = write_intrinsics(file, camera, views=12, rms_px=0.11, created="2026-11-20")
    found = read_intrinsics(file)
    assert found == written
    assert found.known().intrinsics == camera.intrinsics
    assert np.array_equal(found.known().covariance, camera.covariance)
    assert (found.views, found.rms_px, found.created) == (12, 0.11, "2026-11-20")
    assert [p.name for p in tmp_path.iterdir()] == ["lens.toml"]


def test_residuals_and_places_of_marks_read_back(tmp_path: Path) -> None:
    """What was found by view and by mark stands in the file; a file without it is as good."""
    file = tmp_path / "lens.toml"
    given: dict[str, Any] = {"views": 2, "rms_px": 0.11, "created": "2026-11-20"}
    plain = write_intrinsics(file, known(), **given)
    assert (plain.view_rms_px, plain.mark_rms_px, plain.marks) == ((), {}, {})
    more: dict[str, Any] = {
        "view_rms_px": [0.1, 0.12],
        "mark_rms_px": {"P1": 0.0},
        "marks": {"P1": [0, 0.1, 25]},
    }
    write_intrinsics(file, known(), **given, **more)
    found = read_intrinsics(file)
    assert (found.view_rms_px, found.mark_rms_px) == ((0.1, 0.12), {"P1": 0.0})
    assert found.marks == {"P1": (0.0, 0.1, 25.0)}


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("alpha_u = 652.0", "alpha_u = -1.0", "alpha_u"),
        ("alpha_u = 652.0", "", "alpha_u"),
        ("alpha_u = 652.0", "alpha_u = 652.0\nalpha = 1", "alpha"),
        ("u0 = 346.0", "u0 = 900.0", "u0"),
        ("v0 = 279.0", "v0 = nan", "v0"),
        ("width = 768", "width = '768'", "width"),
        ('created = "2026-11-20"', 'created = "soon"', "created"),
        ("[\n  [", "[\n  [1.0], [", "covariance"),
    ],
)
def test_a_wrong_file_is_refused_by_key(tmp_path: Path, old: str, new: str, key: str) -> None:
    """Each wrong, missing or unknown value is a ConfigError that names file and key."""
    file = tmp_path / "lens.toml"
    write_intrinsics(file, known(), views=12, rms_px=0.11, created="2026-11-20")
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    with pytest.raises(ConfigError) as caught:
        read_intrinsics(file)
    assert caught.value.file == str(file)
    assert caught.value.key.startswith(key)


@pytest.mark.parametrize(
    ("covariance", "why"),
    [
        (-np.eye(6), "negative variance"),
        (np.eye(6) + np.triu(np.ones((6, 6)), 1), "not symmetric"),
        (2.0 * np.ones((6, 6)) - np.eye(6), "eigenvalue"),
    ],
)
def test_a_matrix_that_is_no_covariance_is_not_written(
    tmp_path: Path, covariance: np.ndarray, why: str
) -> None:
    """Neither a negative variance nor an indefinite matrix gets into a file; an old one stays."""
    file = tmp_path / "lens.toml"
    file.write_text("old")
    camera = KnownIntrinsics(known().intrinsics, covariance)
    with pytest.raises(ConfigError, match=why):
        write_intrinsics(file, camera, views=12, rms_px=0.1, created="2026-11-20")
    assert file.read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1


def test_an_exactly_known_camera_may_have_a_zero_covariance(tmp_path: Path) -> None:
    """Zeros mean exactly known and are accepted."""
    camera = KnownIntrinsics(known().intrinsics)
    file = tmp_path / "lens.toml"
    write_intrinsics(file, camera, views=1, rms_px=0.0, created="2026-11-20T01:02:03Z")
    assert not read_intrinsics(file).known().covariance.any()
