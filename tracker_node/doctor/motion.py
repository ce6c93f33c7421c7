"""What moves in the images that the doctor has kept: on one grid of time steps for all cameras, and how fast.

How well cameras agree on where something moves, from images alone: no markers, no model, no matched points.

All points of a plane through two cameras' centers (an epipolar plane) are seen on one line by each of them. If nothing moves
on that line in one image, hardly anything moves on the line of the same plane in the other camera's image of that time step.
So the amount of motion as a function of the plane's angle about the baseline and of time, the *profile*, is nearly the same
for both cameras where their places, lenses and clocks are true, from however different sides they look. The idea is that of
motion barcodes (Ben-Artzi, Kasten, Peleg, Werman: Camera calibration from dynamic silhouettes using motion barcodes, CVPR
2016), here with amounts instead of bits, and with calibrated planes instead of a search for them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from ..camera.model import CameraModel
from ..camera.rig import Camera
from ..compiled.kernels import compiled
from .recording import CameraRecording

LAG_S = 0.05  # images that are compared are so far apart, or one image
_CELLS = 160  # places along the longer side of an image
_FULL_CHANGE = 20.0  # gray levels of change above the threshold that count as motion in full
_LEAST_CHANGE = 6.0
_RATE_PAIRS = 12  # pairs of images in which the speed is measured
_CHANGED = 8.0  # gray levels
_LEAST_CHANGED = 30  # pixels of the small images


def common_grid(recordings: Mapping[str, CameraRecording]) -> np.ndarray:
    """Time steps (T,) in ns at which all cameras have images, one per image of the slowest camera."""
    first = max(r.stamps_ns[0] for r in recordings.values())
    last = min(r.stamps_ns[-1] for r in recordings.values())
    period = max(period_ns(r) for r in recordings.values())
    return np.arange(first, last + 1, period, dtype=np.int64)


def period_ns(recording: CameraRecording) -> int:
    """Median time from image to image; a second for a single image."""
    return int(np.median(np.diff(recording.stamps_ns))) if len(recording) > 1 else 1_000_000_000


def motion_on_grid(recording: CameraRecording, grid: np.ndarray, usable: np.ndarray) -> ImageMotion:
    """Motion of one camera at the time steps of a grid.

    Parameters
    ----------
    recording : images of the camera.
    grid : (T,) stamps in ns, equally spaced.
    usable : (n,) bool of the camera's images; others count as missing.

    Returns
    -------
    What moves, in pixels of the camera's images.
    """
    stamps = np.array(recording.stamps_ns)
    nearest = np.abs(stamps[None] - grid[:, None]).argmin(axis=1)
    spacing = int(grid[1] - grid[0]) if len(grid) > 1 else 1
    there = usable[nearest] & (np.abs(stamps[nearest] - grid) <= spacing)
    lag = max(1, round(LAG_S * 1e9 / spacing))
    width, height = recording.size
    factor = _CELLS / max(width, height)
    cells = (max(1, round(width * factor)), max(1, round(height * factor)))
    images = [cv2.resize(recording.small[i], cells, interpolation=cv2.INTER_AREA).astype(np.float32) for i in nearest]
    brightness = recording.brightness()[nearest]
    changes = np.zeros((len(grid), cells[0] * cells[1]), dtype=np.float32)
    valid = np.zeros(len(grid), dtype=bool)
    for t in range(lag, len(grid)):
        valid[t] = there[t] and there[t - lag]
        if valid[t]:
            changes[t] = np.abs(images[t] * (brightness[t - lag] / brightness[t]) - images[t - lag]).ravel()
    noise = float(np.median(changes[valid])) if valid.any() else 0.0
    amounts = np.clip((changes - max(_LEAST_CHANGE, 4.0 * noise)) / _FULL_CHANGE, 0.0, 1.0)
    used = np.flatnonzero(amounts.max(axis=0) > 0.0)
    v, u = np.divmod(used, cells[0])
    pixels = np.stack([(u + 0.5) * width / cells[0] - 0.5, (v + 0.5) * height / cells[1] - 0.5], axis=1)
    return ImageMotion.of_table(pixels, amounts[:, used], valid)


@dataclass(frozen=True)
class Speed:
    """How far things move from image to image, for what they are.

    Parameters
    ----------
    growth : by what factor more of the image changes over two images than over one: 2 for slow motion, 1 where things are
        elsewhere in every image.
    step : 90th percentile of the motion from image to image, as a fraction of the image's longer side; too little where flow
        cannot follow.
    """

    growth: float
    step: float


def speed(recording: CameraRecording, usable: np.ndarray) -> Speed | None:
    """Speed of what moves in the images.

    Parameters
    ----------
    recording : images of a camera.
    usable : (n,) bool of the images.

    Returns
    -------
    None where too little moves.
    """
    images = [cv2.GaussianBlur(image, (0, 0), 1.5) for image, ok in zip(recording.small, usable, strict=True) if ok]
    flow_of = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    once, twice, steps = [], [], []
    for i in range(0, len(images) - 2, max(1, (len(images) - 2) // _RATE_PAIRS)):
        changed = cv2.absdiff(images[i + 1], images[i]) > _CHANGED
        once.append(int(changed.sum()))
        twice.append(int((cv2.absdiff(images[i + 2], images[i]) > _CHANGED).sum()))
        if once[-1] >= _LEAST_CHANGED:
            flow = flow_of.calc(images[i], images[i + 1], np.zeros((*changed.shape, 2), dtype=np.float32))
            steps.append(float(np.percentile(np.linalg.norm(flow[changed], axis=1), 90)) / max(changed.shape))
    return Speed(sum(twice) / sum(once), float(np.mean(steps))) if steps else None


PLANES = 1200  # angles about the baseline: 0.3 degrees each
LEAST_TIME_STEPS = 8


@dataclass(frozen=True, eq=False)
class ImageMotion:
    """What moves in the images of one camera.

    Parameters
    ----------
    pixels : (n, 2) places in the image, in its pixels.
    time_steps, places, amounts : (m,) how much (0..1) of which place moves at which time step; the others are 0.
    valid : (T,) bool, time steps of which the camera has an image that can be used.
    """

    pixels: np.ndarray
    time_steps: np.ndarray
    places: np.ndarray
    amounts: np.ndarray
    valid: np.ndarray
    _rays: list[tuple[CameraModel, np.ndarray]] = field(default_factory=list, init=False, repr=False)  # of the latest lens

    @classmethod
    def of_table(cls, pixels: np.ndarray, table: np.ndarray, valid: np.ndarray) -> ImageMotion:
        """Motion from a full table.

        Parameters
        ----------
        pixels : (n, 2) places.
        table : (T, n) amounts, 0 to 1.
        valid : (T,) bool, see `ImageMotion`.

        Returns
        -------
        The same, as a sparse table.
        """
        time_steps, places = np.nonzero(table * valid[:, None])
        return cls(pixels, time_steps, places, table[time_steps, places].astype(float), valid)

    @property
    def center(self) -> np.ndarray:
        """Mean place of all motion, pixels (2,)."""
        return self.amounts @ self.pixels[self.places] / self.amounts.sum()

    def at(self, time_step: int) -> np.ndarray:
        """(n,) how much of each place moves at a time step."""
        now = self.time_steps == time_step
        return np.bincount(self.places[now], self.amounts[now], len(self.pixels))

    def rays(self, lens: CameraModel) -> np.ndarray:
        """(n, 3) directions of the places in the camera's frame; zero where the lens has none."""
        if not self._rays or self._rays[0][0] is not lens:
            rays, valid = lens.rays(self.pixels)
            self._rays[:] = [(lens, rays * valid[:, None])]
        return self._rays[0][1]

    def mirrored(self, width: int) -> ImageMotion:
        """As in images with left and right exchanged."""
        return replace(self, pixels=np.stack([width - 1 - self.pixels[:, 0], self.pixels[:, 1]], axis=1))

    def every(self, step: int) -> ImageMotion:
        """Every ``step``-th time step only."""
        kept = self.time_steps % step == 0
        return self._with(kept, self.time_steps[kept] // step, self.valid[::step])

    def shifted(self, time_steps: int) -> ImageMotion:
        """The motion of ``time_steps`` later moved to now (negative: earlier); what is then unknown is not valid."""
        n = len(self.valid)
        source = np.arange(n) + time_steps
        inside = (source >= 0) & (source < n)
        valid = inside & self.valid[np.clip(source, 0, n - 1)]
        moved = self.time_steps - time_steps
        kept = (moved >= 0) & (moved < n)
        return self._with(kept, moved[kept], valid)

    def _with(self, kept: np.ndarray, time_steps: np.ndarray, valid: np.ndarray) -> ImageMotion:
        return replace(self, time_steps=time_steps, places=self.places[kept], amounts=self.amounts[kept], valid=valid)


def agreement(a: Camera, motion_a: ImageMotion, b: Camera, motion_b: ImageMotion) -> float:
    """Correlation of the profiles of two cameras.

    Parameters
    ----------
    a : one camera.
    motion_a : what moves in its images.
    b : the other camera.
    motion_b : what moves in its images, at the same time steps.

    Returns
    -------
    -1 to 1; NaN with too few time steps, or where nothing moves.
    """
    both = motion_a.valid & motion_b.valid
    if both.sum() < LEAST_TIME_STEPS:
        return float("nan")
    profile_a = _profile(a, b.center - a.center, motion_a, both)
    profile_b = _profile(b, b.center - a.center, motion_b, both)
    norm = np.sqrt((profile_a**2).sum() * (profile_b**2).sum())
    return float((profile_a * profile_b).sum() / norm) if norm > 0.0 else float("nan")


def agreements(cameras: Sequence[Camera], motions: Mapping[str, ImageMotion]) -> np.ndarray:
    """Agreement of all pairs of cameras.

    Parameters
    ----------
    cameras : C of them.
    motions : camera -> what moves in its images.

    Returns
    -------
    (C, C) symmetric, NaN on the diagonal.
    """
    result = np.full((len(cameras), len(cameras)), np.nan)
    for i, a in enumerate(cameras):
        for j, b in enumerate(cameras[:i]):
            result[i, j] = result[j, i] = agreement(a, motions[a.name], b, motions[b.name])
    return result


def _profile(camera: Camera, baseline: np.ndarray, motion: ImageMotion, time_steps: np.ndarray) -> np.ndarray:
    """(T, PLANES): square roots of the amounts of motion, less each time step's mean; zero but at ``time_steps`` (T,) bool."""
    directions = motion.rays(camera.model) @ camera.T_world_cam[:3, :3].T
    along, across = _perpendicular(baseline)
    position = np.arctan2(directions @ across, directions @ along) * (PLANES / (2.0 * np.pi))
    seen = np.any(directions != 0.0, axis=1)
    total = _shared_out(motion.time_steps, motion.places, motion.amounts, position, seen, len(motion.valid))
    roots = np.sqrt(total) * time_steps[:, None]
    return roots - roots.mean(axis=1, keepdims=True)


@compiled
def _shared_out(time_steps, places, amounts, position, seen, n_time_steps):
    """Amounts by time step and plane; each place's is shared out among the two nearest planes, so that the agreement is a
    continuous function of where cameras stand."""
    total = np.zeros((n_time_steps, PLANES))
    for i in range(len(time_steps)):
        place = places[i]
        if seen[place]:
            low = int(np.floor(position[place]))
            fraction = position[place] - low
            total[time_steps[i], low % PLANES] += (1.0 - fraction) * amounts[i]
            total[time_steps[i], (low + 1) % PLANES] += fraction * amounts[i]
    return total


def _perpendicular(baseline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors (3,) that make a right-handed frame with the baseline."""
    axis = np.eye(3)[np.argmin(np.abs(baseline))]
    along = np.cross(baseline, axis)
    along /= np.linalg.norm(along)
    across = np.cross(baseline, along)
    return along, across / np.linalg.norm(across)
