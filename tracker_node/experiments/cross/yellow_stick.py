"""The YellowStick: a bright yellow cross of two rectangular prisms, the object of the color paper's video experiment.

The paper gives no dimensions; these are of a cross that a man can throw. Its four arms differ in length, so that no turn maps the
cross onto itself, and its prisms differ in breadth and thickness, so that no two faces lie in one plane.
"""

from __future__ import annotations

import numpy as np

from ...geometry import se3
from ...model.articulated import ArticulatedModel, Landmark, Shape
from ...model.kinematic_chain import KinematicChain
from ...model.shapes.primitives import Box

YELLOW_RGB = (250, 215, 30)
UP, DOWN = 0.38, 0.62  # metres from the crossing to the ends of the long prism
LEFT, RIGHT = 0.40, 0.25  # ... of the short one
LONG_SECTION = (0.060, 0.090)  # thickness (x) and breadth (y)
SHORT_SECTION = (0.045, 0.080)  # thickness (x) and breadth (z)


def yellow_stick() -> ArticulatedModel:
    """A rigid cross in the plane x = 0: origin in the crossing, the long prism along z, the short one along y."""
    long = Box((*LONG_SECTION, UP + DOWN))
    short = Box((SHORT_SECTION[0], LEFT + RIGHT, SHORT_SECTION[1]))
    shapes = (
        Shape("long", "cross", long, _at(0.0, 0.0, 0.5 * (UP - DOWN)), YELLOW_RGB),
        Shape("short", "cross", short, _at(0.0, 0.5 * (LEFT - RIGHT), 0.0), YELLOW_RGB),
    )
    landmarks = (
        Landmark("crossing", "cross", (0.0, 0.0, 0.0)),
        Landmark("top", "cross", (0.0, 0.0, UP)),
        Landmark("bottom", "cross", (0.0, 0.0, -DOWN)),
        Landmark("left_end", "cross", (0.0, LEFT, 0.0)),
        Landmark("right_end", "cross", (0.0, -RIGHT, 0.0)),
    )
    return ArticulatedModel("yellow_stick", KinematicChain(("cross",), ()), shapes, landmarks)


def _at(x: float, y: float, z: float) -> np.ndarray:
    return se3.from_rotation_translation(np.eye(3), np.round((x, y, z), 6))
