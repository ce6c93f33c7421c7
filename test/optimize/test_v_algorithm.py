"""Where two straight flanks meet, by hand."""

import math

import pytest

from tracker_node.optimize.stepping import intersection, vertex


def test_two_lines_meet():
    """y = 10 - 2 x falls through (0, 10), (1, 8); y = 3 x - 5 rises through (3.5, 5.5), (4, 7); both are 4 at 3."""
    assert intersection([0.0, 1.0, 3.5, 4.0], [10.0, 8.0, 5.5, 7.0]) == pytest.approx(3.0)
    assert intersection([0.0, -1.0, -3.5, -4.0], [10.0, 8.0, 5.5, 7.0]) == pytest.approx(-3.0)  # walked the other way
    assert intersection([10.0, 11.0, 13.5, 14.0], [10.0, 8.0, 5.5, 7.0]) == pytest.approx(13.0)


@pytest.mark.parametrize(
    "f",
    [
        [1.0, 1.0, 1.0, 2.0],  # does not fall
        [1.0, 2.0, 1.0, 2.0],  # rises at once
        [2.0, 1.0, 2.0, 2.0],  # does not rise
        [2.0, 1.0, 2.0, 1.0],
        [math.inf, 1.0, 1.0, 2.0],
        [2.0, 1.0, 1.0, math.inf],
        [math.nan, 1.0, 1.0, 2.0],
    ],
)
def test_what_is_no_v(f):
    assert intersection([0.0, 1.0, 2.0, 3.0], f) is None


def test_flanks_must_meet_between_the_outer_points():
    """Falling by 1 a step from 1, rising by 1 from the height h at 2: they meet at 2 - h / 2 ... which is beyond 0 for h > 4."""
    assert intersection([0.0, 1.0, 2.0, 3.0], [1.0, 0.0, 2.0, 3.0]) == pytest.approx(0.5)
    assert intersection([0.0, 1.0, 2.0, 3.0], [1.0, 0.0, 3.0, 4.0]) is None  # at the first point itself
    assert intersection([0.0, 1.0, 2.0, 3.0], [1.0, 0.0, -4.0, -3.0]) is None  # at 3.5
    assert intersection([0.0, 1.0, 2.0, 3.0], [1.0, 0.0, -3.0, -2.0]) is None  # at the last point itself
    assert intersection([3.0, 2.0, 1.0, 0.0], [1.0, 0.0, 2.0, 3.0]) == pytest.approx(2.5)


def test_a_vertex_is_of_the_lowest_the_one_before_and_two_after():
    x = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert vertex(x, [9.0, 7.0, 5.0, 3.5, 5.0, 6.5]) == pytest.approx(3.0)  # behind (2, 5), (3, 3.5): in the lowest itself
    f = [abs(3.25 - p) for p in x]
    assert vertex(x, f) == pytest.approx(3.25)


@pytest.mark.parametrize(("lowest", "found"), [(0, False), (1, True), (2, True), (3, False), (4, False)])
def test_enough_points_are_needed_on_both_sides(lowest, found):
    x = [0.0, 1.0, 2.0, 3.0, 4.0]
    f = [abs(lowest + 0.1 - p) for p in x]
    assert (vertex(x, f) is not None) == found
    if found:
        assert vertex(x, f) == pytest.approx(lowest + 0.1)
