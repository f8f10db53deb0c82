"""Where the records are, as a file says it: read before anything heavy is loaded."""

from pathlib import Path

from legato.config.decode import read_toml


def state_dir_in(file: Path) -> Path | None:
    """Return `records.state_dir` of a file; None where only the whole configuration can tell.

    Raises ConfigError for a file that cannot be read.
    """
    records = read_toml(file, "a configuration file").get("records")
    name = records.get("state_dir") if isinstance(records, dict) else None
    return Path(absolute(name, file.resolve().parent)) if isinstance(name, str) and name else None


def absolute(name: str, folder: Path) -> str:
    """Return a path as absolute text; `~` that names nobody stays as it stands."""
    try:
        path = Path(name).expanduser()
    except RuntimeError:
        path = Path(name)
    return str(folder / path)
