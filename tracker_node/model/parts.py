"""Bodies without some of their parts, or with other parts in their places: amputees, prostheses, tools in a hand."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from ..errors import ModelError
from .articulated import ArticulatedModel
from .kinematic_chain import Joint, KinematicChain


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
