"""Cameras and what moves in them: where it is, and how much each pair says of it."""

import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.doctor.motion import ImageMotion, agreement
from tracker_node.doctor.setup import Setup
from tracker_node.synthesis.scenes.scene import looking_at

LENS = CameraModel(320, 240, np.array([[300.0, 0.0, 159.5], [0.0, 300.0, 119.5], [0.0, 0.0, 1.0]]))
POINT = np.array([0.3, -0.2, 1.1])
N = 60


def camera(name, x, y, z=1.0, target=(0.0, 0.0, 1.0)):
    return Camera(name, LENS, looking_at(np.array([x, y, z], dtype=float), np.array(target)))


def motion(camera, places, valid=None):
    """Of points (n, 3) that are each there at one time step."""
    table = np.eye(len(places))
    return ImageMotion.of_table(
        camera.project(np.asarray(places))[0], table, np.ones(len(places), bool) if valid is None else valid
    )


def setup(*cameras, places=None):
    places = [POINT] * 3 if places is None else places
    return Setup.of(cameras, {one.name: motion(one, places) for one in cameras})


FRONT, SIDE, BACK, NEAR = camera("a", 0, -4), camera("b", 4, 0), camera("c", 0.02, 4), camera("d", 0.5, -4)


def test_the_center_is_where_the_lines_of_sight_meet():
    assert setup(FRONT, SIDE).center == pytest.approx(POINT, abs=1e-6)
    assert setup(FRONT, SIDE, BACK, NEAR).center == pytest.approx(POINT, abs=1e-6)


def test_a_camera_without_motion_has_no_part_in_the_center():
    blind = camera("e", 3, 3, target=(9.0, 0.0, 1.0))
    cameras = (FRONT, SIDE, blind)
    motions = {one.name: motion(one, [POINT] * 3) for one in (FRONT, SIDE)}
    nothing = ImageMotion.of_table(np.zeros((1, 2)), np.zeros((3, 1)), np.ones(3, bool))
    assert Setup.of(cameras, {**motions, "e": nothing}).center == pytest.approx(POINT, abs=1e-6)


def test_cameras_at_right_angles_are_trusted_and_those_that_face_each_other_are_not():
    weights = setup(FRONT, SIDE, BACK).weights
    assert np.array_equal(weights, weights.T)
    assert not np.diag(weights).any()
    assert weights[0, 1] == 1.0
    assert weights[0, 2] == pytest.approx(0.02)


@pytest.mark.parametrize(("degrees", "weight"), [(8.0, 0.02), (10.0, None), (20.0, None), (29.0, None), (31.0, 1.0)])
def test_trust_grows_with_the_sine_between_baseline_and_sight(degrees, weight):
    """Two cameras and the point are an isosceles triangle with this angle at both cameras."""
    reach = 3.0
    drop = reach * np.tan(np.radians(degrees))
    target = (0.0, 0.0, 1.0)
    left, right = camera("l", -reach, drop), camera("r", reach, drop)
    weights = setup(left, right, places=[np.array(target)] * 3).weights
    expected = weight if weight is not None else (np.sin(np.radians(degrees)) - 0.15) / 0.35
    assert weights[0, 1] == pytest.approx(expected, abs=1e-6)


def test_agreement_is_the_mean_with_all_others_by_their_weights():
    rng = np.random.default_rng(1)
    places = POINT + 0.4 * rng.standard_normal((N, 3))
    cameras = (FRONT, SIDE, NEAR)
    whole = setup(*cameras, places=places)
    pairs = [agreement(FRONT, whole.motions["a"], other, whole.motions[other.name]) for other in (SIDE, NEAR)]
    assert whole.agreement_of(0) == pytest.approx(np.average(pairs, weights=whole.weights[0, 1:]))
    assert np.isnan(setup(FRONT).agreement_of(0))
    unlike = whole.with_motions({"b": motion(SIDE, places[::-1])})
    assert unlike.agreement_of(0) < whole.agreement_of(0)
    assert unlike.motions["a"] is whole.motions["a"]


def test_one_camera_is_exchanged():
    moved = setup(FRONT, SIDE, NEAR).with_camera(1, BACK)
    assert [one.name for one in moved.cameras] == ["a", "c", "d"]


@pytest.mark.parametrize(("n", "kept"), [(10, 10), (40, 40), (79, 79), (80, 40), (130, 44)])
def test_long_motions_are_thinned(n, kept):
    motions = setup(FRONT, SIDE, places=[POINT] * n).thinned().motions
    assert {len(one.valid) for one in motions.values()} == {kept}
