"""Halton's points, against scipy's."""

import numpy as np
import pytest
from scipy.stats import qmc

from tracker_node.optimize.robust_start import scrambled_halton


@pytest.mark.parametrize(("n", "n_dims", "seed"), [(1, 1, 0), (16, 2, 1), (500, 8, 7), (48, 40, 0), (257, 90, 123456)])
def test_the_points_are_those_of_scipy(n, n_dims, seed):
    np.testing.assert_array_equal(scrambled_halton(n, n_dims, seed), qmc.Halton(n_dims, seed=seed).random(n))


def test_another_seed_gives_other_points():
    assert not np.array_equal(scrambled_halton(8, 3, 0), scrambled_halton(8, 3, 1))


def test_no_points_of_some_dimensions():
    assert scrambled_halton(0, 3, 0).shape == (0, 3)
