"""The way to the daemon: only `[server]` is read, so that stop works whatever else is wrong."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from legato.cli.command import Context
from legato.cli.exits import Exit, Failure

if TYPE_CHECKING:
    from legato.config.schema import ServerTable
    from legato.daemon.client import Client

LEASE = "LEGATO_LEASE"  # the token of a lease that another command keeps


@contextmanager
def connected(
    context: Context, *, events: bool = False, line: str = "requests"
) -> "Iterator[Client]":
    """Give a client of the configured daemon, with its events where they are wanted.

    `line` is `requests`, or `stop` for the line that only stops.
    """
    from legato.config.load import load_server
    from legato.daemon.keys import client_keys

    server = load_server(context.config)
    asked = _fixed(server, line)
    heard = _fixed(server, "events") if events else None
    keys = client_keys(server, context.config or "the configuration")
    given = (asked, heard) if keys is None else (asked, heard, keys)
    client = context.services.connect(*given)
    token = os.environ.get(LEASE)
    if token:
        client.under(token)
    try:
        yield client
    finally:
        client.close()


def _fixed(server: "ServerTable", name: str) -> str:
    """Return where a client finds one of the daemon's lines."""
    from legato.config.endpoints import has_fixed_port, reachable

    endpoint = str(getattr(server, name))
    if not has_fixed_port(endpoint):
        hint = f"set server.{name} to a fixed port"
        raise Failure(f"server.{name} = {endpoint} says no port", Exit.USAGE, hint)
    return reachable(endpoint)
