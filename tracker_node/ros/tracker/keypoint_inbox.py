"""The receiving end of a detector: points in messages are checked, and matched to the image sets that they are of.

They are matched by their stamps, each once. Points of the images of a set that are there when it is tracked are used with it.
Those that come later come with the next one, before which theirs and one of those since are fitted anew
(`tracking.keypoints.late`). Everything else is counted by its reason.
"""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice, pairwise
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from tracker_msgs.msg import Keypoints

from ...errors import CalibrationError, shown
from ...observation.image_set import CameraImage, ImageSet
from ...observation.keypoints.people import Person
from ...runs.messages.people import DetectedPeople, detected_people, with_known_names, with_people
from ...tracking.keypoints.late import MOST_LATE_S
from ..diagnostics import OK, WARN, Diagnostics, QosMismatches
from ..qos import RESULT, overridable

IN_TIME, LATE = "in time", "late"
OVERTAKEN, TOO_OLD, DUPLICATE, UNMATCHED = "overtaken", "too old", "duplicate", "unmatched"
REASONS = (IN_TIME, LATE, OVERTAKEN, TOO_OLD, DUPLICATE, UNMATCHED)
"""What becomes of the points of one image.

``in time``: used with the set of their image. ``late``: with a later one. ``overtaken``: later points of the camera were there.
``too old``: by more than `MOST_LATE_S`, or before a backward jump of stamps. ``duplicate``: the same image had some already.
``unmatched``: no image of the camera has such a stamp, or one within an image period of it.
"""
_MOST_LATE_NS = round(1e9 * MOST_LATE_S)
_WINDOW_NS = 2 * _MOST_LATE_NS  # of stamps of images that are remembered, and by which points may be ahead of all images
_MOST_AHEAD = 8  # points of a camera that may wait beside those of its images
_PATIENCE_S = 5.0  # a network takes a fraction of a second; less than what a source of images waits for the tracker
_LOOK_S = 0.1


@dataclass(eq=False)
class _Lane:
    """What is known of one camera."""

    images_ns: deque[int] = field(default_factory=deque)  # as they have come: those that wait, and a window before
    first_ns: int | None = None  # stamp of the first image that asked for points
    waiting: dict[int, DetectedPeople] = field(default_factory=dict)  # stamp -> points, in the order of their arrival
    had_ns: deque[int] = field(default_factory=lambda: deque(maxlen=64))
    counts: Counter[str] = field(default_factory=Counter)
    problem: str = ""
    silent: bool = False  # a wait was in vain, and no points have come since


class PointMatching:
    """Points that wait, and the images that they may be of. Both may be told of from any thread.

    Points wait as long as the images that they are of: a lossless tracker may be far behind its cameras.

    Parameters
    ----------
    image_period_s : between two images of a camera, which stamps of points may be off where an image was lost.

    Attributes
    ----------
    sets : image sets that asked for points.
    """

    def __init__(self, image_period_s: float):
        self._tolerance_ns = round(1e9 * image_period_s)
        self._lock = threading.Condition()
        self._lanes: dict[str, _Lane] = {}
        self.sets = 0

    def counts(self) -> dict[str, Counter[str]]:
        """Camera -> what became of its points, and how many wait."""
        with self._lock:
            return {camera: lane.counts + Counter(waiting=len(lane.waiting)) for camera, lane in self._lanes.items()}

    def problems(self) -> dict[str, str]:
        """Camera -> why its latest points match no image; of those that do nothing."""
        with self._lock:
            return {camera: lane.problem for camera, lane in self._lanes.items() if lane.problem}

    def _lane(self, camera: str) -> _Lane:
        return self._lanes.setdefault(camera, _Lane())

    def put(self, camera: str, detected: DetectedPeople) -> None:
        """Points have come.

        Parameters
        ----------
        camera, detected : of one image.
        """
        with self._lock:
            self._lock.notify_all()
            lane = self._lane(camera)
            lane.silent = False
            if detected.stamp_ns in lane.had_ns or detected.stamp_ns in lane.waiting:
                lane.counts[DUPLICATE] += 1
                return
            lane.had_ns.append(detected.stamp_ns)
            lane.waiting[detected.stamp_ns] = detected
            if len(lane.waiting) > len(lane.images_ns) + _MOST_AHEAD:
                stamp_ns = min(lane.waiting.keys() - set(lane.images_ns))
                self._drop(lane, stamp_ns, TOO_OLD if lane.images_ns and stamp_ns < lane.images_ns[0] else UNMATCHED)

    def wait(self, image_set: ImageSet, given_up: Callable[[], bool]) -> None:
        """Wait until the points of a set have come, or cannot come any more.

        A detector that sends points of a later image has left this one out. One that sends none of a camera is waited for once:
        which detectors there are is not asked, since a publisher may be discovered later than its first message is due.

        Parameters
        ----------
        image_set : the next one to be tracked.
        given_up : whether nobody wants the set any more.
        """
        until_s = time.monotonic() + _PATIENCE_S
        with self._lock:
            while not given_up():
                lanes = [(self._lane(image.camera), image.stamp_ns) for image in image_set.images]
                awaited = [lane for lane, ns in lanes if not lane.silent and max(lane.had_ns, default=-1) < ns]
                if not awaited:
                    return
                if time.monotonic() > until_s:
                    for lane in awaited:
                        lane.silent = True
                    return
                self._lock.wait(_LOOK_S)

    def came(self, camera: str, stamp_ns: int) -> None:
        """An image has come, and waits to be tracked.

        Parameters
        ----------
        camera, stamp_ns : of the image.
        """
        with self._lock:
            images_ns = self._lane(camera).images_ns
            if not images_ns or images_ns[-1] != stamp_ns:  # a camera whose stamps stand still fills no memory
                images_ns.append(stamp_ns)

    def passed(self, camera: str, stamp_ns: int) -> None:
        """No image of a camera waits any more that came before this one.

        Parameters
        ----------
        camera, stamp_ns : of the image, which is being tracked, or never will be.
        """
        with self._lock:
            images_ns = self._lane(camera).images_ns
            if stamp_ns in images_ns:
                while not stamp_ns - _WINDOW_NS <= images_ns[0] <= stamp_ns:  # later stamps are from before they went back
                    images_ns.popleft()

    def restart(self) -> None:
        """Stamps went back, or tracking begins anew: what was before is over."""
        with self._lock:
            for lane in self._lanes.values():
                since, n = _since_they_went_back(lane.images_ns), len(lane.waiting)
                lane.waiting = {stamp_ns: detected for stamp_ns, detected in lane.waiting.items() if stamp_ns in since}
                lane.counts[TOO_OLD] += n - len(lane.waiting)
                lane.had_ns.clear()
                lane.had_ns.extend(lane.waiting)
                lane.first_ns = None

    def attached(self, image_set: ImageSet) -> ImageSet:
        """A set that is tracked next, with the newest points that there are of each camera.

        Parameters
        ----------
        image_set : with images of which nobody is known.

        Returns
        -------
        With people in some of its images.
        """
        with self._lock:
            self.sets += 1
            return replace(image_set, images=tuple(map(self._attached, image_set.images)))

    def _attached(self, image: CameraImage) -> CameraImage:
        lane, chosen = self._lane(image.camera), None
        lane.first_ns = image.stamp_ns if lane.first_ns is None else lane.first_ns
        self.passed(image.camera, image.stamp_ns)
        furthest_ns = max([image.stamp_ns, *lane.images_ns]) + _WINDOW_NS
        since = _since_they_went_back(lane.images_ns)
        not_yet = set() if image.stamp_ns in since else since
        for stamp_ns in sorted(lane.waiting.keys() - not_yet, reverse=True):
            reason = self._reason(lane, stamp_ns, image.stamp_ns, furthest_ns)
            if reason == "":
                continue  # of an image that has not been tracked yet
            if reason in (IN_TIME, LATE):
                lane.problem = ""
                if chosen is None:
                    chosen, lane.counts[reason] = lane.waiting.pop(stamp_ns), lane.counts[reason] + 1
                    continue
                reason = OVERTAKEN
            self._drop(lane, stamp_ns, reason)
        return image if chosen is None else with_people(image, chosen)

    def _reason(self, lane: _Lane, stamp_ns: int, image_ns: int, furthest_ns: int) -> str:
        if stamp_ns == image_ns:
            return IN_TIME
        if stamp_ns > image_ns:
            return "" if stamp_ns <= furthest_ns else UNMATCHED
        near = any(abs(stamp_ns - other_ns) <= self._tolerance_ns for other_ns in lane.images_ns)
        if image_ns - stamp_ns > _MOST_LATE_NS:
            forgotten = lane.first_ns is not None and lane.first_ns <= stamp_ns < lane.images_ns[0]
            return TOO_OLD if near or forgotten else UNMATCHED
        return LATE if near else UNMATCHED

    def _drop(self, lane: _Lane, stamp_ns: int, reason: str) -> None:
        del lane.waiting[stamp_ns]
        lane.counts[reason] += 1
        if reason == UNMATCHED:
            newest = f", {1e-9 * (stamp_ns - lane.images_ns[-1]):+.3f} s from its newest image" if lane.images_ns else ""
            lane.problem = f"points at {stamp_ns} ns match no image{newest}"


def _since_they_went_back(stamps_ns: Sequence[int]) -> set[int]:
    """Those behind the last step back; none where there is none."""
    first = max((i for i, (before, after) in enumerate(pairwise(stamps_ns), 1) if after < before), default=len(stamps_ns))
    return set(islice(stamps_ns, first, None))


MOST_BYTES = 64 * 2**20  # of one message; sixteen people in an image of 12 megapixels have less
_SILENT_S = 10.0  # without any points, which a detector at 1 Hz never is
_UNUSED = {  # why none of the points that come are used
    OVERTAKEN: "later ones were there first",
    TOO_OLD: f"they come more than {MOST_LATE_S:g} s after their images",
    DUPLICATE: "their stamps do not change, or are of images that had some",
    UNMATCHED: "no image has their stamps",
}
_RECEIVED, _SETS, _NONE_FOUND = "received", "sets", "none found"
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
    received, refused, none_found : camera -> messages; those with people of whom no point can be used.
    """

    def __init__(
        self, node: Node, matching: PointMatching, mismatches: QosMismatches, diagnostics: Diagnostics, names: Collection[str]
    ):
        self._names = frozenset(names)
        self._node, self.matching, self._mismatches, self._diagnostics = node, matching, mismatches, diagnostics
        self._subscriptions: dict[str, Subscription] = {}
        self._problems: dict[str, str] = {}  # camera -> why its latest message was refused
        self._noted: set[str] = set()
        self._recent: deque[tuple[float, Counter[str]]] = deque()  # when, and all counts then, over `_SILENT_S`
        self._received_before, self._before_s = 0, time.monotonic()
        self._last_s = time.monotonic()
        self.received: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        self.none_found: Counter[str] = Counter()

    def subscribe(self, cameras: Collection[str]) -> None:
        """Listen to detectors of these cameras and of no others."""
        if cameras and not self._subscriptions:
            self._last_s = time.monotonic()
            self._recent.clear()
        for camera in [name for name in self._subscriptions if name not in cameras]:
            self._node.destroy_subscription(self._subscriptions.pop(camera))
        for camera in cameras:
            if camera not in self._subscriptions:
                self._subscriptions[camera] = self._subscribed(camera)

    def _subscribed(self, camera: str) -> Subscription:
        topic = f"{camera}/keypoints"
        self._mismatches.of_subscription(f"points of {camera}", topic)
        return self._node.create_subscription(Keypoints, topic, partial(self._take, camera), **overridable(RESULT), raw=True)

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
        self.none_found[camera] += bool(detected.people) and not any(np.any(person.scores > 0.0) for person in detected.people)
        if _are_useless(message, detected.people):
            problem = "keypoints: no point can be used: expected finite pixels, covariances that are some, and scores from 0 to 1"
            self._problems[camera] = f"camera '{camera}': {problem}"
            self._tell_once(camera, self._problems[camera], problem)
        for note in detected.notes:
            self._tell_once(camera, f"camera '{camera}': keypoints: {note}", note)
        self.matching.put(camera, detected)

    def _tell_once(self, camera: str, text: str, what: str) -> None:
        kind = f"{camera} {''.join(c for c in what if not c.isdigit())[:80]}"
        if kind not in self._noted and len(self._noted) < 100:
            self._noted.add(kind)
            self._node.get_logger().warning(text)

    def report(self, cameras: Collection[str]) -> None:
        """Once a second, while the tracker is active."""
        if not self._subscriptions:
            if any(self._node.count_publishers(f"{camera}/keypoints") for camera in cameras):
                self._diagnostics.report(PART, OK, "published, and not in use: modalities has no keypoints")
            return
        now, total = time.monotonic(), Counter[str]()
        for counts in self.matching.counts().values():
            total.update(counts)
        rate = (self.received.total() - self._received_before) / max(now - self._before_s, 1e-3)
        self._received_before, self._before_s = self.received.total(), now
        values: dict[str, object] = {"messages per second": rate, "received": self.received.total()}
        values |= {reason: total[reason] for reason in (*REASONS, "waiting")} | {"refused": self.refused.total()}
        total.update({_RECEIVED: self.received.total(), _SETS: self.matching.sets, _NONE_FOUND: self.none_found.total()})
        new = total - self._recent[-1][1] if self._recent else total
        level, said = OK, "used"
        problems, unused = self.matching.problems(), self._unused(now, total)
        if self._problems:
            level, said = WARN, next(iter(self._problems.values()))
        elif problems and new[UNMATCHED]:
            camera, problem = next(iter(problems.items()))
            level, said = WARN, f"camera '{camera}': {problem}"
        elif now - self._last_s > _SILENT_S:
            level, said = WARN, f"no points come on {next(iter(self._subscriptions))}/keypoints: a detector has to run"
        elif unused:
            level, said = WARN, unused
        elif not total[IN_TIME] + total[LATE]:
            said = "waiting for points"
        self._diagnostics.report(PART, level, said, values)

    def _unused(self, now_s: float, total: Counter[str]) -> str:
        """Why messages have been of no use for `_SILENT_S`; empty where they were, or nothing asked for points."""
        self._recent.append((now_s, total))
        while len(self._recent) > 1 and self._recent[1][0] <= now_s - _SILENT_S:
            self._recent.popleft()
        then_s, before = self._recent[0]
        new = total - before
        if now_s - then_s < _SILENT_S or not (new[_RECEIVED] and new[_SETS]):
            return ""
        if new[_NONE_FOUND] == new[_RECEIVED]:
            return f"people come without a point that was found for {_SILENT_S:.0f} s: scores of 0, or covariances that are none"
        reason = max(_UNUSED, key=lambda reason: new[reason])
        used = new[IN_TIME] + new[LATE] or not new[reason]
        return "" if used else f"points come, but none was used for {_SILENT_S:.0f} s: {_UNUSED[reason]} ({reason} {new[reason]})"

    def rest(self) -> None:
        """Points are not among the modalities any more."""
        if self.received.total():
            self._diagnostics.report(PART, OK, "not in use")


def _are_useless(message: Any, people: Sequence[Person]) -> bool:
    """Whether points were found, and none of them is one that can be used: see `observation.keypoints.people.checked`."""
    found = any(np.any(np.isfinite(person.u) & (np.array(person.scores) > 0.0)) for person in message.persons)
    return found and not any(np.any(person.scores > 0.0) for person in people)
