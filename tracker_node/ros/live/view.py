"""A running graph as others may look at it: trackers, images, diagnostics, and the trackers' services.

One thread does all that ROS asks for; everybody else reads what it has left. Of images only the newest is kept, and only topics
that somebody watches are subscribed to, since a tracker draws overlays for its subscribers alone.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Collection
from concurrent.futures import Future
from dataclasses import dataclass
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

from ...errors import TrackerError, UnknownNameError
from ...loaders.bag.images import COMPRESSED, RAW
from ..conversions import compressed_message, decode_raw_image, stamp_ns_of
from ..guarded_node import GuardedNode
from ..message_classes import message_class
from ..qos import RESULT, SENSOR, use_fastdds_profile
from .facts import LiveDiagnostics, LiveTracker

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
        return bytes(compressed_message(0, "", decode_raw_image(topic, self.content).bgr).data)


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
        """Image topics that ``who`` wants to see from now on; none: it goes."""
        with self._lock:
            self._watched.pop(who, None)
            if topics:
                self._watched[who] = frozenset(topics)

    def image(self, topic: str) -> LiveImage | None:
        """The newest image of a watched topic."""
        return self._images.get(topic)

    def call(self, tracker: str, service: str, **fields: Any) -> tuple[bool, str]:
        """Ask a service of a tracker; whether it succeeded, and what it said.

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
        """Send a request once the service is found; looked for again with the next errands."""
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
