"""The half-twisting forward somersault of Trewartha, Yeadon & Knight, and the scene in which it is filmed.

The paper prints the range of every variable and the number of images, not the time histories; these are the plainest ones that
flight allows. Vertical: a parabola under gravity. Anterior-posterior: uniform. Somersault: uniform, as in a body that keeps its
shape. Tilt: rises from zero and goes back to it. Twist: its rate is in proportion to the tilt, as in a twist that comes from
tilting the body out of the plane of the somersault. Lateral: the pelvis swings to the side that the head tilts away from.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..camera.camera_model import CameraModel
from ..camera.camera_rig import Camera, CameraRig
from ..camera.light import Light
from ..errors import UnknownNameError
from ..geometry import se3
from ..model.articulated_model import ArticulatedModel
from ..model.configuration import State
from ..model.pose_variables import ROOT_NAMES, from_variables
from .scenes import looking_at

GRAVITY = 9.81  # m/s^2
IMAGE_SIZE = (768, 576)
CAMERA_NAMES = ("front", "side", "top")
_CAMERA_DISTANCE = 8.0  # metres from the middle of the flight
_FOCAL_PX = {"front": 1320.0, "side": 1320.0, "top": 1800.0}  # the whole flight just fits in every view
_MIDDLE = np.array([0.5, 0.0, 1.44])  # of the flight, metres


@dataclass(frozen=True)
class SomersaultRanges:
    """Ranges over all images (Table 1 of the paper): metres and degrees; ``apex`` is the share of the flight before the apex."""

    vertical: float = 0.790
    anterior_posterior: float = 1.000
    lateral: float = 0.010
    somersault_deg: float = 360.0
    tilt_deg: float = 8.0
    twist_deg: float = 180.0
    apex: float = 0.45
    take_off_height: float = 1.30

    @property
    def flight_time(self) -> float:
        """Seconds: gravity and the height of the fall from the apex settle it."""
        return float(np.sqrt(2.0 * self.vertical / GRAVITY)) / (1.0 - self.apex)


def somersault_variables(n_images: int = 11, ranges: SomersaultRanges | None = None) -> np.ndarray:
    """(n_images, 6) in the order of `pose_variables.ROOT_NAMES`, evenly spaced from take-off to landing."""
    r = ranges or SomersaultRanges()
    s = np.linspace(0.0, 1.0, n_images)
    columns = {
        "x": s,
        "y": np.sin(np.pi * s) ** 2,
        "z": -((s - r.apex) ** 2),
        "somersault": s,
        "tilt": np.sin(np.pi * s) ** 2,
        "twist": s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi),  # the integral of the tilt
    }
    sizes = {
        "x": r.anterior_posterior, "y": r.lateral, "z": r.vertical,
        "somersault": np.deg2rad(r.somersault_deg), "tilt": np.deg2rad(r.tilt_deg), "twist": np.deg2rad(r.twist_deg),
    }  # fmt: skip
    variables = np.stack([columns[name] * (sizes[name] / np.ptp(columns[name])) for name in ROOT_NAMES], axis=1)
    variables[:, 2] += r.take_off_height - variables[0, 2]
    return variables


def somersault_states(model: ArticulatedModel, variables: np.ndarray, posture_deg: Mapping[str, float]) -> list[State]:
    """The body in one fixed posture at every row of ``variables`` (n, 6)."""
    angles = posture(model, posture_deg)
    return [from_variables(np.concatenate([row, angles])) for row in variables]


def posture(model: ArticulatedModel, degrees: Mapping[str, float]) -> np.ndarray:
    """(n_axes,) radians: the named joint axes at these angles, the others neutral."""
    angles = np.array([axis.neutral for axis in model.chain.axes])
    names = [axis.name for axis in model.chain.axes]
    for name, value in degrees.items():
        if name not in names:
            raise UnknownNameError("joint axis", name, names)
        angles[names.index(name)] = np.deg2rad(value)
    return angles


def somersault_rig(width: int = IMAGE_SIZE[0]) -> CameraRig:
    """Front, side and top view of the flight and the lights, all known; smaller pictures for ``width`` below 768."""
    scale = width / IMAGE_SIZE[0]
    height = round(scale * IMAGE_SIZE[1])
    front = looking_at(_MIDDLE + _CAMERA_DISTANCE * np.array([1.0, 0.0, 0.0]), _MIDDLE)
    side = looking_at(_MIDDLE - _CAMERA_DISTANCE * np.array([0.0, 1.0, 0.0]), _MIDDLE)
    # Seen from above, the flight goes to the right of the picture.
    top = se3.from_rotation_translation(np.diag([1.0, -1.0, -1.0]), _MIDDLE + _CAMERA_DISTANCE * np.array([0.0, 0.0, 1.0]))
    lights = (
        Light("ambient", (0.35, 0.35, 0.35)),
        Light("directional", (0.45, 0.45, 0.45), direction=(-1.0, -0.6, -0.8)),
        Light("directional", (0.30, 0.30, 0.30), direction=(-0.2, 1.0, -0.7)),
    )
    cameras = []
    for name, place in zip(CAMERA_NAMES, (front, side, top), strict=True):
        focal = scale * _FOCAL_PX[name]
        K = np.array([[focal, 0.0, 0.5 * (width - 1)], [0.0, focal, 0.5 * (height - 1)], [0.0, 0.0, 1.0]])
        cameras.append(Camera(name, CameraModel(width, height, K), place))
    return CameraRig(tuple(cameras), lights=lights)
