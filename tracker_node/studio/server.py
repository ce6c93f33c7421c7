"""The studio's web server: pages of this machine for this machine, without a build step or anything from outside.

Who may talk to the studio: only pages that it has served itself, opened by whoever started it.

A server on the loopback is still in reach of every page that the same browser shows. Three checks keep them out: the Host must be
this machine's (DNS rebinding), the Origin this server's (cross-site requests and WebSockets), and a random token, which only the
address on the terminal has, must have become a cookie (other people and programs on the machine).
"""

from __future__ import annotations

import hmac
import secrets
import socket
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlencode

from starlette.applications import Starlette
from starlette.datastructures import MutableHeaders
from starlette.middleware import Middleware
from starlette.requests import HTTPConnection, Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.routing import BaseRoute, Mount, Route, Router
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ..errors import SourceError, TrackerError
from ..render.palette import STATES, WORDS
from .endpoints import Answer, get, image
from .session import StudioFiles, StudioSession, open_session
from .wizard import page as wizard_page

WEB_FOLDER = Path(__file__).parent / "web"

Page = Callable[[StudioSession], Sequence[BaseRoute]]


def make_app(
    session: StudioSession, access: Access, pages: Sequence[Page] = (), unexpected: Callable[[Exception], object] | None = None
) -> Starlette:
    """The application.

    Parameters
    ----------
    session : rig, body, images and folder.
    access : what requests must show.
    pages : what the single pages add: each gives its routes, below ``/api/<page>/``, for a session.
    unexpected : is given an error that no handler has foreseen; the page gets it in one sentence. None: it is raised.

    Returns
    -------
    To be served.
    """
    current = CurrentPages(session, pages)
    routes: list[BaseRoute] = [*wizard_page.routes(session, current.reopen), Mount("/", current)]
    middleware = [Middleware(OnlyOwnPages, access=access)]
    if unexpected is not None:
        middleware.append(Middleware(UnexpectedErrors, report=unexpected))
    return Starlette(routes=routes, middleware=middleware, exception_handlers={TrackerError: _told, OSError: _not_written})


class CurrentPages:
    """ASGI application of the pages that show the files of a session, which are read anew when steps have written others.

    Parameters
    ----------
    session : to begin with.
    pages : see `make_app`.
    """

    def __init__(self, session: StudioSession, pages: Sequence[Page]):
        self._first, self._pages = session, pages
        self._session, self._router = session, self._router_of(session)
        self._opening = threading.Lock()
        self._files: StudioFiles | None = session.files
        session.closing.callback(self._close)
        if session.files.new is not None:
            self.reopen(True)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        await self._router(scope, receive, send)

    def reopen(self, changed: bool) -> None:
        """Show what lies in the recording's folder now; what cannot be opened is left out: its step says why.

        Parameters
        ----------
        changed : whether files may have other contents; else only others than before are shown.
        """
        folder = self._first.files.new
        if folder is None:
            return
        with self._opening:
            poses = {"new": folder, "folder": folder / "poses", "clicks": folder / "clicks"}
            files = StudioFiles(**poses, **wizard_page.files_of(folder))
            if files == self._files and not changed:
                return
            self._files = files
            try:
                session = open_session(files)
            except TrackerError:
                session, self._files = open_session(StudioFiles(**poses)), None  # tried again: somebody may mend a file
            before, self._session, self._router = self._session, session, self._router_of(session)
            if before is not self._first:
                before.closing.close()

    def _router_of(self, session: StudioSession) -> Router:
        routes: list[BaseRoute] = [
            get("/api/session", lambda: session_facts(session)),
            image("/images/{camera}/{number}", session.needed_images),
            Route("/palette.css", _palette),
        ]
        for page in self._pages:
            routes += page(session)
        return Router([*routes, Mount("/", StaticFiles(directory=WEB_FOLDER, html=True))])

    def _close(self) -> None:
        if self._session is not self._first:
            self._session.closing.close()


def all_pages() -> tuple[Page, ...]:
    """Of all modules that are pages."""
    from .digitize import page as digitizing_page
    from .live import page as live_page
    from .playback import page as playback_page
    from .pose import page as pose_page

    return (pose_page.routes, digitizing_page.routes, playback_page.routes, live_page.routes)


def listening_socket(port: int) -> tuple[socket.socket, Access]:
    """A socket on the loopback, and what requests to it must show; port 0 is a free one.

    Raises
    ------
    SourceError : the port is taken.
    """
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind(("127.0.0.1", port))
        listener.listen()  # whoever gets the address may come at once
    except OSError as error:
        listener.close()
        raise SourceError(f"port {port}", f"cannot be served: {error.strerror}") from None
    return listener, Access(listener.getsockname()[1], secrets.token_urlsafe(24))


def session_facts(session: StudioSession) -> dict[str, Any]:
    """What every page may want to know."""
    files, images = session.files, session.images
    cameras = [{"name": c.name, "width": c.model.width, "height": c.model.height} for c in session.rig or ()]
    sets = images.sets if images is not None else ()
    return {
        "files": {name: None if path is None else str(path) for name, path in vars(files).items()},
        "cameras": cameras,
        "model": None if session.model is None else {"name": session.model.name, "n_dof": session.model.n_dof},
        "sets": [{"stamp_ns": s.stamp_ns, "numbers": dict(s.numbers)} for s in sets],
        "problems": list(images.problems) if images is not None else [],
    }


async def _told(request: Request, error: Exception) -> Response:
    """A user's mistake is one sentence, as on the command line."""
    return Answer({"error": str(error)}, status_code=400)


async def _not_written(request: Request, error: Exception) -> Response:
    """A file that cannot be written, mostly: a full disk, a folder that is not ours."""
    assert isinstance(error, OSError)
    where = f"{error.filename}: " if error.filename else ""
    return Answer({"error": f"{where}{error.strerror or error}"}, status_code=400)


class UnexpectedErrors:
    """ASGI middleware that answers errors without a handler by status 500 with a sentence, as a user's mistakes are answered.

    Parameters
    ----------
    report : is given each error, once.
    """

    def __init__(self, app: ASGIApp, report: Callable[[Exception], object]):
        self._app, self._report = app, report

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        begun = False

        async def noticed(message: Message) -> None:
            nonlocal begun
            begun = True
            await send(message)

        try:
            await self._app(scope, receive, noticed)
        except Exception as error:
            self._report(error)
            if scope["type"] == "http" and not begun:
                sentence = f"an error inside the studio ({type(error).__name__}): its terminal says more"
                await Answer({"error": sentence}, status_code=500)(scope, receive, send)


def palette_css() -> str:
    """The colors of states as CSS variables: ``--tracking`` and so on for areas, ``--tracking-word`` for text."""
    areas = [f"--{state}: {color};" for state, color in STATES.items()]
    words = [f"--{state}-word: {color};" for state, color in WORDS.items()]
    return f":root {{ {' '.join([*areas, *words])} }}\n"


async def _palette(request: Request) -> Response:
    return Response(palette_css(), media_type="text/css")


MOST_BODY_BYTES = 16 * 2**20
_SAFE_METHODS = ("GET", "HEAD")
_HOSTS = ("127.0.0.1", "localhost", "[::1]")
_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'; base-uri 'none';"
    " form-action 'none'; object-src 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}


@dataclass(frozen=True)
class Access:
    """What a request must show: the port that is served, and the token of this start."""

    port: int
    token: str

    @property
    def hosts(self) -> tuple[str, ...]:
        """Values of the header Host that are ours; a browser leaves out port 80."""
        named = tuple(f"{host}:{self.port}" for host in _HOSTS)
        return named + _HOSTS if self.port == 80 else named

    @property
    def cookie(self) -> str:
        """Cookies are shared by all ports of a host, so the port is in the name."""
        return f"studio_{self.port}"

    @property
    def start_url(self) -> str:
        return f"http://127.0.0.1:{self.port}/?{urlencode({'token': self.token})}"

    def is_token(self, text: str) -> bool:
        return hmac.compare_digest(text.encode(), self.token.encode())

    def problem(self, connection: HTTPConnection) -> str:
        """Why a request or a WebSocket is refused, in words; empty for one that is ours, its token aside."""
        host, origin = connection.headers.get("host", ""), connection.headers.get("origin")
        if host not in self.hosts:
            return f"the studio answers to {self.hosts[0]} only, not to the host '{host}'"
        safe = connection.scope["type"] == "http" and connection.scope["method"] in _SAFE_METHODS
        if origin is None and safe:
            return ""
        if origin != f"http://{host}":
            return f"expected a request from a page of the studio, got the origin '{origin}'"
        return ""


class OnlyOwnPages:
    """ASGI middleware that refuses whatever `Access` does not allow, and puts the headers of a closed page on every answer."""

    def __init__(self, app: ASGIApp, access: Access):
        self._app, self._access = app, access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(HTTPConnection(scope))
        if scope["type"] == "websocket":
            if refusal is not None:
                await receive()  # the handshake
                await send({"type": "websocket.close", "code": 1008})  # before it is accepted: the browser sees a 403
                return
            await self._app(scope, receive, send)
            return
        answer: ASGIApp = refusal if refusal is not None else self._app
        await answer(scope, receive, _closed(send))

    def _refusal(self, connection: HTTPConnection) -> Response | None:
        access = self._access
        problem = access.problem(connection)
        if problem:
            return PlainTextResponse(problem, 403)
        length = connection.headers.get("content-length", "0")
        bounded = length.isdecimal() and len(length) < 12 and int(length) <= MOST_BODY_BYTES
        if not bounded or "transfer-encoding" in connection.headers:
            return PlainTextResponse(f"expected a body of known length, of at most {MOST_BODY_BYTES} bytes", 413)
        offered = parse_qs(connection.scope["query_string"].decode("latin-1")).get("token", [])
        if connection.scope["type"] == "http" and any(map(access.is_token, offered)):
            return self._let_in(connection)
        if not access.is_token(connection.cookies.get(access.cookie, "")):
            return PlainTextResponse("open the studio by the whole address that `tracker_node studio` has printed", 403)
        return None

    def _let_in(self, connection: HTTPConnection) -> Response:
        """The cookie, and on to the same page without the token in its address.

        By a page, not by a redirect: a browser that comes from another site would not send a strict cookie along with that.
        """
        path = escape("/" + connection.url.path.lstrip("/"), quote=True)
        head = f'<meta http-equiv="refresh" content="0;url={path}"><link rel="icon" href="data:,"><title>studio</title>'
        response = HTMLResponse(f"<!doctype html>{head}")
        response.set_cookie(self._access.cookie, self._access.token, httponly=True, samesite="strict", path="/")
        return response


def _closed(send: Send) -> Send:
    async def with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in _HEADERS.items():
                headers.setdefault(name, value)  # a report has a policy of its own
            headers.setdefault("Cache-Control", "no-store")
        await send(message)

    return with_headers
