"""Offsets of detected points, followed: one set exactly, several to the true ones, and what is not seen stays as it was."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from helpers.bodies.detected_people import HUMAN, POINTS, posed, seen_by
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.model.humans.keypoints import BLAZEPOSE
from tracker_node.objective.keypoints.correspondences import BodyPoints, PointsAt
from tracker_node.tracking.config import KeypointConfig
from tracker_node.tracking.keypoints.modality import KeypointModality, PointOffsets

RNG = np.random.default_rng(5)
CONFIG = KeypointConfig(wobble_m=0.02, correlation_sets=4.0, least_offset_sigma_m=1e-4)


def positive(scale: float) -> np.ndarray:
    half = RNG.normal(size=(3, 3))
    return scale * (half @ half.T + np.eye(3))


MEANS = 0.01 * RNG.normal(size=(3, 3))
COVARIANCES = np.array([positive(1e-4) for _ in range(3)])
INFORMATION = np.array([positive(2e3) for _ in range(3)])
ALONE = 0.02 * RNG.normal(size=(3, 3))  # where the images alone have the points
EVERYTHING = np.ones(3, dtype=bool)


def offsets(config: KeypointConfig = CONFIG) -> PointOffsets:
    return PointOffsets(BodyPoints(HUMAN, np.arange(3), np.zeros((3, 3)), MEANS, COVARIANCES), config)


def seen(body: BodyPoints, weights: Any = ((1.0, 1.0),) * 3, information: np.ndarray = INFORMATION) -> PointsAt:
    """The points at their best offsets, as the fit has them: between the belief and the images."""
    best = [
        np.linalg.solve(A + prior, A @ alone + prior @ mean)
        for A, prior, alone, mean in zip(information, body.priors, ALONE, body.means, strict=True)
    ]
    nothing = None, None, None, None
    return PointsAt(*nothing, np.array(best), information, np.array(weights), np.zeros((3, 2)))  # type: ignore[arg-type]


def test_a_set_counts_with_its_wobble_and_as_one_in_so_many():
    made = offsets()
    made.update(seen(made.body), EVERYTHING)
    for k in range(3):
        says = np.linalg.inv(np.linalg.inv(INFORMATION[k]) + CONFIG.wobble_m**2 * np.eye(3)) / CONFIG.correlation_sets
        prior = np.linalg.inv(COVARIANCES[k])
        np.testing.assert_allclose(made.body.covariances[k], np.linalg.inv(prior + says), rtol=1e-6)
        expected = np.linalg.solve(prior + says, prior @ MEANS[k] + says @ ALONE[k])
        np.testing.assert_allclose(made.body.means[k], expected, atol=1e-9)


def test_a_point_that_is_not_trusted_or_an_outlier_everywhere_stays():
    made = offsets()
    made.update(seen(made.body, ((0.5, -1.0), (0.1, 0.51), (1.0, 1.0))), np.array([True, True, False]))
    changed = np.abs(made.body.means - MEANS).max(axis=1) > 0.0
    assert changed.tolist() == [False, True, False]
    np.testing.assert_array_equal(made.body.covariances[[0, 2]], COVARIANCES[[0, 2]])


def test_images_that_say_nothing_leave_the_belief_as_it_is():
    made = offsets()
    made.update(seen(made.body, information=np.zeros((3, 3, 3))), EVERYTHING)
    np.testing.assert_allclose(made.body.means, MEANS, atol=1e-12)
    np.testing.assert_allclose(made.body.covariances, COVARIANCES, rtol=1e-9)


def test_no_belief_is_surer_than_the_least():
    made = offsets(KeypointConfig(wobble_m=0.0, correlation_sets=1.0, least_offset_sigma_m=0.004))
    for _ in range(20):
        made.update(seen(made.body), EVERYTHING)
    values = np.linalg.eigvalsh(made.body.covariances)
    assert values[:, 0] == pytest.approx(0.004**2) and np.abs(made.body.means - ALONE).max() < 2e-3
    np.testing.assert_allclose(made.body.covariances, np.swapaxes(made.body.covariances, 1, 2), atol=1e-15)


def test_a_reset_goes_back_to_what_was_expected():
    made = offsets()
    made.update(seen(made.body), EVERYTHING)
    made.reset()
    np.testing.assert_array_equal(made.body.means, MEANS)
    np.testing.assert_array_equal(made.body.covariances, COVARIANCES)


def true_offsets() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(8)
    return {name: np.array(BLAZEPOSE[name].offset) + np.array(BLAZEPOSE[name].sigma) * rng.normal(size=3) for name in POINTS}


def test_offsets_are_found_from_several_sets_in_which_the_body_is_known():
    rig, true = circle_rig(4), true_offsets()
    made = KeypointModality(rig, HUMAN, KeypointConfig(correlation_sets=1.0, sigma_fraction=1e-3, wobble_m=0.005), BLAZEPOSE)
    wanted = np.array([true[name] for name in made.names])
    before = np.linalg.norm(made.offsets.body.means - wanted, axis=1)
    off = [before.mean()]
    for seed in range(24):
        state = posed(seed)
        made.set_images((), state, None, seen_by(rig, state, offsets=true))
        made.learn((), state, None)
        off.append(np.linalg.norm(made.offsets.body.means - wanted, axis=1).mean())
    assert off[0] > 0.015 and all(b < a for a, b in pairwise(off[:4]))
    assert off[-1] < 0.001 and np.linalg.norm(made.offsets.body.means - wanted, axis=1).max() < 0.003
    sigmas = np.sqrt(np.linalg.eigvalsh(made.offsets.body.covariances)[:, -1])
    assert (sigmas > 0.0049).all() and (sigmas < 0.006).all()


def test_the_more_sets_share_an_error_the_slower_offsets_are_learned():
    rig, true, state, left = circle_rig(4), true_offsets(), posed(1), []
    for sets in (1.0, 10.0, 100.0):
        made = KeypointModality(rig, HUMAN, KeypointConfig(correlation_sets=sets), BLAZEPOSE)
        wanted = np.array([true[name] for name in made.names])
        made.set_images((), state, None, seen_by(rig, state, offsets=true))
        made.learn((), state, None)
        left.append(np.linalg.norm(made.offsets.body.means - wanted, axis=1).mean())
    assert left[0] < left[1] < left[2]


def test_one_camera_teaches_across_its_sight_and_not_along_it():
    rig, true, state = circle_rig(3), true_offsets(), posed(2)
    made = KeypointModality(rig, HUMAN, KeypointConfig(correlation_sets=1.0), BLAZEPOSE)
    first = made.offsets.body
    made.set_images((), state, None, [seen_by(rig, state, offsets=true)[0], None, None])
    made.learn((), state, None)
    for k, (before, after) in enumerate(zip(first.covariances, made.offsets.body.covariances, strict=True)):
        taken = np.linalg.inv(after) - np.linalg.inv(before)
        values = np.linalg.eigvalsh(taken)
        assert abs(values[0]) < 1e-3 * values[-1], made.names[k]
