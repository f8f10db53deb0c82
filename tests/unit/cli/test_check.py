"""`legato check`: what is missing, in which of the cell's parts, and what to do."""

from datetime import UTC, datetime
from pathlib import Path

from legato.cli.doctor import device, examine
from legato.cli.exits import Exit
from legato.config.load import load
from tests.unit.cli.samples import document, run, write_cell


def test_check_is_content_with_the_simulated_cell(cell: Path) -> None:
    """Configuration, intrinsics, stations, devices and disk are looked at, and all is well."""
    result = run("check", "--config", cell, "--json")
    assert result.exit_code == 0, result.output
    names = [c["name"] for c in document(result)["checks"]]
    for name in ("configuration", "intrinsics", "station 187 mm", "arm", "camera", "state_dir"):
        assert name in names


def test_check_names_what_is_missing_and_what_to_do(tmp_path: Path) -> None:
    """Absent devices, an unwritable place and a full disk are each told, with code 1."""
    (tmp_path / "file").touch()
    cell = write_cell(tmp_path)
    text = cell.read_text().replace('"state"', '"file/state"\nmin_free_mb = 10000000')
    text = text.replace("[camera]", "[camera]\ndriver = 'opencv'\nsource = 'no-camera'")
    cell.write_text(text + "[robot]\ndriver = 'teachmover'\nport = '/dev/none'\n")
    result = run("check", "--config", cell)
    assert result.exit_code == Exit.FAILED
    for part in ("/dev/none is not there", "no-camera is not there", "is no folder", "MB needed"):
        assert part in result.stdout
    assert result.stdout.count("what to do") >= 4


def test_check_reports_a_missing_lens_beside_the_rest(tmp_path: Path) -> None:
    """A missing intrinsics file is one finding among the others, with code 2."""
    cell = write_cell(tmp_path)
    (tmp_path / "lens.toml").unlink()
    result = run("check", "--config", cell)
    assert result.exit_code == Exit.USAGE
    assert "legato intrinsics" in result.stdout
    assert "station 7 mm" in result.stdout


def test_check_tells_of_faults_on_schedule(tmp_path: Path) -> None:
    """A simulated cell may have them; before a real arm they are found wanting."""
    faults = "faults = [{ kind = 'arm_lost', call = 3 }]\n"
    result = run("check", "--config", write_cell(tmp_path, faults))
    assert result.exit_code == 0, result.output
    assert "1 on schedule: arm_lost" in result.output
    text = write_cell(tmp_path, faults + "[robot]\ndriver = 'teachmover'\n")
    result = run("check", "--config", text)
    assert result.exit_code == 1
    assert "take sim.faults out" in result.output


def test_check_finds_a_station_out_of_reach(tmp_path: Path) -> None:
    """A leg laid beyond the arm is found before anybody tries."""
    cell = write_cell(tmp_path, "leg_at_mm = [124.29, 200.0, 30.52]\n")
    findings = {f.name: f for f in examine(load(cell), datetime(2026, 11, 22, tzinfo=UTC))}
    assert findings["station 187 mm"].ok is False
    assert findings["station 187 mm"].hint


def test_old_intrinsics_deserve_a_look(cell: Path) -> None:
    """After half a year the camera should be calibrated again; nothing is hindered."""
    findings = {f.name: f for f in examine(load(cell), datetime(2027, 11, 22, tzinfo=UTC))}
    assert findings["intrinsics"].ok is None
    assert "366 days" in findings["intrinsics"].text


def test_a_device_that_is_there_is_content(tmp_path: Path) -> None:
    """A readable file passes as a source of pictures."""
    file = tmp_path / "film.avi"
    file.touch()
    assert device("camera", file, "").ok
