"""Alignment of cameras that expose at different instants."""

import numpy as np
import pytest

from helpers.cameras.late_camera import LATE, MODEL, RIG, STATE, VELOCITY, images
from tracker_node.objective.color.alignment import PhotometricObjective, PhotometricOptions
from tracker_node.objective.color.asynchronous import AsynchronousPhotometricObjective
from tracker_node.optimize.alignment import AlignmentOptions, align

OPTIONS = PhotometricOptions("raw", levels=2)
OFF = np.array([0.012, -0.008, 0.01, 0.02, -0.015, 0.02])


def objective(late_s, velocity=VELOCITY) -> AsynchronousPhotometricObjective:
    result = AsynchronousPhotometricObjective(MODEL, RIG, late_s, OPTIONS)
    result.set_images(images(LATE))
    result.velocity = velocity
    return result


def test_without_delays_it_is_the_plain_problem():
    plain = PhotometricObjective(MODEL, RIG, OPTIONS)
    plain.set_images(images(LATE))
    for level in (0, 1):
        expected, got = (o.at_level(level).linearize(STATE.retract(OFF)) for o in (plain, objective((0.0, 0.0, 0.0))))
        np.testing.assert_allclose(got.H, expected.H, rtol=1e-6)
        np.testing.assert_allclose(got.g, expected.g, rtol=1e-6)
        assert (got.cost, got.count) == (pytest.approx(expected.cost, rel=1e-6), expected.count)


def test_parts_add_up_where_each_camera_sees_the_body():
    whole = objective(LATE).at_level(0).linearize(STATE)
    total, count = 0.0, 0
    for i, late in enumerate(LATE):
        alone = PhotometricObjective(MODEL, RIG.subset([RIG.names[i]]), OPTIONS)
        alone.set_images([images(LATE)[i]])
        part = alone.at_level(0).linearize(STATE.retract(late * VELOCITY))
        total, count = total + part.cost, count + part.count
    assert whole.count == count and whole.cost == pytest.approx(total, rel=1e-3)


@pytest.mark.parametrize("dropped", [None, 0])
def test_split_into_parts_it_stays_the_plain_problem(dropped):
    """Delays of a nanosecond make every camera a part; one of them may give no image, or lose sight of the body."""
    shown = [None if i == dropped else image for i, image in enumerate(images((0.0, 0.0, 0.0)))]
    plain, split = PhotometricObjective(MODEL, RIG, OPTIONS), objective((0.0, 1e-9, 2e-9))
    for made in (plain, split):
        made.set_images(shown)
    sideways = 1.2 * RIG.cameras[1].T_world_cam[:3, 0]
    levels, costs = [made.at_level(1) for made in (plain, split)], []
    for change in (np.zeros(6), OFF, np.r_[sideways, np.zeros(3)]):
        expected, got = (level.linearize(STATE.retract(change)) for level in levels)
        np.testing.assert_allclose(got.H, expected.H, rtol=1e-4, atol=1e-6 * np.abs(expected.H).max())
        np.testing.assert_allclose(got.g, expected.g, rtol=1e-3, atol=1e-5 * np.abs(expected.g).max())
        assert (got.cost, got.count) == (pytest.approx(expected.cost, rel=1e-4), expected.count)
        costs.append(got.cost)
    assert np.isfinite(costs).all() and costs[0] == min(costs)


def test_too_little_in_all_cameras_together_is_infinite():
    away = STATE.retract(np.array([50.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert np.isinf(objective(LATE).at_level(0).linearize(away).cost)
    pixels = objective(LATE).at_level(0).linearize(STATE).count // 3
    for few, finite in ((pixels, True), (pixels + 1, False)):
        made = AsynchronousPhotometricObjective(MODEL, RIG, LATE, PhotometricOptions("raw", min_pixels=few, levels=1))
        made.set_images(images(LATE))
        made.velocity = VELOCITY
        assert np.isfinite(made.at_level(0).linearize(STATE).cost) == finite


def test_a_known_delay_brings_the_alignment_nearer_to_the_truth():
    late, errors, costs = (0.0, 0.0, 0.02), [], []
    for velocity in (VELOCITY, None):
        seen = objective(late, velocity)
        seen.set_images(images(late))
        found = align(seen, STATE.retract(OFF), MODEL.chain, AlignmentOptions(coarsest=1))
        errors.append(np.linalg.norm(found.state.difference(STATE)))
        costs.append(found.equations.cost)
    assert errors[0] < 0.5 * errors[1] and costs[0] < 0.5 * costs[1], (errors, costs)
    assert objective(LATE).n_levels == 2
