"""The somersault flies as bodies fly, has the paper's ranges, and stays in view."""

import itertools

import numpy as np
import pytest

from tracker_node.errors import UnknownNameError
from tracker_node.experiments.free_flight import GRAVITY
from tracker_node.experiments.somersault.scene import (
    CAMERA_NAMES,
    DURATION,
    MASS,
    POSTURE_DEG,
    TAKE_OFF_HEIGHT,
    pose_angles,
    rigid_body,
    somersault_rig,
    somersault_states,
    somersault_variables,
)
from tracker_node.geometry import se3, so3
from tracker_node.model.configuration import Configuration, State, to_variables
from tracker_node.model.humans.segments18 import ellipsoid_human

BODY = ellipsoid_human()
RIGID = rigid_body(BODY, POSTURE_DEG)


def test_ranges_are_those_of_the_paper():
    size = np.ptp(somersault_variables(), axis=0)
    assert np.allclose(size[:3], [1.0, 0.01, 0.79], atol=1e-5)
    assert np.allclose(np.degrees(size[3:]), [360.0, 8.0, 180.0], atol=0.01)


def test_the_center_of_mass_falls_with_gravity_and_the_pelvis_turns_about_it():
    n = 401
    states = somersault_states(RIGID, somersault_variables(n), {})
    centers = np.array([se3.apply(state.T_world_root, MASS.center) for state in states])
    dt = DURATION / (n - 1)
    assert np.allclose(np.diff(centers, 2, axis=0) / dt**2, [0.0, 0.0, -GRAVITY], atol=1e-3)
    assert states[0].T_world_root[2, 3] == pytest.approx(TAKE_OFF_HEIGHT)
    assert np.abs(np.diff(somersault_variables()[:, 2])).max() < 0.17


def test_angular_momentum_is_lateral_and_constant():
    """From the angles alone, by differences."""
    rotations = [so3.from_somersault_tilt_twist(*row) for row in somersault_variables(401)[:, 3:]]
    momenta = []
    for before, after in itertools.pairwise(rotations):
        spin = so3.log(after @ before.T) * 400.0
        middle = so3.exp(0.5 * spin / 400.0) @ before
        momenta.append(middle @ MASS.inertia @ middle.T @ spin)
    size = np.linalg.norm(np.mean(momenta, axis=0))
    assert np.allclose(momenta, [0.0, size, 0.0], atol=1e-4 * size)


def test_mass_center_and_inertia_are_those_of_the_body_by_random_points():
    rng = np.random.default_rng(3)
    configuration = Configuration(BODY, State(np.eye(4), pose_angles(BODY, POSTURE_DEG)))
    points, weights = [], []
    for shape, T in zip(BODY.shapes, configuration.Ts_world_shape, strict=True):
        cube = rng.uniform(-1.0, 1.0, (8000, 3))
        ball = cube[(cube**2).sum(axis=1) <= 1.0]
        points.append(ball * shape.primitive.radii @ T[:3, :3].T + T[:3, 3])
        weights.append(np.full(len(ball), np.prod(shape.primitive.radii) / len(ball)))
    weight = np.concatenate(weights) / np.sum([w.sum() for w in weights])
    points = np.concatenate(points)
    assert np.allclose(weight @ points, MASS.center, atol=0.002)
    offset = points - weight @ points
    inertia = (weight @ (offset**2).sum(axis=1)) * np.eye(3) - np.einsum("n,ni,nj->ij", weight, offset, offset)
    assert np.allclose(inertia, MASS.inertia, atol=0.003)


def test_states_keep_their_joint_angles():
    variables = somersault_variables(11)
    states = somersault_states(BODY, variables, {"left_knee_flexion": 20.0})
    index = BODY.chain.axis_index("left_knee_flexion")
    for state, row in zip(states, variables, strict=True):
        assert state.joint_positions[index] == pytest.approx(np.deg2rad(20.0))
        assert np.allclose(to_variables(state, row)[:6], row)
    with pytest.raises(UnknownNameError, match="left_wing"):
        somersault_states(BODY, variables, {"left_wing": 1.0})


def test_a_rigid_body_is_where_the_posed_one_is():
    variables = somersault_variables(11)[4:5]
    posed = Configuration(BODY, somersault_states(BODY, variables, POSTURE_DEG)[0])
    stiff = Configuration(RIGID, somersault_states(RIGID, variables, {})[0])
    assert RIGID.chain.n_axes == 0 and np.allclose(stiff.Ts_world_shape, posed.Ts_world_shape)


@pytest.mark.parametrize("width", [768, 192])
def test_the_whole_flight_is_in_view(width):
    rig = somersault_rig(width)
    assert rig.names == CAMERA_NAMES and rig.cameras[0].model.height == width * 3 // 4
    for state in somersault_states(BODY, somersault_variables(41), POSTURE_DEG):
        points = Configuration(BODY, state).landmarks_world
        for camera in rig:
            pixels, valid = camera.project(points)
            assert valid.all()
            margin = 0.012 * width  # landmarks lie within the skin
            assert np.all((pixels > margin) & (pixels < [width - margin, camera.model.height - margin]))
