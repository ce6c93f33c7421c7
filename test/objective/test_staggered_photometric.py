"""Alignment of cameras that expose at different instants."""

import numpy as np
import pytest
from late_camera import LATE, MODEL, RIG, STATE, VELOCITY, images

from tracker_node.objective.photometric import PhotometricObjective, PhotometricOptions
from tracker_node.objective.staggered_photometric import StaggeredPhotometricObjective
from tracker_node.optimize.alignment import AlignmentOptions, align

OPTIONS = PhotometricOptions("raw", levels=2)
OFF = np.array([0.012, -0.008, 0.01, 0.02, -0.015, 0.02])


def objective(late_s, velocity=VELOCITY) -> StaggeredPhotometricObjective:
    result = StaggeredPhotometricObjective(MODEL, RIG, late_s, OPTIONS)
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
