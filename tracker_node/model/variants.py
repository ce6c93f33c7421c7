"""Bodies made from others: of another size, without some parts, or with other parts in their places.

Joints, shapes and landmarks of each link are stretched along the link's axes. Parts are left out and put in their places for
amputees, prostheses, tools in a hand.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..errors import ModelError
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


def without_links(model: ArticulatedModel, links: Iterable[str]) -> ArticulatedModel:
    """The body without some links and all that hangs on them: their shapes, joints and landmarks.

    Parameters
    ----------
    model : the body.
    links : to be removed, ``left_shank``; the joint at which one hung stays as a landmark, if it was one.

    Returns
    -------
    The body that is left.

    Raises
    ------
    ModelError : the root is among them, or what is left follows an axis that is gone.
    UnknownNameError : no such link.
    """
    chain = model.chain
    gone = {chain.link_index(link) for link in links}
    if 0 in gone:
        raise ModelError(f"'{model.name}' cannot be without its root '{chain.links[0]}'")
    for i in range(len(chain.links)):  # parents come first
        if int(chain.parents[i]) in gone:
            gone.add(i)
    names = {chain.links[i] for i in gone}
    joints = tuple(joint for joint in chain.joints if joint.child not in names)
    axes = {axis.name for joint in joints for axis in joint.axes}
    for joint in joints:
        for axis in joint.axes:
            if axis.mimic is not None and axis.mimic.leader not in axes:
                raise ModelError(f"'{axis.name}' of '{model.name}' follows '{axis.mimic.leader}', which is among the removed")
    return replace(
        model,
        chain=KinematicChain(tuple(link for link in chain.links if link not in names), joints),
        shapes=tuple(shape for shape in model.shapes if shape.link not in names),
        landmarks=tuple(landmark for landmark in model.landmarks if landmark.link not in names),
    )


def with_part(model: ArticulatedModel, link: str, part: ArticulatedModel) -> ArticulatedModel:
    """The body with another part in the place of a link and all that hangs on it.

    Parameters
    ----------
    model : the body.
    link : to be replaced, ``left_foot``.
    part : a body of its own; its root is welded where the link's joint was, axes as those of the link in the neutral pose.

    Returns
    -------
    The body with the part, and with its degrees of freedom.

    Raises
    ------
    ModelError : the link is the root, or a name of the part is one of the body's.
    UnknownNameError : no such link.
    """
    rest = without_links(model, [link])
    joint = next(joint for joint in model.chain.joints if joint.child == link)
    kinds = {
        "link": (rest.chain.links, part.chain.links),
        "joint": ([j.name for j in rest.chain.joints], [joint.name, *(j.name for j in part.chain.joints)]),
        "degree of freedom": ([axis.name for axis in rest.chain.axes], [axis.name for axis in part.chain.axes]),
        "shape": ([shape.name for shape in rest.shapes], [shape.name for shape in part.shapes]),
        "landmark": (rest.landmark_names, part.landmark_names),
    }
    for kind, (own, others) in kinds.items():
        twice = [name for name in others if name in own]
        if twice:
            raise ModelError(f"'{part.name}' in the place of '{link}': the body has a {kind} '{twice[0]}' already")
    weld = Joint(joint.name, joint.parent, part.chain.links[0], joint.T_parent_joint)
    return replace(
        rest,
        chain=KinematicChain((*rest.chain.links, *part.chain.links), (*rest.chain.joints, weld, *part.chain.joints)),
        shapes=(*rest.shapes, *part.shapes),
        landmarks=(*rest.landmarks, *part.landmarks),
    )
