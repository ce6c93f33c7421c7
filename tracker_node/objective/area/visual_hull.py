"""A coarse visual hull: what part of space all cameras take for the body, and where in it a body may stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import scipy  # imports its modules when they are first used

from ...camera.rig import Camera, axes_equations

_LEAST = 0.1  # probability left to a place that a camera denies: silhouettes have holes
_SOLID = 0.4  # probability above which a point counts
_MOST_STEPS = 200  # of a grid, each way: 8 million points, some hundred megabytes
_REACH = 1.6  # of the distance from the cameras to what they see: half the width of the volume


@dataclass(frozen=True, eq=False)
class Volume:
    """A grid of points: ``origin`` (3,) meters, ``step_m``, ``shape`` (3,) points along x, y, z."""

    origin: np.ndarray
    step_m: float
    shape: tuple[int, int, int]

    @property
    def points(self) -> np.ndarray:
        """(n, 3) meters, world, z the fastest."""
        axes = [self.origin[i] + self.step_m * np.arange(self.shape[i]) for i in range(3)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def seen_volume(cameras: Sequence[Camera], size_m: float, step_m: float) -> Volume:
    """Grid over what the cameras see; its middle is nearest to all optical axes.

    One camera only, or cameras side by side, have no such point: then it lies where the body would fill two thirds of an image.

    Parameters
    ----------
    cameras : at least one.
    size_m : of the body.
    step_m : of the grid; it is larger where the grid would have too many points.

    Returns
    -------
    The grid, world.
    """
    centers = np.array([camera.center for camera in cameras])
    axes = np.array([camera.T_world_cam[:3, 2] for camera in cameras])
    filling = np.array([1.5 * size_m * c.model.K[1, 1] / min(c.model.width, c.model.height) for c in cameras])
    guess = np.mean(centers + filling[:, None] * axes, axis=0)
    weak = 0.02 * len(cameras)  # axes that all but agree leave the depth to the guess
    A, b = axes_equations(cameras)
    middle = np.linalg.solve(A + weak * np.eye(3), b + weak * guess)
    reach = max(float(np.median(np.linalg.norm(centers - middle, axis=1))) / _REACH, size_m)
    low, high = middle - reach, middle + reach
    step_m = max(step_m, 2.0 * reach / _MOST_STEPS)
    shape = tuple(int(n) for n in np.ceil((high - low) / step_m) + 1)
    return Volume(low, step_m, (shape[0], shape[1], shape[2]))


def occupancy(volume: Volume, cameras: Sequence[Camera], maps: Sequence[np.ndarray | None], min_cameras: int) -> np.ndarray:
    """Probability that a point belongs to the body: the geometric mean over the cameras that see it.

    Parameters
    ----------
    volume : of the points.
    cameras, maps : log-odds (h, w) on images of each camera's size; None for a camera without an image.
    min_cameras : points that fewer see get 0.

    Returns
    -------
    (nx, ny, nz).
    """
    points = volume.points
    total, count = np.zeros(len(points)), np.zeros(len(points))
    for camera, odds in zip(cameras, maps, strict=True):
        if odds is None:
            continue
        pixels, valid = camera.project(points)
        valid &= camera.model.in_image(pixels)
        likely = np.log(_LEAST + (1.0 - _LEAST) / (1.0 + np.exp(-cv2.blur(odds, (3, 3)))))
        u, v = np.rint(pixels[valid]).astype(np.int64).T
        total[valid] += likely[v.clip(0, odds.shape[0] - 1), u.clip(0, odds.shape[1] - 1)]
        count[valid] += 1.0
    occupied = np.where(count >= min_cameras, np.exp(total / np.maximum(count, 1.0)), 0.0)
    return occupied.reshape(volume.shape)


def seen_from(camera: Camera, volume: Volume, occupied: np.ndarray) -> np.ndarray:
    """The likeliest point of a volume along the ray of each pixel.

    Parameters
    ----------
    camera : whose pixels.
    volume, occupied : points, and (nx, ny, nz) their probabilities.

    Returns
    -------
    (h, w) float32; 0 beside the volume.
    """
    points, model = volume.points, camera.model
    pixels, valid = camera.project(points)
    valid &= model.in_image(pixels)
    depth = float(np.median(np.linalg.norm(points - camera.center, axis=1)))
    cell = max(1, round(1.5 * volume.step_m * float(model.K[0, 0]) / max(depth, 1e-6)))  # pixels that a point stands for
    coarse = np.zeros((-(-model.height // cell), -(-model.width // cell)), dtype=np.float32)
    u, v = (np.rint(pixels[valid]).astype(np.int64) // cell).T
    np.maximum.at(coarse, (v, u), occupied.ravel()[valid].astype(np.float32))
    large = cv2.resize(coarse, (coarse.shape[1] * cell, coarse.shape[0] * cell), interpolation=cv2.INTER_LINEAR)
    return np.asarray(large[: model.height, : model.width], dtype=np.float32)


def places(volume: Volume, occupied: np.ndarray, size_m: float, n: int) -> np.ndarray:
    """Middles of what may be bodies, the likeliest first.

    Parameters
    ----------
    volume, occupied : points, and (nx, ny, nz) their probabilities.
    size_m : of the body.
    n : places at most.

    Returns
    -------
    (m, 3) meters, world, m <= ``n``.
    """
    solid = np.where(occupied > _SOLID, occupied, 0.0)
    mass = scipy.ndimage.gaussian_filter(solid, 0.18 * size_m / volume.step_m).ravel()
    likely = np.flatnonzero(mass > max(0.05 * float(mass.max(initial=0.0)), 1e-3))  # of a million points, some thousand
    points, mass, inside = volume.points, mass[likely], np.flatnonzero(solid)
    body, weights, points = points[inside], solid.ravel()[inside], points[likely]
    found: list[np.ndarray] = []
    while len(found) < n and len(mass):
        peak = points[np.argmax(mass)]
        middle = peak
        for _ in range(4):  # to the middle of what is around
            near = np.exp(-0.5 * np.sum((body - middle) ** 2, axis=1) / (0.4 * size_m) ** 2) * weights
            middle = near @ body / max(float(near.sum()), 1e-9)
        if all(np.linalg.norm(middle - other) > 0.25 * size_m for other in found):
            found.append(middle)
        rest = [np.sum((points - at) ** 2, axis=1) >= (0.25 * size_m) ** 2 for at in (peak, middle)]
        points, mass = points[rest[0] & rest[1]], mass[rest[0] & rest[1]]
    return np.array(found).reshape(-1, 3)
