"""Where the records are, told before anything heavy is loaded: the same as the whole file tells."""

import subprocess
import sys
from pathlib import Path

import pytest

from legato.config.errors import ConfigError
from legato.config.load import load, shipped
from legato.config.place import state_dir_in


@pytest.mark.parametrize("name", ["sim.toml", "emulated.toml"])
def test_a_file_tells_the_same_alone(name: str) -> None:
    """Relative to its own folder, with the user's home in it."""
    file = shipped(name)
    assert str(state_dir_in(file)) == load(file).config.records.state_dir


@pytest.mark.parametrize("text", ["", "records = 5", "[records]\nstate_dir = 7",
                                  '[records]\nstate_dir = ""'])  # fmt: skip
def test_what_only_the_whole_can_tell_is_left_to_it(tmp_path: Path, text: str) -> None:
    """Defaults and refusals are the configuration's own."""
    file = tmp_path / "cell.toml"
    file.write_text(text)
    assert state_dir_in(file) is None


def test_a_file_that_is_no_configuration_is_refused(tmp_path: Path) -> None:
    """As loading it would be."""
    with pytest.raises(ConfigError, match="can be read"):
        state_dir_in(tmp_path / "none.toml")


def test_nothing_heavy_is_loaded_for_it() -> None:
    """A second daemon ends before it has loaded what the first one works with."""
    look = "import sys, legato.config.place, legato.daemon.lock; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
