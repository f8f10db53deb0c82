"""Where a command finds the records: --state-dir, or the configuration's state_dir."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from legato.cli.command import Context

if TYPE_CHECKING:
    from legato.records.store import Store

state_dir_option = click.option(
    "--state-dir",
    type=click.Path(file_okay=False, path_type=Path),
    help="Where the records are; by default records.state_dir.",
)


def opened_store(context: Context, state_dir: Path | None) -> "Store":
    """Return the store of records under `state_dir`, or where the configuration says."""
    from legato.config.load import load
    from legato.records.store import Store

    if state_dir is not None:
        return Store(state_dir)
    return Store(Path(load(context.config, need_intrinsics=False).config.records.state_dir))
