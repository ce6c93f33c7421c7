"""Where on a line the contour is: cases whose mean and variance are known in closed form."""

import numpy as np
import pytest

from tracker_node.objective.lines.correspondence import fit_distributions
from tracker_node.objective.lines.table import BEFORE, LOG_RATIO, LONGEST, MEAN, N_LINE_COLUMNS, N_PLAN_COLUMNS, PRECISION

HALF = 6


def fitted(odds, before=0, half=HALF, scale=1.0, sharpness=1.0):
    """Mean, precision and log-ratio of one line with these log-odds of its pixels."""
    values = np.zeros((1, LONGEST), dtype=np.float32)
    values[0, : len(odds)] = odds
    plan = np.zeros((1, N_PLAN_COLUMNS), dtype=np.int32)
    plan[0, BEFORE] = before
    lines = np.full((1, N_LINE_COLUMNS), np.nan)
    fit_distributions(values, plan, 1, half, scale, sharpness, lines)
    return lines[0, [MEAN, PRECISION, LOG_RATIO]]


def edge(at, half=HALF, height=30.0):
    """The body speaks up to a place and the scene beyond it: only that place is left."""
    places = np.arange(2 * half)
    return np.where(places < half + at, height, -height)


def prior_taken_out(mean, variance, half=HALF):
    """(mean, precision) where the uniform prior over the places is divided out."""
    uniform = ((2 * half + 1) ** 2) / 12.0  # of all places, each a pixel wide
    precision = 1.0 / variance - 1.0 / uniform
    return mean / variance / precision, precision


@pytest.mark.parametrize("at", [-6, -3, 0, 2, 5, 6])
def test_a_sharp_edge_is_where_it_is(at):
    mean, precision, _ = fitted(edge(at))
    expected_mean, expected_precision = prior_taken_out(at, 1.0 / 12.0)  # of the one place that is left
    assert mean == pytest.approx(np.clip(expected_mean, -HALF, HALF), abs=1e-3)
    assert precision == pytest.approx(expected_precision, rel=1e-3)


def test_places_are_scale_pixels_apart():
    (mean, precision, ratio), (mean2, precision2, ratio2) = fitted(edge(2)), fitted(edge(2), scale=2.0)
    assert mean2 == pytest.approx(2.0 * mean)
    assert precision2 == pytest.approx(precision / 4.0)
    assert ratio2 == pytest.approx(ratio)


def test_the_ratio_is_of_the_best_place_to_the_better_end():
    _, _, ratio = fitted(edge(2, height=1.5))
    assert ratio == pytest.approx(1.5 * 4, rel=1e-5)  # four pixels from the outer end; eight from the inner
    _, _, ratio = fitted(edge(-3, height=1.5))
    assert ratio == pytest.approx(1.5 * 3, rel=1e-5)
    _, _, weaker = fitted(edge(-3, height=1.5), sharpness=0.5)
    assert weaker == pytest.approx(0.5 * ratio)


def test_an_edge_and_its_mirror_image():
    rng = np.random.default_rng(1)
    odds = edge(2, height=0.8) + 0.3 * rng.standard_normal(2 * HALF)
    one, other = fitted(odds), fitted(-odds[::-1])
    assert other[0] == pytest.approx(-one[0], abs=1e-5)
    assert other[1:] == pytest.approx(one[1:], rel=1e-4)


def test_moments_of_a_soft_edge():
    """Against sums in double precision, over the places' likelihoods."""
    odds = 0.35 * edge(1, height=1.0)
    places = np.arange(-HALF, HALF + 1)
    log = np.concatenate([[0.0], np.cumsum(odds)])
    for sharpness in (1.0, 0.7):
        p = np.exp(sharpness * (log - log.max()))
        p /= p.sum()
        variance = p @ places**2 - (p @ places) ** 2 + 1.0 / 12.0
        mean, precision = prior_taken_out(p @ places, variance)
        found = fitted(odds, sharpness=sharpness)
        assert found[0] == pytest.approx(mean, abs=1e-3)
        assert found[1] == pytest.approx(precision, rel=1e-3)


def test_nothing_seen_is_nothing_known():
    assert fitted(np.zeros(2 * HALF)).tolist() == [0.0, 0.0, 0.0]


def test_two_ends_that_are_equally_likely_know_less_than_nothing():
    """More spread than places all alike: no precision."""
    odds = np.concatenate([np.full(HALF, -3.0), np.full(HALF, 3.0)])
    assert fitted(odds).tolist() == [0.0, 0.0, 0.0]


def test_a_line_without_colors_stays_as_it_is():
    assert np.isnan(fitted(edge(0), before=-1)).all()


def test_a_narrow_part_is_as_wide_as_its_pixels():
    """Three pixels of body anywhere on the line: the contour is at the outer end of them; no log-ratio but to nothing."""
    width, at = 3, 1
    odds = np.full(2 * HALF + width, -10.0)
    odds[HALF + at : HALF + at + width] = 10.0  # covered when the contour is at place `at`
    mean, _, ratio = fitted(odds, before=width)
    assert mean == pytest.approx(prior_taken_out(at, 1.0 / 12.0)[0], abs=1e-3)
    assert ratio == pytest.approx(10.0 * width)


def test_lines_do_not_touch_each_other():
    values = np.zeros((3, LONGEST), dtype=np.float32)
    for row, at in zip(values, (1, 2, 3), strict=True):
        row[: 2 * HALF] = edge(at)
    plan = np.zeros((3, N_PLAN_COLUMNS), dtype=np.int32)
    plan[1, BEFORE] = -1
    lines = np.full((3, N_LINE_COLUMNS), 7.0)
    fit_distributions(values, plan, 3, HALF, 1.0, 1.0, lines)
    assert lines[1].tolist() == [7.0] * N_LINE_COLUMNS
    for j, at in ((0, 1), (2, 3)):
        assert lines[j, [MEAN, PRECISION, LOG_RATIO]] == pytest.approx(fitted(edge(at)))
