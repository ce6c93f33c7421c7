"""A first state from the points of one image set."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.detected_people import (
    HUMAN,
    NAMES,
    POINTS,
    off_m,
    person_at,
    places,
    posed,
    seen_by,
    standing,
    swapped,
    with_skeletons,
    without,
)
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.camera.rig import CameraRig
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import gait_human, human_model
from tracker_node.model.humans.keypoints import BLAZEPOSE
from tracker_node.model.humans.measures import HumanMeasures
from tracker_node.model.variants import without_links
from tracker_node.observation.keypoints.people import Person
from tracker_node.tracking.config import TrackerConfig, from_dict
from tracker_node.tracking.keypoints.fitting import KeypointFitting
from tracker_node.tracking.keypoints.modality import KeypointModality
from tracker_node.tracking.keypoints.people_groups import grouped, mirrored
from tracker_node.tracking.keypoints.start import PointStart, _focus, _mobility

RIG = circle_rig(3)
EXACT = {
    "keypoints.offset_scale": 0.02, "keypoints.sigma_fraction": 0.003, "motion.neutral_angle": 0.02, "motion.stay_angle": 0.0,
    "collision.enabled": False,
}  # fmt: skip
"""Offsets are known, and nothing else holds the body."""


def config(**more) -> TrackerConfig:
    return from_dict({"modalities": ["region", "keypoints"], **more})


def starting(made: TrackerConfig | None = None, rig=RIG) -> PointStart:
    made = made or config()
    modality = KeypointModality(rig, HUMAN, made.keypoints, BLAZEPOSE)
    return PointStart(rig, HUMAN, KeypointFitting(HUMAN, made, modality))


ONE = CameraRig(RIG.cameras[:1])


def off_across_m(one: State, other: State) -> float:
    """How far points are beside each other as the camera sees them, at most."""
    away = (places(one) - places(other)) @ ONE.cameras[0].T_cam_world[:3, :3].T
    return float(np.linalg.norm(away[:, :2], axis=1).max())


@pytest.mark.parametrize("seed", range(6))
def test_one_camera_places_the_body_by_its_size(seed):
    """Depths and the turn are those that the detector guesses; pixels hold what they tell."""
    true = posed(seed, share=0.2)
    person = with_skeletons(ONE, seen_by(ONE, true), true)[0]
    found = starting(config(**EXACT), ONE).find([(person,)])
    assert found is not None and off_across_m(found, true) < 0.02 and off_points_m(found, true).max() < 0.25


def test_without_guesses_one_camera_takes_the_body_to_be_as_far_as_its_longest_part_says():
    true = standing(0.2, 0.1, 0.3)
    found = starting(config(**EXACT), ONE).find([(seen_by(ONE, true)[0],)])
    assert found is not None and off_across_m(found, true) < 0.03 and off_points_m(found, true).max() < 0.4


def test_one_camera_without_any_length_to_go_by_says_nothing():
    true = standing(0.2, 0.1, 0.3)
    head = without(seen_by(ONE, true)[0], tuple(name for name in POINTS if name not in ("nose", "left_ear", "right_ear")))
    assert starting(config(**EXACT), ONE).find([(head,)]) is None


def test_one_of_several_cameras_waits_for_the_others_before_it_says_where_the_body_is():
    true = posed(2, share=0.2)
    person, made = with_skeletons(RIG, seen_by(RIG, true), true)[0], starting(config(**EXACT))
    found = [made.find([(person,), (), ()]) for _ in range(6)]
    assert found[:5] == [None] * 5 and found[5] is not None and off_across_m(found[5], true) < 0.02


def test_one_camera_waits_while_the_detector_is_unsure():
    true = posed(2, share=0.2)
    person, made = with_skeletons(ONE, seen_by(ONE, true), true)[0], starting(config(**EXACT), ONE)
    found = [made.find([(replace(person, score=0.6),)]) for _ in range(6)]
    assert found[:5] == [None] * 5 and found[5] is not None


def after_waiting(people) -> State | None:
    """The state where points disagree, which are waited for at first."""
    made = starting()
    return next((state for state in (made.find(people) for _ in range(6)) if state is not None), None)


def off_points_m(one: State, other: State) -> np.ndarray:
    return np.linalg.norm(places(one) - places(other), axis=1)


@pytest.mark.parametrize("seed", range(20))
def test_any_pose_is_found_within_millimeters_from_exact_points(seed):
    true = posed(seed)
    found = starting(config(**EXACT)).find([(person,) for person in seen_by(RIG, true)])
    assert found is not None and off_points_m(found, true).max() < 0.003


@pytest.mark.parametrize("model", [gait_human(), without_links(gait_human(), ["left_shank"])], ids=["whole", "one shank"])
def test_the_fuller_human_is_found_also_by_one_leg(model):
    """By all of the detector's points: what it takes for a lost shank's is no evidence."""
    made, true = config(**EXACT), posed(3)
    modality = KeypointModality(RIG, model, made.keypoints, BLAZEPOSE)
    found = PointStart(RIG, model, KeypointFitting(model, made, modality)).find([(person,) for person in seen_by(RIG, true)])
    assert found is not None
    here, there = Configuration(model, found).landmarks_world, Configuration(HUMAN, true).landmarks_world
    for name in ("right_ankle", "left_knee", "left_wrist", "right_shoulder"):
        assert np.linalg.norm(here[model.landmark_index(name)] - there[HUMAN.landmark_index(name)]) < 0.02, name


@pytest.mark.parametrize("seed", range(4))
def test_with_noise_and_offsets_that_are_not_known_it_is_found_within_centimeters(seed):
    rng, true = np.random.default_rng(seed), posed(seed)
    offsets = {n: np.array(BLAZEPOSE[n].offset) + np.array(BLAZEPOSE[n].sigma) * rng.normal(size=3) for n in POINTS}
    people = seen_by(RIG, true, rng, 2.0, offsets, stated_px=2.0)
    found = starting().find([(without(person, ("nose",)),) for person in people])
    assert found is not None and off_m(found, true).mean() < 0.03
    assert off_m(found, true).max() < 0.12


def test_a_camera_that_takes_left_for_right_does_no_harm():
    true = posed(3)
    people = seen_by(RIG, true)
    people[1] = swapped(people[1])
    found = starting(config(**EXACT)).find([(person,) for person in people])
    assert found is not None and off_points_m(found, true).max() < 0.003


def test_all_cameras_but_the_first_may_be_right():
    """Points meet whether all have exchanged left and right or none has: the body that suits tells."""
    true = posed(3)
    people = seen_by(RIG, true)
    people[0] = swapped(people[0])
    found = starting(config(**EXACT)).find([(person,) for person in people])
    assert found is not None and off_points_m(found, true).max() < 0.003


@pytest.mark.parametrize("wrong", [0, 2])
def test_a_camera_whose_left_and_right_were_grouped_wrongly_is_put_right(wrong):
    rig, true = circle_rig(4), posed(3)
    made = starting(config(**EXACT), rig)
    (group,) = grouped(rig, [(person,) for person in seen_by(rig, true)])
    persons = [mirrored(person) if i == wrong else person for i, person in enumerate(group.persons)]
    state, cost = made._fitted(replace(group, persons=tuple(persons)))
    assert off_points_m(state, true).max() < 0.003 and cost < 2.0 * made._fitted(group)[1] + 0.01


def shaken(people: list[Person], px: float, seed: int = 0) -> list[tuple[Person]]:
    """The same with points that are as far off as no network says."""
    rng = np.random.default_rng(seed)
    return [(replace(person, pixels=person.pixels + px * rng.normal(size=person.pixels.shape)),) for person in people]


def test_points_that_disagree_are_waited_for_but_not_for_ever():
    made, true = starting(), posed(3)
    people = seen_by(RIG, true)
    clear, shaky = [(person,) for person in people], shaken(people, 12.0)
    assert made.find(clear) is not None
    assert [made.find(shaky) is None for _ in range(7)] == [True] * 5 + [False, True]
    assert made.find(clear) is not None  # as soon as they agree
    assert [made.find(shaky) is None for _ in range(6)] == [True] * 5 + [False]
    assert made.find(shaky) is None
    made.reset()
    assert [made.find(shaky) is None for _ in range(6)] == [True] * 5 + [False]


def test_somebody_who_lies_or_stands_on_the_hands_is_found():
    for tilt in ((1.5, 0.0, 0.3), (0.0, 2.9, 0.0)):
        delta = np.zeros(HUMAN.n_dof)
        delta[3:6] = tilt
        true = standing(left_hip_flexion=30.0).retract(delta)
        true.T_world_root[:3, 3] = 0.0, 0.0, 0.9
        found = starting(config(**EXACT)).find([(person,) for person in seen_by(RIG, true)])
        assert found is not None and off_points_m(found, true).max() < 0.003


def test_cameras_look_where_their_axes_meet():
    np.testing.assert_allclose(_focus(RIG), [0.0, 0.0, 1.0], atol=1e-9)


@pytest.mark.parametrize("order", [1, -1])
def test_of_two_people_the_one_where_the_cameras_look_is_the_body(order):
    near, far = standing(0.2, 0.1, 0.6), standing(-0.7, 0.6, 2.0)
    lists = [(one, other)[::order] for one, other in zip(seen_by(RIG, near), seen_by(RIG, far), strict=True)]
    found = starting().find(lists)
    assert found is not None and off_m(found, near).mean() < 0.03


def test_somebody_whom_half_of_the_cameras_see_may_be_the_body_and_whom_fewer_see_may_not():
    rig = circle_rig(5)
    near, far = standing(0.2, 0.1, 0.6), standing(-0.7, 0.6, 2.0)
    one, other = seen_by(rig, near), seen_by(rig, far)
    for missing, expected in ((2, near), (3, far)):
        lists = [(b,) if i < missing else (a, b) for i, (a, b) in enumerate(zip(one, other, strict=True))]
        found = starting(rig=rig).find(lists)
        assert found is not None and off_m(found, expected).mean() < 0.03


def test_somebody_who_is_found_twice_is_where_more_cameras_see_it():
    """Though the other find lies nearer to where the cameras look."""
    true, twice = standing(0.4, 0.1, 0.6), standing(0.25, 0.06, 0.6)
    people, others = (seen_by(RIG, state, np.random.default_rng(1), 2.0) for state in (true, twice))
    found = starting().find([(people[0], others[0]), (people[1], others[1]), (people[2],)])
    assert found is not None and off_m(found, true).mean() < 0.05


def test_somebody_of_another_size_is_not_the_body_though_they_stand_where_the_cameras_look():
    child = human_model(HumanMeasures.of_stature(1.1))
    near, far = standing(0.0, 0.1, 0.6, child), standing(-0.7, 0.6, 2.0)
    near.T_world_root[2, 3] = 0.6
    lists = list(zip(seen_by(RIG, near, model=child), seen_by(RIG, far), strict=True))
    found = starting().find(lists)
    assert found is not None and off_m(found, far).mean() < 0.03


@pytest.mark.parametrize("seed", [1, 10, 34])
def test_limbs_that_are_bent_far_are_reached(seed):
    true = posed(seed, share=0.7)
    found = starting(config(**EXACT)).find([(person,) for person in seen_by(RIG, true)])
    assert found is not None and off_points_m(found, true).max() < 0.005


def test_a_limb_is_bent_to_the_middle_of_its_ranges_and_the_others_stay():
    made, state, chain = starting(), posed(3), HUMAN.chain
    for limb in made._limbs:
        bent, own = made._bent(state, limb), limb.dofs[6:]
        np.testing.assert_allclose(bent.joint_positions[own], 0.5 * (chain.lower + chain.upper)[own])
        np.testing.assert_array_equal(bent.joint_positions[~own], state.joint_positions[~own])
        np.testing.assert_array_equal(bent.T_world_root, state.T_world_root)
    assert len(made._limbs) == 5  # without the trunk


def test_points_that_are_not_numbers_do_no_harm():
    true = posed(5)
    people = [without(person, ("left_wrist", "nose", "right_hip")) for person in seen_by(RIG, true)]
    sure = [replace(person, scores=np.where(np.array(NAMES) == "nose", 1.0, person.scores)) for person in people]
    for given in (people, sure):
        found = starting(config(**EXACT)).find([(person,) for person in given])
        assert (
            found is not None and off_points_m(found, true)[[POINTS.index("left_knee"), POINTS.index("right_elbow")]].max() < 0.01
        )


def test_somebody_who_suits_the_body_is_taken_in_place_of_who_does_not():
    """The first group is of points that meet in space, but have no person's shape."""
    rng, true = np.random.default_rng(6), standing(0.0, 0.3)
    cloud = rng.uniform([-0.9, -0.9, 0.2], [0.9, 0.9, 1.9], (len(POINTS), 3))
    people = seen_by(RIG, true)
    strangers = [person_at(camera, cloud) for camera in RIG]
    found = starting().find([(strangers[0], people[0]), (people[1], strangers[1]), (strangers[2],)])
    assert found is not None and off_m(found, true).mean() < 0.03
    assert starting().find([(person,) for person in strangers]) is None


def test_one_camera_does_not_tell_where_anybody_is():
    people = seen_by(RIG, standing())
    assert starting().find([(people[0],), (), None]) is None
    assert starting().find([(people[0], people[0]), None, None]) is None
    assert starting().find([]) is None and starting().find([None, None, None]) is None


def test_two_cameras_do():
    true = standing(0.1, 0.2, 1.0, left_shoulder_elevation_front=40.0)
    people = seen_by(RIG, true)
    found = starting().find([(people[0],), (people[1],), None])
    assert found is not None and off_m(found, true).mean() < 0.04


def test_a_body_is_placed_by_four_points_at_least():
    """Where less than four of the body's points are seen by two cameras, others being none of its own."""
    true = standing()
    people = seen_by(RIG, true)
    table = {name: BLAZEPOSE[name] for name in ("left_hip", "right_hip", "left_shoulder")}
    made = config()
    modality = KeypointModality(RIG, HUMAN, made.keypoints, table)
    start = PointStart(RIG, HUMAN, KeypointFitting(HUMAN, made, modality))
    assert start.find([(person,) for person in people]) is None
    four = {**table, "right_shoulder": BLAZEPOSE["right_shoulder"]}
    modality = KeypointModality(RIG, HUMAN, made.keypoints, four)
    found = PointStart(RIG, HUMAN, KeypointFitting(HUMAN, made, modality)).find([(person,) for person in people])
    assert found is not None
    trunk = [HUMAN.landmark_index(name) for name in four]
    assert off_m(found, true)[trunk].mean() < 0.03


def test_points_that_joints_move_little_are_the_steadiest():
    modality = KeypointModality(RIG, HUMAN, config().keypoints, BLAZEPOSE)
    moved = dict(zip(modality.names, _mobility(HUMAN, modality.offsets.body), strict=True))
    for side in ("left", "right"):
        assert moved[f"{side}_hip"] < moved[f"{side}_knee"] < moved[f"{side}_ankle"]
        assert moved[f"{side}_shoulder"] < moved[f"{side}_elbow"] < moved[f"{side}_wrist"]
    steady = sorted(moved, key=moved.__getitem__)[:4]
    assert set(steady) == {"left_hip", "right_hip", "left_shoulder", "right_shoulder"}


def test_how_far_a_point_moves_by_differences():
    """Root of the sum of squares over joints of: meters a radian, times the joint's range, half a turn at most."""
    modality = KeypointModality(RIG, HUMAN, config().keypoints, BLAZEPOSE)
    body, chain, neutral = modality.offsets.body, HUMAN.chain, State.neutral(HUMAN)

    def at(state: State) -> np.ndarray:
        T = Configuration(HUMAN, state).Ts_world_link[body.links]
        return np.einsum("nij,nj->ni", T[:, :3, :3], body.positions + body.means) + T[:, :3, 3]

    squares = np.zeros(len(body))
    for axis in range(chain.n_axes):
        step = np.zeros(HUMAN.n_dof)
        step[6 + axis] = 1e-5
        slope = np.linalg.norm(at(neutral.retract(step)) - at(neutral.retract(-step)), axis=1) / 2e-5
        squares += (slope * min(chain.upper[axis] - chain.lower[axis], np.pi)) ** 2
    np.testing.assert_allclose(_mobility(HUMAN, body), np.sqrt(squares), rtol=1e-4, atol=1e-9)


def elsewhere(person: Person, names: tuple[str, ...], rng: np.random.Generator) -> Person:
    """Some of the points anywhere around where they are."""
    rows = [NAMES.index(name) for name in names]
    pixels = person.pixels.copy()
    pixels[rows] += rng.uniform(60.0, 200.0, (len(rows), 2)) * rng.choice([-1.0, 1.0], (len(rows), 2))
    return replace(person, pixels=pixels)


def test_half_of_the_points_have_to_be_no_outliers():
    true, rng = standing(), np.random.default_rng(2)
    few = tuple(name for name in POINTS if name.endswith(("nose", "ear", "elbow", "wrist")))
    found = after_waiting([(elsewhere(person, few, rng),) for person in seen_by(RIG, true)])
    assert found is not None
    legs = [HUMAN.landmark_index(f"{side}_{name}") for side in ("left", "right") for name in ("hip", "knee", "ankle")]
    assert off_m(found, true)[legs].mean() < 0.05
    assert after_waiting([(elsewhere(person, POINTS[3:], rng),) for person in seen_by(RIG, true)]) is None


@pytest.mark.parametrize("people", [(), [None], [()]])
def test_one_camera_in_which_nobody_is_seen_says_nothing(people):
    made = starting(rig=ONE)
    assert made.find(people) is None and made.candidates(people) == []
