"""Bodies as images show them: in clothes, whose surfaces lie beside the body's shapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .articulated import ArticulatedModel
from .scaling import scaled_primitive
from .shape_parameters import half_extents
from .shapes.primitives import Primitive, TruncatedCone

_THINNEST = 1.0 / 3.0  # of what a shape was


def with_surfaces(model: ArticulatedModel, surfaces: np.ndarray) -> ArticulatedModel:
    """The body as its clothes make it look: each shape thicker and shifted, joints and landmarks where they were.

    Parameters
    ----------
    model : the body.
    surfaces : (n_shapes, 4) meters: how far outside of the shape, and the shift in the axes of its link.

    Returns
    -------
    Body of the same parts, none thinner than a third of what it was.
    """
    shapes = []
    for shape, (outside, *shift) in zip(model.shapes, np.asarray(surfaces, dtype=np.float64).tolist(), strict=True):
        thicker, T = _thicker(shape.primitive, outside), np.array(shape.T_link_shape)
        T[:3, 3] += shift + T[:3, :3] @ (_middle(shape.primitive) - _middle(thicker))
        shapes.append(replace(shape, primitive=thicker, T_link_shape=T))
    return replace(model, shapes=tuple(shapes))


def _middle(primitive: Primitive) -> np.ndarray:
    """(3,) meters, its frame: what stays where it is while a shape grows; a mesh may lie beside its frame."""
    vertices = getattr(primitive, "vertices", None)
    return np.zeros(3) if vertices is None else 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))


def _thicker(primitive: Primitive, outside: float) -> Primitive:
    """A shape whose surface lies so far outside, meters; a cone keeps its length and, if it can, by how much its ends differ."""
    factors = np.maximum(1.0 + outside / half_extents(primitive), _THINNEST)
    if not isinstance(primitive, TruncatedCone):
        return scaled_primitive(primitive, factors)
    middle, half = 0.5 * (primitive.z1 + primitive.z2), 0.5 * (primitive.z2 - primitive.z1)
    widening = 1.0 + primitive.k * middle
    a, b = (float(radius * widening * factor) for radius, factor in zip((primitive.a, primitive.b), factors, strict=False))
    before = primitive.k / widening  # of the radius in the middle, a meter
    steepest = max(abs(before), (1.0 - _THINNEST) / max(half, abs(middle)))  # so that no radius is negative, nor that at z = 0
    slope = float(np.clip(before * widening * (primitive.a + primitive.b) / (a + b), -steepest, steepest))
    at_origin = 1.0 - slope * middle
    return TruncatedCone(a * at_origin, b * at_origin, slope / at_origin, primitive.z1, primitive.z2)
