"""Four cameras around a motion, each with a height, distance and focal length of its own; the person stays whole in view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmark.clothed.render._raster import looking_at, project, view_of
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig

SIZE = (640, 480)
N_CAMERAS = 4
_MARGIN_PX = 14.0
_HEIGHT_PX = (160.0, 300.0)  # of the person, at the middle of the motion; less where the motion needs it
_WALL_M = 0.25


@dataclass(frozen=True, eq=False)
class View:
    """A camera: name, K (3, 3), pose (4, 4) ``T_world_cam``, size."""

    name: str
    K: np.ndarray
    T_world_cam: np.ndarray
    size: tuple[int, int]

    @property
    def matrix(self) -> np.ndarray:
        """(3, 4) from the world to (u z, v z, z)."""
        return view_of(self.K, self.T_world_cam)

    def scaled(self, scale: float) -> View:
        """The same camera with fewer pixels."""
        K = np.diag([scale, scale, 1.0]) @ self.K
        K[:2, 2] += 0.5 * (scale - 1.0)  # pixel centers are integers
        return View(self.name, K, self.T_world_cam, (round(self.size[0] * scale), round(self.size[1] * scale)))


def draw_cameras(points: np.ndarray, stature: float, half_sizes: np.ndarray, rng: np.random.Generator) -> list[View]:
    """Cameras around people.

    Parameters
    ----------
    points : (n, 3) that are to be in view of all cameras, meters.
    stature : of the person, meters.
    half_sizes : (2,) of the room.
    rng : decides the rest.

    Returns
    -------
    The cameras.
    """
    start = rng.uniform(0.0, 2.0 * np.pi)
    views = []
    for i in range(N_CAMERAS):
        angle = start + i * 2.0 * np.pi / N_CAMERAS + rng.uniform(-0.3, 0.3)
        distance = rng.uniform(3.3, 5.2)
        place = np.array([distance * np.cos(angle), distance * np.sin(angle), rng.uniform(0.9, 2.45)])
        place[:2] = np.clip(place[:2], _WALL_M - half_sizes, half_sizes - _WALL_M)
        views.append(_aimed(f"cam{i + 1:02d}", place, points, stature, rng))
    return views


def _aimed(name: str, place: np.ndarray, points: np.ndarray, stature: float, rng: np.random.Generator) -> View:
    """A camera that holds all points, the person about as high as is drawn."""
    pose = looking_at(place, 0.5 * (points.min(axis=0) + points.max(axis=0)))
    for _ in range(3):  # the middle of what is seen to the middle of the image
        uv = project(view_of(np.eye(3), pose), points)[:, :2]
        middle = 0.5 * (uv.min(axis=0) + uv.max(axis=0))
        pose = looking_at(place, place + pose[:3, :3] @ np.array([*middle, 1.0]))
    uv = project(view_of(np.eye(3), pose), points)[:, :2]
    fitting = (np.array(SIZE) / 2.0 - _MARGIN_PX) / np.abs(uv).max(axis=0)
    distance = np.linalg.norm(place[:2] - points[:, :2].mean(axis=0))
    wanted = rng.uniform(*_HEIGHT_PX) * distance / stature
    focal = round(float(min(wanted, fitting.min())), 1)
    K = np.array([[focal, 0.0, 319.5], [0.0, focal, 239.5], [0.0, 0.0, 1.0]])
    K[:2, 2] += np.round(rng.uniform(-4.0, 4.0, 2), 1)
    return View(name, K, pose, SIZE)


def rig_of(views: list[View]) -> CameraRig:
    """The rig of some cameras, without distortion."""
    return CameraRig([Camera(v.name, CameraModel(*v.size, v.K), v.T_world_cam, source=v.name) for v in views])
