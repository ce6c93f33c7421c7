"""A bag into topics, bytes as they are, with the clock of its recording."""

from __future__ import annotations

import threading
import time
from collections import Counter
from dataclasses import dataclass

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool

from ..errors import TrackerError
from ..loaders.bag_metadata import OfferedQos
from ..loaders.bag_reader import BagMessage, BagReader
from .conversions import stamp_message
from .message_classes import message_class, qos_profile
from .qos import images_published

CLOCK = "/clock"
DEPTH = 100  # a player may run ahead of slow subscribers by so many messages
_SETTLE_S = 0.3  # between the discovery of a subscriber here and ours there
_ACKNOWLEDGE_S = 5.0


@dataclass(frozen=True)
class PlayerOptions:
    """How a bag is played.

    Parameters
    ----------
    topics : only these; empty for all.
    exclude : but not these.
    rate : speed; 2.0 plays twice as fast.
    start_s : seconds from the beginning of the bag to leave out.
    duration_s : seconds of the bag to play; None to its end.
    loop : begin again at the end, for ever.
    clock_hz : rate of ``/clock`` in wall time; 0 for none.
    wait_for_subscribers : begin when every topic of the bag has so many.
    paused : wait for the service ``~/pause``.
    """

    topics: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    rate: float = 1.0
    start_s: float = 0.0
    duration_s: float | None = None
    loop: bool = False
    clock_hz: float = 100.0
    wait_for_subscribers: int = 0
    paused: bool = False


class PlayerNode(Node):
    """Publishes the messages of a bag at the times of their recording.

    The topics have the types and the quality of service that were recorded. The service ``~/pause`` (std_srvs/SetBool) stops
    the bag's time and lets it go on.

    Attributes
    ----------
    published : topic -> number of messages.
    problems : topic -> why it is not played.
    finished : set when the end is reached, or playing failed.

    Raises
    ------
    TrackerError : no topic can be played, or a named one is not in the bag.
    """

    def __init__(self, reader: BagReader, options: PlayerOptions | None = None):
        super().__init__("player")
        self._bag, self._how = reader, options or PlayerOptions()
        self.published: Counter[str] = Counter()
        self.problems: dict[str, str] = {}
        self.finished = threading.Event()
        self.problem = ""
        self._outlets = self._make_publishers()
        clock_hz = self._how.clock_hz
        self._clock_outlet = self.create_publisher(Clock, CLOCK, images_published()) if clock_hz > 0 else None
        self._stopped = threading.Event()
        self._bag_time = BagTime(self._how.rate, self._how.paused)
        self._pause_service = self.create_service(SetBool, "~/pause", self._on_pause)
        self._player = threading.Thread(target=self._run, name="play bag", daemon=True)

    def start(self) -> None:
        """Begin to play, in a thread."""
        self._player.start()

    def close(self) -> None:
        """End the thread."""
        self._stopped.set()
        self._bag_time.wake()
        if self._player.is_alive():
            self._player.join(timeout=_ACKNOWLEDGE_S + 5.0)

    def _make_publishers(self) -> dict[str, Publisher]:
        for name in (*self._how.topics, *self._how.exclude):
            self._bag.topic(name)
        publishers = {}
        for name, topic in self._bag.topics.items():
            if name in self._how.exclude or (self._how.topics and name not in self._how.topics):
                continue
            if name == CLOCK and self._how.clock_hz > 0:
                continue  # ours, not that of another run
            try:
                depth = topic.qos.depth if topic.qos.durability == "transient_local" else DEPTH
                qos = OfferedQos(topic.qos.reliability, topic.qos.durability, topic.qos.history, depth)
                publishers[name] = self.create_publisher(message_class(topic.type_name), name, qos_profile(qos))
            except TrackerError as error:
                self.problems[name] = str(error)
                self.get_logger().error(f"{name} is not played: {error}")
        if not publishers:
            why = "; ".join(self.problems.values()) or "it is empty"
            raise TrackerError(f"bag {self._bag.path}: no topic can be played: {why}")
        return publishers

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._bag_time.pause(request.data)
        response.success = True
        response.message = "paused" if request.data else "playing"
        return response

    def _run(self) -> None:
        try:
            if self._wait_for_subscribers():
                while self._play_once() and self._how.loop:
                    pass
            for publisher in self._outlets.values():
                publisher.wait_for_all_acked(Duration(seconds=_ACKNOWLEDGE_S))
        except Exception as error:  # a thread must not end in silence
            self.problem = str(error)
        finally:
            self.finished.set()

    def _wait_for_subscribers(self) -> bool:
        wanted, asked = self._how.wait_for_subscribers, time.monotonic()
        while wanted and not self._stopped.is_set():
            lacking = [name for name, p in self._outlets.items() if p.get_subscription_count() < wanted]
            if not lacking:
                return not self._stopped.wait(_SETTLE_S)
            if time.monotonic() - asked > 5.0:
                asked = time.monotonic()
                self.get_logger().info(f"waiting for {wanted} subscriber(s) of {', '.join(lacking)}")
            self._stopped.wait(0.02)
        return not self._stopped.is_set()

    def _play_once(self) -> bool:
        """The bag from start to end; False if it was stopped."""
        begin_ns = self._bag.start_ns + round(self._how.start_s * 1e9)
        duration_s = self._how.duration_s
        end_ns = None if duration_s is None else begin_ns + round(duration_s * 1e9)
        self._bag_time.begin(begin_ns)
        for message in self._bag.messages(self._outlets, begin_ns, end_ns):
            if not self._wait_until(message.stamp_ns):
                return False
            self._publish(message)
        return True

    def _wait_until(self, stamp_ns: int) -> bool:
        """Until the bag's time is there, with the clock ticking; False when stopped."""
        period_s = 1.0 / self._how.clock_hz if self._clock_outlet is not None else 0.1
        while not self._stopped.is_set():
            now_ns = self._bag_time.now_ns()
            if self._clock_outlet is not None and self._bag_time.tick_is_due(period_s):
                self._clock_outlet.publish(Clock(clock=stamp_message(min(now_ns, stamp_ns))))
            if now_ns >= stamp_ns:
                return True
            self._bag_time.sleep(stamp_ns, period_s)
        return False

    def _publish(self, message: BagMessage) -> None:
        self._outlets[message.topic].publish(message.data)
        self.published[message.topic] += 1


class BagTime:
    """The time of a bag that is played: runs at a rate, and can be paused from another thread."""

    def __init__(self, rate: float = 1.0, paused: bool = False):
        if not rate > 0.0:
            raise TrackerError(f"rate: expected a positive number, got {rate}")
        self._rate, self._paused = rate, paused
        self._condition = threading.Condition()
        self._bag_ns, self._wall_s, self._tick_s = 0, time.monotonic(), 0.0

    def begin(self, bag_ns: int) -> None:
        """It is ``bag_ns`` now."""
        with self._condition:
            self._bag_ns, self._wall_s = bag_ns, time.monotonic()
            self._tick_s = 0.0

    def now_ns(self) -> int:
        """The bag's time now."""
        with self._condition:
            return self._now_ns()

    def _now_ns(self) -> int:
        return self._bag_ns if self._paused else self._bag_ns + round((time.monotonic() - self._wall_s) * self._rate * 1e9)

    def pause(self, paused: bool) -> None:
        """Stop, or go on from where it stopped."""
        with self._condition:
            self._bag_ns, self._wall_s = self._now_ns(), time.monotonic()
            self._paused = paused
            self._condition.notify_all()

    def wake(self) -> None:
        """End every `sleep`."""
        with self._condition:
            self._condition.notify_all()

    def tick_is_due(self, period_s: float) -> bool:
        """True once every ``period_s`` of wall time."""
        now = time.monotonic()
        if now < self._tick_s:
            return False
        self._tick_s = now + period_s
        return True

    def sleep(self, until_ns: int, at_most_s: float) -> None:
        """Until the bag's time is there, but not longer than ``at_most_s`` of wall time."""
        with self._condition:
            left_s = at_most_s if self._paused else (until_ns - self._now_ns()) * 1e-9 / self._rate
            if left_s > 0.0:
                self._condition.wait(min(left_s, at_most_s))
