"""What others in the graph do that spoils a node's work: its name, or the topic of a camera, is taken twice; no clock ticks."""

from __future__ import annotations

from collections import Counter
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import CompressedImage, Image

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
