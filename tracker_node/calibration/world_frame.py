"""Another world for a rig: its origin, its axes, its scale; and whether scale and vertical are true.

Cameras alone know neither where the floor is nor how long a meter is. Points seen by two cameras or more tell: points of
known place, an origin with points on two axes, the two ends of a wand, a plumb line.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..camera.light import Light
from ..camera.rig import Camera, CameraRig
from ..errors import CalibrationError, TrackerError, UnknownNameError
from ..geometry import se3
from .points.triangulation import reproject, triangulate

LEAST_M = 1e-9  # points that are nearer to each other are one
UP = np.array([0.0, 0.0, 1.0])
_CLEARLY_UP = 0.8  # cosine of the angle between an axis of the world and what is up for the cameras
_AGREED_UP = 0.3  # length of the mean of the cameras' ups
_LINE = 0.02  # second singular value to the first from which on points do not lie on a line


@dataclass(frozen=True, eq=False)
class WorldChange:
    """``new = scale * rotation @ old + translation``, meters; ``residuals_m`` (n,) of the points that it was fitted to."""

    rotation: np.ndarray
    translation: np.ndarray
    scale: float = 1.0
    residuals_m: np.ndarray | None = None

    def points(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the old world in the new one."""
        return self.scale * np.asarray(points) @ self.rotation.T + self.translation

    def rig(self, rig: CameraRig) -> CameraRig:
        """The cameras and lights in the new world."""
        return replace(rig, cameras=tuple(map(self._camera, rig)), lights=tuple(map(self._light, rig.lights)))

    def _camera(self, camera: Camera) -> Camera:
        rotation = self.rotation @ camera.T_world_cam[:3, :3]
        return replace(camera, T_world_cam=se3.from_rotation_translation(rotation, self.points(camera.center)))

    def _light(self, light: Light) -> Light:
        position = None if light.position is None else tuple(self.points(np.array(light.position)))
        direction = None if light.direction is None else tuple(self.rotation @ np.array(light.direction))
        return replace(light, position=position, direction=direction)


@dataclass(frozen=True, eq=False)
class SeenPoint:
    """A point (3,) of the rig's world, and how far its pixels are off in the worst camera."""

    place: np.ndarray
    worst_px: float


def seen_points(rig: CameraRig, clicks: Mapping[str, Mapping[str, np.ndarray]]) -> dict[str, SeenPoint]:
    """Triangulate points that were clicked on.

    Parameters
    ----------
    rig : the cameras.
    clicks : camera -> point -> pixel (2,).

    Returns
    -------
    Point -> place and error.

    Raises
    ------
    UnknownNameError : a camera that is not in the rig.
    CalibrationError : a pixel that is not on the image, or a point that fewer than two cameras see from different sides.
    """
    for name in clicks:
        if name not in rig.names:
            raise UnknownNameError("camera", name, rig.names)
    names = list(dict.fromkeys(point for points in clicks.values() for point in points))
    pixels, weights = np.zeros((len(names), len(rig), 2)), np.zeros((len(names), len(rig)))
    for i, camera in enumerate(rig):
        for point, pixel in clicks.get(camera.name, {}).items():
            if not camera.model.in_image(pixel):  # of a still, where the rig is for videos
                size, at = f"{camera.model.width}x{camera.model.height}", ", ".join(f"{value:g}" for value in pixel)
                raise CalibrationError(camera.name, f"point '{point}': expected a pixel of its image of {size}, got {at}")
            pixels[names.index(point), i], weights[names.index(point), i] = pixel, 1.0
    models, places = [camera.model for camera in rig], np.array([camera.T_world_cam for camera in rig])
    points, valid = triangulate(models, places, pixels, weights)
    for name, ok in zip(names, valid, strict=True):
        if not ok:
            problem = f"point '{name}' has to be seen by another camera too, from another side"
            raise CalibrationError(_cameras_of(clicks, name), problem)
    back, _ = reproject(models, places, points)
    off = np.linalg.norm(back - pixels, axis=2) * (weights > 0.0)
    return {name: SeenPoint(points[i], float(off[i].max())) for i, name in enumerate(names)}


def onto_points(points: np.ndarray, targets: np.ndarray, with_scale: bool = False) -> WorldChange:
    """The least-squares rigid motion, or similarity, of points to targets.

    Parameters
    ----------
    points, targets : (n, 3).
    with_scale : also fit the scale.

    Returns
    -------
    The change of the world, with its residuals.

    Raises
    ------
    TrackerError : fewer than three points, or points on a line.
    """
    middle_p, middle_t = points.mean(axis=0), targets.mean(axis=0)
    p, t = points - middle_p, targets - middle_t
    for what, values in (("seen", p), ("given", t)):
        singular = np.linalg.svd(values, compute_uv=False)
        if len(points) < 3 or singular[0] < LEAST_M or singular[1] < _LINE * singular[0]:
            problem = "do not span a plane: three that do not lie on a line are the least"
            raise TrackerError(f"the {len(points)} points, as {what}, {problem}")
    rotation = se3.rigid_fit(points, targets)[:3, :3]
    scale = float(np.sum(t * (p @ rotation.T)) / np.sum(p**2)) if with_scale else 1.0
    change = WorldChange(rotation, middle_t - scale * rotation @ middle_p, scale)
    return replace(change, residuals_m=np.linalg.norm(change.points(points) - targets, axis=1))


def onto_axes(origin: np.ndarray, on_x: np.ndarray, on_y: np.ndarray) -> WorldChange:
    """The world of an origin and points on two axes.

    Parameters
    ----------
    origin : (3,) the new origin.
    on_x : (3,) on the positive x axis.
    on_y : (3,) in the plane z = 0, at y > 0.

    Returns
    -------
    The change of the world.

    Raises
    ------
    TrackerError : the three lie on a line, or two at one place.
    """
    x, towards_y = on_x - origin, on_y - origin
    for name, to in (("x", x), ("y", towards_y)):
        if np.linalg.norm(to) < LEAST_M:
            raise TrackerError(f"the point on {name} is at the same place as the origin")
    z = np.cross(x, towards_y)
    if np.linalg.norm(z) < _LINE * np.linalg.norm(x) * np.linalg.norm(towards_y):
        raise TrackerError("the origin and the points on x and y lie on one line")
    x, z = x / np.linalg.norm(x), z / np.linalg.norm(z)
    rotation = np.stack([x, np.cross(z, x), z])
    return WorldChange(rotation, -rotation @ origin)


def upright(up: np.ndarray) -> WorldChange:
    """The smallest turn about the origin after which ``up`` (3,), any length but zero, is the z axis.

    Raises
    ------
    TrackerError : it has no length.
    """
    _check_vertical(up)
    rotation, _ = Rotation.align_vectors(UP[None], up[None])
    return WorldChange(rotation.as_matrix(), np.zeros(3))


def up_of_cameras(rig: CameraRig) -> np.ndarray | None:
    """The axis of the world, one way or the other, that is up for cameras that stand about upright; None where none is."""
    up = -np.mean([camera.T_world_cam[:3, 1] for camera in rig], axis=0)
    axis, length = int(np.argmax(np.abs(up))), float(np.linalg.norm(up))
    if length < _AGREED_UP or abs(up[axis]) < _CLEARLY_UP * length:
        return None
    return np.sign(up[axis]) * np.eye(3)[axis]


def scaled(factor: float) -> WorldChange:
    """The same world with lengths multiplied by a positive number, about the origin."""
    return WorldChange(np.eye(3), np.zeros(3), factor)


def tilt_deg(up: np.ndarray) -> float:
    """Angle of a vertical (3,) to the z axis, degrees.

    Raises
    ------
    TrackerError : it has no length.
    """
    _check_vertical(up)
    return float(np.degrees(np.arctan2(np.linalg.norm(up[:2]), up[2])))


def _check_vertical(up: np.ndarray) -> None:
    if np.linalg.norm(up) < LEAST_M:
        raise TrackerError("the vertical has no length: top and bottom are at the same place")


def _cameras_of(clicks: Mapping[str, Mapping[str, np.ndarray]], point: str) -> str:
    return ", ".join(camera for camera, points in clicks.items() if point in points)
