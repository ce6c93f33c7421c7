"""A cross of two boxes with unequal arms, for tests that need no more of it."""

import numpy as np

from tracker_node.geometry import se3
from tracker_node.model.articulated import ArticulatedModel, Landmark, Shape
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box

ENDS = {"top": (0.0, 0.0, 0.4), "bottom": (0.0, 0.0, -0.6), "left": (0.0, 0.38, 0.1), "right": (0.0, -0.28, 0.1)}


def cross() -> ArticulatedModel:
    """A stick of 1 m along z and an arm of 0.66 m along y; landmarks in the middle of the four ends."""
    shapes = (
        Shape("stick", "cross", Box((0.05, 0.05, 1.0)), at(0.0, 0.0, -0.1), (240, 215, 20)),
        Shape("arm", "cross", Box((0.05, 0.66, 0.05)), at(0.0, 0.05, 0.1), (240, 215, 20)),
    )
    landmarks = tuple(Landmark(name, "cross", position) for name, position in ENDS.items())
    return ArticulatedModel("cross", KinematicChain(("cross",), ()), shapes, landmarks)


def at(x: float, y: float, z: float) -> np.ndarray:
    return se3.from_rotation_translation(np.eye(3), np.array([x, y, z]))
