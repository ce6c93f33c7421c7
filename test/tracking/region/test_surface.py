"""Surfaces followed from set to set."""

from dataclasses import replace

import numpy as np
import pytest

from tracker_node.model.clothes import expected_surfaces
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.measures import HumanMeasures
from tracker_node.objective.lines.surfaces import SurfaceSums
from tracker_node.tracking.config import KeypointConfig
from tracker_node.tracking.region.modality import SurfaceFilter

HUMAN = human_model()
N = len(HUMAN.shapes)
CONFIG = KeypointConfig(surface_scale=2.0, surface_wobble_m=0.01, correlation_sets=4.0)
RNG = np.random.default_rng(2)
EVERYTHING = np.ones(N, dtype=bool)
ALONE = 0.02 * RNG.normal(size=(N, 4))  # where lines alone have the surfaces


def informations(scale: float = 3e3) -> np.ndarray:
    half = RNG.normal(size=(N, 4, 4))
    return scale * (half @ np.swapaxes(half, 1, 2) + np.eye(4))


H = informations()


def sums(filter_: SurfaceFilter, H: np.ndarray = H) -> SurfaceSums:
    """Of lines whose residuals are those of surfaces at `ALONE`, about what is expected."""
    b = -np.einsum("sij,sj->si", H, ALONE - filter_.surfaces.means)
    return SurfaceSums(H, b, np.zeros((N, 6, 4)), filter_.surfaces.priors, HUMAN.shape_links)


@pytest.mark.parametrize("size", [1.0, 1.2])
def test_the_beginning_is_what_is_expected_of_a_body_of_this_size(size):
    model = human_model(HumanMeasures.of_stature(size * HumanMeasures().stature))
    made, (means, sigmas) = SurfaceFilter(model, CONFIG), expected_surfaces(model)
    np.testing.assert_allclose(made.surfaces.means, size * means, rtol=1e-6)
    for k in range(N):
        np.testing.assert_allclose(made.surfaces.covariances[k], np.diag((2.0 * size * sigmas[k]) ** 2), rtol=1e-6)
        np.testing.assert_allclose(made.surfaces.priors[k] @ made.surfaces.covariances[k], np.eye(4), atol=1e-9)


@pytest.mark.parametrize("size", [1.0, 1.2])
def test_a_set_counts_with_its_wobble_and_as_one_in_so_many(size):
    made = SurfaceFilter(human_model(HumanMeasures.of_stature(size * HumanMeasures().stature)), CONFIG)
    before = made.surfaces
    made.update(sums(made), EVERYTHING)
    for k in range(N):
        says = np.linalg.inv(np.linalg.inv(H[k]) + (0.01 * size) ** 2 * np.eye(4)) / 4.0
        prior = np.linalg.inv(before.covariances[k])
        np.testing.assert_allclose(made.surfaces.covariances[k], np.linalg.inv(prior + says), rtol=1e-5, atol=1e-12)
        expected = np.linalg.solve(prior + says, prior @ before.means[k] + says @ ALONE[k])
        np.testing.assert_allclose(made.surfaces.means[k], expected, atol=1e-9)


def is_own(filter_: SurfaceFilter) -> bool:
    return not filter_.surfaces.means.any() and bool((filter_.surfaces.covariances < 0.0051**2).all())


def test_contours_that_lie_on_the_shapes_decide_for_them():
    made = SurfaceFilter(HUMAN, CONFIG)
    assert made.rival is not None and not is_own(made)
    made.compare(0.009)
    assert made.rival is not None and not is_own(made)
    made.compare(0.003)
    assert made.rival is None and is_own(made)
    made.reset()
    assert made.rival is not None and not is_own(made)


def test_after_a_few_sets_clothes_are_taken_for_granted():
    made, n = SurfaceFilter(HUMAN, CONFIG), 0
    while made.rival is not None and n < 100:
        made.compare(0.02)
        n += 1
    assert 1 < n < 20 and not is_own(made)


def test_the_shapes_of_a_clothed_model_are_those_that_are_seen():
    made = SurfaceFilter(replace(HUMAN, clothed=True), CONFIG)
    assert made.rival is None and is_own(made)


def test_parts_that_are_elsewhere_stay_as_they_were():
    made = SurfaceFilter(HUMAN, CONFIG)
    before, trusted = made.surfaces, EVERYTHING.copy()
    trusted[[1, 4]] = False
    made.update(sums(made), trusted)
    moved = np.abs(made.surfaces.means - before.means).max(axis=1) > 1e-9
    np.testing.assert_array_equal(moved, trusted)
    np.testing.assert_allclose(made.surfaces.covariances[[1, 4]], before.covariances[[1, 4]], rtol=1e-9)


def test_surfaces_are_found_from_many_sets():
    made, left = SurfaceFilter(HUMAN, KeypointConfig(correlation_sets=1.0)), []
    for _ in range(30):
        left.append(np.abs(made.surfaces.means - ALONE).max())
        made.update(sums(made), EVERYTHING)
    assert left[0] > left[1] > left[5] > left[29] and left[29] < 0.1 * left[0]


def test_no_belief_is_surer_than_a_quarter_of_the_wobble():
    made = SurfaceFilter(HUMAN, KeypointConfig(correlation_sets=1.0, surface_wobble_m=0.02))
    for _ in range(200):
        made.update(sums(made, 1e6 * H), EVERYTHING)
    values = np.linalg.eigvalsh(made.surfaces.covariances)
    np.testing.assert_allclose(values, 0.005**2, rtol=1e-6)
    np.testing.assert_allclose(made.surfaces.covariances, np.swapaxes(made.surfaces.covariances, 1, 2), atol=1e-15)


def test_lines_that_say_nothing_change_nothing_and_a_reset_forgets():
    made = SurfaceFilter(HUMAN, CONFIG)
    before = made.surfaces
    made.update(sums(made, np.zeros((N, 4, 4))), EVERYTHING)
    np.testing.assert_allclose(made.surfaces.means, before.means, atol=1e-15)
    np.testing.assert_allclose(made.surfaces.covariances, before.covariances, rtol=1e-9)
    made.update(sums(made), EVERYTHING)
    made.reset()
    assert made.surfaces is before
