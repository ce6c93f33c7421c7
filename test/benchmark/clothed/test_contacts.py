"""Instants of feet, paired."""

import numpy as np
import pytest

from benchmark.clothed.angles.contacts import _paired, figures


def test_each_instant_has_one_partner_the_nearest_first():
    found = _paired(np.array([1.0, 2.0, 5.0]), np.array([1.1, 0.95, 5.5]))
    assert found == [pytest.approx(0.05)]  # 1.1 is left without one, 5.5 is too far off
    assert _paired(np.zeros(0), np.array([1.0])) == []


def test_figures_are_over_all_clips():
    clips = [(np.array([True, True, False]), [0.02, 0.04], [3, 1, 2, 0]), (np.array([True]), [], [1, 1, 2, 2])]
    found = figures(clips)
    assert found["contacts.agree"] == 0.75 and found["contacts.instant_ms"] == pytest.approx(30.0)
    assert (found["contacts.instants"], found["contacts.missed"], found["contacts.invented"]) == (4, 0.5, 0.5)
    assert np.isnan(figures(clips[1:])["contacts.instant_ms"])
