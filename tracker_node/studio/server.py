"""The studio's web server: pages of this machine for this machine, without a build step or anything from outside."""

from __future__ import annotations

import secrets
import socket
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ..errors import SourceError, TrackerError
from ..render.palette import STATES, WORDS
from .endpoints import Answer, get, image
from .security import Access, OnlyOwnPages
from .session import StudioSession

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
    routes: list[BaseRoute] = [
        get("/api/session", lambda: session_facts(session)),
        image("/images/{camera}/{number}", session.needed_images),
        Route("/palette.css", _palette),
    ]
    for page in pages:
        routes += page(session)
    routes.append(Mount("/", StaticFiles(directory=WEB_FOLDER, html=True)))
    middleware = [Middleware(OnlyOwnPages, access=access)]
    if unexpected is not None:
        middleware.append(Middleware(UnexpectedErrors, report=unexpected))
    return Starlette(
        routes=routes,
        middleware=middleware,
        exception_handlers={TrackerError: _told, OSError: _not_written},
    )


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
