"""How many neighboring lines share one error, on contours whose spacing is known."""

import numpy as np
import pytest

from tracker_node.objective.lines.camera import add_correlated
from tracker_node.objective.lines.correspondence import LINE_U, LINE_V, N_LINE_COLUMNS, PRECISION
from tracker_node.render.contour.samples import LINK, N_INFO_COLUMNS, SHAPE

LENGTH_PX, TAKEN, FOUND, PRECISE = 4.0, 0.5, 0.2, 20.0


def ratio(places, shapes=None, precisions=None) -> float:
    """Scatter over information of lines of one link at ``places`` (n,) pixels along a straight contour."""
    n = len(places)
    lines, info, sums = np.zeros((n, N_LINE_COLUMNS)), np.zeros((n, N_INFO_COLUMNS), dtype=np.int32), np.zeros((3, 2))
    lines[:, LINE_U], lines[:, LINE_V] = 0.6 * np.asarray(places), 0.8 * np.asarray(places)
    lines[:, PRECISION] = PRECISE if precisions is None else precisions
    info[:, LINK], info[:, SHAPE] = 1, 0 if shapes is None else shapes
    add_correlated(lines, info, n, TAKEN, FOUND, LENGTH_PX, sums)
    assert not sums[[0, 2]].any()
    return sums[1, 0] / sums[1, 1]


ALONE = ratio([0.0])


def test_lines_that_are_far_apart_err_by_themselves():
    own = 1.0 / PRECISE
    assert pytest.approx((FOUND + 0.25 * own) / (TAKEN + own)) == ALONE
    assert ratio([0.0, 24.0, 48.0]) == pytest.approx(ALONE, rel=0.01)
    assert ratio([0.0, 1.0, 2.0], shapes=[0, 1, 2]) == pytest.approx(ALONE)
    assert ratio([0.0, 1.0], precisions=[PRECISE, 0.0]) == pytest.approx(ALONE)  # a line that says nothing


@pytest.mark.parametrize("spacing", [1.0, 3.0, 8.0])
def test_a_row_of_lines_is_worth_what_its_correlation_says(spacing):
    """Against the variance of the mean of many with that correlation."""
    n = 400
    lags = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    expected = np.exp(-spacing * lags / LENGTH_PX).sum() / n
    assert ratio(spacing * np.arange(n)) / ALONE == pytest.approx(expected, rel=0.03)
