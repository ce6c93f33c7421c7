"""Distances against brute force and against scipy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scipy import ndimage

from helpers.numeric import naive
from tracker_node.observation.chamfer.distance_transform import LARGEST_LIMIT, distance_to, signed_distance

masks = arrays.arrays(np.bool_, st.tuples(st.integers(1, 24), st.integers(1, 90)), fill=st.just(False))
truncations = st.floats(1.0, 30.0) | st.integers(1, 30)


@settings(max_examples=150, deadline=None)
@given(masks, truncations)
def test_small_masks(mask, truncation):
    np.testing.assert_allclose(distance_to(mask, truncation), naive.distance_to(mask, truncation), atol=1e-5)


@settings(max_examples=150, deadline=None)
@given(masks, truncations)
def test_small_masks_signed(mask, truncation):
    outside, inside = naive.distance_to(mask, 1e6), naive.distance_to(~mask, 1e6)
    expected = np.clip(np.where(mask, 0.5 - inside, outside - 0.5), -truncation, truncation)
    np.testing.assert_allclose(signed_distance(mask, truncation), expected, atol=1e-5)


@pytest.mark.parametrize("truncation", [16, 40.0, 63.7, LARGEST_LIMIT, LARGEST_LIMIT + 40])
@pytest.mark.parametrize("density", [0.0001, 0.003, 0.5])
def test_large_masks(truncation, density):
    rng = np.random.default_rng(1)
    mask = rng.random((260, 333)) < density
    mask = ndimage.binary_dilation(mask, iterations=4) if density < 0.1 else mask
    expected = np.minimum(ndimage.distance_transform_edt(~mask), truncation)
    np.testing.assert_allclose(distance_to(mask, truncation), expected, atol=2e-5)
    np.testing.assert_allclose(distance_to(mask.astype(np.uint8) * 255, truncation), expected, atol=2e-5)
    inside = ndimage.distance_transform_edt(mask)
    signed = np.where(mask, 0.5 - inside, ndimage.distance_transform_edt(~mask) - 0.5)
    np.testing.assert_allclose(signed_distance(mask, truncation), np.clip(signed, -truncation, truncation), atol=2e-5)


def test_part_of_a_larger_array():
    whole = np.zeros((60, 90), dtype=np.uint8)
    whole[30, 40] = 1
    part = whole[10:50, 20:80]
    np.testing.assert_array_equal(distance_to(part, 20), distance_to(part.copy(), 20))


def test_nothing_and_everything():
    nothing = np.zeros((5, 7), dtype=np.uint8)
    assert (distance_to(nothing, 9.5) == 9.5).all()
    assert (signed_distance(nothing, 9.5) == 9.5).all()
    assert (signed_distance(nothing + 1, 9.5) == -9.5).all()


def test_misuse_is_named():
    with pytest.raises(ValueError, match=r"uint8 or bool, got float64 \(2, 2\)"):
        distance_to(np.zeros((2, 2)), 5)
