"""Bodies as images show them: in clothes, whose surfaces lie beside the body's shapes.

The shapes of the human are those of an average body without clothes, and its joints not quite where those of a skeleton are: on
eight rendered people in clothes contours lay so far outside of each shape, and beside it in the axes of its link
(`benchmark/clothed/_fit.py`). Meters, of a body of the default size; spreads are a quarter larger than measured.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .articulated import ArticulatedModel
from .shape_parameters import half_extents
from .shapes.primitives import Primitive, TruncatedCone
from .variants import scaled_primitive

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


# Part, of either side (the left one's axes): means and standard deviations of: outside, forward, left, up
_SURFACES: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "pelvis": ((0.021, 0.040, 0.000, 0.008), (0.021, 0.016, 0.006, 0.037)),
    "abdomen": ((0.020, 0.045, 0.000, -0.022), (0.023, 0.028, 0.006, 0.029)),
    "torso": ((0.028, 0.034, 0.000, 0.005), (0.022, 0.014, 0.010, 0.026)),
    "neck": ((0.016, 0.001, 0.000, 0.000), (0.008, 0.009, 0.006, 0.010)),
    "head": ((0.014, 0.000, 0.000, 0.025), (0.008, 0.008, 0.009, 0.018)),
    "clavicle": ((0.032, -0.006, -0.011, -0.003), (0.018, 0.010, 0.020, 0.016)),
    "upper_arm": ((0.018, -0.002, -0.017, 0.011), (0.020, 0.010, 0.014, 0.011)),
    "forearm": ((0.001, 0.004, 0.000, -0.009), (0.008, 0.008, 0.006, 0.025)),
    "hand": ((0.004, 0.009, -0.024, 0.011), (0.008, 0.008, 0.009, 0.010)),
    "thigh": ((0.016, 0.016, -0.016, -0.007), (0.020, 0.008, 0.008, 0.020)),
    "shank": ((0.008, -0.012, 0.005, 0.016), (0.008, 0.008, 0.006, 0.023)),
    "foot": ((-0.001, -0.004, 0.008, -0.006), (0.008, 0.010, 0.007, 0.011)),
    "hips": ((0.021, 0.037, 0.000, 0.002), (0.019, 0.018, 0.006, 0.018)),
    # Of hands and feet in several parts; of thumb and heel, which lie before others, spreads are our own
    "palm": ((0.006, 0.007, -0.016, -0.009), (0.008, 0.008, 0.007, 0.012)),
    "fingers": ((0.005, 0.006, -0.032, 0.028), (0.008, 0.008, 0.009, 0.008)),
    "thumb": ((0.007, -0.007, -0.010, 0.012), (0.010, 0.010, 0.010, 0.010)),
    "midfoot": ((0.003, 0.020, 0.008, -0.009), (0.008, 0.008, 0.009, 0.008)),
    "heel": ((0.006, 0.010, 0.002, 0.003), (0.010, 0.012, 0.010, 0.010)),
    "toes": ((0.001, -0.014, 0.015, 0.001), (0.008, 0.010, 0.013, 0.010)),
}
_OF_OTHERS = (0.010, 0.0, 0.0, 0.0), (0.020, 0.012, 0.012, 0.012)  # of a part that is none of these


def expected_surfaces(model: ArticulatedModel) -> tuple[np.ndarray, np.ndarray]:
    """Means and standard deviations of the surfaces of a body's parts.

    Parameters
    ----------
    model : the human, or another body.

    Returns
    -------
    (n_shapes, 4) meters each: outside of the shape, and shifted in the axes of its link; of a body of the default size.
    """
    means, sigmas = np.empty((len(model.shapes), 4)), np.empty((len(model.shapes), 4))
    for i, shape in enumerate(model.shapes):
        side, _, part = shape.name.partition("_")
        known = _SURFACES.get(part if side in ("left", "right") else shape.name, _OF_OTHERS)
        means[i], sigmas[i] = known
        means[i, 2] *= -1.0 if side == "right" else 1.0
    return means, sigmas
