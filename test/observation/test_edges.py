"""Edges in a region, and within a mask."""

import cv2
import numpy as np
import pytest

from tracker_node.observation.edges import find_edges, gray_gradient


@pytest.fixture(scope="module")
def image():
    """Dark, with a bright disc and a bright bar."""
    drawn = np.full((100, 140, 3), 40, dtype=np.uint8)
    cv2.circle(drawn, (50, 50), 20, (200, 210, 190), -1)
    cv2.rectangle(drawn, (100, 10), (110, 90), (0, 0, 255), -1)
    return drawn


def test_edges_lie_where_the_image_steps(image):
    edges = find_edges(image, (0, 0, 140, 100), 40, 100)
    v, u = np.nonzero(edges[:, :90])
    assert len(v) > 80
    radius = np.hypot(u - 50, v - 50)
    assert (np.abs(radius - 20) <= 1.5).all()


def test_a_region_sees_what_the_whole_image_sees(image):
    """Its border makes no edges and hides none."""
    whole = cv2.Canny(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), 40, 100)
    for u0, v0, u1, v1 in ((0, 0, 140, 100), (41, 33, 77, 71), (50, 50, 140, 100), (104, 0, 106, 100)):
        np.testing.assert_array_equal(find_edges(image, (u0, v0, u1, v1), 40, 100), whole[v0:v1, u0:u1])


def test_only_inside_the_mask_grown_or_shrunk(image):
    disc = np.zeros((100, 140), dtype=np.uint8)
    cv2.circle(disc, (50, 50), 20, 1, -1)
    region = (0, 0, 140, 100)
    everywhere, grown = find_edges(image, region, 40, 100), find_edges(image, region, 40, 100, disc, grow_px=2)
    np.testing.assert_array_equal(grown[:, :90], everywhere[:, :90])
    assert not grown[:, 90:].any()
    assert not find_edges(image, region, 40, 100, disc, grow_px=-3).any()
    assert not find_edges(image, region, 40, 100, np.zeros_like(disc)).any()


def test_gradient_points_to_the_bright_side(image):
    x, y = gray_gradient(image, (20, 20, 80, 80))
    assert x.dtype == np.int16
    assert x[30, 10] > 300 and x[30, 50] < -300  # left and right of the disc
    assert y[10, 30] > 300 and y[50, 30] < -300
    assert x[30, 30] == 0 == y[30, 30]


def test_misuse_is_named(image):
    with pytest.raises(ValueError, match="expected a region"):
        find_edges(image, (0, 0, 141, 100), 40, 100)
    with pytest.raises(ValueError, match=r"region's shape \(10, 20\), got \(100, 140\)"):
        find_edges(image, (0, 0, 20, 10), 40, 100, np.zeros((100, 140), dtype=np.uint8))
