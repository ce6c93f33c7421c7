"""A node's /diagnostics: every second, and at once when something changes; mismatches of quality of service among it.

What others in the graph do that spoils its work is told, too: its name, or the topic of a camera, is taken twice; no clock ticks.
"""

from __future__ import annotations

import math
import re
import threading
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSCompatibility, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo
from sensor_msgs.msg import CompressedImage, Image

from ..tracking.estimate import BUMPED, DELAYED, FROZEN, TURNED, CameraFault
from .qos import RESULT, policy_of

_LOOKS, _CLOCK_LOOKS = 25, 5  # in a row at which a problem is there until it is told: a killed node is in the graph for 20 s
_NAMED = 4  # topics in a message


class GraphCheck:
    """To be asked once a second.

    Parameters
    ----------
    node : whose surroundings are looked at.
    """

    def __init__(self, node: Node):
        self._node = node
        self._looks: Counter[str] = Counter()  # kind of problem -> looks in a row at which it was there

    def problems(self) -> list[str]:
        """Those that last, for people."""
        found = {"name": self._same_name(), "images": self._several_publishers(), "clock": self._no_clock()}
        self._looks = Counter({kind: self._looks[kind] + 1 for kind, text in found.items() if text})
        return [found[kind] for kind, n in self._looks.items() if n >= (_CLOCK_LOOKS if kind == "clock" else _LOOKS)]

    def _same_name(self) -> str:
        own = self._node.get_name(), self._node.get_namespace()
        if self._node.get_node_names_and_namespaces().count(own) < 2:
            return ""
        full = self._node.get_fully_qualified_name()
        return f"another node is named {full}: end it, or name one otherwise"

    def _several_publishers(self) -> str:
        """Of images, which are of one camera each, and would be mixed."""
        ends: list[Any] = [*self._node.publishers, *self._node.subscriptions]
        topics = dict.fromkeys(end.topic_name for end in ends if end.msg_type in (Image, CompressedImage))
        counts = {topic: n for topic in topics if (n := self._node.count_publishers(topic)) > 1}
        more = f" and {len(counts) - _NAMED} more" if len(counts) > _NAMED else ""
        return f"{max(counts.values())} publishers on {', '.join(list(counts)[:_NAMED])}{more}" if counts else ""

    def _no_clock(self) -> str:
        clock: Any = self._node.get_clock()
        waits = clock.ros_time_is_active and clock.now().nanoseconds == 0
        return "use_sim_time is true, and nobody has published /clock" if waits else ""


OK = DiagnosticStatus.OK
WARN = DiagnosticStatus.WARN
ERROR = DiagnosticStatus.ERROR
STALE = DiagnosticStatus.STALE
PAUSED = "paused by request"  # of parts that nothing is expected of meanwhile
CALLBACKS = "callbacks"  # the part that says what they have raised
GRAPH = "graph"  # the part that says what is wrong around the node
_TROUBLE = (WARN, ERROR)


class Diagnostics:
    """Statuses of the parts of one node, published under ``<node>: <part>``, the node's name with its namespace.

    `report` may be called from any thread. A change of level or message is published at once, values alone with the next
    second; trouble, and its end, is logged, though not again when only numbers in its message change. The seconds are those
    of a steady clock: a simulated one that stands still is no reason to say nothing.
    """

    def __init__(self, node: Node, hardware_id: str = "", period_s: float = 1.0):
        self._node, self._hardware_id = node, hardware_id
        self._name = node.get_fully_qualified_name().lstrip("/")
        self._lock = threading.Lock()
        self._statuses: dict[str, DiagnosticStatus] = {}
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", RESULT)
        errors = getattr(node, "callback_errors", None)
        if errors is not None:
            errors.diagnostics = self
        self._graph = GraphCheck(node)
        self._timer = node.create_timer(period_s, self._look_and_publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def report(
        self,
        part: str,
        level: bytes,
        message: str,
        values: Mapping[str, object] | None = None,
        *,
        hardware_id: str = "",
        logged: bool = True,
    ) -> None:
        """Set the state of one part.

        Parameters
        ----------
        part : behind the node's name.
        level : `OK`, `WARN`, `ERROR` or `STALE`.
        message : in words.
        values : shown as text, floats with three decimals.
        hardware_id : in place of the node's.
        logged : False: only published.
        """
        status = DiagnosticStatus(
            level=level,
            name=f"{self._name}: {part}",
            message=message,
            hardware_id=hardware_id or self._hardware_id,
            values=[KeyValue(key=key, value=_text(value)) for key, value in (values or {}).items()],
        )
        with self._lock:
            before = self._statuses.get(part)
            self._statuses[part] = status
        if before is None or (before.level, before.message) != (level, message):
            trouble = level in _TROUBLE or (before is not None and before.level in _TROUBLE)
            if logged and trouble and (before is None or (before.level, _gist(before.message)) != (level, _gist(message))):
                self._log(part, level, message)
            if before is not None or level != OK:
                self.publish()

    def rest(self, message: str) -> None:
        """Every part is at rest, and no trouble: nothing is expected of it."""
        for part in list(self._statuses):
            if part != CALLBACKS:
                self.report(part, OK, message)

    def _look_and_publish(self) -> None:
        problems = self._graph.problems()
        if problems:
            self.report(GRAPH, WARN, "; ".join(problems))
        elif GRAPH in self._statuses:
            self.report(GRAPH, OK, "nothing is wrong with it")
        self.publish()

    def publish(self) -> None:
        """Publish all statuses as they are."""
        with self._lock:
            statuses = list(self._statuses.values())
        if statuses:
            stamp = self._node.get_clock().now().to_msg()
            message = DiagnosticArray(status=statuses)
            message.header.stamp = stamp
            self._publisher.publish(message)

    def wait_until_delivered(self, timeout_s: float = 1.0) -> None:
        """Until everything has arrived at those who listen: a node that ends takes with it what has not."""
        self._publisher.wait_for_all_acked(Duration(seconds=timeout_s))

    def _log(self, part: str, level: bytes, message: str) -> None:
        logger = self._node.get_logger()
        text = f"{part}: {message}"
        if level in (OK, STALE):
            logger.info(text)
        elif level == WARN:
            logger.warning(text)
        else:
            logger.error(text)


_DEGREES, _MILLISECONDS = (180.0 / math.pi, "deg"), (1e3, "ms")
_UNITS = {TURNED: _DEGREES, BUMPED: _DEGREES, DELAYED: _MILLISECONDS, FROZEN: _MILLISECONDS}
"""Kind of fault -> how many of a unit its size is, and the unit; of the others it is a share of what is usual."""


def statuses_of(faults: Iterable[CameraFault]) -> dict[str, tuple[bytes, str, dict[str, object]]]:
    """Camera -> level, message and values, of every camera that the others contradict; WARN where it might as well be another."""
    result: dict[str, tuple[bytes, str, dict[str, object]]] = {}
    for fault in faults:
        per_unit, unit = _UNITS.get(fault.kind, (100.0, "%"))
        values = {f"{fault.kind} [{unit}]": per_unit * fault.size, f"sigma [{unit}]": per_unit * fault.sigma}
        values["since [s]"] = 1e-9 * fault.since_ns
        for camera in (fault.camera, *fault.rivals):
            level, said, more = result.get(camera, (OK, "", {}))
            level = max(level, WARN if fault.rivals else ERROR)
            result[camera] = (level, f"{said}; {fault.text}" if said else fault.text, {**more, **values})
    return result


def _gist(message: str) -> str:
    """A message without its numbers; digits in names stay."""
    return re.sub(r"(?<![\w.])\d+(\.\d+)?(?!\w)", "#", message)


def _text(value: object) -> str:
    return f"{value:.3f}" if isinstance(value, float) else str(value)


_UNKNOWN = "_NODE_NAME_UNKNOWN_"  # of rmw


class QosMismatches:
    """Reports each mismatch of our ends of topics as a part ``quality of service of <what>``, as `recheck` finds them.

    Parameters
    ----------
    node, diagnostics : whose ends are looked at, and where it is said.
    """

    def __init__(self, node: Node, diagnostics: Diagnostics):
        self._node, self._diagnostics = node, diagnostics
        self._watched: dict[str, tuple[str, str]] = {}  # what -> topic, and who is at its other end
        self._ends: dict[str, tuple[int, int]] = {}  # what -> publishers and subscribers when it was looked at last
        self._known: dict[str, str] = {}  # what -> policy

    def of_subscription(self, what: str, topic: str) -> None:
        """Watch a subscription.

        Parameters
        ----------
        what : name of the subscription for people.
        topic : its name.
        """
        self._watched[what] = topic, "a publisher"

    def of_publisher(self, what: str, topic: str) -> None:
        """Watch a publisher.

        Parameters
        ----------
        what : name of the publisher for people.
        topic : its name.
        """
        self._watched[what] = topic, "a subscriber"

    def recheck(self, again: bool = True) -> None:
        """Once a second: those whose other end has left, or come back with what matches, are no trouble any more.

        Those known are reported ``again``: a node that was at rest has said meanwhile that nothing is expected of it.
        """
        for what, (topic, other) in self._watched.items():
            ends = self._node.count_publishers(topic), self._node.count_subscribers(topic)
            known = self._known.get(what)
            if known is None and ends == self._ends.get(what):
                continue
            policy = self._mismatched(topic) if all(ends) else ""
            self._ends[what] = ends
            if policy and (again or policy != known):
                self._known[what] = policy
                problem = f"nothing passes between us and {other}: its {policy} does not match ours"
                self._diagnostics.report(_part(what), WARN, problem, {"topic": topic, "policy": policy})
            elif known is not None and not policy:
                del self._known[what]
                self._diagnostics.report(_part(what), OK, "matches", {"topic": topic})

    def _mismatched(self, topic: str) -> str:
        """The policy by which nothing passes between one of our ends of a topic and another; empty where all match."""
        full = self._node.resolve_topic_name(topic)
        publishers = self._node.get_publishers_info_by_topic(full)
        subscribers = self._node.get_subscriptions_info_by_topic(full)
        for one in publishers:
            for other in subscribers:
                if self._is_ours(one) or self._is_ours(other):
                    compatible, reason = qos_check_compatible(one.qos_profile, other.qos_profile)
                    if compatible == QoSCompatibility.ERROR:
                        return policy_of(reason)
        return ""

    def _is_ours(self, end: TopicEndpointInfo) -> bool:
        if end.node_name == _UNKNOWN:  # the graph has not heard of its node yet
            return True
        return (end.node_name, end.node_namespace) == (self._node.get_name(), self._node.get_namespace())


def _part(what: str) -> str:
    return f"quality of service of {what}"
