"""A bag into topics, bytes as they are, with the clock of its recording.

The time of a bag that is played.
"""

from __future__ import annotations

import math
import threading
import time
from collections import Counter
from dataclasses import dataclass

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.duration import Duration
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool, Trigger

from ...errors import TrackerError
from ...loaders.bag.metadata import OfferedQos
from ...loaders.bag.reader import BagMessage, BagReader
from ..conversions import message_class, stamp_message
from ..guarded_node import GuardedNode
from ..parameter_overrides import integers_as_doubles, overrides_of
from ..qos import images_published, qos_profile

CLOCK = "/clock"
DEPTH = 100  # a player may run ahead of slow subscribers by so many messages
_SETTLE_S = 0.3  # between the discovery of a subscriber here and ours there
_ACKNOWLEDGE_S = 5.0
_BETWEEN_LOOPS_S = 0.01


@dataclass(frozen=True)
class PlayerOptions:
    """How a bag is played.

    Parameters
    ----------
    topics : only these; empty for all.
    exclude : but not these.
    rate : speed; 2.0 plays twice as fast; from `clock.MIN_RATE` to `clock.MAX_RATE`.
    start_s : seconds from the beginning of the bag to leave out.
    duration_s : seconds of the bag to play; None to its end.
    loop : begin again at the end, for ever.
    clock_hz : rate of ``/clock`` in wall time; 0 for none.
    wait_for_subscribers : begin when every topic of the bag has so many.
    wait_for_node : begin when the node of this name, such as tracker or /lab/tracker, subscribes to topics of the bag.
    reliable : offer reliably what was recorded as best effort, too.
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
    wait_for_node: str = ""
    reliable: bool = False
    paused: bool = False


class PlayerNode(GuardedNode):
    """Publishes the messages of a bag at the times of their recording.

    The topics have the types and the quality of service that were recorded. The service ``~/pause`` (std_srvs/SetBool) stops
    the bag's time and lets it go on, ``~/play_next`` (std_srvs/Trigger) publishes the next message while it stands still, and
    those within ``step_s`` after it. The parameter ``rate`` is the speed; setting ``position`` goes to so many seconds from
    the beginning of the bag. Wherever playing begins, the last message before of every latched topic is published first.

    Attributes
    ----------
    published : topic -> number of messages.
    problems : topic -> why it is not played.
    finished : set when the end is reached, or playing failed.

    Raises
    ------
    TrackerError : no topic can be played, a named one is not in the bag, or an option or parameter is out of range.
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
        self._check_part()
        self._sought_ns: int | None = None
        self._steps = threading.Semaphore(0)
        self._step_ns, self._step_end_ns = 0, 0  # how long a step is; where the last one ends
        self._pause_service = self.create_service(SetBool, "~/pause", self._on_pause)
        self._next_service = self.create_service(Trigger, "~/play_next", self._on_play_next)
        self._declare_parameters()
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
                reliability = "reliable" if self._how.reliable else topic.qos.reliability
                qos = OfferedQos(reliability, topic.qos.durability, topic.qos.history, depth)
                publishers[name] = self.create_publisher(message_class(topic.type_name), name, qos_profile(qos))
            except (TrackerError, NameValidationException) as error:
                self.problems[name] = str(error).splitlines()[0]
                self.get_logger().error(f"{name} is not played: {self.problems[name]}")
        if not publishers:
            why = "; ".join(self.problems.values()) or "it is empty"
            raise TrackerError(f"bag {self._bag.path}: no topic can be played: {why}")
        return publishers

    def _check_part(self) -> None:
        seconds = (self._bag.end_ns - self._bag.start_ns) * 1e-9
        if not 0.0 <= self._how.start_s <= seconds:
            raise TrackerError(f"start: expected 0 to {seconds:.3f} s, the length of the bag, got {self._how.start_s}")
        if self._how.duration_s is not None and not 0.0 < self._how.duration_s < math.inf:
            raise TrackerError(f"duration: expected a positive number, got {self._how.duration_s}")
        self._begin_ns = self._bag.start_ns + round(self._how.start_s * 1e9)
        self._end_ns = None if self._how.duration_s is None else self._begin_ns + round(self._how.duration_s * 1e9)

    def _declare_parameters(self) -> None:
        seconds = (self._bag.end_ns - self._bag.start_ns) * 1e-9
        integers_as_doubles(self, ["rate", "position", "step_s"])
        for name, value, low, high, text in (
            ("rate", self._how.rate, MIN_RATE, MAX_RATE, "speed; 2.0 plays twice as fast"),
            ("position", self._how.start_s, 0.0, seconds, "set it to go to so many seconds from the beginning of the bag"),
            ("step_s", 0.0, 0.0, seconds, "play_next publishes the next message and those within so many seconds after it"),
        ):
            bounds = FloatingPointRange(from_value=low, to_value=high)
            try:
                self.declare_parameter(name, value, ParameterDescriptor(description=text, floating_point_range=[bounds]))
            except ParameterException:  # the command line says otherwise
                given = overrides_of(self)[name].value if name in overrides_of(self) else value
                raise TrackerError(f"parameter '{name}': expected a number from {low:g} to {high:g}, got {given!r}") from None
        given_too = ["position"] if "position" in overrides_of(self) else []
        self._on_parameters(self.get_parameters(["rate", "step_s", *given_too]))
        self.add_post_set_parameters_callback(self._on_parameters)

    def _on_parameters(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == "rate":
                self._bag_time.set_rate(parameter.value)
            elif parameter.name == "step_s":
                self._step_ns = round(parameter.value * 1e9)
            elif parameter.name == "position":
                self._sought_ns = self._bag.start_ns + round(parameter.value * 1e9)
                self._bag_time.wake()

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._bag_time.pause(request.data)
        response.success = True
        response.message = "paused" if request.data else "playing"
        return response

    def _on_play_next(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._bag_time.paused and not self.finished.is_set()
        if response.success:
            self._steps.release()
            self._bag_time.wake()
        response.message = "one step" if response.success else "only while it is paused"
        return response

    def _run(self) -> None:
        try:
            if self._wait_for_subscribers() and self._wait_for_node():
                self._play()
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

    def _wait_for_node(self) -> bool:
        """Until a node has subscribed to all that it takes: it has begun, and for a moment nothing is added."""
        name, asked = self._how.wait_for_node, time.monotonic()
        taken: set[str] = set()
        while name and not self._stopped.is_set():
            subscribers = {topic: self._subscribers(topic) for topic in self._outlets}
            before, taken = taken, {topic for topic, nodes in subscribers.items() if any(_is_named(node, name) for node in nodes)}
            if taken and taken == before:
                return True
            if time.monotonic() - asked > 5.0:
                asked = time.monotonic()
                others = ", ".join(sorted(set().union(*subscribers.values()))) or "nobody"
                self.get_logger().info(f"waiting for the node {name} to subscribe; so far {others} has")
            self._stopped.wait(_SETTLE_S)
        return not self._stopped.is_set()

    def _subscribers(self, topic: str) -> set[str]:
        """Full names of the nodes."""
        ends = self.get_subscriptions_info_by_topic(self.resolve_topic_name(topic))
        return {f"{each.node_namespace.rstrip('/')}/{each.node_name}" for each in ends}

    def _play(self) -> None:
        """To the end, in a loop if asked for, and wherever somebody seeks."""
        begin_ns = self._begin_ns
        while not self._stopped.is_set():
            if self._sought_ns is not None:  # perhaps before the beginning, while it waited for subscribers
                begin_ns, self._sought_ns = self._sought_ns, None
            count = self._play_from(begin_ns)
            if self._sought_ns is not None:
                continue
            if not self._how.loop or (not count and begin_ns == self._begin_ns):
                return
            begin_ns = self._begin_ns
            self._stopped.wait(_BETWEEN_LOOPS_S)

    def _play_from(self, begin_ns: int) -> int:
        """To the end, or until it is stopped or sent elsewhere; returns how many messages were due."""
        self._publish_latched(begin_ns)
        self._bag_time.begin(begin_ns)
        self._step_end_ns = 0
        count = 0
        for message in self._bag.messages(self._outlets, begin_ns, self._end_ns):
            if not self._wait_until(message.stamp_ns):
                break
            self._publish(message)
            count += 1
        return count

    def _publish_latched(self, before_ns: int) -> None:
        """The latched messages that a subscriber of the recorded graph would have got that came later."""
        latched = [name for name in self._outlets if self._bag.topics[name].qos.durability == "transient_local"]
        if latched and before_ns > self._bag.start_ns:
            last = {message.topic: message for message in self._bag.messages(latched, None, before_ns)}
            for message in last.values():
                self._publish(message)

    def _wait_until(self, stamp_ns: int) -> bool:
        """Until the bag's time is there, with the clock ticking; False when stopped, or sent elsewhere."""
        period_s = 1.0 / self._how.clock_hz if self._clock_outlet is not None else 0.1
        while not self._stopped.is_set() and self._sought_ns is None:
            if self._bag_time.paused and self._may_step(stamp_ns):
                self._bag_time.begin(stamp_ns)
                self._tick(stamp_ns)
                return True
            now_ns = self._bag_time.now_ns()
            if self._bag_time.tick_is_due(period_s):
                self._tick(min(now_ns, stamp_ns))
            if now_ns >= stamp_ns and not self._bag_time.paused:
                return True
            self._bag_time.sleep(stamp_ns, period_s)
        return False

    def _may_step(self, stamp_ns: int) -> bool:
        if stamp_ns < self._step_end_ns:
            return True
        if not self._steps.acquire(blocking=False):
            return False
        self._step_end_ns = stamp_ns + self._step_ns
        return True

    def _tick(self, now_ns: int) -> None:
        if self._clock_outlet is not None:
            self._clock_outlet.publish(Clock(clock=stamp_message(now_ns)))

    def _publish(self, message: BagMessage) -> None:
        self._outlets[message.topic].publish(message.data)
        self.published[message.topic] += 1


MIN_RATE, MAX_RATE = 0.001, 1000.0


class BagTime:
    """Runs at a rate, and can be paused from another thread."""

    def __init__(self, rate: float = 1.0, paused: bool = False):
        if not MIN_RATE <= rate <= MAX_RATE:
            raise TrackerError(f"rate: expected a positive number from {MIN_RATE} to {MAX_RATE:g}, got {rate}")
        self._rate, self._paused = rate, paused
        self._condition = threading.Condition()
        self._bag_ns, self._wall_s, self._tick_s = 0, time.monotonic(), 0.0

    @property
    def paused(self) -> bool:
        return self._paused

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

    def set_rate(self, rate: float) -> None:
        """Go on from here at another speed."""
        with self._condition:
            self._bag_ns, self._wall_s = self._now_ns(), time.monotonic()
            self._rate = rate
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
        """Wait for a time of the bag.

        Parameters
        ----------
        until_ns : time of the bag, nanoseconds.
        at_most_s : seconds of wall time, after which the wait ends in any case.
        """
        with self._condition:
            left_s = at_most_s if self._paused else (until_ns - self._now_ns()) * 1e-9 / self._rate
            if left_s > 0.0:
                self._condition.wait(min(left_s, at_most_s))


def _is_named(node: str, name: str) -> bool:
    """Whether the full name of a node is ``name``, or ends with it where that has no slash."""
    return node == name if "/" in name else node.rpartition("/")[2] == name
