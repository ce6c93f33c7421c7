"""What the doctor keeps of a camera's first seconds: small gray copies, and what only the full images tell.

Images come from the rig's own sources, other files, or a bag. They are processed one after the other, as they are decoded; none
is kept at full size.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import dropwhile, islice
from pathlib import Path

import cv2
import numpy as np

from ..camera.rig import Camera, CameraRig
from ..errors import SourceError, TrackerError
from ..loaders.bag.metadata import STORAGE_SUFFIXES
from ..loaders.images.source import ImageSource, open_camera_source_of_any_size
from ..observation.deinterlace import comb_ratio
from ..observation.keypoints.people import People
from ..runs.people.detection import Detector

SMALL_PX = 320  # longer side of the small copies
_VIEW_PX = 960  # longer side of the images in which the background is matched
_VIEW_EVERY_S = 0.25
_COMB_PAIRS = 24  # successive images that are examined for a comb
_LEAST_MATCHES = 25
_INLIER_PX = 3.0  # of the images in which the background is matched
_LEAST_SHARE = 0.35  # of the matches that must agree on how the view has moved
_LEAST_SPREAD = 0.25  # of the image's area, that these span: before a plain wall most features are on who moves
_LOOKS = 24  # images of a camera in which people are looked for


@dataclass(frozen=True)
class ViewShift:
    """How far the background lies from where it was in the first image: ``px`` of the camera's own pixels."""

    index: int
    px: float


@dataclass(frozen=True, eq=False)
class Look:
    """Whom a detector has found in the image of a stamp."""

    stamp_ns: int
    people: People


@dataclass(eq=False)
class CameraRecording:
    """The images of one camera, in order of time; `add` takes them in.

    Attributes
    ----------
    size : (width, height) of the images, (0, 0) before the first.
    stamps_ns, small : stamp and small gray copy, (h, w) uint8, of each image.
    changes : mean absolute difference of each image to the one before, gray levels; not-a-number for the first.
    combs : `comb_ratio` of some pairs of successive images in which enough moves.
    view_shifts : how the background has moved, now and then.
    shown : the image in the middle of those seen so far, BGR, for the report (its index is ``shown_index``).
    problems, notes : what went wrong while reading, and what is unusual about the source, one sentence each.
    detector : looks for people in some of the images; None: nobody does.
    looks : what it has found.
    """

    name: str
    n_expected: int
    rate_hz: float
    size: tuple[int, int] = (0, 0)
    stamps_ns: list[int] = field(default_factory=list)
    small: list[np.ndarray] = field(default_factory=list)
    changes: list[float] = field(default_factory=list)
    combs: list[float] = field(default_factory=list)
    view_shifts: list[ViewShift] = field(default_factory=list)
    shown: np.ndarray | None = None
    shown_index: int = 0
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    detector: Detector | None = None
    looks: list[Look] = field(default_factory=list)

    def __post_init__(self):
        self._before: np.ndarray | None = None
        self._view: _View | None = None

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def add(self, stamp_ns: int, bgr: np.ndarray) -> None:
        """Take in the next image.

        Parameters
        ----------
        stamp_ns : of the image.
        bgr : (h, w, 3) uint8.
        """
        index = len(self)
        height, width = bgr.shape[:2]
        self.size = (width, height)
        self.stamps_ns.append(stamp_ns)
        gray = cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY)
        self.small.append(_shrunk(gray, SMALL_PX))
        self.changes.append(float("nan") if self._before is None else float(cv2.absdiff(bgr, self._before).mean()))
        if self._before is not None and index % max(1, self.n_expected // _COMB_PAIRS) == 0:
            ratio = comb_ratio([self._before, bgr])
            if ratio is not None:
                self.combs.append(ratio)
        self._look_at_background(index, gray)
        if self.shown is None or index == self.n_expected // 2:
            self.shown, self.shown_index = bgr, index
        self._before = bgr
        if self.detector is not None and stamp_ns >= self._next_look_ns:
            self.looks.append(Look(stamp_ns, self.detector.detect(np.ascontiguousarray(bgr))))

    @property
    def _next_look_ns(self) -> float:
        """Half an image before the next of `_LOOKS` times: the nearest image is looked at."""
        return self.stamps_ns[0] + 1e9 / self.rate_hz * (len(self.looks) * self.n_expected / _LOOKS - 0.5)

    def _look_at_background(self, index: int, gray: np.ndarray) -> None:
        if index % max(1, round(_VIEW_EVERY_S * self.rate_hz)) and index != self.n_expected - 1:
            return
        if self._view is None:
            self._view = _View(gray)
            return
        shift = self._view.shift_px(gray)
        if shift is not None:
            self.view_shifts.append(ViewShift(index, shift))

    def brightness(self) -> np.ndarray:
        """(T,) of each image against the first one: median ratio of places that are neither dark nor burnt out."""
        first = self.small[0].astype(np.float32)
        usable = (first > 20) & (first < 220)
        if not usable.any():
            return np.ones(len(self))
        return np.array([float(np.median((image[usable] + 1.0) / (first[usable] + 1.0))) for image in self.small])

    def moved_from(self, least_px: float) -> list[ViewShift]:
        """Shifts from the first one on after which the background never comes back; none of the last moment alone."""
        moved: list[ViewShift] = []
        for shift in reversed(self.view_shifts):
            if shift.px < least_px:
                break
            moved.insert(0, shift)
        lasting = bool(moved) and moved[-1].index - moved[0].index >= 0.5 * _VIEW_EVERY_S * self.rate_hz
        return moved if lasting else []

    def repeated(self, others: Sequence[CameraRecording]) -> np.ndarray:
        """(T,) bool: images that are the one before once more, though something moves.

        Identical images always count; nearly identical ones (a codec's copies) where they change much less than this
        camera's images do otherwise, and where another camera sees motion at that time.
        """
        changes = np.array(self.changes)
        known = changes[np.isfinite(changes)]
        if not len(known) or not np.any(known > 0.0):
            return np.zeros(len(changes), dtype=bool)
        usual = float(np.median(known[known > 0.0]))
        same = changes == 0.0
        nearly = changes < 0.15 * usual
        for i in np.flatnonzero(nearly & ~same):
            nearly[i] = any(other.moves_at(self.stamps_ns[i]) for other in others if other is not self)
        return same | nearly

    def moves_at(self, stamp_ns: int) -> bool:
        """Whether the image nearest to a stamp changes at least half as much as this camera's images usually do."""
        changes = np.array(self.changes)
        i = int(np.argmin(np.abs(np.array(self.stamps_ns) - stamp_ns)))
        return bool(changes[i] > 0.5 * np.nanmedian(changes))


class _View:
    """Features of the first image, found again in later ones."""

    def __init__(self, gray: np.ndarray):
        self._scale = max(gray.shape) / _VIEW_PX if max(gray.shape) > _VIEW_PX else 1.0
        self._orb = cv2.ORB.create(1200, fastThreshold=8)
        self._matcher = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True)
        self._shape = gray.shape
        self._points, self._descriptors = self._features(gray)

    def shift_px(self, gray: np.ndarray) -> float | None:
        """By how much most of the features have moved, the corner of the image that has moved most; None if unknown."""
        points, descriptors = self._features(gray)
        if self._descriptors is None or descriptors is None:
            return None
        matches = [m for m in self._matcher.match(self._descriptors, descriptors) if m.distance < 48]
        if len(matches) < _LEAST_MATCHES:
            return None
        before = np.array([self._points[m.queryIdx] for m in matches])
        now = np.array([points[m.trainIdx] for m in matches])
        moved, inliers = cv2.estimateAffinePartial2D(before, now, ransacReprojThreshold=_INLIER_PX)
        agree = np.ravel(inliers) > 0
        if moved is None or agree.mean() < _LEAST_SHARE:
            return None
        spread = cv2.contourArea(cv2.convexHull(before[agree])) * self._scale**2
        if spread < _LEAST_SPREAD * self._shape[0] * self._shape[1]:
            return None
        return float(np.median(np.linalg.norm((now - before)[agree], axis=1)) * self._scale)

    def _features(self, gray: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        keypoints, descriptors = self._orb.detectAndCompute(_shrunk(gray, _VIEW_PX), None)
        return np.array([k.pt for k in keypoints], dtype=np.float32), descriptors


def _shrunk(gray: np.ndarray, longer_side: int) -> np.ndarray:
    factor = longer_side / max(gray.shape)
    if factor >= 1.0:
        return gray
    size = (max(1, round(gray.shape[1] * factor)), max(1, round(gray.shape[0] * factor)))
    return cv2.resize(gray, size, interpolation=cv2.INTER_AREA)


DEFAULT_SECONDS = 4.0


def with_inputs(rig: CameraRig, inputs: Sequence[str]) -> CameraRig:
    """The rig with other sources.

    Parameters
    ----------
    rig : the cameras.
    inputs : none, for the rig's own; one bag; one video, folder or other source per camera in the order of the rig; or
        ``camera=source`` for some of them.

    Returns
    -------
    The rig with these sources.

    Raises
    ------
    SourceError : neither one for each camera nor a bag.
    UnknownNameError : a camera that is not in the rig.
    """
    if not inputs:
        return rig
    if all("=" in text for text in inputs):
        named = dict(text.split("=", 1) for text in inputs)
    elif len(inputs) == 1 and _is_bag(inputs[0]):
        named = {name: f"bag:{inputs[0].removeprefix('bag:')}" for name in rig.names}
    elif len(inputs) == len(rig):
        named = dict(zip(rig.names, inputs, strict=True))
    else:
        names = ", ".join(rig.names)
        problem = f"expected a bag, one source for each of {names}, or camera=source; got {len(inputs)} sources"
        raise SourceError(" ".join(inputs), problem)
    return rig.with_sources(named)


def record(
    rig: CameraRig, seconds: float = DEFAULT_SECONDS, progress: Callable[[str], None] = lambda camera: None,
    detector: Detector | None = None,
) -> dict[str, CameraRecording]:
    """Read the first images of every camera, from the moment on at which the last of them begins.

    A camera that ends before that moment is read from its own beginning. What cannot be read is told in the recording's
    ``problems``.

    Parameters
    ----------
    rig : cameras with sources.
    seconds : how much is read.
    progress : called with the name of each camera before it is read.
    detector : looks for people in some of the images; None: nobody does.

    Returns
    -------
    Camera -> its images. What cannot be read is in the recording's ``problems``.
    """
    opened = {camera.name: _opened(camera) for camera in rig}
    first_ns = max((o.stamp_ns(o.options.start) for o in opened.values() if isinstance(o, ImageSource)), default=0)
    recordings = {}
    for name, source in opened.items():
        progress(name)
        if isinstance(source, ImageSource):
            recordings[name] = _recorded(name, source, seconds, first_ns, detector)
        else:
            recordings[name] = CameraRecording(name, 0, 1.0, problems=[str(source)])
    return recordings


def _opened(camera: Camera) -> ImageSource | TrackerError:
    """The source, or why it cannot be opened."""
    try:
        source = open_camera_source_of_any_size(camera)
        source.stamp_ns(source.options.start)  # which has to be read from a bag
        return source
    except TrackerError as error:
        return error


def _recorded(name: str, source: ImageSource, seconds: float, first_ns: int, detector: Detector | None) -> CameraRecording:
    early = round(1e-9 * (first_ns - source.stamp_ns(source.options.start)) * source.rate_hz)
    if early >= source.n_images:  # over before the others begin
        early, first_ns = 0, source.stamp_ns(source.options.start)
    n = min(source.n_images - early, max(2, round(seconds * source.rate_hz)))
    recording = CameraRecording(name, n, source.rate_hz, notes=[source.note] if source.note else [], detector=detector)
    try:
        for stamp_ns, bgr in islice(dropwhile(lambda image: image[0] < first_ns, source), n):
            recording.add(stamp_ns, bgr)
    except TrackerError as error:
        recording.problems.append(str(error))
    recording.problems += source.counts.problems
    return recording


def _is_bag(text: str) -> bool:
    path = Path(text.removeprefix("bag:"))
    return text.startswith("bag:") or path.suffix in STORAGE_SUFFIXES or (path / "metadata.yaml").exists()
