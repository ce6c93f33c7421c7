"""Images of several cameras become image sets: by stamp, without a wall clock.

The result is a function of the images in the order in which they were put in, so a recording gives the same sets as the
live cameras did. Time passes only as the cameras' own stamps advance: ``stream time`` is the progress of the camera that
has progressed most, each image counting for as much as the one before it, or an image period, at most (a pause of all cameras
is not a timeout).

Stamps may go back, as those of a recording that begins again. Images of a camera whose stamps do are kept until most of the
cameras that send have gone back with it: then all begins anew with them. Of two cameras nobody knows which one is right: the
first one is believed. A camera that goes back alone is wrong: its images are dropped, and the others go on.

Counts of time steps without an image set, by reason.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from ..errors import UnknownNameError
from .image_set import CameraImage, ImageSet

REASONS = ("late", "duplicate", "incomplete", "too_old", "ahead", "clock_jump", "reset")
"""Why an image is not in any set.

``late``: a set of its time step or a later one is out already. ``duplicate``: its camera gave another image of that time step.
``incomplete``: too few cameras gave one. ``too_old``: its partners did not come within the queue's time, or too many wait.
``ahead``: more cameras than have an image of its time step went on to send images from far before it (a wrong clock).
``clock_jump``: stamps went backward, its own or those of most cameras. ``reset``: by request.
"""

SET_REASONS = tuple(reason for reason in REASONS if reason != "duplicate")
"""Why there is no set of a time step of which some camera has sent an image. ``late``: all its images came too late."""

_MOST_WAITING, _QUEUES_WAITING = 100, 10.0  # images of a camera that may wait: at least so many, or so many queues' time
_LEAST_IMAGES = 3  # that a camera may miss before it is silent, however slow it is
_FORGETS = 0.995  # of what is known of a camera's disorder, with each image in order


@dataclass
class _Waiting:
    image: CameraImage
    number: int  # how many images had been put in before it
    since_ns: int  # stream time of its arrival


@dataclass
class _Lane:
    """What is known of one camera; ``newest_ns`` and what follows belong to the time since the last reset."""

    waiting: list[_Waiting] = field(default_factory=list)  # in order of stamps
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(("received", "used", *REASONS), 0))
    newest_ns: int | None = None
    newest_number: int = 0
    last_used_ns: int | None = None
    progress_ns: int = 0
    step_ns: int = 0  # by which its stamps advanced last
    back: list[_Waiting] = field(default_factory=list)  # since its stamps went back, while it is not known who is right
    back_ns: int | None = None  # the latest stamp since then; None: its stamps have not gone back
    active_ns: int = 0  # stream time when its stamps last advanced
    old_clock_ns: int = 0  # for how much longer images of before a clock jump are expected
    disorder_ns: float = 0.0  # by how much its images have lately been overtaken by later ones

    def forget(self) -> None:
        self.waiting.clear()
        self.back.clear()
        self.newest_ns, self.newest_number, self.last_used_ns = None, 0, None
        self.progress_ns = self.step_ns = self.active_ns = self.old_clock_ns = 0
        self.disorder_ns, self.back_ns = 0.0, None

    def drop_back(self, n: int | None = None) -> None:
        """The first ``n`` images of after it went back, or all: the others did not."""
        self.counts["clock_jump"] += len(self.back[:n])
        del self.back[:n]


class ImageSynchronizer:
    """Matches images by stamp.

    A set is the earliest waiting image and, of every other camera, the image within the tolerance after it. Sets are in
    strict order of time and never overlap. A complete set comes out at once. An incomplete one is decided as soon as no
    missing camera is worth waiting for: because it has sent something later (later by as much as its images have lately
    overtaken each other), has been silent for ``queue_s``, lags by more than ``queue_s``, or the set itself is ``queue_s``
    old. It then comes out if it has ``min_cameras`` images. Of each camera no more than 100 images wait, or what comes in ten
    times ``queue_s``: where stream time hardly passes, the oldest goes as ``too_old``.

    Parameters
    ----------
    cameras : names; images of a set come in this order.
    image_period_s : nominal time between two images of a camera.
    tolerance : largest spread of the stamps in a set, as a fraction of the image period; 0 asks for equal stamps.
    queue_s : how long an image waits for its partners, in stream time.
    min_cameras : smallest number of cameras in a set; 0 means all.

    Raises
    ------
    ValueError : an argument out of range, or camera names that repeat.
    """

    def __init__(self, cameras: Sequence[str], *, image_period_s: float, tolerance: float, queue_s: float, min_cameras: int = 0):
        self.cameras = tuple(cameras)
        if not self.cameras or len(set(self.cameras)) != len(self.cameras):
            raise ValueError(f"expected one or more unique camera names, got {self.cameras}")
        if not (image_period_s > 0 and 0 <= tolerance < 1 and queue_s >= 0):
            got = (image_period_s, tolerance, queue_s)
            raise ValueError(f"expected image_period_s > 0, tolerance in [0, 1), queue_s >= 0, got {got}")
        if not 0 <= min_cameras <= len(self.cameras):
            raise ValueError(f"expected min_cameras in [0, {len(self.cameras)}], got {min_cameras}")
        self.min_cameras = min_cameras or len(self.cameras)
        self._period_ns = round(image_period_s * 1e9)
        self._tolerance_ns = round(tolerance * image_period_s * 1e9)
        self._queue_ns = round(queue_s * 1e9)
        self._back_ns = max(self._queue_ns, self._period_ns)  # further back is no disorder
        self._most_waiting = max(_MOST_WAITING, round(_QUEUES_WAITING * self._queue_ns / self._period_ns))
        self._lanes = {camera: _Lane() for camera in self.cameras}
        self._stream_ns = 0
        self._number = 0
        self._last_set_end_ns: int | None = None
        self.sets_complete = self.sets_incomplete = self.clock_jumps = 0
        self._accounts = SetAccounts(self._tolerance_ns, SET_REASONS)

    @property
    def counters(self) -> dict[str, dict[str, int]]:
        """Per camera: ``received`` = ``used`` + the `REASONS` + ``waiting``."""
        return {camera: {**lane.counts, "waiting": len(lane.waiting) + len(lane.back)} for camera, lane in self._lanes.items()}

    @property
    def sets_not_formed(self) -> dict[str, int]:
        """Time steps without a set, of which some camera has sent an image, by the `SET_REASONS`; what waits is not in it."""
        return self._accounts.counts

    def add(self, image: CameraImage) -> list[ImageSet]:
        """Put in one image; returns the sets that are thereby decided, in order of time.

        Raises
        ------
        UnknownNameError : the image's camera is not one of ``cameras``.
        """
        if image.camera not in self._lanes:
            raise UnknownNameError("camera", image.camera, self.cameras)
        lane = self._lanes[image.camera]
        lane.counts["received"] += 1
        self._number += 1
        if self._is_back(lane, image.stamp_ns) and self._joins(lane, image.stamp_ns):
            while lane.waiting:  # of its wrong clock
                self._accounts.failed(lane.waiting[0].image.stamp_ns, "ahead")
                self._drop_first(lane, "ahead")
            lane.newest_ns = None
        if self._is_back(lane, image.stamp_ns):
            self._keep_back(lane, image)
            sets = self._jump_back(lane) if self._is_believed(lane) else self._decide(final=False)
        else:
            lane.drop_back()
            lane.back_ns = None
            sets = self._put(lane, image, self._number)
        for other in self._lanes.values():
            other.drop_back(sum(self._stream_ns - w.since_ns > self._back_ns for w in other.back))
        return sets

    def _put(self, lane: _Lane, image: CameraImage, number: int) -> list[ImageSet]:
        refusal = self._refusal(lane, image.stamp_ns)
        if refusal != "clock_jump":
            self._advance(lane, image.stamp_ns, number)  # also a late image says that its camera lags
        if refusal:
            lane.counts[refusal] += 1
            if refusal == "late":
                self._accounts.late(image.stamp_ns)
        else:
            stamps = [w.image.stamp_ns for w in lane.waiting]
            lane.waiting.insert(bisect_right(stamps, image.stamp_ns), _Waiting(image, number, self._stream_ns))
        sets = self._decide(final=False)
        if len(lane.waiting) > self._most_waiting:  # a clock that hardly advances while the others are silent
            self._accounts.failed(lane.waiting[0].image.stamp_ns, "too_old")
            self._drop_first(lane, "too_old")
        return sets

    def flush(self) -> list[ImageSet]:
        """Decide all that waits, as at the end of a recording."""
        for lane in self._lanes.values():
            lane.drop_back()
        return self._decide(final=True)

    def reset(self) -> None:
        """Forget all that waits, and what time it is; the counters stay."""
        self._drop_all("reset")

    def _drop_all(self, reason: str) -> None:
        for stamp_ns in sorted(w.image.stamp_ns for lane in self._lanes.values() for w in lane.waiting):
            self._accounts.failed(stamp_ns, reason)
        self._accounts.forget()
        for lane in self._lanes.values():
            lane.counts[reason] += len(lane.waiting) + len(lane.back)
            lane.forget()
        self._stream_ns, self._last_set_end_ns = 0, None

    def _is_back(self, lane: _Lane, stamp_ns: int) -> bool:
        return lane.newest_ns is not None and stamp_ns < lane.newest_ns - self._back_ns

    def _going_on(self) -> list[_Lane]:
        """Cameras that send, and whose stamps have not gone back."""
        lanes = (lane for lane in self._lanes.values() if lane.newest_ns is not None and lane.back_ns is None)
        return [lane for lane in lanes if self._stream_ns - lane.active_ns <= self._back_ns]

    def _joins(self, lane: _Lane, stamp_ns: int) -> bool:
        """Whether a camera whose clock was ahead of most others' comes back to theirs."""
        assert lane.newest_ns is not None
        others = [other.newest_ns for other in self._going_on() if other is not lane and other.newest_ns is not None]
        left = [ns for ns in others if ns < lane.newest_ns - self._back_ns and abs(ns - stamp_ns) <= self._back_ns]
        return 2 * len(left) > len(others)

    def _keep_back(self, lane: _Lane, image: CameraImage) -> None:
        if lane.back_ns is None or image.stamp_ns < lane.back_ns - self._back_ns:
            lane.drop_back()
            lane.back_ns = image.stamp_ns
        self._pass(lane, max(0, image.stamp_ns - lane.back_ns))
        lane.back_ns = max(lane.back_ns, image.stamp_ns)
        lane.back.append(_Waiting(image, self._number, self._stream_ns))
        lane.drop_back(max(0, len(lane.back) - self._most_waiting))

    def _back_with(self, lane: _Lane) -> list[_Lane]:
        """Cameras whose stamps have gone back to where this one's have."""
        assert lane.back_ns is not None
        return [x for x in self._lanes.values() if x.back_ns is not None and abs(x.back_ns - lane.back_ns) <= self._back_ns]

    def _is_believed(self, lane: _Lane) -> bool:
        """Whether more cameras have gone back with this one than go on; a single one that goes on may as well be wrong."""
        return len(self._going_on()) < max(len(self._back_with(lane)), 2)

    def _jump_back(self, lane: _Lane) -> list[ImageSet]:
        """Stamps went back: a loop of a recording, usually. Some cameras may still send from before the jump."""
        had_sent = [other for other in self._lanes.values() if other.newest_ns is not None]
        with_it = self._back_with(lane)
        back = sorted((w for other in with_it for w in other.back), key=lambda w: w.number)
        for other in with_it:
            other.back = []
        self._drop_all("clock_jump")
        self.clock_jumps += 1
        for other in had_sent:
            other.old_clock_ns = self._back_ns
        return [found for w in back for found in self._put(self._lanes[w.image.camera], w.image, w.number)]

    def _refusal(self, lane: _Lane, stamp_ns: int) -> str | None:
        if lane.old_clock_ns > 0:
            newest = max((x.newest_ns for x in self._lanes.values() if x.newest_ns is not None), default=stamp_ns)
            if stamp_ns > newest + self._queue_ns:
                lane.old_clock_ns -= self._period_ns
                return "clock_jump"
            lane.old_clock_ns = 0
        if stamp_ns == lane.last_used_ns or any(w.image.stamp_ns == stamp_ns for w in lane.waiting):
            return "duplicate"
        if self._last_set_end_ns is not None and stamp_ns <= self._last_set_end_ns:
            return "late"
        return None

    def _advance(self, lane: _Lane, stamp_ns: int, number: int) -> None:
        if lane.newest_ns is None:
            lane.progress_ns, step_ns = self._stream_ns, 0
        elif stamp_ns <= lane.newest_ns:
            lane.disorder_ns = min(max(lane.disorder_ns, lane.newest_ns - stamp_ns), self._queue_ns)
            return
        else:
            step_ns = stamp_ns - lane.newest_ns
        lane.disorder_ns *= _FORGETS
        lane.newest_ns, lane.newest_number = stamp_ns, number
        self._pass(lane, step_ns)

    def _pass(self, lane: _Lane, step_ns: int) -> None:
        """Stream time passes with a camera's stamps, at the rate that they have: a longer step is a pause."""
        usual_ns = min(lane.step_ns, self._queue_ns // _LEAST_IMAGES)
        lane.progress_ns += min(step_ns, max(usual_ns, self._period_ns))
        lane.step_ns = step_ns
        self._stream_ns = max(self._stream_ns, lane.progress_ns)
        lane.active_ns = self._stream_ns

    def _decide(self, final: bool) -> list[ImageSet]:
        sets: list[ImageSet] = []
        while True:
            heads = [lane.waiting[0] for lane in self._lanes.values() if lane.waiting]
            if not heads:
                return sets
            anchor = min(heads, key=lambda w: w.image.stamp_ns)
            group = self._group(anchor.image.stamp_ns)
            missing = [lane for camera, lane in self._lanes.items() if camera not in group]
            needed = len(group) < self.min_cameras
            if missing and not final and any(self._worth_waiting(lane, anchor, needed) for lane in missing):
                return sets
            waited = self._stream_ns - anchor.since_ns > self._queue_ns
            if needed or self._better_later(group):
                reason = "too_old" if waited else "incomplete"
            elif not self._ahead(group, missing, anchor):
                sets.append(self._take(group))
                continue
            elif waited or final:
                reason = "ahead"
            else:
                return sets  # the others' images, which come before it, are decided as they come
            self._accounts.failed(anchor.image.stamp_ns, reason)
            self._drop_first(self._lanes[anchor.image.camera], reason)

    def _group(self, start_ns: int) -> dict[str, _Waiting]:
        """Of every camera the first waiting image in [start, start + tolerance]."""
        group = {}
        for camera, lane in self._lanes.items():
            first = next((w for w in lane.waiting if w.image.stamp_ns >= start_ns), None)
            if first is not None and first.image.stamp_ns <= start_ns + self._tolerance_ns:
                group[camera] = first
        return group

    def _worth_waiting(self, lane: _Lane, anchor: _Waiting, needed: bool) -> bool:
        """Whether ``lane``, which has no image with ``anchor``, may still send one (silent ones only where ``needed``)."""
        start_ns = anchor.image.stamp_ns
        if lane.back_ns is not None:
            return False
        silent_ns = 0 if needed else self._stream_ns - lane.active_ns
        if max(silent_ns, self._stream_ns - anchor.since_ns) > self._queue_ns:
            return False
        if lane.newest_ns is None:
            return True
        lags = lane.newest_number > anchor.number and lane.newest_ns < start_ns - self._queue_ns
        return lane.newest_ns <= start_ns + self._tolerance_ns + lane.disorder_ns and not lags

    def _better_later(self, group: dict[str, _Waiting]) -> bool:
        """Whether a start a little later gives a set of more images."""
        return any(len(self._group(w.image.stamp_ns)) > len(group) for w in group.values())

    def _ahead(self, group: dict[str, _Waiting], missing: list[_Lane], anchor: _Waiting) -> bool:
        """Whether more cameras than are in the group have since sent images from far before it.

        Once it were out, theirs would all be late; so it waits, until they have come as far or its time is up. Cameras that
        have sent nothing since it came may have paused with the others.
        """
        before_ns = anchor.image.stamp_ns - self._back_ns
        behind = [
            lane for lane in missing
            if lane.newest_ns is not None and lane.newest_number > anchor.number and lane.newest_ns < before_ns
            and self._stream_ns - lane.active_ns <= self._queue_ns
        ]  # fmt: skip
        return len(behind) > len(group)

    def _take(self, group: dict[str, _Waiting]) -> ImageSet:
        images = tuple(group[camera].image for camera in self.cameras if camera in group)
        start_ns, end_ns = min(image.stamp_ns for image in images), max(image.stamp_ns for image in images)
        self._accounts.formed(start_ns)
        for image in images:
            lane = self._lanes[image.camera]
            lane.waiting = [w for w in lane.waiting if w.image is not image]
            lane.counts["used"] += 1
            lane.last_used_ns = image.stamp_ns
            while lane.waiting and lane.waiting[0].image.stamp_ns <= end_ns:
                self._drop_first(lane, "duplicate")
        self._last_set_end_ns = end_ns
        if len(images) == len(self.cameras):
            self.sets_complete += 1
        else:
            self.sets_incomplete += 1
        return ImageSet(start_ns, images)

    @staticmethod
    def _drop_first(lane: _Lane, reason: str) -> None:
        lane.counts[reason] += 1
        del lane.waiting[0]


_REMEMBERED = 256  # time steps that images may be late for


class SetAccounts:
    """Counts time steps of which some camera has sent an image and that got no set, each once.

    Parameters
    ----------
    tolerance_ns : images at most so far after the first belong to one time step.
    reasons : for which a time step may go without a set.
    """

    def __init__(self, tolerance_ns: int, reasons: Sequence[str]):
        self._tolerance_ns = tolerance_ns
        self._counts = dict.fromkeys(reasons, 0)
        self._failed: tuple[int, str] | None = None  # first stamp of the latest time step without a set so far, and why
        self._decided: deque[int] = deque(maxlen=_REMEMBERED)  # first stamps of time steps that have a set or are counted

    @property
    def counts(self) -> dict[str, int]:
        """Time steps without a set by reason."""
        counts = dict(self._counts)
        if self._failed is not None:
            counts[self._failed[1]] += 1
        return counts

    def formed(self, start_ns: int) -> None:
        """A set whose earliest image has this stamp."""
        if self._failed is not None and abs(start_ns - self._failed[0]) <= self._tolerance_ns:
            self._failed = None  # its time step has a set after all, of other images
        self._settle()
        self._decided.append(start_ns)

    def failed(self, stamp_ns: int, reason: str) -> None:
        """An image goes without a set: of a new time step, or of that of the image before.

        Parameters
        ----------
        stamp_ns : of the image.
        reason : one of those given at first.
        """
        if self._failed is None or abs(stamp_ns - self._failed[0]) > self._tolerance_ns:
            self._settle()
            self._failed = stamp_ns, reason

    def late(self, stamp_ns: int) -> None:
        """An image came when a later set was out: there may never have been one of its time step."""
        known = [*self._decided, *([self._failed[0]] if self._failed else [])]
        if all(abs(stamp_ns - other_ns) > self._tolerance_ns for other_ns in known):
            self._decided.append(stamp_ns)
            self._counts["late"] += 1

    def forget(self) -> None:
        """Time begins anew; the counts stay."""
        self._settle()
        self._decided.clear()

    def _settle(self) -> None:
        if self._failed is not None:
            self._decided.append(self._failed[0])
            self._counts[self._failed[1]] += 1
            self._failed = None
