"""Models as robot descriptions (URDF), for programs that show robots."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from xml.etree import ElementTree

import numpy as np

from ...geometry import so3
from ...model.articulated import ArticulatedModel, Shape
from ...model.humans.masses import Inertial
from ...model.kinematic_chain import UNLIMITED_VELOCITY
from ...model.shapes.primitives import Box, Ellipsoid, Mesh, TruncatedCone


def urdf_of(model: ArticulatedModel, masses: Mapping[str, Inertial] | None = None) -> str:
    """URDF of a model: one joint (and link) per axis, its name the axis's.

    URDF knows neither tapered cones nor ellipsoids: they appear as the cylinder or sphere of equal mean radius, a mesh as its
    bounding box. The markers show the true shapes.

    Parameters
    ----------
    model : the body.
    masses : of its links; None: it tells nothing of them.

    Returns
    -------
    XML.
    """
    robot = ElementTree.Element("robot", name=model.name)
    chain, joint_of = model.chain, {joint.child: joint for joint in model.chain.joints}
    for i, link in enumerate(chain.links):
        if i:
            _add_joints(robot, model, i, joint_of[link].name)
        element = ElementTree.SubElement(robot, "link", name=link)
        if masses and link in masses:
            _add_inertial(element, masses[link])
        for shape in model.shapes:
            if shape.link == link:
                _add_visual(element, shape)
    ElementTree.indent(robot)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding="unicode")


def _add_joints(robot: ElementTree.Element, model: ArticulatedModel, link_index: int, joint_name: str) -> None:
    chain = model.chain
    link, parent = chain.links[link_index], chain.links[chain.parents[link_index]]
    first, count = int(chain.axis_start[link_index]), int(chain.axis_count[link_index])
    origin = chain.offsets[link_index]
    if count == 0:
        joint = ElementTree.SubElement(robot, "joint", name=joint_name, type="fixed")
        _add_ends(joint, origin, parent, link)
    for i, axis in enumerate(chain.axes[first : first + count]):
        last = i == count - 1
        child = link if last else f"{link}_after_{axis.name}"
        kind = "prismatic" if axis.prismatic else "continuous" if axis.endless else "revolute"
        joint = ElementTree.SubElement(robot, "joint", name=axis.name, type=kind)
        _add_ends(joint, origin, parent, child)
        ElementTree.SubElement(joint, "axis", xyz=_numbers(axis.direction))
        limits = {} if axis.endless else {"lower": f"{axis.lower:.9g}", "upper": f"{axis.upper:.9g}"}
        fastest = min(axis.velocity_limit, UNLIMITED_VELOCITY)
        ElementTree.SubElement(joint, "limit", {**limits, "effort": "0", "velocity": f"{fastest:.9g}"})
        if axis.mimic is not None:
            following = {"multiplier": f"{axis.mimic.multiplier:.9g}", "offset": f"{axis.mimic.offset:.9g}"}
            ElementTree.SubElement(joint, "mimic", {"joint": axis.mimic.leader, **following})
        if not last:
            ElementTree.SubElement(robot, "link", name=child)
        parent, origin = child, np.eye(4)


def _add_ends(joint: ElementTree.Element, T_parent_child: np.ndarray, parent: str, child: str) -> None:
    _add_origin(joint, T_parent_child)
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)


def _add_origin(element: ElementTree.Element, T: np.ndarray) -> None:
    ElementTree.SubElement(element, "origin", xyz=_numbers(T[:3, 3]), rpy=_numbers(so3.to_roll_pitch_yaw(T[:3, :3])))


def _add_inertial(link: ElementTree.Element, of_link: Inertial) -> None:
    element, about = ElementTree.SubElement(link, "inertial"), of_link.inertia
    ElementTree.SubElement(element, "origin", xyz=_numbers(of_link.center), rpy="0 0 0")
    ElementTree.SubElement(element, "mass", value=f"{of_link.mass:.9g}")
    entries = {f"i{'xyz'[i]}{'xyz'[j]}": f"{about[i, j]:.9g}" for i in range(3) for j in range(i, 3)}
    ElementTree.SubElement(element, "inertia", entries)


def _add_visual(link: ElementTree.Element, shape: Shape) -> None:
    visual = ElementTree.SubElement(link, "visual", name=shape.name)
    primitive, T = shape.primitive, shape.T_link_shape.copy()
    geometry = ElementTree.Element("geometry")
    if isinstance(primitive, Ellipsoid):
        ElementTree.SubElement(geometry, "sphere", radius=f"{np.mean(primitive.radii):.6g}")
    elif isinstance(primitive, Box):
        ElementTree.SubElement(geometry, "box", size=_numbers(primitive.size))
    elif isinstance(primitive, TruncatedCone):
        middle = 0.5 * (primitive.z1 + primitive.z2)
        T[:3, 3] += T[:3, 2] * middle
        radius = np.sqrt(primitive.a * primitive.b) * (1.0 + primitive.k * middle)
        ElementTree.SubElement(geometry, "cylinder", radius=f"{radius:.6g}", length=f"{primitive.z2 - primitive.z1:.6g}")
    elif isinstance(primitive, Mesh):
        low, high = primitive.vertices.min(axis=0), primitive.vertices.max(axis=0)
        T[:3, 3] += T[:3, :3] @ (0.5 * (low + high))
        ElementTree.SubElement(geometry, "box", size=_numbers(np.maximum(high - low, 1e-6)))
    _add_origin(visual, T)
    visual.append(geometry)
    material = ElementTree.SubElement(visual, "material", name=f"{shape.name}_color")
    rgba = [*(c / 255.0 for c in shape.color_rgb), 1.0]
    ElementTree.SubElement(material, "color", rgba=_numbers(rgba))


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{float(v):.9g}" for v in values)
