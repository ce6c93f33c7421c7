"""Routes from plain functions: JSON in, checked; JSON or an image out; the work is done in threads."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any, TypeVar

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from ..errors import FileFormatError
from ..loaders.file_model import FileModel, validate
from .images import RecordedImages

_MOST_SHRINK, _MOST_IMAGES = 16, 10**9

Asked = TypeVar("Asked", bound=FileModel)


class Answer(JSONResponse):
    """JSON in ASCII: names of files may hold what is no Unicode text, and still must be shown."""

    def render(self, content: Any) -> bytes:
        return json.dumps(content, allow_nan=False, separators=(",", ":")).encode("ascii")


def json_object(text: str | bytes) -> dict[str, Any]:
    """What a JSON object says.

    Raises
    ------
    FileFormatError : anything else, also halves of surrogate pairs, which are no text, or lists in lists without end.
    """
    try:
        values = json.loads(text)
        json.dumps(values, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        values = None
    if not isinstance(values, dict):
        raise FileFormatError("request", "(body)", "a JSON object", text[:100])
    return values


def get(path: str, answer: Callable[[], Any]) -> Route:
    """A route that answers without being asked anything.

    Parameters
    ----------
    path : of the route.
    answer : gives what becomes JSON; called in a thread.

    Returns
    -------
    For GET.
    """

    async def endpoint(request: Request) -> Response:
        return Answer(await run_in_threadpool(answer))

    return Route(path, endpoint)


def post(path: str, kind: type[Asked], answer: Callable[[Asked], Any]) -> Route:
    """A route that answers a JSON object.

    Parameters
    ----------
    path : of the route.
    kind : what the object must be.
    answer : gives what becomes JSON; called in a thread.

    Returns
    -------
    For POST.
    """

    async def endpoint(request: Request) -> Response:
        body = json_object(await request.body())
        return Answer(await run_in_threadpool(answer, validate(kind, body, "request")))

    return Route(path, endpoint, methods=["POST"])


def image(path: str, images: Callable[[], RecordedImages]) -> Route:
    """A camera's image by its number in the source; ``?shrink=N``: smaller.

    Parameters
    ----------
    path : with ``{camera}`` and ``{number}``.
    images : gives the images; called in a thread.

    Returns
    -------
    For GET.
    """

    async def endpoint(request: Request) -> Response:
        shrink = _whole("shrink", request.query_params.get("shrink", "1"), 1, _MOST_SHRINK)
        number = _whole("image", request.path_params["number"], 0, _MOST_IMAGES)
        data = await run_in_threadpool(lambda: images().jpeg(request.path_params["camera"], number, shrink))
        # Another studio on this port, with other images, has another token in its cookie
        kept = {"Cache-Control": "private, max-age=3600", "Vary": "Cookie"}
        return Response(data, media_type="image/jpeg", headers=kept)

    return Route(path, endpoint)


def _whole(field: str, text: str, least: int, most: int) -> int:
    digits = len(str(most))  # Python refuses to read thousands of them
    if not text.isdecimal() or len(text) > digits or not least <= int(text) <= most:
        raise FileFormatError("request", field, f"a whole number from {least} to {most}", text)
    return int(text)
