"""How much moves in a camera's images, by the epipolar planes that it shares with each other camera.

How much moves altogether differs from view to view, and correlates poorly. But a plane through the centers of two cameras is a
line in both images, and what moves in that plane moves on both lines: at one and the same time both cameras see motion in the
same planes (motion barcodes: Ben-Artzi et al., "Camera calibration from dynamic silhouettes using motion barcodes", 2016). *How
much* moves on a line is another matter: the views see other parts of a velocity. So a few pixels that have changed count as much
as many: sums of changes were 10 to 25 ms off where cameras look at a dancer from the front and from the side, this 1 to 4 ms.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import cv2
import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.ndimage import gaussian_filter1d
from scipy.signal import fftconvolve

from ...camera.rig import Camera, CameraRig
from ...errors import CalibrationError
from ...loaders.images.source import open_camera_source
from ...parallel import Workers

N_PLANES = 40  # over what two cameras see of their common planes; a person takes half of them
LONG_SIDE_PX = 320  # of the images in which motion is measured
MIN_IMAGES = 20
_CHANGED_LEVELS, _SURELY_LEVELS = 5.0, 7.0  # by how many gray levels more than its surroundings' noise a pixel has to change
_NOISE_FACTOR = 4.0  # in median changes of the image
_FEW_PIXELS = 2.0  # that have changed on a line: something moves there
_LEAST_BASELINE_M = 1e-3
LEAST_CORRELATION = 0.15  # of a pair that is used
_LEAST_OVERLAP = 0.4  # of the shorter recording
_LEAST_OVERLAP_S = 0.5
_LASTING = 8  # steps, four image periods or more: beyond what smoothing makes of noise
_BLOCK_S = 0.4  # motion is taken to be independent from one block to the next
_ITERATIONS = 30
MOST_AT_ONCE = 4  # recordings that are read side by side

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class MotionProfiles:
    """Motion in a camera's images.

    Parameters
    ----------
    camera : its name.
    times_s : (n,) middles between the stamps of an image and the next, seconds.
    profiles : other camera -> (n, n_planes), 0..1, whether something moves in each plane; without planes (n, 1), changed pixels.
    first_s, last_s : stamps of its first and last image.
    """

    camera: str
    times_s: np.ndarray
    profiles: Mapping[str, np.ndarray]
    first_s: float
    last_s: float


def plane_numbers(camera: Camera, other: Camera, size: tuple[int, int], other_size: tuple[int, int]) -> np.ndarray:
    """Number of the common plane in which each pixel lies.

    Parameters
    ----------
    camera, other : the two cameras; pixels are those of ``camera``.
    size, other_size : (width, height) that the images of both cameras are made small to.

    Returns
    -------
    (height * width,) 0 to `N_PLANES` - 1, or -1 for none.
    """
    angles = [_angles(c, camera, other, s) for c, s in ((camera, size), (other, other_size))]
    low, high = (max(np.nanmin(a) for a in angles), min(np.nanmax(a) for a in angles))
    if not high > low:
        return np.full(size[0] * size[1], -1)
    numbers = np.floor((angles[0] - low) * (N_PLANES / (high - low)))
    return np.where((numbers >= 0) & (numbers < N_PLANES), numbers, -1).astype(np.int64)


def _angles(camera: Camera, a: Camera, b: Camera, size: tuple[int, int]) -> np.ndarray:
    """Angle about the line through the centers of ``a`` and ``b`` of every pixel of ``camera``, radians; NaN without a ray.

    The same for both orders of ``a`` and ``b``, so that profiles of either camera can be compared.
    """
    first, second = sorted((a, b), key=lambda c: c.name)
    axis = second.center - first.center
    axis = axis / np.linalg.norm(axis)
    ahead = first.T_world_cam[:3, 2] + second.T_world_cam[:3, 2]
    ahead = ahead - axis * (axis @ ahead)
    if np.linalg.norm(ahead) < 1e-6:  # both look along the line
        ahead = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    ahead = ahead / np.linalg.norm(ahead)
    u, v = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    rays, ok = camera.model.resized(*size).rays(np.stack([u, v], axis=-1).reshape(-1, 2).astype(np.float64))
    directions = rays @ camera.T_world_cam[:3, :3].T
    return np.where(ok, np.arctan2(directions @ np.cross(axis, ahead), directions @ ahead), np.nan)


def small_size(width: int, height: int) -> tuple[int, int]:
    """Size to which images are reduced.

    Parameters
    ----------
    width, height : pixels.

    Returns
    -------
    (width, height), the longer one at most `LONG_SIDE_PX`.
    """
    scale = min(1.0, LONG_SIDE_PX / max(width, height))
    return max(1, round(scale * width)), max(1, round(scale * height))


class MotionMeter:
    """Motion profiles of one camera of a rig, or, without a rig, its motion altogether: then every profile has one value.

    Parameters
    ----------
    camera : its name. others : the cameras to be compared with. rig : lenses and places; None where they are not known.
    """

    def __init__(self, camera: str, others: Iterable[str], rig: CameraRig | None = None):
        self._camera, self._rig, self._others = camera, rig, tuple(others)
        self._planes: dict[str, np.ndarray] = {}

    def measure(self, images: Iterable[tuple[int, np.ndarray]]) -> MotionProfiles:
        """Profiles of (stamp_ns, (h, w, 3) BGR) images in the order of time.

        Raises
        ------
        CalibrationError : fewer than `MIN_IMAGES` images, or nothing moves in them.
        """
        stamps: list[int] = []
        rows: dict[str, list[np.ndarray]] = {other: [] for other in self._others}
        before: np.ndarray | None = None
        for stamp_ns, bgr in images:
            now = self._small(bgr)
            if before is not None:
                changed = _changed(before, now)
                for other in self._others:
                    rows[other].append(self._profile(other, changed))
            before = now
            stamps.append(stamp_ns)
        check_images(self._camera, len(stamps))
        profiles = {other: np.array(values) for other, values in rows.items()}
        if not any(values.any() for values in profiles.values()):
            raise CalibrationError(self._camera, "nothing moves in its images, at least not where other cameras look")
        seconds = 1e-9 * np.array(stamps, dtype=np.float64)
        middles = 0.5 * (seconds[1:] + seconds[:-1])
        return MotionProfiles(self._camera, middles, profiles, float(seconds[0]), float(seconds[-1]))

    def _small(self, bgr: np.ndarray) -> np.ndarray:
        size = small_size(bgr.shape[1], bgr.shape[0])
        if not self._planes:
            self._planes = {other: self._numbers(other, size) for other in self._others}
        small = cv2.resize(bgr, size, interpolation=cv2.INTER_AREA)
        return cv2.GaussianBlur(small, (0, 0), 1.0).astype(np.float32).reshape(-1, 3)

    def _numbers(self, other: str, size: tuple[int, int]) -> np.ndarray:
        if self._rig is None:
            return np.zeros(size[0] * size[1], dtype=np.int64)
        a, b = self._rig[self._camera], self._rig[other]
        if np.linalg.norm(b.center - a.center) < _LEAST_BASELINE_M:
            return np.zeros(size[0] * size[1], dtype=np.int64)
        return plane_numbers(a, b, size, small_size(b.model.width, b.model.height))

    def _profile(self, other: str, changed: np.ndarray) -> np.ndarray:
        planes = self._planes[other]
        used = np.flatnonzero((changed > 0.0) & (planes >= 0))
        if self._rig is None:
            return np.array([changed[used].sum()])
        return 1.0 - np.exp(-np.bincount(planes[used], weights=changed[used], minlength=N_PLANES) / _FEW_PIXELS)


def measured_motions(
    rig: CameraRig, seconds: float, whole_images: bool = False, progress: Callable[[str, int], None] | None = None
) -> list[MotionProfiles]:
    """Motion in the images of all cameras, read side by side.

    Parameters
    ----------
    rig : cameras with sources.
    seconds : how much of each source is read.
    whole_images : how much moves altogether, for cameras whose places are not known.
    progress : called from several threads with a camera and how many images it gave.

    Returns
    -------
    In the order of the rig.

    Raises
    ------
    CalibrationError : see `MotionMeter.measure`.
    """
    sources = [open_camera_source(camera) for camera in rig]

    def measured(index: int) -> MotionProfiles:
        name = rig.names[index]
        meter = MotionMeter(name, [other for other in rig.names if other != name], None if whole_images else rig)
        motion = meter.measure(beginning(sources[index], seconds))
        if progress is not None:
            progress(name, len(motion.times_s) + 1)
        return motion

    return Workers(min(MOST_AT_ONCE, len(sources))).map(measured, range(len(sources)))


def check_images(camera: str, n_images: int) -> None:
    """Refuse a recording that tells too little.

    Parameters
    ----------
    camera, n_images : its name; how many images it has.

    Raises
    ------
    CalibrationError : fewer than `MIN_IMAGES`.
    """
    if n_images < MIN_IMAGES:
        raise CalibrationError(camera, f"has {n_images} images; at least {MIN_IMAGES} are needed to find its time")


def beginning(source: Iterable[tuple[int, np.ndarray]], seconds: float) -> Iterator[tuple[int, np.ndarray]]:
    """Images of the first seconds.

    Parameters
    ----------
    source, seconds : (stamp_ns, image) in the order of time; how much of it.

    Yields
    ------
    The same, up to there.
    """
    first_ns = None
    for stamp_ns, image in source:
        first_ns = stamp_ns if first_ns is None else first_ns
        if stamp_ns - first_ns > 1e9 * seconds:
            return
        yield stamp_ns, image


def _changed(before: np.ndarray, now: np.ndarray) -> np.ndarray:
    """(pixels,) 0..1, whether each pixel has changed, beyond noise and a change of brightness of the whole image."""
    difference = now - before
    difference = np.abs(difference - np.median(difference, axis=0))
    noise = _NOISE_FACTOR * np.median(difference, axis=0)
    blue, green, red = (difference - noise).T
    beyond = np.maximum(np.maximum(blue, green), red)  # as .max(axis=1), in a tenth of the time
    return np.clip((beyond - _CHANGED_LEVELS) / (_SURELY_LEVELS - _CHANGED_LEVELS), 0.0, 1.0)


@dataclass(frozen=True)
class Lag:
    """Lag of a camera behind another one, how well both agree there, and at the next best lag as a share of that."""

    lag_s: float
    variance_s2: float
    correlation: float
    runner_up: float


@dataclass(frozen=True, eq=False)
class Pair:
    """Lag of camera ``j`` behind ``i``: what i shows at t, j shows at t + lag[0] + lag[1] * (t - middle).

    ``unlike`` is the share of the motion that only one of both sees, and that lasts: no noise of images.
    """

    i: int
    j: int
    lag: np.ndarray
    covariance: np.ndarray
    correlation: float
    unlike: float = 0.0


def pairs_that_agree(cameras: Sequence[T], lag_of: Callable[[T, T], Lag | None]) -> tuple[list[Pair], list[float]]:
    """Lags of every pair of cameras.

    Parameters
    ----------
    cameras : what each has seen or heard.
    lag_of : the lag of two of them; None where they do not agree.

    Returns
    -------
    pairs : of those that agree.
    runners_up : of each camera, how well the second best lag agrees, in shares of the best.
    """
    pairs, runners_up = [], [0.0] * len(cameras)
    for (i, a), (j, b) in itertools.combinations(enumerate(cameras), 2):
        lag = lag_of(a, b)
        if lag is None:
            continue
        for k in (i, j):
            runners_up[k] = max(runners_up[k], lag.runner_up)
        pairs.append(Pair(i, j, np.array([lag.lag_s]), np.array([[lag.variance_s2]]), lag.correlation))
    return pairs, runners_up


class Signals:
    """Profiles of a camera on an even grid of time, smoothed over the longest image period of all cameras."""

    def __init__(self, motion: MotionProfiles, period_s: float, smooth_s: float):
        self.step_s = 0.5 * period_s
        first, last = (int(np.round(t / self.step_s)) for t in motion.times_s[[0, -1]])
        self.first, self.times_s = first, self.step_s * np.arange(first, last + 1)
        self._values: dict[str, np.ndarray] = {}
        for other, profile in motion.profiles.items():
            even = np.array([np.interp(self.times_s, motion.times_s, column) for column in profile.T]).T
            smooth = gaussian_filter1d(even, smooth_s / self.step_s, axis=0, mode="nearest")
            self._values[other] = smooth - smooth.mean(axis=0)
        self.camera = motion.camera

    def towards(self, other: Signals) -> np.ndarray:
        """(n, n_planes) by the planes that are common with ``other``."""
        return self._values[other.camera]


Tables = Mapping[tuple[int, int], tuple[int, np.ndarray] | None]


def correlations(signals: Sequence[Signals], max_offset_s: float) -> Tables:
    """Correlation of the motion of every pair of cameras, at all lags.

    Parameters
    ----------
    signals : one a camera.
    max_offset_s : largest lag.

    Returns
    -------
    Pair -> (first lag in steps, correlation at each lag from there on); None without motion in common.
    """
    result: dict[tuple[int, int], tuple[int, np.ndarray] | None] = {}
    for (i, a), (j, b) in itertools.combinations(enumerate(signals), 2):
        x, y = a.towards(b), b.towards(a)
        first = b.first - a.first - (len(x) - 1)  # of the lags that fftconvolve gives
        lags = first + np.arange(len(x) + len(y) - 1)
        products = _lagged(x, y).sum(axis=1)
        norms = _lagged(np.ones(len(x)), np.sum(y**2, axis=1)) * _lagged(np.sum(x**2, axis=1), np.ones(len(y)))
        overlap_s = a.step_s * _lagged(np.ones(len(x)), np.ones(len(y)))
        least_s = max(_LEAST_OVERLAP_S, _LEAST_OVERLAP * a.step_s * min(len(x), len(y)))
        ok = (np.abs(lags) * a.step_s <= max_offset_s) & (overlap_s >= least_s)
        norm = np.sqrt(np.maximum(norms, 0.0))
        usable = ok & (norm > 1e-9 * norm.max(initial=0.0))
        table = np.where(usable, products / np.where(usable, norm, 1.0), -1.0)
        result[i, j] = (int(lags[ok][0]), table[ok]) if usable.any() else None
    return result


def _lagged(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Sums of x[t] * y[t + lag] for all lags from -(len(x) - 1) on, along the first axis."""
    return fftconvolve(x[::-1], y, axes=0)


def refined(i: int, j: int, signals: Sequence[Signals], lag_s: float, middle_s: float, width: int) -> Pair | None:
    """Lag of a pair of cameras below the image period.

    Parameters
    ----------
    i, j : numbers of the cameras.
    signals : one a camera.
    lag_s : start.
    middle_s : time that the lag is for.
    width : 2 to estimate the drift as well, 1 without it.

    Returns
    -------
    The lag with its covariance; None where the cameras do not agree near ``lag_s``.
    """
    a, b = signals[i], signals[j]
    curve = make_interp_spline(b.times_s, b.towards(a), k=3)
    slope = curve.derivative()
    margin_s = 4.0 * a.step_s
    inside = (a.times_s + lag_s >= b.times_s[0] + margin_s) & (a.times_s + lag_s <= b.times_s[-1] - margin_s)
    if np.count_nonzero(inside) * a.step_s < _LEAST_OVERLAP_S:
        return None
    times, x = a.times_s[inside], a.towards(b)[inside]
    basis = np.stack([np.ones_like(times), times - middle_s][:width], axis=1)
    lag = np.array([lag_s, 0.0][:width])
    for _ in range(_ITERATIONS):
        at = np.clip(times + basis @ lag, b.times_s[0], b.times_s[-1])
        y, dy = curve(at), slope(at)
        gain = np.sum(x * y) / max(float(np.sum(y * y)), 1e-300)
        rest = x - gain * y
        pull = basis * np.sum(rest * gain * dy, axis=1)[:, None]
        normal = basis.T @ (basis * np.sum((gain * dy) ** 2, axis=1)[:, None])
        step = np.linalg.solve(normal + 1e-12 * np.trace(normal) * np.eye(len(lag)), pull.sum(axis=0))
        lag = lag + step
        if np.abs(step).max() < 1e-7:
            break
    correlation = float(np.sum(x * y) / np.sqrt(max(float(np.sum(x * x) * np.sum(y * y)), 1e-300)))
    if correlation < LEAST_CORRELATION or abs(lag[0] - lag_s) > margin_s:
        return None
    blocks = np.unique(np.floor((times - times[0]) / _BLOCK_S), return_inverse=True)[1]
    sums = np.array([np.bincount(blocks, weights=column) for column in pull.T])
    spread = sums @ sums.T * (sums.shape[1] / max(sums.shape[1] - len(lag), 1))
    inverse = np.linalg.inv(normal)
    lasting = np.sum(rest[:-_LASTING] * rest[_LASTING:]) / max(float(np.sum(rest * rest)), 1e-300)
    return Pair(i, j, lag, inverse @ spread @ inverse, correlation, (1.0 - correlation**2) * max(float(lasting), 0.0))
