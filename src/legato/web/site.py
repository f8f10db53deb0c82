"""Brings the daemon's word and the records to the pages; the event loop's thread alone uses it.

Reading records takes time: it is done in a thread of its own, once for all that came meanwhile.
"""

import asyncio
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from typing import Any

from legato.web.board import Board
from legato.web.pages import Pages
from legato.web.shelf import Shelf

READ_ON = ("session", "state", "fault")  # what may have left a picture or a calibration


class Site:
    """The pages, and what they are sent."""

    def __init__(self, pages: Pages, board: Board, shelf: Shelf) -> None:
        self.pages = pages
        self._board = board
        self._shelf = shelf
        self._reader = ThreadPoolExecutor(1, thread_name_prefix="records")
        self._reading: asyncio.Task[None] | None = None
        self._again = False
        self._heard_at: str | None = None
        self._loop: asyncio.AbstractEventLoop | None = None

    def open(self) -> None:
        """Begin, in the event loop that will do the work."""
        self._loop = asyncio.get_running_loop()
        self._read_soon()

    def close(self) -> None:
        """Let go of the thread."""
        self._reader.shutdown(wait=False, cancel_futures=True)

    def post(self, kind: str, what: Any) -> None:
        """Take in what the feed says, from its thread."""
        assert self._loop is not None, "opened before the feed starts"
        try:
            self._loop.call_soon_threadsafe(self.take, kind, what)
        except RuntimeError:
            return  # the loop has ended: nobody looks any more

    def take(self, kind: str, what: Any) -> None:
        """Take in what the feed says."""
        wall = datetime.now(UTC).isoformat()
        if kind != "lost":
            self._heard_at = wall
        match kind:
            case "up":
                self._board.up(wall)
                self._read_soon()
            case "lost":
                reason, hint, stop = what
                self._board.lost(reason, hint, self._heard_at, stop)
            case "described":
                self._board.described(what)
            case "status":
                self._board.status(what, wall)
            case "sessions":
                self.pages.publish("sessions", what)
            case "event":
                topic, event = what
                self._board.take(topic, event, wall)
                if topic in READ_ON:
                    self._read_soon()

    def _read_soon(self) -> None:
        """Read the records anew; what asks for it meanwhile is served by one more reading."""
        self._again = True
        if self._reading is None or self._reading.done():
            self._reading = asyncio.get_running_loop().create_task(self._read())

    async def _read(self) -> None:
        while self._again:
            self._again = False
            loop = asyncio.get_running_loop()
            found = await loop.run_in_executor(self._reader, self._shelf.look)
            self._board.looked(**found)
