"""Series of image sets in which something holds, gaps between sets, and how long losses take."""

import numpy as np
import pytest

from tracker_node.evaluation.metrics import Interval, intervals, reacquisition_times, times_with_gaps


@pytest.mark.parametrize(
    ("flags", "known", "found"),
    [
        ("..11.1", None, [(2, 3, True), (5, 5, False)]), ("11", None, [(0, 1, False)]), ("", None, []), ("...", None, []),
        ("1.1", "1.1", [(0, 2, False)]), (".11.", "1.11", [(2, 2, True)]), ("11.", "11.", [(0, 1, False)]),
    ],
)  # fmt: skip
def test_series_are_of_sets_that_can_be_judged(flags, known, found):
    on = np.array([c == "1" for c in flags], dtype=bool)
    judged = None if known is None else np.array([c == "1" for c in known], dtype=bool)
    assert intervals(on, judged) == tuple(Interval(*one) for one in found)


def test_both_ends_are_counted():
    assert Interval(2, 4, True).n_sets == 3


def test_gaps_have_their_first_and_last_missing_set():
    """One set is missing after 0.1 s, three after 0.3 s."""
    times, sets = times_with_gaps(np.array([0.0, 0.1, 0.3, 0.7]), 0.1)
    assert times == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.6, 0.7])
    assert sets.tolist() == [0, 1, -1, 2, -1, -1, 3]
    times, sets = times_with_gaps(np.array([0.0, 0.14]), 0.1)
    assert sets.tolist() == [0, 1]
    times, sets = times_with_gaps(np.array([0.0, 0.24]), 0.1)
    assert sets.tolist() == [0, -1, 1]


def test_losses_last_until_the_first_sound_set():
    times = np.array([0.0, 1.0, 2.5, 3.0, 7.0, 8.0])
    flags = np.array([False, True, True, False, True, True])
    assert reacquisition_times(flags, times).tolist() == [2.0]
    known = np.array([True, True, True, False, True, True])
    assert reacquisition_times(np.array([False, True, True, False, False, True]), times, known).tolist() == [6.0]
    assert reacquisition_times(np.zeros(6, bool), times).tolist() == []
