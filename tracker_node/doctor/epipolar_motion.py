"""How well cameras agree on where something moves, from images alone: no markers, no model, no matched points.

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

import numba as nb
import numpy as np

from ..camera.model import CameraModel
from ..camera.rig import Camera

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


@nb.njit(cache=True, nogil=True)
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
