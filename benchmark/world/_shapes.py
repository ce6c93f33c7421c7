"""Closed, hollow shapes of many triangles, as scanners leave them; every seed has another."""

from __future__ import annotations

import numpy as np

from tracker_node.model.shapes.primitives import Mesh

AROUND, ALONG = 64, 480
LEVELS = 6  # of a subdivided icosahedron: 81 920 triangles
SIZE_M = 0.24


def knot(seed: int) -> Mesh:
    """A tube along a trefoil, thicker on one side: 61 440 triangles."""
    rng = np.random.default_rng([seed, 21])
    t = np.linspace(0.0, 2.0 * np.pi, ALONG, endpoint=False)
    ring, tall = 1.0 + 0.45 * np.cos(3 * t), rng.uniform(0.45, 0.65)
    middle = np.column_stack([ring * np.cos(2 * t), 0.8 * ring * np.sin(2 * t), tall * np.sin(3 * t)])
    thick = 0.24 + 0.07 * np.cos(t + rng.uniform(0.0, 2.0 * np.pi))
    tangent = np.roll(middle, -1, axis=0) - np.roll(middle, 1, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.cross(tangent, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(side, tangent)
    angles = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
    spokes = np.cos(angles)[None, :, None] * side[:, None] + np.sin(angles)[None, :, None] * up[:, None]
    vertices = (middle[:, None] + thick[:, None, None] * spokes).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(ALONG), np.arange(AROUND), indexing="ij")
    a, b = i * AROUND + j, (i + 1) % ALONG * AROUND + j
    c, d = (i + 1) % ALONG * AROUND + (j + 1) % AROUND, i * AROUND + (j + 1) % AROUND
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return sized(vertices, faces)


def horned(seed: int) -> Mesh:
    """A ball with horns and dents: 81 920 triangles."""
    import trimesh

    rng = np.random.default_rng([seed, 22])
    ball = trimesh.creation.icosphere(subdivisions=LEVELS, radius=1.0)
    directions = np.asarray(ball.vertices)
    radius = np.full(len(directions), 0.6)
    for height, width in [*zip(rng.uniform(0.5, 0.9, 6), rng.uniform(6.0, 14.0, 6), strict=True), (-0.3, 6.0), (-0.25, 8.0)]:
        pole = rng.normal(size=3)
        radius += height * np.exp(width * (directions @ (pole / np.linalg.norm(pole)) - 1.0))
    return sized(directions * np.maximum(radius, 0.2)[:, None] * rng.uniform(0.8, 1.2, 3), np.asarray(ball.faces))


def sized(vertices: np.ndarray, faces: np.ndarray) -> Mesh:
    """A mesh whose longest side is `SIZE_M`, about its middle, with its faces outward."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    vertices = (vertices - 0.5 * (low + high)) * (SIZE_M / (high - low).max())
    corners = vertices[faces]
    if (corners[:, 0] * np.cross(corners[:, 1], corners[:, 2])).sum() < 0.0:
        faces = faces[:, ::-1]
    return Mesh(vertices, faces)
