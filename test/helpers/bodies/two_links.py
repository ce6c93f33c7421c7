"""An arm of two links before two cameras, for tests of objectives."""

import numpy as np

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain
from tracker_node.model.shapes.primitives import Ellipsoid, TruncatedCone


def two_links(hand: bool = True) -> ArticulatedModel:
    axes = (Axis("bend", (0.0, 1.0, 0.0), -2, 2), Axis("turn", (0.0, 0.0, 1.0), -2, 2))
    joint = Joint("elbow", "upper", "lower", se3.from_rotation_translation(np.eye(3), [0, 0, 0.3]), axes)
    shapes = (
        Shape("upper", "upper", TruncatedCone(0.05, 0.04, -0.5, 0.0, 0.3)),
        Shape("lower", "lower", TruncatedCone(0.04, 0.03, -0.8, 0.0, 0.25)),
        Shape("hand", "lower", Ellipsoid((0.03, 0.05, 0.08)), se3.from_rotation_translation(np.eye(3), [0, 0, 0.3])),
    )
    return ArticulatedModel("arm", KinematicChain(("upper", "lower"), (joint,)), shapes if hand else shapes[:2])


def cameras() -> list[Camera]:
    lens = CameraModel(640, 480, [[600, 0, 310], [0, 590, 250], [0, 0, 1]], "plumb_bob", [-0.2, 0.05, 1e-3, -2e-3, 0.0])
    front = se3.from_rotation_translation(so3.exp([-np.pi / 2, 0, 0]), [0.0, -2.0, 0.2])
    side = se3.from_rotation_translation(so3.exp([0, 0, -np.pi / 2]) @ so3.exp([-np.pi / 2, 0, 0]), [-2.0, 0.1, 0.3])
    return [Camera("front", lens, front), Camera("side", lens, side)]
