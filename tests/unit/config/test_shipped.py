"""The files of etc/: both load, and the real cell's explains every key."""

import re
import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path

import msgspec
from msgspec import inspect

from legato.config.load import load, shipped
from legato.config.schema import Config

KEY = re.compile(r"^(?:# )?(?P<key>[A-Za-z_0-9]+) = (?P<rest>.*)$")
TABLE = re.compile(r"^\[(?P<table>[a-z._]+)\]")


def keys_of(kind: inspect.Type, path: str = "") -> Iterator[str]:
    """Yield every dotted key of the schema that holds a value."""
    if isinstance(kind, inspect.StructType):
        for field in kind.fields:
            yield from keys_of(field.type, f"{path}.{field.encode_name}".lstrip("."))
    else:
        yield path


def written(text: str) -> dict[str, str]:
    """Return each dotted key of a file, also one commented out, with the comments that it has."""
    found: dict[str, str] = {}
    table, before = "", ""
    key = ""
    for line in text.splitlines():
        if match := TABLE.match(line):
            table, before = match["table"], line.partition("#")[2]
            found[table] = before
        elif match := KEY.match(line):
            key = f"{table}.{match['key']}"
            found[key] = match["rest"].partition("#")[2].strip() or before
        elif line.strip().startswith("#"):
            before = line.strip("# ")
            found[key] = found.get(key, "") or before
    return found


def test_every_key_stands_in_the_real_cells_file_and_is_explained() -> None:
    """No key of the schema is missing from cell.toml, and none is without a comment."""
    found = written(shipped("cell.toml").read_text(encoding="utf-8"))
    keys = set(keys_of(inspect.type_info(Config)))
    assert len(keys) > 100
    assert not sorted(keys - set(found))
    assert not [key for key in keys if len(found[key]) < 2]


def test_figures_called_default_are_the_defaults() -> None:
    """A line that says Default has the schema's default, so that the file cannot go stale."""
    text = shipped("cell.toml").read_text(encoding="utf-8")
    data = tomllib.loads(text)
    defaults = msgspec.to_builtins(Config())
    for key, comment in written(text).items():
        value, default = data, defaults
        for part in key.split("."):
            value, default = value.get(part, {}), default.get(part, {})
        says = re.search(r"\bDefault( \[inferred\])?([.;,:]|$)", comment)
        if says and not isinstance(value, dict):
            assert value == (list(default) if isinstance(default, tuple) else default), key


def test_both_shipped_cells_load(tmp_path: Path, lens: Path) -> None:
    """Beside an intrinsics file of the camera both files are a whole cell, without a warning."""
    for name, camera in (("sim.toml", "sim"), ("cell.toml", "cell")):
        file = tmp_path / name
        shutil.copy(shipped(name), file)
        shutil.copy(lens, tmp_path / f"{camera}-intrinsics.toml")
        loaded = load(file)
        assert loaded.intrinsics is not None
    assert load(tmp_path / "sim.toml").config.robot.driver == "sim"
    assert load(tmp_path / "cell.toml").config.robot.driver == "teachmover"


def test_the_simulated_cell_believes_its_camera_where_it_is() -> None:
    """The default cell is a well measured one: belief and truth are the same camera pose."""
    config = load(shipped("sim.toml"), need_intrinsics=False).config
    assert config.cell.camera_at_mm == config.sim.camera_at_mm
    assert config.cell.camera_looks_at_mm == config.sim.camera_looks_at_mm
