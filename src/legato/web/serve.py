"""The page's server as a process: one listening socket on loopback, until SIGINT or SIGTERM."""

import secrets
import socket
from collections.abc import Callable

import uvicorn

from legato.web.acts import Acts, Line
from legato.web.app import application
from legato.web.board import Board
from legato.web.feed import Feed
from legato.web.pages import Pages
from legato.web.setup import Setup
from legato.web.shelf import Shelf
from legato.web.site import Site

LOOPBACK = "127.0.0.1"


def serve(
    setup: Setup, port: int, *, observe: bool, ready: Callable[[str, str | None], None]
) -> None:
    """Serve the page; `ready` is told its address, and the token where pages may act.

    Port 0 takes a free one. Raises OSError where the port is taken.
    """
    token = None if observe else secrets.token_urlsafe(24)
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((LOOPBACK, port))
        listening.listen()
        port = int(listening.getsockname()[1])
        pages = Pages()
        shelf = Shelf(setup.state_dir)
        site = Site(pages, Board(setup.model, pages.publish, setup.time_scale), shelf)
        requests = Line(setup.lines["requests"], setup.keys, "act")
        stops = Line(setup.lines["stop"], setup.keys, "stop")
        feed = Feed(setup.lines, setup.keys, site.post)
        acts = Acts(requests, stops, token, setup.role)
        app = application(setup, site, shelf, acts, feed, port)
        config = uvicorn.Config(
            app,
            log_level="warning",
            access_log=False,
            server_header=False,
            ws="websockets-sansio",
            ws_max_size=1024,
            ws_max_queue=4,
            timeout_graceful_shutdown=1,
        )
        ready(f"http://{LOOPBACK}:{port}/", token)
        uvicorn.Server(config).run(sockets=[listening])
    finally:
        listening.close()
