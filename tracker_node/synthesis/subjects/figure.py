"""A figure of ten truncated elliptical cones with 22 degrees of freedom, and a fast motion of it.

Six degrees of freedom of the root (trunk, with the head fixed to it) and 16 joint angles: shoulders and hips 2 x 3, elbows and
knees 2 x 1. Neutral is standing with hanging arms; axes are those of the body (x forward, y left, z up), mirrored on the right
side as those of the human are.
"""

from __future__ import annotations

import numpy as np

from ...geometry import se3, so3
from ...model.articulated import ArticulatedModel, Landmark, Shape
from ...model.configuration import Configuration, State
from ...model.kinematic_chain import Joint, KinematicChain, axes_in_degrees
from ...model.shapes.primitives import TruncatedCone

_SIDES = (("left", 1.0), ("right", -1.0))  # name, and sign of y
UPPER_ARM_M, FOREARM_M, THIGH_M, SHANK_M = 0.30, 0.27, 0.43, 0.42
_TRUNK_BOTTOM_M, _TRUNK_TOP_M, _HEAD_TOP_M = -0.09, 0.48, 0.78
_HIP_HEIGHT_M = THIGH_M + SHANK_M + 0.04
_SHOULDER_M, _HIP_M = (0.0, 0.20, 0.44), (0.0, 0.095, -0.03)

COLORS_RGB = {
    "trunk": (176, 52, 46), "head": (212, 164, 136),
    "left_upper_arm": (48, 86, 160), "left_forearm": (226, 180, 58), "left_thigh": (62, 70, 104), "left_shank": (202, 118, 52),
    "right_upper_arm": (50, 128, 78), "right_forearm": (146, 84, 156), "right_thigh": (116, 88, 60),
    "right_shank": (64, 152, 164),
}  # fmt: skip

# Axes of the left side: name, direction, limits, middle of the motion and its amplitude, in degrees, frequency in Hz. Arms and
# legs stay off the trunk and each other; elbows and knees stay bent, as a nearly round cone tells its roll by what it carries.
_AXES: dict[str, tuple[tuple[str, tuple[float, float, float], tuple[float, float], float, float, float], ...]] = {
    "shoulder": (
        ("shoulder_flexion", (0.0, -1.0, 0.0), (-90.0, 200.0), 35.0, 16.0, 0.62),
        ("shoulder_abduction", (1.0, 0.0, 0.0), (-40.0, 180.0), 42.0, 9.0, 0.52),
        ("shoulder_internal_rotation", (0.0, 0.0, -1.0), (-120.0, 120.0), 0.0, 20.0, 0.74),
    ),
    "elbow": (
        ("elbow_flexion", (0.0, -1.0, 0.0), (-5.0, 155.0), 70.0, 33.0, 0.79),
    ),
    "hip": (
        ("hip_flexion", (0.0, -1.0, 0.0), (-60.0, 140.0), 22.0, 14.0, 0.56),
        ("hip_abduction", (1.0, 0.0, 0.0), (-45.0, 90.0), 16.0, 7.0, 0.45),
        ("hip_internal_rotation", (0.0, 0.0, -1.0), (-80.0, 80.0), 0.0, 12.0, 0.50),
    ),
    "knee": (
        ("knee_flexion", (0.0, 1.0, 0.0), (-10.0, 160.0), 45.0, 20.0, 0.62),
    ),
}  # fmt: skip
_STIFFNESS = 1.0  # 1/rad^2


def figure_model() -> ArticulatedModel:
    """The body; landmarks are its joints, the ends of its limbs, neck and head."""
    links = ["trunk"]
    joints: list[Joint] = []
    shapes = [
        _shape("trunk", "trunk", _cone((0.105, 0.150), 1.18, _TRUNK_BOTTOM_M, _TRUNK_TOP_M)),
        _shape("head", "trunk", _cone((0.070, 0.058), 1.35, _TRUNK_TOP_M, _HEAD_TOP_M)),
    ]
    landmarks = [Landmark("neck", "trunk", (0.0, 0.0, _TRUNK_TOP_M)), Landmark("head", "trunk", (0.0, 0.0, _HEAD_TOP_M))]
    rows_of = {joint: [(*axis[:3], _STIFFNESS, axis[3]) for axis in axes] for joint, axes in _AXES.items()}
    for side, sign in _SIDES:
        rows = (
            ("shoulder", "trunk", "upper_arm", _SHOULDER_M, (0.052, 0.042), 0.78, UPPER_ARM_M, None),
            ("elbow", "upper_arm", "forearm", (0.0, 0.0, -UPPER_ARM_M), (0.043, 0.033), 0.62, FOREARM_M, "wrist"),
            ("hip", "trunk", "thigh", _HIP_M, (0.086, 0.070), 0.66, THIGH_M, None),
            ("knee", "thigh", "shank", (0.0, 0.0, -THIGH_M), (0.060, 0.048), 0.60, SHANK_M, "ankle"),
        )
        for joint, parent, child, (x, y, z), radii, end_scale, length, end in rows:
            link, parent = f"{side}_{child}", parent if parent == "trunk" else f"{side}_{parent}"
            links.append(link)
            place = se3.from_rotation_translation(np.eye(3), np.array([x, sign * y, z]))
            joints.append(Joint(f"{side}_{joint}", parent, link, place, axes_in_degrees(rows_of[joint], f"{side}_", sign)))
            shapes.append(_shape(link, link, TruncatedCone(*radii, (1.0 - end_scale) / length, -length - 0.01, 0.02)))
            landmarks.append(Landmark(f"{side}_{joint}", parent, (x, sign * y, z)))
            if end:
                landmarks.append(Landmark(f"{side}_{end}", link, (0.0, 0.0, -length)))
    return ArticulatedModel("figure", KinematicChain(tuple(links), tuple(joints)), tuple(shapes), tuple(landmarks))


def _shape(name: str, link: str, cone: TruncatedCone) -> Shape:
    return Shape(name, link, cone, np.eye(4), COLORS_RGB[name])


def _cone(bottom: tuple[float, float], top: float, z1: float, z2: float) -> TruncatedCone:
    """Upright cone: half-axes ``bottom`` at z1, the ``top``-fold of them at z2."""
    k = (top - 1.0) / (z2 - top * z1)  # from (1 + k z2) = top (1 + k z1)
    return TruncatedCone(bottom[0] / (1.0 + k * z1), bottom[1] / (1.0 + k * z1), k, z1, z2)


def figure_motion(rate_hz: float = 30.0, n_images: int = 100, seed: int = 5) -> list[State]:
    """Every joint swings with a frequency of its own, the root sways and turns; `speeds` says how fast.

    ``seed`` decides phases, and frequencies within a tenth.

    Parameters
    ----------
    rate_hz : states per second.
    n_images : number of states.
    seed : of phases, and of frequencies within a tenth.

    Returns
    -------
    One state an image.
    """
    rng = np.random.default_rng(seed)
    by_name = {row[0]: row for axes in _AXES.values() for row in axes}
    rows = [by_name[axis.name.partition("_")[2]] for axis in figure_model().chain.axes]
    middle, amplitude = (np.deg2rad([row[i] for row in rows]) for i in (3, 4))
    frequency_hz = np.array([row[5] for row in rows]) * rng.uniform(0.9, 1.1, len(rows))
    phase = rng.uniform(0.0, 2.0 * np.pi, len(rows))
    t = np.arange(n_images) / rate_hz
    joints = middle + amplitude * np.sin(2.0 * np.pi * frequency_hz * t[:, None] + phase)
    sway_hz, sway_phase = rng.uniform(0.25, 0.45, 6), rng.uniform(0.0, 2.0 * np.pi, 6)
    curves = np.sin(2.0 * np.pi * sway_hz * t[:, None] + sway_phase)
    states = []
    for i in range(n_images):
        x, y, z, roll, pitch, turn = curves[i] * (0.08, 0.08, 0.03, 0.08, 0.08, 0.3)
        rotation = so3.exp([0.0, 0.0, turn]) @ so3.exp([roll, pitch, 0.0])
        pose = se3.from_rotation_translation(rotation, np.array([x, y, _HIP_HEIGHT_M + z]))
        states.append(State(pose, joints[i]))
    return states


def speeds(model: ArticulatedModel, states: list[State]) -> tuple[float, float]:
    """Largest motion from one state to the next.

    Parameters
    ----------
    model : the body.
    states : of the motion.

    Returns
    -------
    Of a landmark, meters.
    Of a link, radians.
    """
    bodies = [Configuration(model, state) for state in states]
    points = np.array([body.landmarks_world for body in bodies])
    turns = np.array([body.Ts_world_link[:, :3, :3] for body in bodies])
    steps = np.swapaxes(turns[:-1], -1, -2) @ turns[1:]
    angles = np.arccos(np.clip(0.5 * (np.trace(steps, axis1=-2, axis2=-1) - 1.0), -1.0, 1.0))
    return float(np.linalg.norm(np.diff(points, axis=0), axis=-1).max()), float(angles.max())
