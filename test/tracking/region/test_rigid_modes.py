"""Other poses of a rigid body, when they are tried, and what is said of them."""

import numpy as np
import pytest

from benchmark.contour.box import image_sets, rig_around
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.limbs.tree import thing_size
from tracker_node.tracking.region.rigid_modes import Misfit
from tracker_node.tracking.tracker import Tracker
from tracker_node.tracking.uncertainty.modes import TILTS, shifted, tilted


def test_tilts_keep_the_middle_and_turn_about_axes_across_the_sight():
    T_shape = se3.from_rotation_translation(np.eye(3), np.array([0.3, 0.1, -0.2]))
    model = ArticulatedModel("m", KinematicChain(("a",), ()), (Shape("s", "a", Box((0.2, 0.1, 0.3)), T_shape),))
    state = State.neutral(model, se3.exp(np.array([0.2, -0.1, 1.0, 0.3, 0.5, -0.4])))
    rig = circle_rig(3)

    def middle(s):
        return Configuration(model, s).Ts_world_shape[0, :3, 3]

    nearest = min(rig, key=lambda camera: np.linalg.norm(camera.center - middle(state)))
    sight = middle(state) - nearest.center
    turns = []
    for other in tilted(model, rig, state):
        assert np.allclose(middle(other), middle(state), atol=1e-12)
        turn = so3.log(other.T_world_root[:3, :3] @ state.T_world_root[:3, :3].T)
        assert abs(turn @ sight) < 1e-9
        assert min(abs(np.linalg.norm(turn) - angle) for angle in TILTS) < 1e-9
        turns.append(turn)
    assert np.linalg.norm(np.sum(turns, axis=0)) < 1e-9  # to all sides alike


def test_shifts_are_along_the_axes_of_the_nearest_camera_and_grow_with_the_body():
    model = ArticulatedModel("m", KinematicChain(("a",), ()), (Shape("s", "a", Box((0.2, 0.1, 0.3)), np.eye(4)),))
    assert thing_size(model) == pytest.approx(np.linalg.norm([0.2, 0.1, 0.3]))
    state = State.neutral(model, se3.exp(np.array([0.2, -0.1, 1.0, 0.3, 0.5, -0.4])))
    rig = circle_rig(3)
    nearest = min(rig, key=lambda camera: np.linalg.norm(camera.center - state.T_world_root[:3, 3]))
    moves = np.array([other.difference(state) for other in shifted(model, rig, state, thing_size(model))])
    assert np.allclose(moves[:, 3:], 0.0) and np.allclose(moves.sum(axis=0), 0.0, atol=1e-12)
    by_axis = moves[:, :3] @ nearest.T_cam_world[:3, :3].T
    assert np.allclose(np.sort(np.abs(by_axis), axis=1), np.tile([0.0, 0.0, 0.12 * thing_size(model)], (6, 1)), atol=1e-12)


@pytest.mark.parametrize("n_cameras", [1, 3])
def test_a_plate_that_one_camera_sees_may_be_tilted_to_the_other_side_and_that_is_said(n_cameras):
    shape = Shape("s", "a", Box((0.24, 0.17, 0.004)), np.eye(4), (200, 30, 30))
    plate = ArticulatedModel("m", KinematicChain(("a",), ()), (shape,))
    rig = rig_around([(0.0, 0.0), (70.0, 20.0), (-70.0, 20.0)][:n_cameras], distance_m=6.0, focal_px=2500.0)
    sight = rig.cameras[0].T_world_cam[:3, :3]
    T = se3.from_rotation_translation(sight @ so3.exp(np.radians([7.0, 0.0, 0.0])), np.zeros(3))
    mirrored = T.copy()
    mirrored[:3, :3] = sight @ so3.exp(np.radians([-7.0, 0.0, 0.0]))
    states = [State.neutral(plate, T)] * 6
    tracker = Tracker(rig, plate, from_dict({}), None, states[0])
    for one in image_sets(rig, plate, states):
        estimate = tracker.step(one)
    off = State.neutral(plate, mirrored).difference(estimate.state)[3:6]
    sigmas = np.sqrt(off @ np.linalg.solve(estimate.covariance[3:6, 3:6], off))
    right = np.degrees(np.linalg.norm(states[0].difference(estimate.state)[3:6]))
    if n_cameras == 1:
        assert estimate.status is Status.DEGRADED and sigmas < 4.0
    else:
        assert estimate.status is Status.TRACKING and sigmas > 10.0 and right < 0.5


def test_a_misfit_is_sudden_when_it_is_much_more_than_usual():
    misfit = Misfit()
    assert not any(misfit.is_sudden(value) for value in (0.1, 0.12, 0.09, 0.2, 0.11))
    assert misfit.is_sudden(0.5)
    assert misfit.is_sudden(0.5)  # and does not become usual at once
    assert not misfit.is_sudden(0.12)


def test_a_misfit_that_stays_becomes_usual():
    misfit = Misfit()
    assert not misfit.is_sudden(0.1)
    assert [misfit.is_sudden(0.5) for _ in range(6)] == [True] * Misfit.PATIENCE + [False] * 3
    assert misfit.is_sudden(2.0)


@pytest.mark.parametrize("growth", [1.03, 1.12])
def test_a_misfit_that_grows_slowly_is_not_sudden(growth):
    misfit = Misfit()
    values = 0.1 * growth ** np.arange(20)
    assert not any(misfit.is_sudden(float(value)) for value in values)
