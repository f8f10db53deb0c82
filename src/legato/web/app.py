"""The page's addresses: the page itself, its live line, acts with the token, pictures, reports."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from legato.records.errors import RecordError
from legato.web.acts import METHODS, Acts, Refused
from legato.web.feed import Feed
from legato.web.guard import REPORT_POLICY, Guard, hosts
from legato.web.marking import SnapAsked, snapped
from legato.web.pages import REST_S
from legato.web.setup import Setup
from legato.web.shelf import NoReport, Shelf
from legato.web.site import Site

STATIC = Path(__file__).resolve().parent / "static"
MOST_BYTES = 64 * 1024
Document = TypeVar("Document")
Answer = Callable[[Request], Awaitable[Response]]


class Desk:
    """Answers the page's requests."""

    def __init__(self, setup: Setup, site: Site, shelf: Shelf, acts: Acts) -> None:
        self._setup = setup
        self._site = site
        self._shelf = shelf
        self._acts = acts

    def routes(self) -> list[BaseRoute]:
        """Return all addresses."""
        return [
            Route("/", self._page),
            Mount("/static", StaticFiles(directory=STATIC)),
            WebSocketRoute("/live", self._live),
            Route("/api/me", told(self._me)),
            Route("/api/act/{method}", told(self._act), methods=["POST"]),
            Route("/api/snap", told(self._snap), methods=["POST"]),
            Route("/sessions/{session}/frames/{name}", told(self._frame)),
            Route("/sessions/{session}/report", told(self._report)),
        ]

    async def _page(self, request: Request) -> Response:
        del request
        return FileResponse(STATIC / "index.html")

    async def _live(self, socket: WebSocket) -> None:
        """Send sections as they change, until the page is closed."""
        await socket.accept()
        page = self._site.pages.join()
        listening = asyncio.ensure_future(_until_closed(socket))
        try:
            while not listening.done():
                waiting = asyncio.ensure_future(page.message())
                await asyncio.wait((waiting, listening), return_when=asyncio.FIRST_COMPLETED)
                if not waiting.done():
                    waiting.cancel()
                    break
                await socket.send_text(waiting.result().decode())
                await asyncio.sleep(REST_S)
        except (WebSocketDisconnect, RuntimeError):
            return  # closed while something was on its way to it
        finally:
            self._site.pages.leave(page)
            listening.cancel()

    async def _me(self, request: Request) -> Response:
        """Say what the bearer of the token may ask for."""
        return document({"may": self._acts.check(token(request)), "role": self._setup.role})

    async def _act(self, request: Request) -> Response:
        """Carry out one act."""
        allowed, method = self._acts.check(token(request)), request.path_params["method"]
        if method not in METHODS:
            raise Refused(404, f"a page cannot ask for {method}")
        if method not in allowed:
            reason = f"{method} is not for role {self._setup.role}"
            raise Refused(403, reason, "start `legato web` with an operator's key")
        params = await body(request, dict[str, Any])
        pool = self._acts.line_of(method).pool
        loop = asyncio.get_running_loop()
        return document(await loop.run_in_executor(pool, self._acts.act, method, params))

    async def _snap(self, request: Request) -> Response:
        """Say what picks snap to."""
        from legato.vision.marks import MarksNotFound
        from legato.vision.picture import PictureError

        self._acts.check(token(request))
        asked = await body(request, SnapAsked)
        picture = await run_in_threadpool(self._shelf.frame, asked.session, asked.name)
        settings = self._setup.settings
        try:
            found = await run_in_threadpool(snapped, picture, asked.picks, settings)
        except MarksNotFound as error:
            raise Refused(422, error.text, error.hint) from error
        except PictureError as error:
            raise Refused(422, str(error)) from error
        return document(found)

    async def _frame(self, request: Request) -> Response:
        """Return a picture of a session."""
        asked = request.path_params
        picture = await run_in_threadpool(self._shelf.frame, asked["session"], asked["name"])
        return Response(picture, media_type="image/png")

    async def _report(self, request: Request) -> Response:
        """Return the report of a session."""
        try:
            page = await run_in_threadpool(self._shelf.report, request.path_params["session"])
        except NoReport as error:
            raise Refused(500, str(error), "try `legato report` with the session's id") from error
        return Response(
            page, media_type="text/html", headers={"content-security-policy": REPORT_POLICY}
        )


def application(
    setup: Setup, site: Site, shelf: Shelf, acts: Acts, feed: Feed, port: int
) -> Starlette:
    """Return the whole application, served at `port`; the feed runs as long as it does."""

    @asynccontextmanager
    async def living(app: Starlette) -> AsyncIterator[None]:
        del app
        site.pages.publish("cell", setup.cell)
        site.open()
        feed.start()
        try:
            yield
        finally:
            feed.end()
            acts.close()
            site.close()

    desk = Desk(setup, site, shelf, acts)
    guard = Middleware(Guard, allowed=hosts(port))
    return Starlette(routes=desk.routes(), middleware=[guard], lifespan=living)


def told(answer: Answer) -> Answer:
    """Make a refusal of an answer a document with reason and hint."""

    async def safe(request: Request) -> Response:
        try:
            return await answer(request)
        except Refused as no:
            return document({"reason": no.reason, "hint": no.hint}, no.status)
        except RecordError as error:
            return document({"reason": error.text, "hint": error.hint}, 404)
        except FileNotFoundError as error:
            return document({"reason": str(error), "hint": ""}, 404)

    return safe


def document(value: Mapping[str, Any], status: int = 200) -> Response:
    """Return a JSON answer."""
    return Response(msgspec.json.encode(value), status, media_type="application/json")


def token(request: Request) -> str | None:
    """Return the token that a request shows, if it shows one."""
    scheme, _, shown = request.headers.get("authorization", "").partition(" ")
    return shown if scheme.lower() == "bearer" and shown else None


async def body(request: Request, kind: type[Document]) -> Document:
    """Return a request's document. Raises Refused where it is none of this kind."""
    read = b""
    async for piece in request.stream():
        read += piece
        if len(read) > MOST_BYTES:
            raise Refused(413, f"a request has at most {MOST_BYTES} bytes")
    try:
        return msgspec.json.decode(read or b"{}", type=kind)
    except msgspec.DecodeError as error:
        raise Refused(400, f"not what was expected: {error}") from error


async def _until_closed(socket: WebSocket) -> None:
    """Return once a page has gone; whatever it says is of no interest."""
    with suppress(WebSocketDisconnect):
        while True:
            message = await socket.receive()
            if message["type"] == "websocket.disconnect":
                return
