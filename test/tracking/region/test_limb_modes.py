"""Other places of limbs, followed on an objective whose answer is known, and in images."""

import numpy as np
import pytest

from helpers.cameras.start_scenes import scene, standing
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import N_ROOT_DOF
from tracker_node.parallel import Workers
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.engines import contour_engine
from tracker_node.tracking.limbs.judge import LimbJudge

from .test_limb_search import REST, Felt, bent, index, prepared

ARM = "right_forearm"


def own(judge: LimbJudge, i: int, state: State) -> np.ndarray:
    return state.joint_positions[judge.limbs[i].dofs[N_ROOT_DOF:]]


def seen(state: State, images: Felt):
    """What the lines about a state say."""
    return images.part_evidence(state, 2.0)


def test_a_mode_is_taken_once_the_contours_of_two_sets_speak_for_it():
    judge, search = prepared()
    i, modes, truth = index(judge, ARM), search.modes, bent("right", 60.0, 30.0)
    modes.add(i, REST, [own(judge, i, bent("right", 55.0, 30.0))])
    images = Felt(truth)
    assert modes.followed == [i] and modes.follow(REST, seen(REST, images), images) == {}
    found = modes.follow(REST, seen(REST, images), images)[i]
    np.testing.assert_allclose(judge.tip(i, found), judge.tip(i, truth), atol=0.01)
    others = ~judge.limbs[i].dofs[N_ROOT_DOF:]
    np.testing.assert_array_equal(found.joint_positions[others], REST.joint_positions[others])


def test_a_mode_that_contours_speak_against_is_dropped():
    judge, search = prepared()
    i, modes, images = index(judge, ARM), search.modes, Felt(REST)
    modes.add(i, REST, [own(judge, i, bent("right", 80.0, 60.0))])
    for _ in range(3):
        assert modes.follow(REST, seen(REST, images), images) == {}
    assert modes.followed == []


def test_a_mode_that_ends_where_the_limb_does_is_dropped():
    judge, search = prepared()
    i, modes, truth = index(judge, ARM), search.modes, bent("right", 20.0, 10.0)
    modes.add(i, truth, [own(judge, i, bent("right", 39.5, 10.0))])
    assert modes.followed == [i]
    modes.follow(truth, seen(truth, Felt(truth)), Felt(truth))
    assert modes.followed == []


def test_a_mode_moves_on_with_the_images():
    """By 8 degrees a set it would be out of reach after two, if it stayed where it was fitted first."""
    judge, search = prepared()
    i, modes = index(judge, ARM), search.modes
    modes.add(i, REST, [own(judge, i, bent("right", 60.0, 30.0))])
    for flexion in np.arange(60.0, 101.0, 8.0):
        images = Felt(bent("right", flexion, 30.0))
        found = modes.follow(REST, seen(REST, images), images)
    np.testing.assert_allclose(judge.tip(i, found[i]), judge.tip(i, bent("right", flexion, 30.0)), atol=0.02)


def test_three_places_of_a_limb_that_are_apart_are_followed_the_first_ones_first():
    judge, search = prepared()
    i, modes = index(judge, ARM), search.modes
    flexions = (2.0, 60.0, 64.0, 110.0, 150.0, 85.0)  # the first is that of the limb, the third that of the second
    modes.add(i, REST, [own(judge, i, bent("right", flexion, 0.0)) for flexion in flexions])
    ends = [judge.tip(i, bent("right", flexion, 0.0)) for flexion in (60.0, 110.0, 150.0)]
    np.testing.assert_allclose(modes._ends(i, REST, modes._modes[i])[1:], ends, atol=1e-9)
    modes.drop(i)
    assert modes.followed == []
    modes.add(i, REST, [own(judge, i, REST)])
    assert modes.followed == []  # where the limb is, there is nothing to follow


def test_of_two_modes_that_become_one_the_second_is_dropped():
    judge, search = prepared()
    i, modes, truth = index(judge, ARM), search.modes, bent("right", 60.0, 0.0)
    modes.add(i, REST, [own(judge, i, bent("right", flexion, 0.0)) for flexion in (48.0, 71.0)])
    assert len(modes._modes[i]) == 2
    modes.follow(REST, seen(REST, Felt(truth)), Felt(truth))
    assert len(modes._modes[i]) == 1


@pytest.fixture(scope="module")
def wrong_arm():
    """An engine whose body was in place, with an arm elsewhere now; the search is switched off."""
    given = scene(3)
    true = standing(given.model, 0.05, -0.05, 0.4)
    made, images = contour_engine(given.rig, given.model, from_dict({"limb_search.poses": 0}), {}, Workers(1)), given.images(true)
    made.observe(images, made.begin(images, true))
    made.assess(made.fit(true, first=True), given.image_set(0, images))
    judge = made.judge.limbs
    i = index(judge, "right_hand")
    angles = true.joint_positions.copy()
    angles[given.model.chain.axis_index("right_shoulder_elevation_front")] += np.radians(-60.0)
    return given, true, State(true.T_world_root, angles), made, images, i


def test_an_arm_that_is_elsewhere_in_the_images_is_moved_there_and_said_until_then(wrong_arm):
    given, true, wrong, made, images, i = wrong_arm
    judge, modes = made.judge.limbs, made.solver._search.modes
    modes.add(i, wrong, [own(judge, i, true)])
    fits = []
    for _ in range(2):
        made.observe(images, wrong)
        fits.append(made.fit(wrong, first=False))
        assert judge.rivals[i] == (len(fits) == 1)
    off = [np.linalg.norm(judge.tip(i, fit.state) - judge.tip(i, true)) for fit in fits]
    assert off[0] > 0.2 and not fits[0].jumped
    assert off[1] < 0.06 and fits[1].jumped and not judge.rivals.any() and modes.followed == []
    apart = Configuration(given.model, fits[1].state).landmarks_world - Configuration(given.model, true).landmarks_world
    assert np.linalg.norm(apart, axis=1).mean() < 0.02


def test_two_arms_that_are_elsewhere_are_both_moved_in_the_same_set(wrong_arm):
    given, true, _, made, images, _ = wrong_arm
    judge, modes = made.judge.limbs, made.solver._search.modes
    angles = true.joint_positions.copy()
    arms = [index(judge, f"{side}_hand") for side in ("right", "left")]
    for side in ("right", "left"):
        angles[given.model.chain.axis_index(f"{side}_shoulder_elevation_front")] += np.radians(-60.0)
    wrong = State(true.T_world_root, angles)
    for i in arms:
        modes.add(i, wrong, [own(judge, i, true)])
    for _ in range(2):
        made.observe(images, wrong)
        fit = made.fit(wrong, first=False)
    assert modes.followed == [] and fit.jumped
    assert all(np.linalg.norm(judge.tip(i, fit.state) - judge.tip(i, true)) < 0.06 for i in arms)


def test_where_points_come_which_know_each_limb_no_mode_is_followed(wrong_arm):
    _, true, wrong, made, images, i = wrong_arm
    judge, modes = made.judge.limbs, made.solver._search.modes
    modes.add(i, wrong, [own(judge, i, true)])
    made.solver._pace.next_set(has_points=True)
    made.observe(images, wrong)
    made.fit(wrong, first=False)
    assert modes.followed == [] and not judge.rivals.any()
    made.solver._pace.reset()


def test_a_body_that_is_lost_has_no_modes(wrong_arm):
    _, true, wrong, made, images, i = wrong_arm
    judge, modes = made.judge.limbs, made.solver._search.modes
    modes.add(i, wrong, [own(judge, i, true)])
    judge.probabilities[:] = 0.9
    made.observe(images, true)
    made.fit(true, first=False)
    assert modes.followed == [] and not judge.rivals.any()
