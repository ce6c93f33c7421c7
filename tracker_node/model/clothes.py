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
        T = np.array(shape.T_link_shape)
        T[:3, 3] += shift
        shapes.append(replace(shape, primitive=_thicker(shape.primitive, outside), T_link_shape=T))
    return replace(model, shapes=tuple(shapes))


def _thicker(primitive: Primitive, outside: float) -> Primitive:
    """A shape whose surface lies so far outside, meters; a cone keeps its length, and by how much its ends differ."""
    factors = np.maximum(1.0 + outside / half_extents(primitive), _THINNEST)
    if not isinstance(primitive, TruncatedCone):
        return scaled_primitive(primitive, factors)
    middle = 0.5 * (primitive.z1 + primitive.z2)
    widening = 1.0 + primitive.k * middle
    a, b = (float(half * widening * factor) for half, factor in zip((primitive.a, primitive.b), factors, strict=False))
    slope = primitive.k * 0.5 * (primitive.a + primitive.b) / (0.5 * (a + b))
    at_origin = 1.0 - slope * middle
    return TruncatedCone(a * at_origin, b * at_origin, slope / at_origin, primitive.z1, primitive.z2)
