"""Fits to detected points alone: how far they reach, what priors do, and how large the errors are beside their covariance."""

import numpy as np
import pytest

from helpers.bodies.detected_people import HUMAN, off_m, posed, seen_by, standing
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.model.configuration import State
from tracker_node.model.humans.keypoints import BLAZEPOSE
from tracker_node.model.kinematic_chain import N_ROOT_DOF
from tracker_node.objective.constraints.collision import CollisionObjective
from tracker_node.objective.constraints.prior import Prior
from tracker_node.observation.keypoints.people import rearranged
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.keypoints.fitting import KeypointFitting
from tracker_node.tracking.keypoints.modality import KeypointModality
from tracker_node.tracking.limbs.tree import limbs_of

RIG, TRUE = circle_rig(3), standing(0.1, 0.0, 0.5, left_shoulder_elevation_front=40.0, right_hip_flexion=25.0)
NO_PULL = {"motion.neutral_angle": 0.0, "motion.stay_angle": 0.0, "collision.enabled": False}
STATED_PX = 3.0


def fitting(rig=RIG, **more) -> KeypointFitting:
    config = from_dict({"modalities": ["region", "keypoints"], **more})
    return KeypointFitting(HUMAN, config, KeypointModality(rig, HUMAN, config.keypoints, BLAZEPOSE))


def taken(made: KeypointFitting, state: State = TRUE, **more) -> KeypointFitting:
    made.modality.set_images((), state, None, seen_by(made.modality._rig, state, **more))
    return made


def moved(by_m: float, by_rad: float, seed: int = 0) -> State:
    rng = np.random.default_rng(seed)
    delta = by_rad * rng.uniform(-1.0, 1.0, HUMAN.n_dof)
    delta[:3] = by_m * rng.uniform(-1.0, 1.0, 3)
    return TRUE.retract(delta)


@pytest.mark.parametrize("seed", range(3))
def test_the_first_fit_reaches_a_body_from_afar(seed):
    made, far = taken(fitting()), moved(0.3, 0.4, seed)
    first, later = (made.fit(far, at_first, None) for at_first in (True, False))
    assert off_m(far, TRUE).mean() > 0.1 and off_m(first.state, TRUE).mean() < 0.02
    assert first.iterations > later.iterations


def test_a_later_fit_follows_a_body_from_near_by():
    made = taken(fitting())
    assert off_m(made.fit(moved(0.02, 0.05), False, None).state, TRUE).mean() < 0.02


def test_the_last_stage_is_sharp_and_compares_the_cameras():
    made = taken(fitting())
    for first in (True, False):
        fit = made.fit(moved(0.02, 0.05), first, None)
        assert fit.comparison is not None and fit.comparison.state is fit.state and len(fit.comparison.cameras) == 3
        sharp = made.modality.correspond(fit.state, 1.0).linearize(fit.state)
        np.testing.assert_array_equal(fit.correspondences.linearize(fit.state).H, sharp.H)


def test_a_prior_that_is_sure_holds_the_body_and_a_vague_one_does_not():
    near = moved(0.02, 0.05)
    for information, off in ((1e8, 1e-3), (1e-3, 0.02)):
        fit = taken(fitting()).fit(near, False, Prior(near, np.full(HUMAN.n_dof, information)))
        assert off_m(fit.state, near if information > 1.0 else TRUE).mean() < off


def test_without_a_prior_the_start_holds_as_strongly_as_configured():
    near = moved(0.05, 0.1)
    held = taken(fitting(**{"motion.stay_position": 1e9, "motion.stay_angle": 1e9})).fit(near, False, None)
    assert off_m(held.state, near).max() < 1e-3
    given = Prior(TRUE, np.ones(HUMAN.n_dof))
    free = taken(fitting(**{"motion.stay_position": 1e9, "motion.stay_angle": 1e9})).fit(near, False, given)
    assert off_m(free.state, TRUE).mean() < 0.02  # a prediction is in its place


def test_joints_without_points_rest_in_the_neutral_pose():
    made = fitting(**{"motion.neutral_angle": 100.0})
    fit = made.fit(moved(0.0, 0.3), True, Prior(TRUE, np.full(HUMAN.n_dof, 1e-6)))
    neutral = State.neutral(HUMAN).joint_positions
    stiff = np.array([axis.stiffness for axis in HUMAN.chain.axes]) > 0.0
    assert np.abs(fit.state.joint_positions - neutral)[stiff].max() < 1e-3


@pytest.mark.parametrize("enabled", [True, False])
def test_parts_may_not_run_into_each_other_where_that_is_configured(enabled):
    fit = taken(fitting(**{"collision.enabled": enabled})).fit(TRUE, False, None)
    assert any(isinstance(each, CollisionObjective) for each in fit.objective.objectives) is enabled


def test_nothing_is_remembered():
    made = taken(fitting())
    assert made.restart() is False
    near = moved(0.02, 0.05)
    first = made.fit(near, False, None)
    made.remember(first, None)
    made.reset()
    np.testing.assert_array_equal(made.fit(near, False, None).state.to_values(), first.state.to_values())


def test_errors_are_as_large_as_the_covariance_says():
    """Noise, offsets and the prediction are drawn from what they are taken for; e H e has as many degrees as the body."""
    rng, squares, ends = np.random.default_rng(3), [], []
    spread = np.full(HUMAN.n_dof, 0.05)
    spread[:3] = 0.03
    state = posed(2, 0.4)
    for _ in range(40):
        made = fitting(**NO_PULL, **{"keypoints.sigma_fraction": 1e-4, "keypoints.outlier_fraction": 1e-4})
        points = made.modality.offsets.body
        offsets = {name: points.means[k] + np.sqrt(np.diag(points.covariances[k])) * rng.normal(size=3)
                   for k, name in enumerate(made.modality.names)}  # fmt: skip
        people = seen_by(RIG, state, rng, STATED_PX, offsets, stated_px=STATED_PX)
        made.modality.set_images((), state, None, people)
        predicted = state.retract(spread * rng.normal(size=HUMAN.n_dof))
        fit = made.fit(predicted, False, Prior(predicted, spread**-2.0))
        e = fit.state.difference(state)
        squares.append(e @ fit.equations.H @ e / HUMAN.n_dof)
        ends.append(np.linalg.inv(fit.equations.H)[:6, :6].trace())
    assert 0.85 < np.mean(squares) < 1.15 and np.max(squares) < 2.0
    assert np.mean(ends) < 0.5 * (spread[:6] ** 2).sum()  # and points say much more than the prediction


ABOUT = circle_rig(4)
ARMS = {"left_shoulder_elevation_front": 60.0, "left_elbow_flexion": 50.0, "right_shoulder_elevation_front": 40.0}
TWISTED = standing(0.1, 0.0, 0.6, **ARMS)


def end_on(made: KeypointFitting, state: State) -> dict[str, list[int]]:
    return {made.modality.names[pair[0]]: sorted(cameras) for pair, cameras in made.modality.end_on(state)}


def exchanged(people, joint: str, cameras) -> list:
    """People whose left and right of one joint a detector has taken for each other in these cameras."""
    rows = [people[0].names.index(f"{side}_{joint}") for side in ("left", "right")]
    order = np.arange(len(people[0].names))
    order[rows] = rows[::-1]
    return [rearranged(each, order.tolist()) if i in cameras else each for i, each in enumerate(people)]


def test_sides_of_the_trunk_can_be_taken_for_each_other_where_one_is_behind_the_other():
    made = taken(fitting(ABOUT), TWISTED)
    seen = end_on(made, TWISTED)
    assert set(seen) <= {"left_shoulder", "left_hip"} and seen["left_shoulder"]
    left, right = (made.modality.places(TWISTED)[made.modality.names.index(f"{side}_shoulder")] for side in ("left", "right"))
    for i, camera in enumerate(ABOUT):
        across = (left - right) @ camera.T_world_cam[:3, 0] / np.linalg.norm(left - right)
        assert (i in seen["left_shoulder"]) == (abs(across) < 0.6) or 0.5 < abs(across) < 0.7


@pytest.mark.parametrize("joint", ["shoulder", "hip"])
def test_sides_that_two_cameras_have_exchanged_are_told_by_the_limbs(joint):
    made, vague = fitting(ABOUT), Prior(TWISTED, np.full(HUMAN.n_dof, 1e-3))
    right = taken(made, TWISTED).fit(TWISTED, False, vague)
    cameras = end_on(made, TWISTED)[f"left_{joint}"]
    wrong = exchanged(seen_by(ABOUT, TWISTED), joint, cameras)
    made.modality.set_images((), TWISTED, None, wrong)
    misled = made._staged(TWISTED, False, vague)
    fit = made.fit(TWISTED, False, vague)
    assert len(cameras) == 2 and off_m(misled.state, right.state).max() > 0.03
    assert off_m(fit.state, right.state).max() < 0.002
    assert fit.comparison is not None and fit.comparison.state is fit.state


def test_sides_that_are_right_stay():
    made = fitting(ABOUT)
    made.modality.set_images((), TWISTED, None, seen_by(ABOUT, TWISTED, np.random.default_rng(3), 3.0))
    before = made.modality._observed
    made.fit(TWISTED, False, None)
    np.testing.assert_array_equal(made.modality._observed, before)


def bent(**degrees: float) -> State:
    """The true state with single joints elsewhere."""
    state = State(TRUE.T_world_root.copy(), TRUE.joint_positions.copy())
    for name, angle in degrees.items():
        state.joint_positions[HUMAN.chain.axis_index(name)] += np.radians(angle)
    return state


def test_a_limb_alone_goes_where_its_points_are_however_far_that_is():
    made, (arm,) = taken(fitting()), [limb for limb in limbs_of(HUMAN) if limb.name == "left_hand"]
    wrong = bent(left_shoulder_elevation_front=-120.0, left_elbow_flexion=110.0)
    found = made.limb_elsewhere(wrong, arm.dofs)
    assert found is not None and off_m(wrong, TRUE).max() > 0.3 > 0.06 > off_m(found, TRUE).max()
    others = ~arm.dofs[N_ROOT_DOF:]
    np.testing.assert_allclose(found.joint_positions[others], wrong.joint_positions[others], atol=1e-6)
    np.testing.assert_allclose(found.T_world_root, wrong.T_world_root, atol=1e-6)
    assert made.limb_elsewhere(found, arm.dofs) is None  # it is there
    right_arm = next(limb for limb in limbs_of(HUMAN) if limb.name == "right_hand")
    moved_too = made.limb_elsewhere(wrong, right_arm.dofs)
    assert moved_too is None or off_m(moved_too, TRUE).max() > 0.3  # nor does another limb help
