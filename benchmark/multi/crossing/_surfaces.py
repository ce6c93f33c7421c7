"""How far two people's surfaces are from each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from benchmark.clothed.person._body import Body
from benchmark.clothed.person._posing import Pose, skin
from tracker_node.synthesis.scenes.rasterizer import vertex_normals

ARM_JOINTS = ("shoulder", "elbow", "wrist")
_DEEPEST_M = 0.12  # what faces a surface from within is inside where it is nearer than this


class Surface:
    """A closed surface.

    Parameters
    ----------
    vertices : (n, 3) meters.
    faces : (m, 3) outward by the right hand.
    kept : (n,) bool, vertices that count; None: all.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, kept: np.ndarray | None = None):
        kept = np.ones(len(vertices), dtype=bool) if kept is None else kept
        self.points, self._normals = vertices[kept], vertex_normals(vertices, faces)[kept]
        self._tree = cKDTree(self.points)

    def distances(self, points: np.ndarray) -> np.ndarray:
        """(k,) meters of points (k, 3) from the nearest vertex; negative within: their depth."""
        distance, nearest = self._tree.query(points)
        along = np.sum((points - self.points[nearest]) * self._normals[nearest], axis=1)
        return np.where((along < 0.0) & (distance < _DEEPEST_M), along, distance)


def gaps(
    bodies: Sequence[Body], poses: Sequence[Pose], rests: Sequence[np.ndarray] | None = None, arms: bool = True
) -> np.ndarray:
    """Distances of the vertices of each of two people from the other's surface.

    Parameters
    ----------
    bodies, poses : of the two.
    rests : vertices in the rest pose; None: of the skin.
    arms : whether arms count.

    Returns
    -------
    (n,) meters, negative within the other.
    """
    rests = rests or [body.vertices for body in bodies]
    first, second = (
        Surface(skin(body, pose, rest), body.faces, None if arms else ~is_arm(body))
        for body, pose, rest in zip(bodies, poses, rests, strict=True)
    )
    return np.concatenate([second.distances(first.points), first.distances(second.points)])


def is_arm(body: Body) -> np.ndarray:
    """(n,) whether vertices are of an arm."""
    return body.weight_of(*(f"{side}_{joint}" for side in ("left", "right") for joint in ARM_JOINTS)) > 0.3
