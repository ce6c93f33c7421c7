"""A running graph as others may look at it: trackers, images, diagnostics, and the trackers' services.

One thread does all that ROS asks for; everybody else reads what it has left. Of images only the newest is kept, and only topics
that somebody watches are subscribed to, since a tracker draws overlays for its subscribers alone.
"""

from __future__ import annotations

import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription
from sensor_msgs.msg import CompressedImage, Image
from tracker_msgs.msg import TrackedState

from ..errors import TrackerError, UnknownNameError
from ..loaders.bag.images import COMPRESSED, RAW
from ..loaders.json_values import finite
from ..runs.messages import jpeg_of
from ..tracking.estimate import LimbStatus, Status
from .conversions import decode_raw_image, message_class, stamp_ns_of
from .guarded_node import GuardedNode
from .qos import RESULT, SENSOR, use_fastdds_profile

SERVICES = {
    "reset": "std_srvs/srv/Trigger",
    "reinitialize": "std_srvs/srv/Trigger",
    "enable": "std_srvs/srv/SetBool",
    "set_state": "tracker_msgs/srv/SetState",
}
STATE_TYPE = "tracker_msgs/msg/TrackedState"
_LOOK_S, _LOOP_S, _ANSWER_S = 0.5, 0.05, 10.0


@dataclass(frozen=True, eq=False)
class LiveImage:
    """The newest image of a topic: its ``number`` since the start, and what arrived, at ``arrival_s`` of the monotonic clock."""

    number: int
    arrival_s: float
    stamp_ns: int
    content: CompressedImage | bytes

    def jpeg(self, topic: str) -> bytes:
        """As a JPEG (or whatever a compressed topic holds); raw images are encoded when this is called."""
        if isinstance(self.content, CompressedImage):
            return bytes(self.content.data)
        return bytes(jpeg_of(decode_raw_image(topic, self.content).bgr))


class LiveView:
    """A node of one's own context in a thread; usable until `close`."""

    def __init__(self) -> None:
        use_fastdds_profile()
        self._context = Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = GuardedNode("studio", context=self._context, start_parameter_services=False, enable_rosout=False)
        # Not the events executor: it crashes when a subscription is destroyed
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._lock = threading.Lock()
        self._watched: dict[object, frozenset[str]] = {}
        self._subscriptions: dict[str, Subscription] = {}
        self._images: dict[str, LiveImage] = {}
        self._clients: dict[str, Any] = {}
        self._errands: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._stop = threading.Event()
        self.trackers: dict[str, LiveTracker] = {}
        self.diagnostics = LiveDiagnostics()
        self.image_topics: dict[str, str] = {}
        self.services: dict[str, str] = {}
        self.problem = ""  # why the thread has ended by itself
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self.diagnostics.take, RESULT)
        self._thread = threading.Thread(target=self._run, name="live view", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread and the node."""
        self._stop.set()
        self._thread.join()

    def watch(self, who: object, topics: Collection[str]) -> None:
        """Set the image topics that a viewer watches.

        Parameters
        ----------
        who : the viewer.
        topics : in place of those before; none: the viewer is gone.
        """
        with self._lock:
            self._watched.pop(who, None)
            if topics:
                self._watched[who] = frozenset(topics)

    def image(self, topic: str) -> LiveImage | None:
        """The newest image of a watched topic."""
        return self._images.get(topic)

    def call(self, tracker: str, service: str, **fields: Any) -> tuple[bool, str]:
        """Call a service of a tracker.

        Parameters
        ----------
        tracker : full name of the node.
        service : a key of `SERVICES`.
        **fields : of the request.

        Returns
        -------
        success, message : of the response.

        Raises
        ------
        UnknownNameError : no such service is offered now.
        TrackerError : it does not answer.
        """
        name = f"{tracker}/{service}"
        if name not in self.services:
            raise UnknownNameError("service", name, self.services)
        kind = message_class(self.services[name])
        answer: Future[Any] = Future()
        self._errands.put(partial(self._ask, name, kind, kind.Request(**fields), answer, time.monotonic() + _ANSWER_S))
        try:
            response = answer.result(_ANSWER_S + 1.0)
        except TimeoutError:
            raise TrackerError(f"service {name} does not answer") from None
        return bool(response.success), str(response.message)

    # In the thread

    def _run(self) -> None:
        looked_s = -_LOOK_S
        try:
            while not self._stop.is_set():
                self._executor.spin_once(timeout_sec=_LOOP_S)
                if time.monotonic() - looked_s > _LOOK_S:
                    self._look()
                    looked_s = time.monotonic()
                self._subscribe_to_watched()
                self._run_errands()
        except ExternalShutdownException:
            pass
        except Exception as error:  # whatever ROS says: the page tells it, instead of showing what is no longer true
            self.problem = f"the view of the graph has ended: {error}"
            raise
        finally:
            self._executor.shutdown()
            self._node.destroy_node()
            rclpy.try_shutdown(context=self._context)

    def _look(self) -> None:
        """What is published and offered now."""
        topics = {name: types[0] for name, types in self._node.get_topic_names_and_types() if types}
        published = {name: kind for name, kind in topics.items() if kind in (RAW, COMPRESSED, STATE_TYPE)}
        published = {name: kind for name, kind in published.items() if self._node.count_publishers(name)}
        self.image_topics = {name: kind for name, kind in sorted(published.items()) if kind != STATE_TYPE}
        for name, kind in published.items():
            tracker = name.removesuffix("/state")
            if kind == STATE_TYPE and tracker not in self.trackers:
                self.trackers[tracker] = LiveTracker()
                self._node.create_subscription(TrackedState, name, self.trackers[tracker].take, RESULT)
        offered = {name: types[0] for name, types in self._node.get_service_names_and_types() if types}
        expected = {f"{tracker}/{service}": kind for tracker in self.trackers for service, kind in SERVICES.items()}
        self.services = {name: kind for name, kind in expected.items() if offered.get(name) == kind}

    def _subscribe_to_watched(self) -> None:
        with self._lock:
            wanted = set().union(*self._watched.values()) & self.image_topics.keys()
        for topic in self._subscriptions.keys() - wanted:
            self._node.destroy_subscription(self._subscriptions.pop(topic))
            self._images.pop(topic, None)
        for topic in wanted - self._subscriptions.keys():
            raw = self.image_topics[topic] == RAW
            self._subscriptions[topic] = self._node.create_subscription(
                Image if raw else CompressedImage, topic, partial(self._take_image, topic), SENSOR, raw=raw
            )

    def _take_image(self, topic: str, content: CompressedImage | bytes) -> None:
        before = self._images.get(topic)
        number = 1 if before is None else before.number + 1
        stamp_ns = 0 if isinstance(content, bytes) else stamp_ns_of(content.header.stamp)
        self._images[topic] = LiveImage(number, time.monotonic(), stamp_ns, content)

    def _run_errands(self) -> None:
        for _ in range(self._errands.qsize()):
            self._errands.get()()

    def _ask(self, name: str, kind: Any, request: Any, answer: Future, until_s: float) -> None:
        """Send a request once the service is found; it is searched again with the next errands."""
        try:
            client = self._clients.get(name) or self._clients.setdefault(name, self._node.create_client(kind, name))
            if client.service_is_ready():
                client.call_async(request).add_done_callback(partial(_hand_on, name, answer))
            elif time.monotonic() < until_s:
                self._errands.put(partial(self._ask, name, kind, request, answer, until_s))
        except Exception as error:  # a request that ROS cannot send must not end the view
            answer.set_exception(TrackerError(f"service {name} cannot be asked: {error}"))


def _hand_on(name: str, answer: Future, done: Any) -> None:
    """What a service said to whoever waits for it; ``done`` is a future of rclpy."""
    problem = done.exception()
    if problem is None and done.result() is not None:
        answer.set_result(done.result())
    else:
        answer.set_exception(TrackerError(f"service {name} does not answer: {problem or 'it was cancelled'}"))


HISTORY = 4000  # states: more than two minutes at 30 Hz
_RATE_OVER_S = 2.0
_LIKELY_LATENCY_S = 600.0  # stamps farther from now are of another clock, such as those of a file


@dataclass(frozen=True)
class StatePoint:
    """One state, for curves; ``latency_ms`` from its stamp to its arrival, None where stamps are not of this clock."""

    number: int
    arrival_s: float
    status: str
    residual: float | None
    total_ms: float | None
    latency_ms: float | None


class LiveTracker:
    """The newest state of a tracker, and its recent history."""

    def __init__(self) -> None:
        self._history: deque[StatePoint] = deque(maxlen=HISTORY)
        self.latest: TrackedState | None = None

    def take(self, message: TrackedState) -> None:
        """A state that has arrived."""
        latency_s = 1e-9 * (time.time_ns() - stamp_ns_of(message.header.stamp))
        likely = -0.1 < latency_s < _LIKELY_LATENCY_S
        number = self._history[-1].number + 1 if self._history else 1
        self._history.append(
            StatePoint(
                number, time.monotonic(), _name(Status, message.status), finite(message.residual), finite(message.total_ms),
                1e3 * latency_s if likely else None,
            )
        )  # fmt: skip
        self.latest = message

    def points_after(self, number: int) -> list[StatePoint]:
        """States that arrived after that of this number; from any thread."""
        return [point for point in tuple(self._history) if point.number > number]

    def rate_hz(self) -> float:
        """States per second, of the last two seconds."""
        since_s = time.monotonic() - _RATE_OVER_S
        return sum(point.arrival_s > since_s for point in tuple(self._history)) / _RATE_OVER_S

    def facts(self) -> dict[str, Any] | None:
        """The newest state in plain values; None before the first."""
        message = self.latest
        if message is None:
            return None
        limbs = zip(message.limbs, message.limb_status, message.limb_lost_probability, message.limb_reasons, strict=False)
        cameras = zip(message.cameras, message.camera_residuals, message.camera_samples, strict=False)
        return {
            "age_s": time.monotonic() - self._history[-1].arrival_s,
            "status": _name(Status, message.status),
            "reason": message.status_reason,
            "model": message.model,
            "stamp_s": 1e-9 * stamp_ns_of(message.header.stamp),
            "residual": finite(message.residual),
            "residual_unit": message.residual_unit,
            "iterations": message.iterations,
            "dofs": [[name, finite(value)] for name, value in zip(message.dof_names, message.values, strict=False)],
            "limbs": [[name, _name(LimbStatus, status), finite(lost), reason] for name, status, lost, reason in limbs],
            "cameras": [[name, finite(residual), samples] for name, residual, samples in cameras],
        }


class LiveDiagnostics:
    """The newest status of every part of every node."""

    def __init__(self) -> None:
        self._statuses: dict[tuple[str, str], tuple[float, Any]] = {}

    def take(self, message: DiagnosticArray) -> None:
        """Statuses that have arrived."""
        for status in message.status:
            self._statuses[status.name, status.hardware_id] = time.monotonic(), status

    def facts(self) -> list[dict[str, Any]]:
        """Statuses in plain values, by name; ``level`` 0 (OK) to 3 (STALE); ``age_s`` since they were said last."""
        now_s = time.monotonic()
        return [
            {
                "name": status.name,
                "hardware_id": status.hardware_id,
                "level": _level(status.level),
                "message": status.message,
                "values": [[value.key, value.value] for value in status.values],
                "age_s": now_s - arrival_s,
            }
            for _, (arrival_s, status) in sorted(self._statuses.copy().items())
        ]


def _level(level: bytes | Sequence[int] | int) -> int:
    """A ROS byte, which is ``bytes`` of length one."""
    return level if isinstance(level, int) else level[0]


def _name(kind: type[IntEnum], number: int) -> str:
    """Others may send any number."""
    return kind(number).name if number in set(kind) else f"{kind.__name__.upper()} {number}"
