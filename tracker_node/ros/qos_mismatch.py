"""Ends of topics whose quality of service does not match, from the event that says so until they are gone."""

from __future__ import annotations

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSCompatibility, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo

from .diagnostics import OK, WARN, Diagnostics
from .qos import policy_name

_UNKNOWN = "_NODE_NAME_UNKNOWN_"  # of rmw


class QosMismatches:
    """Reports each mismatch as a part ``quality of service of <what>``; `recheck` ends those that are over."""

    def __init__(self, node: Node, diagnostics: Diagnostics):
        self._node, self._diagnostics = node, diagnostics
        self._known: dict[str, tuple[str, dict[str, str]]] = {}  # what -> problem, and its values: topic, policy

    def of_subscription(self, what: str, topic: str) -> SubscriptionEventCallbacks:
        """To be given to ``create_subscription``; ``what`` is the name for people."""
        return SubscriptionEventCallbacks(incompatible_qos=lambda event: self._found(what, topic, "a publisher", event))

    def of_publisher(self, what: str, topic: str) -> PublisherEventCallbacks:
        """To be given to ``create_publisher``."""
        return PublisherEventCallbacks(incompatible_qos=lambda event: self._found(what, topic, "a subscriber", event))

    def _found(self, what: str, topic: str, other: str, event) -> None:
        policy = policy_name(event.last_policy_kind)
        problem = f"nothing passes between us and {other}: its {policy} does not match ours"
        self._known[what] = problem, {"topic": topic, "policy": policy}
        self._tell(what)

    def _tell(self, what: str) -> None:
        self._diagnostics.report(_part(what), WARN, *self._known[what])

    def recheck(self, again: bool = True) -> None:
        """Once a second: those whose other end has left, or come back with what matches, are no trouble any more.

        The others are reported ``again``: a node that was at rest has said meanwhile that nothing is expected of it.
        """
        for what, (_, values) in list(self._known.items()):
            if not self._mismatched(values["topic"]):
                del self._known[what]
                self._diagnostics.report(_part(what), OK, "matches", {"topic": values["topic"]})
            elif again:
                self._tell(what)

    def _mismatched(self, topic: str) -> bool:
        full = self._node.resolve_topic_name(topic)
        publishers = self._node.get_publishers_info_by_topic(full)
        subscribers = self._node.get_subscriptions_info_by_topic(full)
        return any(
            qos_check_compatible(one.qos_profile, other.qos_profile)[0] == QoSCompatibility.ERROR
            for one in publishers
            for other in subscribers
            if self._is_ours(one) or self._is_ours(other)
        )

    def _is_ours(self, end: TopicEndpointInfo) -> bool:
        if end.node_name == _UNKNOWN:  # the graph has not heard of its node yet
            return True
        return (end.node_name, end.node_namespace) == (self._node.get_name(), self._node.get_namespace())


def _part(what: str) -> str:
    return f"quality of service of {what}"
