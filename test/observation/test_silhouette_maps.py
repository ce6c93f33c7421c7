"""Boundary points and edges on shapes whose outline is known."""

import cv2
import numpy as np
import pytest

from tracker_node.observation.body_region import grown, shrunk
from tracker_node.observation.distance_transform import signed_distance
from tracker_node.observation.silhouette_maps import boundary_points, edge_distance

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
