"""The subject of the synthetic scenes: exact joints, constant bones, upright and dressed."""

import numpy as np
import pytest

from tracker_node.geometry import so3
from tracker_node.model.humans.human import human_model
from tracker_node.synthesis.motions.deepmimic import load_motion
from tracker_node.synthesis.subjects.mannequin import LANDMARKS, MannequinSubject

BONES = (
    ("left_shoulder", "left_elbow"), ("left_elbow", "left_wrist"), ("left_hip", "left_knee"), ("left_knee", "left_ankle"),
    ("right_shoulder", "right_elbow"), ("right_elbow", "right_wrist"), ("right_hip", "right_knee"),
    ("right_knee", "right_ankle"), ("left_hip", "right_hip"), ("left_shoulder", "neck"),
)  # fmt: skip


@pytest.fixture(scope="module")
def subject() -> MannequinSubject:
    return MannequinSubject(1.80)


def at(body, name: str) -> np.ndarray:
    return body.landmarks[LANDMARKS.index(name)]


def test_t_pose_stands_on_the_floor_with_arms_to_the_sides(subject):
    body = subject.t_pose()
    assert body.vertices[:, 2].min() == pytest.approx(0.0, abs=1e-9)
    assert body.vertices[:, 2].max() == pytest.approx(1.80, abs=0.01)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        arm = at(body, f"{side}_wrist") - at(body, f"{side}_shoulder")
        np.testing.assert_allclose(arm / np.linalg.norm(arm), [0.0, sign, 0.0], atol=1e-6)
    assert at(body, "head")[2] == pytest.approx(1.80, abs=0.01)


def test_bones_keep_their_length_through_a_motion(subject):
    bodies = list(subject.follow(load_motion("swing", 30.0, 8)))
    for start, end in BONES:
        lengths = [np.linalg.norm(at(body, end) - at(body, start)) for body in bodies]
        assert np.ptp(lengths) < 1e-6, (start, end)


def test_landmarks_lie_inside_the_skin_around_them(subject):
    """A joint center is the middle of the ring of skin about it, whatever the pose: truth and picture belong together."""
    rest = subject.t_pose()
    for body in subject.follow(load_motion("swing", 30.0, 5)):
        for name in ("left_elbow", "right_knee", "left_knee", "right_wrist"):
            near = np.linalg.norm(rest.vertices - at(rest, name), axis=1) < 0.06
            assert near.sum() > 50
            center = body.vertices[near].mean(axis=0)
            assert np.linalg.norm(center - at(body, name)) < 0.03, name


def test_rotations_of_segments_are_obeyed(subject):
    identity = dict.fromkeys(("pelvis", "torso", "head"), np.eye(3))
    for side in ("left", "right"):
        identity |= {f"{side}_{s}": np.eye(3) for s in ("thigh", "shank", "foot", "upper_arm", "forearm")}
    bend = so3.exp([0.0, -1.2, 0.0])  # flexion: what hangs swings to the front
    body = subject.pose(identity | {"left_forearm": bend}, np.zeros(3))
    upper = at(body, "left_elbow") - at(body, "left_shoulder")
    lower = at(body, "left_wrist") - at(body, "left_elbow")
    np.testing.assert_allclose(upper / np.linalg.norm(upper), [0.0, 0.0, -1.0], atol=1e-6)
    np.testing.assert_allclose(lower / np.linalg.norm(lower), [np.sin(1.2), 0.0, -np.cos(1.2)], atol=1e-6)
    turned = subject.pose({name: so3.exp([0.0, 0.0, 0.7]) for name in identity}, np.zeros(3))
    plain = subject.pose(identity, np.zeros(3))
    np.testing.assert_allclose(turned.landmarks, plain.landmarks @ so3.exp([0.0, 0.0, 0.7]).T, atol=1e-6)


def test_the_hips_are_where_they_are_put_and_feet_find_the_floor(subject):
    bodies = list(subject.follow(load_motion("swing", 30.0, 20)))
    lowest = np.array([body.vertices[:, 2].min() for body in bodies])
    assert np.percentile(lowest, 20) == pytest.approx(0.0, abs=1e-9) and lowest.min() > -0.05


def test_it_is_dressed(subject):
    colors, counts = np.unique(subject.colors_rgb, axis=0, return_counts=True)
    assert len(colors) >= 6 and counts.min() > 100
    assert subject.colors_rgb.shape == (24256, 3)


LIMBS = {"thigh": ("hip", "knee", 2), "shank": ("knee", "ankle", 2), "upper_arm": ("shoulder", "elbow", 1),
         "forearm": ("elbow", "wrist", 1)}  # fmt: skip


def test_a_suit_has_the_colors_of_the_parts_where_the_parts_are():
    colors = {shape.name: shape.color_rgb for shape in human_model().shapes}
    suit = MannequinSubject(1.80, colors)
    body = suit.t_pose()

    def of(part: str) -> np.ndarray:
        return body.vertices[(suit.colors_rgb == colors[part]).all(axis=1)]

    for side, sign in (("left", 1.0), ("right", -1.0)):
        for part, (start, end, axis) in LIMBS.items():
            low, high = sorted((at(body, f"{side}_{start}")[axis], at(body, f"{side}_{end}")[axis]))
            points = of(f"{side}_{part}")
            assert len(points) > 50
            assert ((points[:, axis] > low - 0.08) & (points[:, axis] < high + 0.08)).mean() > 0.95, part
            assert (sign * points[:, 1] > 0.0).mean() > 0.97
    heights = [of(part)[:, 2].mean() for part in ("pelvis", "abdomen", "torso", "neck")]
    assert heights == sorted(heights)
