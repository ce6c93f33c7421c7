"""A network's silhouette as odds of pixels."""

import numpy as np
import pytest

from tracker_node.observation.keypoints.people import Silhouette
from tracker_node.observation.region.silhouette import NO_SILHOUETTE, UNKNOWN, odds_table, packed


def test_odds_are_those_against_the_body():
    table = odds_table(1.0, 20.0)
    assert table.shape == (256,) and table.dtype == np.float32
    for value in (0, 50, 127, 200, 255):
        p = (value + 0.5) / 256.0
        assert table[value] == pytest.approx((1.0 - p) / p, rel=1e-5)
    assert (np.diff(np.delete(table, UNKNOWN)) < 0.0).all() and table[UNKNOWN] == 1.0


def test_the_networks_log_odds_count_by_a_share_and_up_to_a_limit():
    full, half, limited = odds_table(1.0, 20.0), odds_table(0.5, 20.0), odds_table(0.5, 1.5)
    np.testing.assert_allclose(half**2, full, rtol=1e-4)
    np.testing.assert_allclose(np.log(limited), np.clip(np.log(half), -1.5, 1.5), atol=1e-5)
    assert np.log(limited[[0, 255]]) == pytest.approx([1.5, -1.5], abs=1e-5)
    assert (odds_table(0.0, 2.0) == 1.0).all() and (odds_table(1.0, 0.0) == 1.0).all()


def test_a_silhouette_lies_where_it_was_found_and_around_it_nothing_is_known():
    table, own = odds_table(0.5, 2.0), np.arange(6, dtype=np.uint8).reshape(2, 3)
    whole, odds = packed(Silhouette(own, (4, 1)), (5, 9), table)
    expected = np.full((5, 9), UNKNOWN)
    expected[1:3, 4:7] = own
    np.testing.assert_array_equal(whole, expected)
    assert whole.dtype == np.uint8 and odds is table


def test_without_a_silhouette_nothing_is_known():
    assert packed(None, (5, 9), odds_table(0.5, 2.0)) is NO_SILHOUETTE
    assert NO_SILHOUETTE[0].size == 0 and (NO_SILHOUETTE[1] == 1.0).all()
