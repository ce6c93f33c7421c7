"""Epipolar curves pass through the images of the points that lie behind a pixel."""

import numpy as np
import pytest

from helpers.cameras.render_scenes import LENSES, look_at
from tracker_node.camera.epipolar import epipolar_curve


def distance_to(curve, pixel):
    """Of a pixel from a line of straight pieces."""
    start, along = curve[:-1], np.diff(curve, axis=0)
    share = np.clip(((pixel - start) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12), 0.0, 1.0)
    return np.linalg.norm(start + share[:, None] * along - pixel, axis=1).min()


@pytest.mark.parametrize("lens", sorted(LENSES))
def test_the_curve_passes_where_the_point_is_seen(lens):
    a = look_at((2.0, 0.3, 1.2), (0.0, 0.0, 0.8), LENSES[lens])
    b = look_at((-0.6, 2.1, 1.0), (0.0, 0.0, 0.8), LENSES[lens])
    for point in np.random.default_rng(0).uniform((-0.3, -0.3, 0.5), (0.3, 0.3, 1.1), (10, 3)):
        (pixel_a, _), (pixel_b, _) = a.project(point), b.project(point)
        assert distance_to(epipolar_curve(a, pixel_a, b), pixel_b) < 0.05


def test_a_ray_that_is_not_in_view_has_no_curve():
    a = look_at((2.0, 0.0, 1.0), (3.0, 0.0, 1.0), LENSES["plain"])
    b = look_at((-2.0, 0.0, 1.0), (-3.0, 0.1, 1.0), LENSES["plain"])
    assert epipolar_curve(a, np.array([80.0, 60.0]), b).shape == (0, 2)
