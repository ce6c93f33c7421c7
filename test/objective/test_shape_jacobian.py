from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.bodies import crane, random_state
from helpers.cameras.camera_rigs import circle_rig
from helpers.numeric.finite_difference import assert_jacobian
from tracker_node.camera.rig import CameraRig
from tracker_node.geometry import se3
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.shape_parameters import ShapeSpace
from tracker_node.objective.shape_jacobian import (
    FOCAL,
    TIME,
    ContourLines,
    denormalized,
    landmarks_D_shape,
    line_residuals,
    linearize_lines,
    normalized,
)

BODIES = {"human": human_model, "crane": crane}


def _scene(name: str, seed: int = 2):
    """A body before cameras, lines at random points of its shapes, a shape that is not the given one."""
    rng = np.random.default_rng(seed)
    model, rig = BODIES[name](), circle_rig(3)
    state = replace(random_state(model, rng, 0.5), T_world_root=se3.exp(np.array([0.1, -0.2, 1.0, 0.2, 0.1, 0.5])))
    n = 40 * len(model.shapes)
    directions = rng.normal(size=(n, 2))
    lines = ContourLines(
        rng.integers(0, len(rig), n),
        rng.integers(0, len(model.shapes), n),
        np.column_stack([rng.uniform(-1.0, 1.0, (n, 2)), rng.uniform(0.0, 1.0, n)]),
        rng.uniform(100.0, 400.0, (n, 2)),
        directions / np.linalg.norm(directions, axis=1, keepdims=True),
        rng.normal(size=n),
        np.ones(n),
    ).sorted()
    space = ShapeSpace(model, symmetric=name == "human")
    return model, rig, state, lines, space, 0.1 * rng.normal(size=len(space)) * (space.sigmas > 0.0)


@pytest.mark.parametrize("name", BODIES)
def test_lines_by_shape_and_state(name):
    _, rig, state, lines, space, s = _scene(name)
    body = space.body(s)
    found = linearize_lines(lines, space, s, body, rig, [state] * len(rig))
    assert found.valid.mean() > 0.9

    def by_shape(step):
        return line_residuals(lines, space.body(s + step), rig, [state] * len(rig))[0]

    def by_state(step):
        return line_residuals(lines, body, rig, [state.retract(step)] * len(rig))[0]

    assert np.allclose(found.residuals, by_shape(np.zeros(len(space))), atol=1e-9)
    assert_jacobian(found.by_shape, by_shape, tolerance=1e-6)
    assert_jacobian(found.by_state, by_state, tolerance=1e-6)


def test_lines_by_camera():
    _, rig, state, lines, space, s = _scene("human")
    body, velocity = space.body(s), np.random.default_rng(4).normal(size=space.model.n_dof)
    found = linearize_lines(lines, space, s, body, rig, [state] * len(rig), velocity)

    def changed(step):
        cameras = []
        for camera in rig:
            K = camera.model.K.copy()
            K[:2, :2] *= np.exp(step[FOCAL])
            lens = type(camera.model)(640, 480, K, camera.model.distortion_model, camera.model.distortion)
            cameras.append(replace(camera, model=lens, T_world_cam=se3.inverse(se3.exp(step[:6]) @ camera.T_cam_world)))
        return line_residuals(lines, body, CameraRig(tuple(cameras)), [state.retract(step[TIME] * velocity)] * len(rig))[0]

    assert_jacobian(found.by_camera, changed, tolerance=1e-6)


@pytest.mark.parametrize("name", BODIES)
def test_landmarks_by_shape(name):
    _, _, state, _, space, s = _scene(name)
    configuration = Configuration(space.body(s), state)
    assert_jacobian(
        landmarks_D_shape(space, configuration),
        lambda step: Configuration(space.body(s + step), state).landmarks_world,
        tolerance=1e-7,
    )


def test_normalized_points_stay_on_a_surface_that_changes():
    model = human_model()
    space = ShapeSpace(model)
    other = space.body(0.1 * np.random.default_rng(0).normal(size=len(space)))
    points = np.random.default_rng(1).normal(size=(20, 3))
    for shape, changed in zip(model.shapes, other.shapes, strict=True):
        inner = normalized(shape.primitive, points)
        assert np.allclose(denormalized(shape.primitive, inner), points)
        if hasattr(shape.primitive, "k"):
            there = denormalized(changed.primitive, inner)
            radius = 1.0 + changed.primitive.k * there[:, 2]
            assert np.allclose(there[:, 0] / (changed.primitive.a * radius), inner[:, 0])


def test_a_body_of_zeros_is_the_given_one():
    model: ArticulatedModel = human_model()
    body = ShapeSpace(model).body(np.zeros(len(ShapeSpace(model))))
    a, b = Configuration(model, State.neutral(model)), Configuration(body, State.neutral(model))
    assert np.allclose(a.landmarks_world, b.landmarks_world, atol=1e-12)
    assert np.allclose(a.Ts_world_shape, b.Ts_world_shape, atol=1e-12)
