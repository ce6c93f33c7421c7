"""The receiving end of a detector: points in messages are checked, and wait for the image sets that they are of."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Collection
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from tracker_msgs.msg import Keypoints

from ...errors import CalibrationError, shown
from ...runs.points import detected_people, with_known_names
from ..diagnostics import OK, WARN, Diagnostics, QosMismatches
from ..qos import RESULT, overridable
from .point_matching import IN_TIME, LATE, REASONS, UNMATCHED, PointMatching

MOST_BYTES = 64 * 2**20  # of one message; sixteen people in an image of 12 megapixels have less
_SILENT_S = 10.0  # without any points, which a detector at 1 Hz never is
PART = "keypoints"  # of /diagnostics


class KeypointInbox:
    """Subscriptions to ``<cam>/keypoints``.

    Parameters
    ----------
    node : of the tracker.
    matching : where the points go.
    mismatches : is informed when a publisher offers what we cannot take.
    diagnostics : of the node.
    names : of points that the body has.

    Attributes
    ----------
    received, refused : camera -> messages.
    """

    def __init__(
        self, node: Node, matching: PointMatching, mismatches: QosMismatches, diagnostics: Diagnostics, names: Collection[str]
    ):
        self._names = frozenset(names)
        self._node, self.matching, self._mismatches, self._diagnostics = node, matching, mismatches, diagnostics
        self._subscriptions: dict[str, Subscription] = {}
        self._problems: dict[str, str] = {}  # camera -> why its latest message was refused
        self._noted: set[str] = set()
        self._before: Counter[str] = Counter()
        self._received_before, self._before_s = 0, time.monotonic()
        self._last_s = time.monotonic()
        self.received: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()

    def subscribe(self, cameras: Collection[str]) -> None:
        """Listen to detectors of these cameras and of no others."""
        if cameras and not self._subscriptions:
            self._last_s = time.monotonic()
        for camera in [name for name in self._subscriptions if name not in cameras]:
            self._node.destroy_subscription(self._subscriptions.pop(camera))
        for camera in cameras:
            if camera not in self._subscriptions:
                self._subscriptions[camera] = self._subscribed(camera)

    def _subscribed(self, camera: str) -> Subscription:
        topic = f"{camera}/keypoints"
        events = self._mismatches.of_subscription(f"points of {camera}", topic)
        return self._node.create_subscription(
            Keypoints, topic, partial(self._take, camera), **overridable(RESULT), event_callbacks=events, raw=True
        )

    def _take(self, camera: str, data: Any) -> None:
        """``data``: the serialized message."""
        self.received[camera] += 1
        self._last_s = time.monotonic()
        try:
            if len(data) > MOST_BYTES:
                raise CalibrationError(camera, f"keypoints: expected at most {MOST_BYTES} bytes, got {len(data)}")
            message = deserialize_message(data, Keypoints)
            if message.camera != camera:
                raise CalibrationError(camera, f"keypoints: they are of camera {shown(message.camera)}")
            detected = with_known_names(detected_people(message), self._names, camera)
        except CalibrationError as error:
            self.refused[camera] += 1
            self._problems[camera] = str(error)
            self._tell_once(camera, str(error), error.problem)
            return
        self._problems.pop(camera, None)
        for note in detected.notes:
            self._tell_once(camera, f"camera '{camera}': keypoints: {note}", note)
        self.matching.put(camera, detected)

    def _tell_once(self, camera: str, text: str, what: str) -> None:
        kind = f"{camera} {''.join(c for c in what if not c.isdigit())[:80]}"
        if kind not in self._noted and len(self._noted) < 100:
            self._noted.add(kind)
            self._node.get_logger().warning(text)

    def report(self) -> None:
        """Once a second, while the tracker is active and uses points."""
        if not self._subscriptions:
            return
        now, total = time.monotonic(), Counter[str]()
        for counts in self.matching.counts().values():
            total.update(counts)
        rate = (self.received.total() - self._received_before) / max(now - self._before_s, 1e-3)
        self._received_before, self._before_s = self.received.total(), now
        values: dict[str, object] = {"messages per second": rate, "received": self.received.total()}
        values |= {reason: total[reason] for reason in (*REASONS, "waiting")} | {"refused": self.refused.total()}
        new, self._before = total - self._before, total
        level, said = OK, "used"
        problems = self.matching.problems()
        if self._problems:
            level, said = WARN, next(iter(self._problems.values()))
        elif problems and new[UNMATCHED]:
            camera, problem = next(iter(problems.items()))
            level, said = WARN, f"camera '{camera}': {problem}"
        elif now - self._last_s > _SILENT_S:
            level, said = WARN, f"no points come on {next(iter(self._subscriptions))}/keypoints: a detector has to run"
        elif not total[IN_TIME] + total[LATE]:
            said = "waiting for points"
        self._diagnostics.report(PART, level, said, values)

    def rest(self) -> None:
        """Points are not among the modalities any more."""
        if self.received.total():
            self._diagnostics.report(PART, OK, "not in use")
