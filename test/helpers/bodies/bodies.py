"""Small bodies for tests."""

import numpy as np

from tracker_node.geometry import se3
from tracker_node.model.articulated import ArticulatedModel, Landmark, Shape
from tracker_node.model.configuration import State
from tracker_node.model.humans.measures import mirrored_name
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid, Mesh, TruncatedCone


def tetrahedron() -> Mesh:
    return Mesh(0.1 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.1]]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def crane() -> ArticulatedModel:
    """A base with an arm of two links, a hook welded to it and a second short arm; every kind of shape."""
    joints = (
        Joint(
            "shoulder", "base", "arm", se3.exp(np.array([0.1, 0.2, 0.3, 0.4, -0.3, 0.2])),
            (Axis("yaw", (0.0, 0.0, 1.0), -2.0, 2.0), Axis("pitch", (0.0, 1.0, 0.0), -1.5, 1.5, 0.2, 5.0)),
        ),
        Joint(
            "elbow", "arm", "forearm", se3.exp(np.array([0.0, 0.0, 0.5, 0.1, 0.0, 0.0])),
            (Axis("bend", (0.6, 0.8, 0.0), -0.1, 2.5),),
        ),
        Joint("weld", "forearm", "hook", se3.exp(np.array([0.0, 0.1, 0.4, 0.0, 1.2, 0.0]))),
        Joint("mast", "base", "flag", se3.exp(np.array([-0.2, 0.0, 0.3, 0.0, 0.0, 0.0])), (Axis("turn", (0.0, 0.0, -1.0)),)),
    )  # fmt: skip
    shapes = (
        Shape("foundation", "base", Box((0.5, 0.4, 0.2)), np.eye(4), (10, 20, 30)),
        Shape("boom", "arm", TruncatedCone(0.06, 0.05, -0.5, -0.05, 0.5), se3.exp(np.array([0.0, 0.0, 0.0, 0.1, 0.2, 0.3]))),
        Shape("counterweight", "arm", Ellipsoid((0.1, 0.2, 0.15)), se3.exp(np.array([0.0, -0.1, 0.0, 0.0, 0.0, 0.0]))),
        Shape("tip", "forearm", TruncatedCone(0.04, 0.04, 0.0, 0.0, 0.4)),
        Shape("plate", "flag", tetrahedron()),
    )
    landmarks = (
        Landmark("elbow", "arm", (0.0, 0.0, 0.5)),
        Landmark("end", "hook", (0.1, 0.02, 0.3)),
        Landmark("corner", "base", (0.25, 0.2, 0.1)),
        Landmark("mast_top", "flag", (0.0, 0.1, 0.3)),
    )
    return ArticulatedModel("crane", KinematicChain(("base", "arm", "forearm", "hook", "flag"), joints), shapes, landmarks)


def gantry() -> ArticulatedModel:
    """Slides and turns in turn, also within one joint."""
    slide = Axis("slide", (0.6, 0.0, 0.8), -0.4, 0.5, prismatic=True)
    lift = Axis("lift", (0.0, 0.0, 1.0), 0.0, 0.6, 0.1, 4.0, prismatic=True)
    joints = (
        Joint(
            "bridge", "base", "trolley", se3.exp(np.array([0.1, 0.2, 0.3, 0.4, -0.3, 0.2])),
            (slide, Axis("swing", (0.0, 1.0, 0.0))),
        ),
        Joint(
            "hoist", "trolley", "hook", se3.exp(np.array([0.0, 0.0, -0.2, 0.3, 0.0, 0.1])),
            (Axis("spin", (0.0, 0.0, 1.0)), lift, Axis("nod", (1.0, 0.0, 0.0))),
        ),
    )  # fmt: skip
    shapes = (Shape("beam", "base", Box((0.1, 0.1, 0.8))), Shape("cable", "hook", TruncatedCone(0.01, 0.01, 0.0, -0.3, 0.0)))
    landmarks = (Landmark("eye", "trolley", (0.0, 0.0, 0.1)), Landmark("end", "hook", (0.1, 0.02, 0.3)))
    return ArticulatedModel("gantry", KinematicChain(("base", "trolley", "hook"), joints), shapes, landmarks)


def random_state(model: ArticulatedModel, rng: np.random.Generator, share: float = 0.9) -> State:
    """A root pose anywhere, and joint angles within ``share`` of their limits."""
    middle, half = 0.5 * (model.chain.upper + model.chain.lower), 0.5 * (model.chain.upper - model.chain.lower)
    angles = middle + share * half * rng.uniform(-1.0, 1.0, model.chain.n_axes)
    return State(se3.exp(rng.normal(size=6)), angles)


def mirrored_states(human: ArticulatedModel, seed: int) -> tuple[State, State]:
    """A state at the origin, and the one with the same angles on the other side."""
    state = State(np.eye(4), random_state(human, np.random.default_rng(seed)).joint_positions)
    mirrored = State(np.eye(4), state.joint_positions.copy())
    for i, axis in enumerate(human.chain.axes):
        central = axis.name.endswith(("bend_right", "turn_left"))
        twin = axis.name if central else mirrored_name(axis.name)
        mirrored.joint_positions[human.chain.axis_index(twin)] = (-1.0 if central else 1.0) * state.joint_positions[i]
    return state, mirrored


def assert_same_body(shipped: ArticulatedModel, model: ArticulatedModel) -> None:
    """Everything but the shapes' geometry."""
    assert (shipped.name, shipped.landmarks) == (model.name, model.landmarks)
    assert shipped.chain.dof_names == model.chain.dof_names
    assert np.allclose(shipped.chain.offsets, model.chain.offsets, atol=1e-12)
    assert np.allclose(shipped.Ts_link_shape, model.Ts_link_shape, atol=1e-12)
    for a, b in zip(shipped.chain.axes, model.chain.axes, strict=True):
        assert np.allclose(a.direction, b.direction, atol=1e-12)
        assert np.allclose((a.lower, a.upper, a.neutral, a.stiffness), (b.lower, b.upper, b.neutral, b.stiffness), atol=1e-12)
    assert [(s.name, s.link, s.color_rgb) for s in shipped.shapes] == [(s.name, s.link, s.color_rgb) for s in model.shapes]
