"""The colors of states for pages: CSS variables, which the pages' scripts read, too."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from ..render.palette import STATES, WORDS


def palette_css() -> str:
    """``--tracking`` and so on for areas, ``--tracking-word`` for text."""
    areas = [f"--{state}: {color};" for state, color in STATES.items()]
    words = [f"--{state}-word: {color};" for state, color in WORDS.items()]
    return f":root {{ {' '.join([*areas, *words])} }}\n"


async def _answer(request: Request) -> Response:
    return Response(palette_css(), media_type="text/css")


ROUTE = Route("/palette.css", _answer)
