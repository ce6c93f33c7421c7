"""A small body for tests of the ROS edge: three links, a ball joint, a weld, one of each shape."""

import numpy as np

from tracker_node.geometry import se3, so3
from tracker_node.model.articulated_model import ArticulatedModel, Landmark, Shape
from tracker_node.model.configuration import State
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain
from tracker_node.model.primitives import Box, Ellipsoid, Mesh, TruncatedCone
from tracker_node.tracking.estimate import CameraReport, Status, Timings, TrackEstimate


def placed(x: float, y: float, z: float, rotation_vector=(0.0, 0.0, 0.0)) -> np.ndarray:
    return se3.from_rotation_translation(so3.exp(np.array(rotation_vector)), np.array([x, y, z]))


def arm() -> ArticulatedModel:
    axes = (
        Axis("shoulder_x", (1.0, 0.0, 0.0), -1.0, 2.0),
        Axis("shoulder_y", (0.0, 1.0, 0.0)),
        Axis("shoulder_z", (0.0, 0.0, 1.0)),
    )
    joints = (
        Joint("shoulder", "trunk", "upper", placed(0.1, 0.2, 0.3, (0.2, -0.4, 0.6)), axes),
        Joint("elbow", "upper", "fore", placed(0.0, 0.0, 0.3), (Axis("elbow_flexion", (0.0, 1.0, 0.0), 0.0, 2.5),)),
        Joint("wrist", "fore", "hand", placed(0.0, 0.0, 0.25, (0.0, 0.3, 0.0))),
    )
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    shapes = (
        Shape("trunk", "trunk", Box((0.3, 0.2, 0.5))),
        Shape("upper", "upper", TruncatedCone(0.05, 0.04, -0.5, 0.0, 0.3), color_rgb=(200, 100, 50)),
        Shape("fore", "fore", Ellipsoid((0.04, 0.03, 0.12)), placed(0.0, 0.0, 0.12, (0.1, 0.2, 0.3))),
        Shape("hand", "hand", Mesh(corners, faces)),
    )
    chain = KinematicChain(("trunk", "upper", "fore", "hand"), joints)
    return ArticulatedModel("arm", chain, shapes, (Landmark("fingertip", "hand", (0.1, 0.0, 0.0)),))


def some_state(model: ArticulatedModel) -> State:
    angles = np.linspace(-0.5, 0.7, model.chain.n_axes)
    return State(placed(0.4, -1.2, 0.9, (0.5, -0.2, 1.1)), angles)


def some_estimate(model: ArticulatedModel, stamp_ns: int = 1_234_567_890_123) -> TrackEstimate:
    n = model.n_dof
    random = np.random.default_rng(3)
    root = random.normal(size=(n, n))
    return TrackEstimate(
        stamp_ns=stamp_ns,
        status=Status.DEGRADED,
        status_reason="few samples",
        state=some_state(model),
        velocity=random.normal(size=n),
        covariance=root @ root.T,
        score=12.5,
        residual_px=1.75,
        cameras=(CameraReport("left", stamp_ns, 1.5, 310), CameraReport("right", 0, 0.0, 0)),
        iterations=4,
        evaluations=6,
        timings=Timings(1.25, 2.5, 4.0),
    )
