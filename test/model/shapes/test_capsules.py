"""Round cones lie within their shapes, and fill them well."""

import numpy as np
import pytest

from tracker_node.model.shapes.capsules import inner_capsules
from tracker_node.model.shapes.primitives import END, END_RADIUS, START, START_RADIUS, Box, Ellipsoid, TruncatedCone

SHAPES = {
    "tube": TruncatedCone(0.05, 0.05, 0.0, -0.2, 0.3),
    "thigh": TruncatedCone(0.09, 0.08, -0.8, 0.0, 0.42),
    "trunk": TruncatedCone(0.1, 0.17, 0.5, -0.1, 0.4),
    "steep": TruncatedCone(0.3, 0.1, 4.0, -0.05, 0.3),
    "coin": TruncatedCone(0.1, 0.1, 0.0, 0.0, 0.01),
    "ball": Ellipsoid((0.1, 0.1, 0.1)),
    "egg": Ellipsoid((0.1, 0.1, 0.15)),
    "hand": Ellipsoid((0.02, 0.05, 0.1)),
    "lens": Ellipsoid((0.2, 0.03, 0.2)),
    "stone": Ellipsoid((0.3, 0.25, 0.2)),
    "cube": Box((0.2, 0.2, 0.2)),
    "beam": Box((1.0, 0.1, 0.1)),
    "board": Box((0.5, 0.02, 0.3)),
}


def inside(primitive, points: np.ndarray) -> np.ndarray:
    """How far inside: positive within, in shares of the shape's size."""
    x, y, z = points.T
    if isinstance(primitive, TruncatedCone):
        scale = 1.0 + primitive.k * z
        mantle = scale - np.hypot(x / primitive.a, y / primitive.b)
        return np.min([mantle, (z - primitive.z1) / 0.1, (primitive.z2 - z) / 0.1], axis=0)
    if isinstance(primitive, Ellipsoid):
        return 1.0 - np.linalg.norm(points / np.array(primitive.radii), axis=1)
    return 1.0 - np.abs(points / (0.5 * np.array(primitive.size))).max(axis=1)


def spheres(capsules: np.ndarray, n: int = 21):
    for row in capsules:
        for share in np.linspace(0.0, 1.0, n):
            center = (1.0 - share) * row[START : START + 3] + share * row[END : END + 3]
            yield center, (1.0 - share) * row[START_RADIUS] + share * row[END_RADIUS]


@pytest.mark.parametrize("name", SHAPES)
def test_round_cones_lie_within_their_shape(name):
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions = np.concatenate([directions, np.eye(3), -np.eye(3)])
    capsules = inner_capsules(SHAPES[name])
    assert len(capsules) and (capsules[:, [START_RADIUS, END_RADIUS]] > 0.0).all()
    for center, radius in spheres(capsules):
        assert inside(SHAPES[name], center + radius * directions).min() > -1e-9


@pytest.mark.parametrize(
    ("name", "share"),
    [("tube", 0.9), ("thigh", 0.7), ("trunk", 0.7), ("egg", 0.9), ("hand", 0.6), ("stone", 0.65), ("beam", 0.7), ("ball", 0.99)],
)
def test_round_cones_fill_their_shape(name, share):
    """By volume, counted with random points."""
    primitive, rng = SHAPES[name], np.random.default_rng(1)
    capsules = inner_capsules(primitive)
    centers = np.concatenate([capsules[:, START : START + 3], capsules[:, END : END + 3]])
    points = rng.uniform(centers.min(axis=0) - 0.2, centers.max(axis=0) + 0.2, (40000, 3))
    points = points[inside(primitive, points) > 0.0]
    covered = np.zeros(len(points), dtype=bool)
    for center, radius in spheres(capsules, 101):
        covered |= ((points - center) ** 2).sum(axis=1) < radius**2
    assert covered.mean() > share
