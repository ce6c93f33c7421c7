"""The human of 18 segments with the surface of a measured body: every segment a loft through its cross-sections."""

from __future__ import annotations

from ..articulated import ArticulatedModel, Shape
from ..shapes.nurbs import N_AROUND, RING_SPACING, loft_mesh
from .segments18 import COLORS, body_chain, body_landmarks, body_lofts


def nurbs_human(n_around: int = N_AROUND, ring_spacing: float = RING_SPACING) -> ArticulatedModel:
    """18 smooth segments, 57 variables; joints, colors and landmarks are those of `ellipsoid_human`.

    Parameters
    ----------
    n_around, ring_spacing : fineness of the meshes, see `loft_mesh`.
    """
    shapes = tuple(
        Shape(name, name, loft_mesh(loft, n_around, ring_spacing), place, COLORS[name])
        for name, (loft, place) in body_lofts().items()
    )
    return ArticulatedModel("nurbs_human", body_chain(), shapes, body_landmarks())
