"""Routes from plain functions: JSON in, checked; JSON or an image out; the work is done in threads."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from ..errors import FileFormatError
from ..loaders.yaml_file import FileModel, validate
from .images import RecordedImages

_MOST_SHRINK = 16

Asked = TypeVar("Asked", bound=FileModel)


def get(path: str, answer: Callable[[], Any]) -> Route:
    """What a function says without being told anything."""

    async def endpoint(request: Request) -> Response:
        return JSONResponse(await run_in_threadpool(answer))

    return Route(path, endpoint)


def post(path: str, kind: type[Asked], answer: Callable[[Asked], Any]) -> Route:
    """What a function says to a JSON object of this kind."""

    async def endpoint(request: Request) -> Response:
        try:
            body = await request.json()
        except (ValueError, RecursionError):  # no JSON, or lists in lists without end
            body = None
        if not isinstance(body, dict):
            raise FileFormatError("request", "(body)", "a JSON object", body)
        return JSONResponse(await run_in_threadpool(answer, validate(kind, body, "request")))

    return Route(path, endpoint, methods=["POST"])


def image(path: str, images: Callable[[], RecordedImages]) -> Route:
    """A camera's image by its number in the source, for a path with ``{camera}`` and ``{number:int}``; ``?shrink=N``: smaller."""

    async def endpoint(request: Request) -> Response:
        shrink = request.query_params.get("shrink", "1")
        if not shrink.isdecimal() or not 1 <= int(shrink) <= _MOST_SHRINK:
            raise FileFormatError("request", "shrink", f"a whole number from 1 to {_MOST_SHRINK}", shrink)
        camera, number = request.path_params["camera"], request.path_params["number"]
        data = await run_in_threadpool(lambda: images().jpeg(camera, number, int(shrink)))
        # Another studio on this port, with other images, has another token in its cookie
        kept = {"Cache-Control": "private, max-age=3600", "Vary": "Cookie"}
        return Response(data, media_type="image/jpeg", headers=kept)

    return Route(path, endpoint)
