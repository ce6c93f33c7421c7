"""What moves in the images that the doctor has kept: on one grid of time steps for all cameras, and how fast."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from .epipolar_motion import ImageMotion
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
