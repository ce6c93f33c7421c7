"""Profiles of motion: where two cameras agree, and what becomes of that when one of them is wrong."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.cameras.moving_balls import balls_rig
from tracker_node.doctor.motion import ImageMotion, agreement, agreements
from tracker_node.geometry import se3, so3

N = 30


@pytest.fixture(scope="module")
def cameras():
    return balls_rig(2).cameras


@pytest.fixture(scope="module")
def motions(cameras):
    """Motion of eight points in space, exact in every camera's pixels."""
    rng = np.random.default_rng(1)
    t = np.arange(N)[:, None, None]
    places = 0.8 * np.sin(0.12 * rng.uniform(1, 2, (8, 3)) * t + rng.uniform(0, 6, (8, 3)))
    result = {}
    for camera in cameras:
        pixels, seen = camera.project(places)
        assert seen.all()
        time_steps, points = np.indices(seen.shape)
        place = (time_steps * 8 + points).ravel()
        result[camera.name] = ImageMotion(
            pixels.reshape(-1, 2), time_steps.ravel(), place, np.ones(8 * N), np.ones(N, dtype=bool)
        )
    return result


def of(cameras, motions):
    return agreement(cameras[0], motions[cameras[0].name], cameras[1], motions[cameras[1].name])


def test_true_cameras_agree_fully_and_less_the_more_one_is_turned(cameras, motions):
    turned = []
    for degrees in (0.0, 0.3, 1.0, 3.0):
        turn = se3.from_rotation_translation(so3.exp(np.radians([degrees, 0.0, 0.0])), np.zeros(3))
        turned.append(of((cameras[0], replace(cameras[1], T_world_cam=cameras[1].T_world_cam @ turn)), motions))
    assert turned[0] > 0.999
    assert turned[0] > turned[1] > turned[2] > turned[3]


def test_the_world_is_free(cameras, motions):
    change = se3.from_rotation_translation(so3.exp(np.array([0.3, -1.0, 0.4])), np.array([5.0, -2.0, 1.0]))
    moved = tuple(replace(camera, T_world_cam=change @ camera.T_world_cam) for camera in cameras)
    assert of(moved, motions) == pytest.approx(of(cameras, motions), abs=1e-3)


def test_a_shift_in_time_is_undone_by_its_inverse(cameras, motions):
    late = {**motions, "cam2": motions["cam2"].shifted(-3)}
    assert of(cameras, late) < 0.8
    assert of(cameras, {**late, "cam2": late["cam2"].shifted(3)}) > 0.999
    assert not late["cam2"].valid[:3].any() and late["cam2"].valid[3:].all()


def test_mirroring_twice_is_nothing(motions):
    np.testing.assert_allclose(motions["cam1"].mirrored(320).mirrored(320).pixels, motions["cam1"].pixels)


def test_fewer_time_steps_and_those_that_are_too_few(cameras, motions):
    assert of(cameras, {name: motion.every(3) for name, motion in motions.items()}) > 0.999
    assert np.isnan(of(cameras, {name: motion.every(10) for name, motion in motions.items()}))


def test_all_pairs(cameras, motions):
    table = agreements(cameras, motions)
    assert np.isnan(np.diag(table)).all()
    assert table[0, 1] == table[1, 0] == pytest.approx(of(cameras, motions), rel=1e-12)
