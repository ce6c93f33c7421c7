"""The body of 18 ellipsoids: the parts and variables of the paper, in the project's conventions, told apart by color."""

import numpy as np
import pytest

from helpers.bodies.bodies import assert_same_body, mirrored_states
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.model.configuration import Configuration, State, to_variables, variable_names
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.measures import mirrored_name
from tracker_node.model.humans.segments18 import ellipsoid_human, equivalent_ellipsoid
from tracker_node.model.shapes.nurbs import Loft, Section, loft_mesh
from tracker_node.model.shapes.primitives import Ellipsoid

MODEL = ellipsoid_human()


def landmarks(model=MODEL, **angles_deg):
    state = State.neutral(model)
    for name, angle in angles_deg.items():
        state.joint_positions[model.chain.axis_index(name)] = np.deg2rad(angle)
    return dict(zip(model.landmark_names, Configuration(model, state).landmarks_world, strict=True))


def test_segments_joints_and_variables_are_those_of_the_paper():
    parts = [shape.name.removeprefix("left_").removeprefix("right_") for shape in MODEL.shapes]
    pairs = ("foot", "shank", "thigh", "shoulder", "upper_arm", "forearm", "hand")
    assert sorted(parts) == sorted([*pairs, *pairs, "pelvis", "torso", "chest", "head"])
    assert all(isinstance(shape.primitive, Ellipsoid) and shape.link == shape.name for shape in MODEL.shapes)
    assert len(MODEL.chain.joints) == 17
    assert {len(joint.axes) for joint in MODEL.chain.joints} == {3}
    assert len(variable_names(MODEL)) == len(to_variables(State.neutral(MODEL))) == 57


def test_joints_are_ball_joints():
    for joint in MODEL.chain.joints:
        directions = np.array([axis.direction for axis in joint.axes])
        assert abs(np.linalg.det(directions)) > 0.99  # three axes at right angles in the neutral pose
        assert all(axis.lower < axis.neutral < axis.upper for axis in joint.axes)


def test_the_root_is_the_top_of_the_pelvis():
    assert MODEL.chain.links[0] == "pelvis"
    assert np.allclose(MODEL.chain.offsets[MODEL.chain.link_index("torso")], np.eye(4))  # the torso begins in the root
    neutral = landmarks()
    assert 0.25 < neutral["neck"][2] < 0.30
    assert -0.30 < neutral["left_hip"][2] < -0.25


def test_proportions_are_those_of_a_man_of_that_stature():
    points = landmarks(left_shoulder_elevation_front=0, left_shoulder_elevation_back=0)
    floor = points["left_ankle"][2] - 0.070
    stature = points["head"][2] - floor
    assert np.isclose(stature, 1.81, atol=0.01)
    # Heights as shares of stature: Drillis & Contini (1966), within 3 percent of stature for a single person
    for name, share in {
        "left_hip": 0.530,
        "left_knee": 0.285,
        "left_shoulder": 0.818,
        "left_wrist": 0.485,
        "left_elbow": 0.630,
    }.items():
        assert abs((points[name][2] - floor) / stature - share) < 0.03, name
    assert points["left_shoulder"][1] > 0.15  # left is +y
    assert points["left_big_toe"][0] > 0.15  # toes forward


def test_landmarks_have_the_names_of_the_other_human():
    assert set(MODEL.landmark_names) == set(human_model().landmark_names)


@pytest.mark.parametrize("seed", range(3))
def test_equal_angles_on_both_sides_are_a_mirrored_pose(seed):
    state, mirrored = mirrored_states(MODEL, seed)
    names, shapes = MODEL.landmark_names, [shape.name for shape in MODEL.shapes]
    one, other = Configuration(MODEL, state), Configuration(MODEL, mirrored)
    for name, point in zip(names, one.landmarks_world, strict=True):
        assert np.allclose(other.landmarks_world[names.index(mirrored_name(name))], point * [1, -1, 1], atol=1e-12)
    for name, T in zip(shapes, one.Ts_world_shape, strict=True):
        assert np.allclose(other.Ts_world_shape[shapes.index(mirrored_name(name))][:3, 3], T[:3, 3] * [1, -1, 1], atol=2e-4)


@pytest.mark.parametrize(("angles", "landmark", "origin", "direction"), [
    ({"left_elbow_flexion": 90, "left_shoulder_elevation_front": 0, "left_shoulder_elevation_back": 0},
     "left_wrist", "left_elbow", (1, 0, 0)),
    ({"left_hip_flexion": 90}, "left_knee", "left_hip", (1, 0, 0)),
    ({"right_hip_abduction": 80}, "right_ankle", "right_hip", (0, -0.985, -0.174)),
    ({"right_knee_flexion": 90}, "right_ankle", "right_knee", (-1, 0, 0)),
    ({"right_shoulder_elevation_front": 180, "right_shoulder_elevation_back": 0}, "right_wrist", "right_shoulder", (0, 0, 1)),
    ({"left_shoulder_elevation_front": 90, "left_shoulder_elevation_back": 45}, "left_wrist", "left_shoulder", (0, 1, 0)),
])  # fmt: skip
def test_limbs_go_where_the_names_say(angles, landmark, origin, direction):
    points = landmarks(**angles)
    ray = points[landmark] - points[origin]
    assert np.allclose(ray / np.linalg.norm(ray), direction, atol=2e-3)


@pytest.mark.parametrize(("angle", "landmark", "direction"), [
    ("torso_flexion", "neck", (1, 0, 0)), ("chest_bend_right", "neck", (0, -1, 0)),
    ("chest_turn_left", "left_shoulder", (-1, 0, 0)),
    ("head_flexion", "head", (1, 0, 0)), ("head_turn_left", "nose", (0, 1, 0)),
    ("left_clavicle_elevation", "left_shoulder", (0, 0, 1)),
    ("right_clavicle_protraction", "right_shoulder", (1, 0, 0)), ("left_ankle_dorsiflexion", "left_big_toe", (0, 0, 1)),
    ("right_ankle_eversion", "right_small_toe", (0, -0.7, 0.7)), ("left_ankle_internal_rotation", "left_big_toe", (0, -1, 0)),
    ("left_knee_abduction", "left_ankle", (0, 1, 0)), ("right_knee_internal_rotation", "right_big_toe", (0, 1, 0)),
])  # fmt: skip
def test_small_turns_go_where_the_names_say(angle, landmark, direction):
    motion = landmarks(**{angle: 1.0})[landmark] - landmarks()[landmark]
    assert motion @ np.array(direction) > 0.7 * np.linalg.norm(motion) > 0.0


def test_hands_turn_where_the_names_say():
    """No landmark lies on a hand: its own axes tell. Palms face inward."""
    for angle, point, direction in (
        ("left_wrist_flexion", (0, 0, -1), (0, -1, 0)),  # the fingers toward the palm
        ("right_wrist_flexion", (0, 0, -1), (0, 1, 0)),
        ("left_wrist_radial_deviation", (0, 0, -1), (1, 0, 0)),  # toward the thumb, which is in front
        ("left_wrist_pronation", (1, 0, 0), (0, -1, 0)),  # the thumb inward: palm backward
    ):
        state = State(np.eye(4), np.zeros(51))
        state.joint_positions[MODEL.chain.axis_index(angle)] = 0.01
        T = Configuration(MODEL, state).Ts_world_link[MODEL.chain.link_index(angle.split("_")[0] + "_hand")]
        assert (T[:3, :3] @ point - point) @ direction > 0.009, angle


def adjacent():
    """Pairs of segments that meet, or that would be taken for each other: those of a joint, and left and right."""
    for joint in MODEL.chain.joints:
        yield joint.parent, joint.child
    for shape in MODEL.shapes:
        if shape.name.startswith("left_"):
            yield shape.name, mirrored_name(shape.name)


@pytest.mark.parametrize(("one", "other"), list(adjacent()))
def test_neighbors_and_sides_differ_in_color_and_in_normalized_color(one, other):
    colors = {shape.name: np.array(shape.color_rgb, dtype=float) for shape in MODEL.shapes}
    assert np.linalg.norm(colors[one] - colors[other]) > 75.0
    shares = {name: color / color.sum() for name, color in colors.items()}
    assert np.linalg.norm(shares[one] - shares[other]) > 0.15


def test_colors_are_bright_and_all_different():
    colors = [shape.color_rgb for shape in MODEL.shapes]
    assert len(set(colors)) == 18
    for color in colors:
        assert max(color) >= 180  # seen where light is weak
        assert min(color) < 0.6 * max(color)  # and of a hue
    assert MODEL.has_colors


def test_equivalent_ellipsoid_of_an_ellipsoid_is_itself():
    """Two domes on a thin disc are an ellipsoid of revolution, up to the chords of its mesh."""
    sphere = loft_mesh(Loft((Section(-0.0005, 0.1, 0.1, 0.03), Section(0.0005, 0.1, 0.1, 0.03)), (0.2, 0.2)), 96, 0.005)
    center, radii = equivalent_ellipsoid(sphere)
    assert np.allclose(center, [0.03, 0.0, 0.0], atol=1e-6)
    assert np.allclose(radii, [0.1, 0.1, 0.2], rtol=0.01)


def test_the_file_that_comes_with_the_package_is_this_body(repository):
    shipped = load_model(repository / "config" / "models" / "ellipsoid_human.yaml")
    assert_same_body(shipped, MODEL)
    for a, b in zip(shipped.shapes, MODEL.shapes, strict=True):
        assert a.primitive == b.primitive
