"""What the color benchmarks share: the ellipsoid human in three views of 768x576, drawn by a renderer that does not score."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracker_node.camera.rig import CameraRig
from tracker_node.experiments.somersault.scene import rigid_body, somersault_rig, somersault_states, somersault_variables
from tracker_node.experiments.target_images import TargetStudio
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.segments18 import ellipsoid_human
from tracker_node.synthesis.scenes.room import cluttered_background

POSTURE_DEG = {
    f"{side}_{axis}": degrees
    for side in ("left", "right")
    for axis, degrees in (("hip_flexion", 28.0), ("knee_flexion", 12.0), ("elbow_flexion", 75.0))
}


@dataclass(frozen=True, eq=False)
class ColorScene:
    """A body in the states ``truth``, and its BGR images, by state and camera."""

    model: ArticulatedModel
    rig: CameraRig
    truth: Sequence[State]
    images: Sequence[list[np.ndarray]]


def make_scene(n_states: int, clutter: bool = False, width: int = 768, backend: str = "pyrender") -> ColorScene:
    """The body in a somersault, ``n_states`` of its images; before black, or before another cluttered room for every state."""
    model, rig = rigid_body(ellipsoid_human(), POSTURE_DEG), somersault_rig(width)
    truth = somersault_states(model, somersault_variables(), {})
    truth = [truth[i] for i in np.linspace(0, len(truth) - 1, n_states).astype(int)]
    with TargetStudio(rig, backend, noise_levels=2.0 if clutter else 0.0) as studio:
        images = [
            studio.images(
                Configuration(model, state),
                [cluttered_background(camera, number) for camera in rig] if clutter else None, number,
            )
            for number, state in enumerate(truth)
        ]  # fmt: skip
    return ColorScene(model, rig, truth, images)


def displaced(state: State, distance_m: float, angle_rad: float, rng: np.random.Generator) -> State:
    """The state exactly so far off in position, and turned by exactly this angle, in random directions."""
    tangent = np.zeros(6 + len(state.joint_positions))
    for first, size in ((0, distance_m), (3, angle_rad)):
        direction = rng.normal(size=3)
        tangent[first : first + 3] = size * direction / np.linalg.norm(direction)
    return state.retract(tangent)


def root_error(state: State, truth: State) -> tuple[float, float]:
    """Distance in millimeters and angle in degrees between two roots."""
    tangent = state.difference(truth)
    return 1e3 * float(np.linalg.norm(tangent[:3])), float(np.degrees(np.linalg.norm(tangent[3:6])))
