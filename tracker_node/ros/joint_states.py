"""What a robot says of its joints (sensor_msgs/JointState), for the image sets of a tracker."""

from __future__ import annotations

import time

from rclpy.node import Node
from sensor_msgs.msg import JointState

from ..errors import TrackerError
from ..loaders.bag.message_types import stamp_ns_of
from ..model.articulated import ArticulatedModel
from ..observation.image_set import ImageSet
from ..runs.joint_states import check_positions, joint_states_of, positions_of, with_joint_states
from .diagnostics import OK, WARN, Diagnostics, QosMismatches
from .qos import RESULT, overridable

PART = "joint_states"  # of /diagnostics
_MOST = 5000  # readings of a joint that are kept: of five seconds, of a fast robot
_BACK_NS = 5_000_000_000  # by which an image set is before the last one, where stamps have gone back
_PATIENCE_S = 1.0  # robots say where they are a hundred times a second
_NEAR_NS = 1_000_000_000  # between what a robot says and the newest images, where both have one clock
_SILENT_S = 2.0
_UNUSED_SETS = 10  # in a row, while messages come


class JointStateInbox:
    """A subscription; its readings wait for the image sets of their times.

    Parameters
    ----------
    node, diagnostics, mismatches : of the tracker.
    model : the body whose joints they are of.
    topic : where the robot says them.

    Attributes
    ----------
    received, refused : messages. used, missed : image sets beside which something was said, or nothing.
    """

    def __init__(self, node: Node, model: ArticulatedModel, topic: str, diagnostics: Diagnostics, mismatches: QosMismatches):
        self._node, self._diagnostics = node, diagnostics
        self._axes = {axis.name: axis for axis in model.chain.axes}
        self._states, self._newest_ns = joint_states_of(model, _MOST), 0
        self._patient, self._last_s, self._problem = True, time.monotonic(), ""
        self._said_ns, self._in_a_row = 0, 0  # stamp of the last message, and image sets since one was used
        self.received = self.refused = self.used = self.missed = 0
        mismatches.of_subscription("joint states", topic)
        self._subscription = node.create_subscription(JointState, topic, self._take, **overridable(RESULT))

    @property
    def topic(self) -> str:
        """Its full name."""
        return self._subscription.topic_name

    def close(self) -> None:
        """Listen no more."""
        self._node.destroy_subscription(self._subscription)

    def _take(self, message: JointState) -> None:
        self.received += 1
        try:
            positions = positions_of(message, self._axes)
            check_positions(positions, self._axes)
            self._states.add(stamp_ns_of(message.header.stamp), positions)
        except TrackerError as error:
            self.refused += 1
            if not self._problem:
                self._node.get_logger().warning(f"{self.topic}: {error}")
            self._problem = str(error)
            return
        self._problem, self._last_s, self._said_ns = "", time.monotonic(), stamp_ns_of(message.header.stamp)
        self._patient = self._patient or abs(self._said_ns - self._newest_ns) < _NEAR_NS  # on another clock nothing ever fits

    def attached(self, image_set: ImageSet, waits: bool) -> ImageSet:
        """An image set beside what the robot says at its time.

        Parameters
        ----------
        image_set : the next one to be tracked.
        waits : for a reading that is not older; a robot that says nothing for long is not waited for again.

        Returns
        -------
        The same images, with ``joint_positions``.
        """
        if image_set.stamp_ns < self._newest_ns - _BACK_NS:
            self._states.clear()  # stamps went back
        self._newest_ns = image_set.stamp_ns
        if waits and self._patient:
            self._patient = self._states.wait_beyond(image_set.stamp_ns, _PATIENCE_S)
        image_set = with_joint_states(self._states, image_set)
        self.used, self.missed = self.used + bool(image_set.joint_positions), self.missed + (not image_set.joint_positions)
        self._in_a_row = 0 if image_set.joint_positions else self._in_a_row + 1
        return image_set

    def report(self) -> None:
        """Once a second, while the tracker is active."""
        level, said = OK, "used" if self.used else "waiting for image sets"
        if self._problem:
            level, said = WARN, self._problem
        elif time.monotonic() - self._last_s > _SILENT_S:
            level, said = WARN, f"nothing comes on {self.topic}"
        elif self._in_a_row >= _UNUSED_SETS:
            stamps = f"they are stamped {1e-9 * self._said_ns:.3f} s, images {1e-9 * self._newest_ns:.3f} s"
            level, said = WARN, f"none at the time of the last {self._in_a_row} image sets: {stamps}; are both of one clock?"
        counts = {"received": self.received, "refused": self.refused, "used": self.used, "without": self.missed}
        self._diagnostics.report(PART, level, said, counts)
