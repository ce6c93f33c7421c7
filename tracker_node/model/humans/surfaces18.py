"""The human of 18 segments with a surface: an ellipsoid for each segment, or a loft through its cross-sections.

The ellipsoids are the body that tracks in the color paper. One has the center and the second moments of the segment's measured
solid (`nurbs_human`): its length, breadth and depth in that sense, and another surface. The solid of an arm's or leg's part is
that between its joint centers: the domes with which it reaches into its neighbors are left out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...geometry import se3
from ..articulated import ArticulatedModel, Shape
from ..shapes.nurbs import N_AROUND, RING_SPACING, Loft, loft_mesh
from ..shapes.primitives import Ellipsoid, Mesh
from .segments18 import COLORS, body_chain, body_landmarks, body_lofts

_BETWEEN_JOINTS = ("upper_arm", "forearm", "thigh", "shank")
_FINENESS = (64, 0.010)  # of the solids that are measured
_FLAT = 0.001  # meters: height of a dome that is as good as none


def ellipsoid_human() -> ArticulatedModel:
    """18 ellipsoids, 57 variables; joints, colors and landmarks are those of `nurbs_human`."""
    shapes = []
    for name, (loft, place) in body_lofts().items():
        center, radii = equivalent_ellipsoid(loft_mesh(_counted(name, loft), *_FINENESS))
        offset = se3.from_rotation_translation(np.eye(3), np.round(center, 4))
        x, y, z = np.round(radii, 4).tolist()
        shapes.append(Shape(name, name, Ellipsoid((x, y, z)), place @ offset, COLORS[name]))
    return ArticulatedModel("ellipsoid_human", body_chain(), tuple(shapes), body_landmarks())


def _counted(name: str, loft: Loft) -> Loft:
    return replace(loft, domes=(_FLAT, _FLAT)) if name.endswith(_BETWEEN_JOINTS) else loft


def equivalent_ellipsoid(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Center (3,) and half-axes (3,) along x, y, z of the ellipsoid that has the solid's center and its variances.

    The solid is cut into tetrahedra from the origin to each face; a solid ellipsoid's variance along a half-axis r is r^2 / 5.
    """
    corners = mesh.vertices[mesh.faces]  # (m, 3, 3)
    volumes = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    total = corners.sum(axis=1)
    mean = volumes @ total / (4.0 * volumes.sum())
    squares = volumes @ (total**2 + (corners**2).sum(axis=1)) / (20.0 * volumes.sum())
    return mean, np.sqrt(5.0 * (squares - mean**2))


def nurbs_human(n_around: int = N_AROUND, ring_spacing: float = RING_SPACING) -> ArticulatedModel:
    """18 smooth segments, 57 variables; joints, colors and landmarks are those of `ellipsoid_human`.

    Parameters
    ----------
    n_around, ring_spacing : fineness of the meshes, see `loft_mesh`.

    Returns
    -------
    Body of 18 links.
    """
    shapes = tuple(
        Shape(name, name, loft_mesh(loft, n_around, ring_spacing), place, COLORS[name])
        for name, (loft, place) in body_lofts().items()
    )
    return ArticulatedModel("nurbs_human", body_chain(), shapes, body_landmarks())
