"""Bodies of another size: joints, shapes and landmarks of each link stretched along the link's axes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from .articulated import ArticulatedModel, Landmark, Shape
from .kinematic_chain import Joint, KinematicChain
from .shapes.nurbs import Loft, LoftedSolid, Section, loft_mesh
from .shapes.primitives import Box, Ellipsoid, Primitive, TruncatedCone

_ONES = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class LinkScale:
    """Factors along a link's x, y and z.

    ``places`` moves what is fixed to the link: joints to its children, shapes' frames, landmarks; ``sizes`` stretches the shapes
    themselves. They differ where joints are nearer or farther without the part being thinner or thicker.
    """

    places: tuple[float, float, float] = _ONES
    sizes: tuple[float, float, float] = _ONES


def scaled_uniformly(model: ArticulatedModel, factor: float) -> ArticulatedModel:
    """The same body in another size.

    Parameters
    ----------
    model, factor : body; size relative to it.

    Returns
    -------
    Body with all lengths times ``factor``.
    """
    scale = LinkScale((factor, factor, factor), (factor, factor, factor))
    return scaled_by_link(model, dict.fromkeys(model.chain.links, scale))


def scaled_by_link(model: ArticulatedModel, scales: Mapping[str, LinkScale]) -> ArticulatedModel:
    """The body with each link stretched.

    Shapes stay what they are (a cone stays a cone): the stretch is taken along the shape's own axes, which is exact where those
    are axes of the link.

    Parameters
    ----------
    model, scales : body; link -> its scale, a link without one stays.

    Returns
    -------
    Stretched body.

    Raises
    ------
    UnknownNameError : a scale for a link that the model does not have.
    ValueError : factors that are not positive.
    """
    for link, scale in scales.items():
        model.chain.link_index(link)
        if min(*scale.places, *scale.sizes) <= 0.0:
            raise ValueError(f"link '{link}': expected positive factors, got {scale}")
    none = LinkScale()
    joints = tuple(_joint(joint, scales.get(joint.parent, none)) for joint in model.chain.joints)
    shapes = tuple(_shape(shape, scales.get(shape.link, none)) for shape in model.shapes)
    landmarks = tuple(_landmark(landmark, scales.get(landmark.link, none)) for landmark in model.landmarks)
    return replace(model, chain=KinematicChain(model.chain.links, joints), shapes=shapes, landmarks=landmarks)


def with_landmarks(model: ArticulatedModel, positions: Mapping[str, np.ndarray]) -> ArticulatedModel:
    """The body with some landmarks moved within their links.

    Parameters
    ----------
    model, positions : body; landmark -> (3,) meters in the frame of its link.

    Returns
    -------
    Body with these landmarks, in the same order.
    """
    for name in positions:
        model.landmark_index(name)
    landmarks = []
    for landmark in model.landmarks:
        x, y, z = (float(v) for v in positions.get(landmark.name, landmark.position))
        landmarks.append(replace(landmark, position=(x, y, z)))
    return replace(model, landmarks=tuple(landmarks))


def _moved(transform: np.ndarray, scale: LinkScale) -> np.ndarray:
    result = np.array(transform)
    result[:3, 3] *= scale.places
    return result


def _joint(joint: Joint, scale: LinkScale) -> Joint:
    return replace(joint, T_parent_joint=_moved(joint.T_parent_joint, scale))


def _shape(shape: Shape, scale: LinkScale) -> Shape:
    # Length of each of the shape's unit axes after the stretch of the link
    factors = np.linalg.norm(np.array(scale.sizes)[:, None] * shape.T_link_shape[:3, :3], axis=0)
    return replace(shape, primitive=scaled_primitive(shape.primitive, factors), T_link_shape=_moved(shape.T_link_shape, scale))


def _landmark(landmark: Landmark, scale: LinkScale) -> Landmark:
    x, y, z = np.array(landmark.position) * scale.places
    return replace(landmark, position=(float(x), float(y), float(z)))


def scaled_primitive(primitive: Primitive, factors: np.ndarray) -> Primitive:
    """A shape stretched along its own axes; a cone stays a cone.

    Parameters
    ----------
    primitive, factors : shape; (3,) positive.

    Returns
    -------
    Shape of the same kind.
    """
    x, y, z = (float(factor) for factor in factors)
    if isinstance(primitive, TruncatedCone):
        return TruncatedCone(primitive.a * x, primitive.b * y, primitive.k / z, primitive.z1 * z, primitive.z2 * z)
    if isinstance(primitive, Ellipsoid):
        a, b, c = primitive.radii
        return Ellipsoid((a * x, b * y, c * z))
    if isinstance(primitive, Box):
        a, b, c = primitive.size
        return replace(primitive, size=(a * x, b * y, c * z))
    if isinstance(primitive, LoftedSolid) and primitive.loft is not None:
        return loft_mesh(_loft(primitive.loft, factors), primitive.n_around, primitive.ring_spacing)
    normals = primitive.normals
    if normals is not None:
        normals = normals / factors
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return replace(primitive, vertices=primitive.vertices * factors, normals=normals)


def _loft(loft: Loft, factors: np.ndarray) -> Loft:
    x, y, z = (float(factor) for factor in factors)
    sections = tuple(Section(s.z * z, s.half_x * x, s.half_y * y, s.x * x, s.y * y) for s in loft.sections)
    return Loft(sections, (loft.domes[0] * z, loft.domes[1] * z))
