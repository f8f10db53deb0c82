"""The way to the daemon: only `[server]` is read, so that stop works whatever else is wrong."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from legato.cli.command import Context
from legato.cli.exits import Exit, Failure

if TYPE_CHECKING:
    from legato.daemon.client import Client


@contextmanager
def connected(context: Context, *, events: bool = False) -> "Iterator[Client]":
    """Give a client of the configured daemon, with its events where they are wanted."""
    from legato.config.endpoints import has_fixed_port
    from legato.config.load import load_server

    server = load_server(context.config)
    for name, endpoint in (("requests", server.requests), ("events", server.events)):
        if not has_fixed_port(endpoint):
            hint = f"set server.{name} to a fixed port"
            raise Failure(f"server.{name} = {endpoint} says no port", Exit.USAGE, hint)
    client = context.services.connect(server.requests, server.events if events else None)
    try:
        yield client
    finally:
        client.close()
