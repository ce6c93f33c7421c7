"""Human motions as world rotations of segments, and a procedural one that needs no file.

Axes of a segment are those of the body that stands with hanging arms: x forward, y left, z up; there every rotation is identity.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ...geometry import so3

# Each segment after its parent; the names are those of the links of the tracker's human.
SEGMENT_PARENTS = {
    "pelvis": "", "torso": "pelvis", "head": "torso",
    "right_thigh": "pelvis", "right_shank": "right_thigh", "right_foot": "right_shank",
    "right_upper_arm": "torso", "right_forearm": "right_upper_arm",
    "left_thigh": "pelvis", "left_shank": "left_thigh", "left_foot": "left_shank",
    "left_upper_arm": "torso", "left_forearm": "left_upper_arm",
}  # fmt: skip
SEGMENTS = tuple(SEGMENT_PARENTS)

LEG_LENGTH = 0.25 * (1.686184 + 1.639480)  # metres from hip to ankle of the clips' skeleton (which is 4 times metric)
PROCEDURAL = "swing"


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion sampled at a constant rate.

    Parameters
    ----------
    name : for messages and file names.
    rate_hz : images per second.
    root_positions : (n, 3) metres, world with Z up: the point midway between the hips.
    rotations : (n, 13, 3, 3) ``R_world_segment`` in the order of `SEGMENTS`, body axes.
    leg_length : metres from hip to ankle of the skeleton for which the root positions hold.
    """

    name: str
    rate_hz: float
    root_positions: np.ndarray
    rotations: np.ndarray
    leg_length: float = LEG_LENGTH

    def __len__(self) -> int:
        return len(self.root_positions)

    @property
    def times_s(self) -> np.ndarray:
        """(n,) seconds from the first image."""
        return np.arange(len(self)) / self.rate_hz

    def of(self, segment: str) -> np.ndarray:
        """(n, 3, 3) world rotations of one segment."""
        return self.rotations[:, SEGMENTS.index(segment)]

    def centered(self) -> Motion:
        """The same motion moved horizontally, so that the middle of its extent is above the world's origin."""
        positions = self.root_positions.copy()
        positions[:, :2] -= 0.5 * (positions[:, :2].min(axis=0) + positions[:, :2].max(axis=0))
        return replace(self, root_positions=positions)


def chained(local: dict[str, np.ndarray]) -> np.ndarray:
    """World rotations (n, 13, 3, 3) from each segment's rotation (n, 3, 3) in its parent's axes."""
    world: dict[str, np.ndarray] = {}
    for segment, parent in SEGMENT_PARENTS.items():
        world[segment] = world[parent] @ local[segment] if parent else local[segment]
    return np.stack([world[segment] for segment in SEGMENTS], axis=1)


def heading(rotation: np.ndarray) -> np.ndarray:
    """The part of a rotation that turns about the world's vertical (swing-twist)."""
    return so3.exp([0.0, 0.0, 2.0 * np.arctan2(rotation[1, 0] - rotation[0, 1], 1.0 + np.trace(rotation))])


def swing(rate_hz: float = 30.0, n_images: int = 60) -> Motion:
    """A procedural motion: slow steps, swinging arms, the right arm raised once; smooth in every angle."""
    t = np.arange(n_images) / rate_hz
    phase = 2.0 * np.pi * 0.8 * t
    raised = 0.5 - 0.5 * np.cos(2.0 * np.pi * t / max(2.0, t[-1] if n_images > 1 else 2.0))
    forward = np.array([0.0, -1.0, 0.0])  # a flexion swings what hangs to the front
    angles = {
        "pelvis": (np.array([0.0, 0.0, 1.0]), 0.08 * np.sin(phase)),
        "torso": (np.array([0.0, 0.0, 1.0]), -0.16 * np.sin(phase)),
        "head": (np.array([0.0, 0.0, 1.0]), 0.25 * np.sin(0.5 * phase)),
    }
    for side, sign in (("right", 1.0), ("left", -1.0)):
        step = sign * np.sin(phase)
        lift = np.maximum(0.0, np.cos(phase + (0.0 if sign > 0 else np.pi))) ** 2
        angles[f"{side}_thigh"] = (forward, 0.35 * step + 0.15 * lift)
        angles[f"{side}_shank"] = (-forward, 0.12 + 0.6 * lift)
        angles[f"{side}_foot"] = (forward, 0.1 * step)
        angles[f"{side}_upper_arm"] = (forward, -0.35 * step)
        angles[f"{side}_forearm"] = (forward, 0.35 + 0.15 * step)
    angles["right_upper_arm"] = (forward, -0.35 * np.sin(phase) * (1.0 - raised) + 1.7 * raised)
    local = {s: Rotation.from_rotvec(a[:, None] * axis).as_matrix() for s, (axis, a) in angles.items()}
    # Hanging arms stand off the trunk by a few degrees.
    for side, sign in (("right", 1.0), ("left", -1.0)):
        local[f"{side}_upper_arm"] = local[f"{side}_upper_arm"] @ so3.exp([-0.12 * sign, 0.0, 0.0])
    ordered = {s: local[s] for s in SEGMENTS}
    roots = np.stack([0.35 * t, 0.02 * np.sin(phase), 0.86 + 0.01 * np.cos(2.0 * phase)], axis=1)
    return Motion(PROCEDURAL, float(rate_hz), roots, chained(ordered))
