"""Boundary points and edges on shapes whose outline is known."""

import cv2
import numpy as np
import pytest

from tracker_node.observation.appearance import grown, shrunk
from tracker_node.observation.chamfer.boundary import boundary_points, edge_distance
from tracker_node.observation.chamfer.distance_transform import signed_distance

CENTER, RADIUS = np.array([60.0, 52.0]), 30.0


def disc(radius: float = RADIUS) -> np.ndarray:
    v, u = np.mgrid[0:110, 0:130]
    return (np.hypot(u - CENTER[0], v - CENTER[1]) < radius).astype(np.uint8)


def points_of(mask: np.ndarray, trusted: np.ndarray | None = None, step: int = 1) -> np.ndarray:
    distance = cv2.blur(signed_distance(mask, 40.0), (3, 3))
    return boundary_points(mask, distance, np.ones_like(mask) if trusted is None else trusted, step)


def test_points_lie_on_the_boundary_with_normals_that_point_out():
    points = points_of(disc())
    assert points.dtype == np.float32 and len(points) > 150
    from_center = points[:, :2] - CENTER
    distance = np.linalg.norm(from_center, axis=1)
    assert distance.mean() == pytest.approx(RADIUS, abs=0.15)
    assert np.abs(distance - RADIUS).max() < 0.9
    np.testing.assert_allclose(np.linalg.norm(points[:, 2:], axis=1), 1.0, atol=1e-5)
    assert np.degrees(np.arccos((from_center * points[:, 2:]).sum(axis=1) / distance)).max() < 12.0


def test_a_hole_has_normals_into_it():
    ring = disc() * (disc(14.0) == 0)
    points = points_of(ring)
    from_center = points[:, :2] - CENTER
    inner = np.linalg.norm(from_center, axis=1) < 22.0
    assert inner.sum() > 50
    assert ((from_center * points[:, 2:]).sum(axis=1) < 0)[inner].all()
    assert ((from_center * points[:, 2:]).sum(axis=1) > 0)[~inner].all()


def test_every_step_th_point_and_no_specks():
    every, third = points_of(disc()), points_of(disc(), step=3)
    assert len(third) == pytest.approx(len(every) / 3, abs=1)
    speckled = disc()
    speckled[5:7, 5:7] = 1
    assert len(points_of(speckled)) == len(every)
    assert points_of(np.zeros((40, 40), np.uint8)).shape == (0, 4)


def test_untrusted_places_and_the_border_give_no_points():
    trusted = np.zeros((110, 130), np.uint8)
    trusted[:, :60] = 1
    assert points_of(disc(), trusted)[:, 0].max() < 61.0
    cut = disc()[:, 45:]
    assert points_of(cut)[:, 0].min() > 2.0


def test_edges_count_within_the_silhouette_only():
    gray = np.full((110, 130), 90, np.uint8)
    gray[:, 55:] = 200  # an edge through body and scene
    distance, edges = edge_distance(gray, disc(), 40.0, 100.0, 25.0)
    rows = np.flatnonzero(edges.any(axis=1))
    assert 20 <= rows.min() <= 24 and 80 <= rows.max() <= 84
    assert distance[52, 55:].tolist() == pytest.approx(np.minimum(np.abs(np.arange(75) - 0.0), 25.0).tolist(), abs=1.01)
    assert distance.max() == 25.0


@pytest.mark.parametrize("reach", [4, 12, 40])
def test_grown_masks_reach_about_as_far_as_asked(reach):
    distance = signed_distance(disc(12.0), 80.0)
    reached = grown(disc(12.0) * np.uint8(7), reach) > 0
    assert distance[reached].max() <= reach + 6.0
    assert reached[distance < reach - 4.0].all()
    assert set(np.unique(grown(disc(), reach))) <= {0, 1}


def test_shrunk_labels_keep_their_values_inside():
    labels = disc() * np.uint8(3)
    labels[:, 60:] = disc()[:, 60:] * np.uint8(5)
    less = shrunk(labels, 2)
    assert set(np.unique(less)) == {0, 3, 5}
    depth = -signed_distance((labels > 0).astype(np.uint8), 80.0)
    assert (less[depth > 3.5] == labels[depth > 3.5]).all() and not less[depth < 1.0].any()


def outline(u0: int, v0: int, u1: int, v1: int, slope: float = 10.0, along: int = 1) -> np.ndarray:
    """Points of a box with these first and last columns and rows in a mask of 40 x 30, on a distance with that slope."""
    mask = np.zeros((30, 40), np.uint8)
    mask[v0 : v1 + 1, u0 : u1 + 1] = 1
    distance = slope * np.indices(mask.shape)[along].astype(np.float32)
    return boundary_points(mask, distance, np.ones_like(mask), 1)


def test_three_pixels_at_each_border_give_no_points():
    """A box of 20 x 15 pixels has 2 (19 + 14) on its outline; each side that is too far out takes its pixels away."""
    assert len(outline(10, 8, 29, 22)) == 66
    assert len(outline(3, 3, 36, 26)) == 2 * (33 + 23)
    assert len(outline(2, 8, 21, 22)) == len(outline(18, 8, 37, 22)) == 66 - 15
    assert len(outline(10, 2, 29, 16)) == len(outline(10, 13, 29, 27)) == 66 - 20


def test_points_go_half_a_pixel_up_the_slope():
    points = outline(10, 8, 29, 22)
    assert points[:, 0].min() == 10.5 and points[:, 0].max() == 29.5 and points[:, 1].min() == 8.0
    np.testing.assert_array_equal(points[:, 2:], np.tile([1.0, 0.0], (66, 1)))
    down = outline(10, 8, 29, 22, slope=-10.0, along=0)
    assert down[:, 0].min() == 10.0 and down[:, 1].min() == 7.5 and down[:, 1].max() == 21.5
    np.testing.assert_array_equal(down[:, 2:], np.tile([0.0, -1.0], (66, 1)))


def test_flat_places_and_outlines_below_twenty_pixels_give_no_points():
    assert len(outline(10, 8, 29, 22, slope=0.25)) == 0  # a change of one over four pixels
    assert len(outline(10, 8, 29, 22, slope=0.26)) == 66
    assert len(outline(10, 8, 15, 13)) == 20 and len(outline(10, 8, 15, 12)) == 0


def test_edges_next_to_the_silhouette_count_and_no_farther():
    gray, mask = np.full((30, 40), 20, np.uint8), np.zeros((30, 40), np.uint8)
    gray[:, 20:] = 220
    mask[10:20, 5:35] = 1
    _, edges = edge_distance(gray, mask, 40.0, 100.0, 25.0)
    assert np.flatnonzero(edges.any(axis=1)).tolist() == list(range(9, 21))
