"""Loading: every refusal names file, key, value and expectation; what is accepted is complete."""

import json
import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from legato.config.errors import ConfigError
from legato.config.load import load, load_server, shipped
from tests.unit.config.refusals import BAD, CAMERA, SKEWED
from tests.unit.config.samples import SIM, Write


@pytest.mark.parametrize(("text", "key", "value", "expected"), BAD)
def test_refusals_name_file_key_value_and_expectation(
    write: Write, text: str, key: str, value: str, expected: str
) -> None:
    """A wrong file is refused with its path, the dotted key, what stands there, and what should."""
    file = write(text)
    with pytest.raises(ConfigError) as caught:
        load(file)
    error = caught.value
    assert error.file == str(file)
    assert error.key == key
    message = str(error)
    assert message.startswith(f"{file}: {key} = ")
    assert value in message
    assert expected in f"{error.expected} {error.hint}"
    assert "\n" not in message


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    """A path without a file, and one that is a folder, are refused with the reason."""
    for path, why in ((tmp_path / "none.toml", "No such file"), (tmp_path, "Is a directory")):
        with pytest.raises(ConfigError, match=re.escape(str(path)) + f": {why}.*expected a conf"):
            load(path)


@pytest.mark.parametrize(
    ("content", "where"),
    [
        (b"[robot]\nport = \n", "line 2"),
        (b"[robot]\n[robot]\n", "line 2"),
        (b"[robot]\nport = '\xff'\n", "line 2"),
        (b"x = " + b"[" * 5000, "nested too deep"),
        (b"x = 1e5\nx = 2\n", "line 2"),
        (b"x = " + b"9" * 6000, "digits"),
        (b"#" * 1_000_001, "larger"),
    ],
)
def test_what_is_no_toml_is_refused_with_its_line(
    tmp_path: Path, content: bytes, where: str
) -> None:
    """A syntax error, bad UTF-8, absurd nesting, numbers and sizes are a ConfigError with place."""
    file = tmp_path / "bad.toml"
    file.write_bytes(content)
    with pytest.raises(ConfigError, match=where) as caught:
        load(file)
    assert caught.value.file == str(file)


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(junk=st.binary(max_size=200))
def test_random_bytes_never_give_anything_but_a_config_error(tmp_path: Path, junk: bytes) -> None:
    """Whatever bytes a file has, loading gives a ConfigError; no bytes make a good cell."""
    file = tmp_path / "junk.toml"
    file.write_bytes(junk)
    with pytest.raises(ConfigError):
        load(file)


scalars = st.one_of(
    st.booleans(),
    st.integers(-(10**20), 10**20),
    st.floats(),
    st.text(max_size=8),
)
values = st.recursive(
    scalars,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=6), inner, max_size=3)
    ),
    max_leaves=8,
)
KEYS = [
    "server.requests", "server.events", "robot.port", "robot.rates", "robot.home", "robot.baud",
    "robot.elbow_deg", "robot.steps_per_rev", "camera.source", "camera.intrinsics", "camera.width",
    "cell.camera_at_mm", "cell.world_from_camera", "cell.workspace", "leg.marks", "leg.length_mm",
    "leg.stations_mm", "leg.big_radius_mm", "calibration.bounds", "calibration.marks",
    "massage.press_mm", "records.state_dir", "records.keep_days", "sim.leg_at_mm", "sim.seed",
]  # fmt: skip


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(key=st.sampled_from(KEYS), value=values)
def test_any_value_at_any_key_is_accepted_or_refused_by_name(
    write: Write, key: str, value: object
) -> None:
    """A value of any kind and size at a key gives a configuration or a ConfigError about a key."""
    import tomllib

    from legato.config.toml import dumps

    table, name = key.split(".")
    data = tomllib.loads(SIM)
    data.setdefault(table, {})[name] = value
    file = write(dumps(data))
    refused = None
    try:
        load(file)
    except ConfigError as error:
        refused = error
    assert refused is None or (refused.key and str(file) in str(refused))


def test_what_is_loaded_is_whole_and_absolute(write: Write, tmp_path: Path) -> None:
    """Defaults are filled in, paths are relative to the file, `~` is home, data is JSON."""
    text = SIM.replace("[camera]", "[camera]\nsource = 'view-%02d.png'")
    loaded = load(write(text + "[records]\nstate_dir = '~/records'\n"))
    assert loaded.config.camera.intrinsics == str(tmp_path / "lens.toml")
    assert loaded.config.camera.source == str(tmp_path / "view-%02d.png")
    assert loaded.config.records.state_dir == str(Path.home() / "records")
    assert loaded.config.leg.stations_mm == (7.0, 67.0, 127.0, 187.0)
    assert loaded.intrinsics is not None
    assert json.loads(json.dumps(loaded.data))["massage"]["strokes"] == 3
    assert load(write(text + "[camera2]\n".replace("[camera2]\n", ""))).hash != loaded.hash


def test_the_hash_tells_configurations_and_intrinsics_apart(write: Write, lens: Path) -> None:
    """The same file gives the same hash; another value or another camera gives another."""
    first = load(write(SIM)).hash
    assert load(write(SIM + "\n# a comment\n")).hash == first
    assert load(write(SIM + "[sim]\nseed = 2\n")).hash != first
    lens.write_text(lens.read_text().replace("alpha_u = 652.0", "alpha_u = 653.0"))
    assert load(write(SIM)).hash != first


def test_streams_and_devices_are_no_relative_paths(write: Write) -> None:
    """A URL and a device's number stay as they are."""
    for source in ("'rtsp://127.0.0.1/cam'", "2"):
        loaded = load(write(SIM.replace("[camera]", f"[camera]\nsource = {source}")))
        assert str(loaded.config.camera.source) == source.strip("'")


def test_a_client_needs_only_the_servers_table(write: Write) -> None:
    """Where the daemon listens is read although the rest is wrong, so that stop still works."""
    file = write("[server]\nrequests = 'tcp://127.0.0.1:9'\n[robot]\nsped = 1\n[cell]\n")
    assert load_server(file).requests == "tcp://127.0.0.1:9"
    with pytest.raises(ConfigError, match=r"server\.requests"):
        load_server(write("[server]\nrequests = 'tcp://0.0.0.0:9'\n"))


def test_a_socket_path_is_relative_to_the_file(write: Write, tmp_path: Path) -> None:
    """An ipc endpoint becomes absolute, so that daemon and client meet wherever they start."""
    server = load_server(write("[server]\nrequests = 'ipc://legato.sock'\n"))
    assert server.requests == f"ipc://{tmp_path}/legato.sock"


def test_a_file_to_be_made_is_let_pass_where_it_is_not_needed(write: Write, lens: Path) -> None:
    """The tool that makes the intrinsics file can load a configuration that names it."""
    lens.unlink()
    assert load(write(SIM), need_intrinsics=False).intrinsics is None


def test_the_shipped_files_are_found() -> None:
    """Both cells of etc/ are where load looks for them."""
    assert shipped("sim.toml").is_file()
    assert shipped("cell.toml").is_file()


def test_the_nearest_rotation_of_the_hint_is_accepted(write: Write) -> None:
    """What the hint prints can be pasted in place of the matrix that was refused."""
    with pytest.raises(ConfigError) as caught:
        load(write(CAMERA + SKEWED))
    rows = caught.value.hint.partition("the nearest is ")[2]
    loaded = load(write(f"{CAMERA}[cell]\nworld_from_camera = {rows}\n"))
    assert loaded.config.cell.world_from_camera is not None
