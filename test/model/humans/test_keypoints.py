"""What the detector's points are on the human."""

from itertools import pairwise

import numpy as np
import pytest

from helpers.bodies.bodies import crane
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import gait_human, human_model
from tracker_node.model.humans.keypoints import BLAZEPOSE, expected_offsets, relative_size
from tracker_node.model.humans.measures import HumanMeasures, mirrored_name
from tracker_node.model.humans.segments18 import ellipsoid_human
from tracker_node.model.shape_parameters import ShapeSpace
from tracker_node.observation.keypoints.blazepose import NAMES

HUMAN, GAIT = human_model(), gait_human()
KNUCKLES = {f"{side}_{name}" for side in ("left", "right") for name in ("index", "pinky", "thumb")}  # of hands that turn


def test_every_point_is_one_of_the_detectors_and_on_a_landmark_of_the_human():
    assert set(BLAZEPOSE) <= set(NAMES) and len(BLAZEPOSE) == 25
    assert {point.landmark for point in BLAZEPOSE.values()} <= set(GAIT.landmark_names)
    assert {name for name, point in BLAZEPOSE.items() if point.landmark not in HUMAN.landmark_names} == KNUCKLES


@pytest.mark.parametrize("name", BLAZEPOSE)
def test_the_sides_are_mirror_images(name):
    point, twin = BLAZEPOSE[name], BLAZEPOSE[mirrored_name(name)]
    assert mirrored_name(point.landmark) == twin.landmark
    np.testing.assert_array_equal(np.array(point.offset) * [1.0, -1.0, 1.0], twin.offset)
    assert point.sigma == twin.sigma and all(0.005 < sigma < 0.05 for sigma in point.sigma)


def test_points_are_where_they_are_on_a_person():
    """In neutral, looking along x with the left at y: ears behind and beside the nose, toes ahead of heels."""
    body, places = Configuration(GAIT, State.neutral(GAIT)), {}
    for name, point in BLAZEPOSE.items():
        row = GAIT.landmark_index(point.landmark)
        places[name] = body.landmarks_world[row] + body.Ts_world_link[GAIT.landmark_links[row], :3, :3] @ point.offset
    assert places["left_ear"][1] > 0.04 > -0.04 > places["right_ear"][1] and places["left_ear"][0] < places["nose"][0] - 0.05
    for side in ("left", "right"):
        assert places[f"{side}_foot_index"][0] > places[f"{side}_heel"][0] + 0.15
        heights = [places[f"{side}_{name}"][2] for name in ("shoulder", "hip", "knee", "ankle", "heel")]
        assert all(a > b for a, b in pairwise(heights))
        knuckles = {name: places[f"{side}_{name}"] - places[f"{side}_wrist"] for name in ("thumb", "index", "pinky")}
        assert knuckles["index"][0] > knuckles["pinky"][0] and min(knuckles["index"][2], knuckles["pinky"][2]) < -0.05
        assert knuckles["thumb"][2] > knuckles["index"][2]
        assert np.linalg.norm(places[f"{side}_hip"] - body.landmarks_world[GAIT.landmark_index(f"{side}_hip")]) < 0.06


@pytest.mark.parametrize("share", [0.8, 1.0, 1.25])
def test_size_is_that_of_trunk_and_leg(share):
    assert relative_size(human_model(HumanMeasures.of_stature(share * HumanMeasures().stature))) == pytest.approx(share)


def test_a_body_with_other_links_has_a_size_and_one_without_hips_that_of_the_default():
    assert relative_size(HUMAN) == pytest.approx(1.0) and 0.8 < relative_size(ellipsoid_human()) < 1.2
    assert relative_size(crane()) == 1.0


def test_points_are_offset_on_average_as_the_table_says_of_a_body_of_the_default_size():
    points = list(BLAZEPOSE.values())
    np.testing.assert_allclose(expected_offsets(HUMAN, points), [point.offset for point in points], atol=1e-12)
    large = human_model(HumanMeasures.of_stature(1.2 * HumanMeasures().stature))
    np.testing.assert_allclose(expected_offsets(large, points), [1.2 * np.array(point.offset) for point in points], atol=1e-6)
    np.testing.assert_array_equal(expected_offsets(crane(), points), [point.offset for point in points])


@pytest.mark.parametrize("thigh", [-0.15, 0.15])
def test_knees_are_marked_where_they_are_on_average_between_hip_and_ankle(thigh):
    space = ShapeSpace(HUMAN, True, ("length",))
    body = space.body(np.where(np.array(space.names) == "length thigh", thigh, 0.0))
    default, other = marked_knee(HUMAN), marked_knee(body)
    assert other == pytest.approx(default, abs=0.006)
    assert abs(joint_knee(body) - joint_knee(HUMAN)) > 0.03


def joint_knee(body: ArticulatedModel, offset: float = 0.0) -> float:
    """How far down the leg the left knee is, or what is beside it along z, as a fraction."""
    places = Configuration(body, State.neutral(body)).landmarks_world[:, 2]
    hip, knee, ankle = (places[body.landmark_index(f"left_{joint}")] for joint in ("hip", "knee", "ankle"))
    return float((hip - knee - offset) / (hip - ankle))


def marked_knee(body: ArticulatedModel) -> float:
    """The same of the detector's point."""
    return joint_knee(body, float(expected_offsets(body, [BLAZEPOSE["left_knee"]])[0, 2]))


PAIRS = (
    "left_knee right_knee", "front_paw_L front_paw_R", "paw_left paw_right", "L-ear R-ear", "l.eye r.eye", "leftPaw rightPaw",
    "LKnee RKnee", "earLeft earRight", "pawL pawR",
)  # fmt: skip


@pytest.mark.parametrize("pair", PAIRS)
def test_the_other_side_is_found_as_programs_name_it(pair):
    name, twin = pair.split()
    assert mirrored_name(name) == twin and mirrored_name(twin) == name


@pytest.mark.parametrize("name", ["nose", "tail_tip", "rump", "l5", "vertebra_l5", "bright", "LED", "Rump", "earlobe", "BALL"])
def test_names_without_a_side_stay(name):
    assert mirrored_name(name) == name
