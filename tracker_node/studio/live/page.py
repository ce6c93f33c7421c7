"""The page that shows a running graph: a WebSocket on which the browser asks for what is new, and a door to the services.

The browser asks again when it has drawn what it got, and is answered ten times a second at most: a slow one misses images, and
nothing piles up.
"""

from __future__ import annotations

import asyncio
import os
import threading
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field
from starlette.concurrency import run_in_threadpool
from starlette.routing import BaseRoute, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from ...errors import FileFormatError, TrackerError
from ...loaders.file_model import FileModel, Number, validate
from ..endpoints import get, json_object, post
from ..session import PoseFiles, StudioSession

if TYPE_CHECKING:
    from ...ros.live_view import LiveView

PERIOD_S = 0.1
_MOST_TOPICS = 32
_INITIAL = "(initial state)"


class Wanted(FileModel):
    """Image topics to see, each with the number of the image that the page has; the last state that it has of each tracker."""

    topics: dict[str, int] = Field(default_factory=dict)
    states: dict[str, int] = Field(default_factory=dict)


class Errand(FileModel):
    """A service of a tracker to be asked; ``on`` for enable, ``dofs`` or a saved state's ``file`` for set_state."""

    tracker: str
    service: Literal["reset", "reinitialize", "enable", "set_state"]
    on: bool = True
    dofs: dict[str, Number] = Field(default_factory=dict)
    file: str = ""


def routes(session: StudioSession) -> Sequence[BaseRoute]:
    """Below ``/api/live/``."""
    page = LivePage(session)

    return [
        get("/api/live", page.facts),
        post("/api/live/service", Errand, page.ask),
        WebSocketRoute("/api/live/stream", page.stream),
    ]


class LivePage:
    """Answers of the page; the graph is joined when the first page asks."""

    def __init__(self, session: StudioSession):
        self._session = session
        self._files = PoseFiles(session.files.folder)
        self._lock = threading.Lock()
        self._view: LiveView | None = None

    def view(self) -> LiveView:
        """The view of the graph.

        Raises
        ------
        TrackerError : ROS is not installed here.
        """
        with self._lock:
            if self._view is None or self._view.problem:
                try:
                    from ...ros.live_view import LiveView
                except ImportError as error:
                    raise TrackerError(f"no live view without ROS 2 and tracker_msgs: {error}; see docs/install.md") from None
                self._view = LiveView()
                self._session.closing.callback(self._view.close)
            return self._view

    def facts(self) -> dict[str, Any]:
        """What does not change: which graph is joined, and states that can be set."""
        graph = {name: os.environ.get(name, "") for name in ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE")}
        return {"graph": graph, "states": self._saved_states()}

    def _saved_states(self) -> list[str]:
        if self._session.model is None:
            return []
        initial = [_INITIAL] if self._session.initial_state is not None else []
        return [*initial, *self._files.names()]

    async def stream(self, socket: WebSocket) -> None:
        """What is new, as often as the page asks, at most ten times a second."""
        await socket.accept()
        who, view = object(), None
        try:
            view = await run_in_threadpool(self.view)
            while True:
                due_s = time.monotonic() + PERIOD_S
                wanted = validate(Wanted, await _received(socket), "request")
                view.watch(who, list(wanted.topics)[:_MOST_TOPICS])
                images, refused = await run_in_threadpool(_new_images, view, wanted)
                announced = [[topic, number] for topic, number, _ in images]
                await socket.send_json({**_news(view, wanted), "images": announced, "refused": refused})
                for _, _, jpeg in images:
                    await socket.send_bytes(jpeg)
                await asyncio.sleep(max(0.0, due_s - time.monotonic()))
        except WebSocketDisconnect:
            pass
        except TrackerError as error:
            await socket.send_json({"problem": str(error)})
            await socket.close()
        finally:
            if view is not None:
                view.watch(who, ())

    def ask(self, errand: Errand) -> dict[str, Any]:
        """Ask a tracker's service."""
        fields: dict[str, Any] = {}
        if errand.service == "enable":
            fields = {"data": errand.on}
        elif errand.service == "set_state":
            values = self._state(errand.file) if errand.file else errand.dofs
            fields = {"dof_names": list(values), "values": [float(value) for value in values.values()]}
        success, message = self.view().call(errand.tracker, errand.service, **fields)
        return {"success": success, "message": message}

    def _state(self, name: str) -> dict[str, float]:
        """A saved state by its file's name, or the initial one."""
        model = self._session.needed_model()
        if name not in self._saved_states():
            raise FileFormatError("request", "file", f"one of {', '.join(self._saved_states()) or '(none)'}", name)
        initial = self._session.initial_state if name == _INITIAL else None
        state = self._files.load(name, model) if initial is None else initial
        return dict(zip(model.chain.dof_names, state.to_values().tolist(), strict=True))


async def _received(socket: WebSocket) -> dict[str, Any]:
    """The next message, which should be a JSON object in a text frame."""
    message = await socket.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code", 1000))
    return json_object(message.get("text") or "")


def _new_images(view: LiveView, wanted: Wanted) -> tuple[list[tuple[str, int, bytes]], list[str]]:
    """Topic, number and JPEG of the images that the page has not got; sentences on those that cannot be shown."""
    found, refused = [], []
    for topic, number in wanted.topics.items():
        image = view.image(topic)
        try:
            if image is not None and image.number != number:
                found.append((topic, image.number, image.jpeg(topic)))
        except TrackerError as error:
            refused.append(str(error))
    return found, refused


def _ages_s(view: LiveView, wanted: Wanted) -> dict[str, float]:
    """Seconds since the newest image of each wanted topic arrived, of those that have one."""
    newest = {topic: view.image(topic) for topic in wanted.topics}
    return {topic: time.monotonic() - image.arrival_s for topic, image in newest.items() if image is not None}


def _news(view: LiveView, wanted: Wanted) -> dict[str, Any]:
    """What the page shows besides images."""
    if view.problem:
        raise TrackerError(view.problem)
    trackers = {
        name: {
            "state": tracker.facts(),
            "rate_hz": tracker.rate_hz(),
            "points": [list(vars(point).values()) for point in tracker.points_after(wanted.states.get(name, 0))],
            "services": [service.removeprefix(f"{name}/") for service in view.services if service.startswith(f"{name}/")],
        }
        for name, tracker in list(view.trackers.items())
    }
    return {
        "now_s": time.monotonic(),
        "trackers": trackers,
        "topics": view.image_topics,
        "ages_s": _ages_s(view, wanted),
        "diagnostics": view.diagnostics.facts(),
    }
