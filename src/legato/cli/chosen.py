"""The session that a command is about: the one named, else the latest."""

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from legato.cli.command import Context, Services
from legato.cli.exits import Exit, Failure
from legato.cli.output import Output
from legato.cli.store import opened_store

if TYPE_CHECKING:
    from legato.records.record import SessionRecord


def chosen(context: Context, session: str | None, state_dir: Path | None) -> "SessionRecord":
    """Return the record of a session, of the latest where none is named."""
    store = opened_store(context, state_dir)
    if session is None:
        found = store.sessions()
        if not found:
            hint = "make one with `legato demo`"
            raise Failure(f"there is no session in {store.folder}", Exit.FAILED, hint)
        session = found[0].id
    return store.read(session)


def place_for(out: Path) -> Path:
    """Return where a file is to be written; raises Failure where its folder is not there."""
    if not out.absolute().parent.is_dir():
        hint = "make it first, or name a file in another folder"
        raise Failure(f"{out}: there is no folder {out.parent}", Exit.USAGE, hint)
    return out


def quiet(ctx: click.Context) -> Context:
    """Return what a command would be given, for a shell that completes its words."""
    return Context(ctx.params.get("config"), Output(), Services())


def completed(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[str]:
    """Return the ids that begin so, newest first, for a shell; none where records are not found."""
    del param
    with suppress(Exception):  # a shell waits for words, and shows no error
        found = opened_store(quiet(ctx), ctx.params.get("state_dir")).sessions()
        return [s.id for s in found if s.id.startswith(incomplete)]
    return []
