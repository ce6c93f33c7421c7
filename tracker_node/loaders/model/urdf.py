"""Robot descriptions (URDF) as models: links, joints with their limits, geometry, colors (docs/formats.md).

Joints keep their names: they are the degrees of freedom, and a landmark marks the origin of each. Read from the specification at
wiki.ros.org/urdf/XML; <capsule> and ``type="spherical"`` are pybullet's, <ellipsoid> is Drake's.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...errors import FileFormatError, ModelError
from ...geometry import se3
from ...model.articulated import DEFAULT_COLOR_RGB, ArticulatedModel, Landmark, Shape
from ...model.kinematic_chain import (
    ENDLESS_RAD,
    ROOT_DOF_NAMES,
    UNLIMITED_VELOCITY,
    Axis,
    Following,
    Joint,
    KinematicChain,
    followers_in_circle,
)
from ...model.shapes.primitives import Box, Ellipsoid, Mesh, Primitive, TruncatedCone
from .mesh_file import read_mesh
from .urdf_xml import Node, read_robot

_KINDS = ("box", "cylinder", "sphere", "capsule", "ellipsoid", "mesh")
Color = tuple[int, int, int]


def read_materials(robot: Node) -> dict[str, Color]:
    """Colors (r, g, b) of 0..255 of the materials that stand outside of links."""
    colors = {}
    for material in robot.all("material"):
        color = _color_of(material)
        if color is not None:
            colors[material.text("name")] = color
    return colors


def read_shapes(link: Node, kind: str, materials: dict[str, Color]) -> list[Shape]:
    """Shapes of a link, in its frame.

    Parameters
    ----------
    link, kind : node; "visual" or "collision".
    materials : name -> color; those that the link defines are added.

    Returns
    -------
    Shapes, their names unique within the link only.
    """
    name, result = link.text("name"), []
    for entry in link.all(kind):
        own = entry.element.get("name") or name
        T_link_shape, color = entry.origin(), _material_of(entry, materials)
        for suffix, T_shape, primitive in _primitives(entry.needed("geometry"), color is not None):
            result.append(Shape(own + suffix, name, primitive, T_link_shape @ T_shape, color or DEFAULT_COLOR_RGB))
    return result


def _material_of(entry: Node, materials: dict[str, Color]) -> Color | None:
    material = entry.one("material")
    if material is None:
        return None
    color = _color_of(material)
    name = material.element.get("name", "")
    if color is not None:
        materials.setdefault(name, color)
        return color
    if material.one("texture") is not None:
        return None
    if name not in materials:
        raise entry.error(f"a material with a color, one of {sorted(materials)}", name, "material")
    return materials[name]


def _color_of(material: Node) -> Color | None:
    color = material.one("color")
    if color is None:
        return None
    rgba = color.numbers("rgba", 4)
    if not all(0.0 <= value <= 1.0 for value in rgba):
        raise color.error("4 numbers of 0..1", color.text("rgba"), "rgba")
    r, g, b = (round(255.0 * value) for value in rgba[:3])
    return r, g, b


def _primitives(geometry: Node, colored: bool) -> list[tuple[str, np.ndarray, Primitive]]:
    """(suffix of the name, T_geometry_shape, shape) of a <geometry>; ``colored``: a mesh's own colors do not count."""
    found = [node for kind in _KINDS for node in geometry.all(kind)]
    if len(found) != 1 or len(geometry.element) != 1:
        inside = [f"<{child.tag}>" for child in geometry.element]
        raise geometry.error(f"one of {', '.join(f'<{kind}>' for kind in _KINDS)}", ", ".join(inside) or "nothing")
    node, here = found[0], np.eye(4)
    if node.tag == "box":
        size = node.numbers("size", 3)
        if not min(size) > 0.0:
            raise node.error("3 positive numbers (meters)", node.text("size"), "size")
        return [("", here, Box(size))]  # type: ignore[arg-type]
    if node.tag == "sphere":
        radius = node.positive("radius")
        return [("", here, Ellipsoid((radius, radius, radius)))]
    if node.tag == "ellipsoid":
        radii = node.numbers("radii", 3)
        if not min(radii) > 0.0:
            raise node.error("3 positive numbers (meters)", node.text("radii"), "radii")
        return [("", here, Ellipsoid(radii))]  # type: ignore[arg-type]
    if node.tag == "mesh":
        return [("", here, _mesh(node, colored))]
    radius, half = node.positive("radius"), 0.5 * node.positive("length")
    tube = TruncatedCone(radius, radius, 0.0, -half, half)
    if node.tag == "cylinder":
        return [("", here, tube)]
    ball, top, bottom = Ellipsoid((radius, radius, radius)), np.eye(4), np.eye(4)
    top[2, 3], bottom[2, 3] = half, -half
    return [("", here, tube), ("_top", top, ball), ("_bottom", bottom, ball)]


def _mesh(node: Node, colored: bool) -> Mesh:
    scale = np.array(node.numbers("scale", 3, (1.0, 1.0, 1.0)))
    if not np.all(scale != 0.0):
        raise node.error("3 numbers other than zero", node.text("scale"), "scale")
    mesh = read_mesh(_mesh_path(node), 1.0, node.path, f"{node.field}.filename")
    faces = mesh.faces if np.prod(scale) > 0.0 else mesh.faces[:, ::-1]  # a mirror turns them inside out
    normals, uv = mesh.normals, mesh.uv
    if normals is not None:
        normals = normals / scale
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    if uv is not None and faces is not mesh.faces:
        uv = uv[:, ::-1]
    mesh = replace(mesh, vertices=mesh.vertices * scale, faces=faces, normals=normals, uv=uv)
    if colored:
        mesh = replace(mesh, face_colors_rgb=None, vertex_colors_rgb=None, uv=None, texture=None)
    return mesh


def _mesh_path(node: Node) -> Path:
    """File of a <mesh>: relative to the URDF, ``file://...``, or ``package://name/...``.

    A package is searched among the folders above the URDF and where ROS has its packages.
    """
    filename, folder = node.text("filename"), node.path.resolve().parent
    scheme, separator, rest = filename.partition("://")
    if not separator:
        return folder / filename
    if scheme == "file":
        return Path(rest)
    if scheme not in ("package", "model"):
        raise node.error("a path, file:// or package://", filename, "filename")
    package, _, inside = rest.partition("/")
    candidates = [above for above in (folder, *folder.parents) if above.name == package]
    candidates += [above / package for above in (folder, *folder.parents)]
    for variable, below in (("AMENT_PREFIX_PATH", "share"), ("COLCON_PREFIX_PATH", "share"), ("ROS_PACKAGE_PATH", "")):
        candidates += [Path(prefix) / below / package for prefix in os.environ.get(variable, "").split(os.pathsep) if prefix]
    for candidate in candidates:
        if os.path.isfile(candidate / inside):
            return candidate / inside
    expected = f"a file of the package '{package}', beside or above the URDF, in AMENT_PREFIX_PATH or ROS_PACKAGE_PATH"
    raise node.error(expected, filename, "filename")


_TYPES = ("revolute", "continuous", "prismatic", "spherical", "fixed", "floating")


def load_urdf(path: str | Path, geometry: str = "visual") -> ArticulatedModel:
    """Model of a robot description.

    Parameters
    ----------
    path : the file.
    geometry : "visual", or "collision" in a file without any visual; "collision": that.

    Returns
    -------
    The robot; its limits of velocity, too.

    Raises
    ------
    FileFormatError : naming file, element and attribute; also for a robot without geometry, and for a floating joint elsewhere
        than at the root (which floats anyway).
    """
    robot = read_robot(path)
    name = robot.text("name")
    links, joint_nodes = _by_name(robot, "link"), _by_name(robot, "joint")
    if not links:
        raise robot.error("at least one <link>", "none")
    shapes = _shapes(robot, links, geometry)
    joints = [_joint(joint, node, links) for joint, node in joint_nodes.items()]
    for joint, node in joint_nodes.items():
        if node.text("type") == "floating":
            joints = _without_floating(joint, node, joints, links, shapes)
    _check_axis_names(joints, joint_nodes)
    _check_leaders(joints, joint_nodes)
    try:
        chain = KinematicChain(tuple(links), tuple(joints))
    except ModelError as error:
        raise FileFormatError(path, "joint", "a tree of all links", str(error)) from None
    landmarks = {joint.name: Landmark(joint.name, joint.child, (0.0, 0.0, 0.0)) for joint in joints}
    landmarks.setdefault(chain.links[0], Landmark(chain.links[0], chain.links[0], (0.0, 0.0, 0.0)))
    return ArticulatedModel(name, chain, tuple(shapes), tuple(landmarks.values()))


def _by_name(robot: Node, tag: str) -> dict[str, Node]:
    nodes: dict[str, Node] = {}
    for node in robot.all(tag):
        name = node.text("name")
        if name in nodes:
            raise node.error(f"each {tag} once", name, "name")
        nodes[name] = node
    return nodes


def _shapes(robot: Node, links: dict[str, Node], kind: str) -> list[Shape]:
    materials = read_materials(robot)
    if kind == "visual" and not any(link.all("visual") for link in links.values()):
        kind = "collision"
    shapes = [shape for link in links.values() for shape in read_shapes(link, kind, materials)]
    if not shapes:
        expected = "a <visual> or <collision> with <geometry> in at least one link: a body without a surface cannot be seen"
        raise robot.error(expected, f"none in {len(links)} links", "link")
    taken: Counter[str] = Counter()
    names = {shape.name for shape in shapes}
    result = []
    for shape in shapes:
        taken[shape.name] += 1
        name, number = shape.name, taken[shape.name]
        while number > 1 and name in names:
            name, number = f"{shape.name}_{number}", number + 1
        names.add(name)
        result.append(Shape(name, shape.link, shape.primitive, shape.T_link_shape, shape.color_rgb))
    return result


def _joint(name: str, node: Node, links: dict[str, Node]) -> Joint:
    kind = node.text("type")
    if kind not in _TYPES:
        raise node.error(f"one of {list(_TYPES)}", kind, "type")
    ends = []
    for end in ("parent", "child"):
        link = node.needed(end).text("link")
        if link not in links:
            raise node.error(f"a link, one of {sorted(links)}", link, f"{end}.link")
        ends.append(link)
    axes, T_joint_child = _axes(name, kind, node)
    return Joint(name, ends[0], ends[1], node.origin() @ T_joint_child, axes)


def _axes(name: str, kind: str, node: Node) -> tuple[tuple[Axis, ...], np.ndarray]:
    """Axes of a joint; and where its child is welded if the limits leave it nothing to move."""
    if kind in ("fixed", "floating"):
        return (), np.eye(4)
    if kind == "spherical":
        x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
        return (Axis(f"{name}_x", x), Axis(f"{name}_y", y), Axis(f"{name}_z", z)), np.eye(4)
    direction, mimic = _direction(node), _following(node)
    if kind == "continuous":
        fastest = _velocity_limit(node.one("limit"))
        return (Axis(name, direction, -ENDLESS_RAD, ENDLESS_RAD, mimic=mimic, velocity_limit=fastest),), np.eye(4)
    limit = node.needed("limit")
    slides = kind == "prismatic"
    lower, upper = (limit.number(end, 0.0) if slides else _stop(limit, end) for end in ("lower", "upper"))
    if lower > upper:
        raise limit.error(f"an upper limit >= the lower one ({lower:g})", upper, "upper")
    if lower == upper:
        motion = lower * np.array(direction)
        return (), se3.exp(np.append(motion, np.zeros(3)) if slides else np.append(np.zeros(3), motion))
    neutral, fastest = min(max(0.0, lower), upper), _velocity_limit(limit)
    return (Axis(name, direction, lower, upper, neutral, 0.0, slides, mimic, fastest),), np.eye(4)


def _stop(limit: Node, end: str) -> float:
    """Where a turn ends, rad; what exporters state as infinite is a turn without end."""
    with suppress(ValueError):
        stated = float(limit.element.get(end, "0"))
        if abs(stated) >= ENDLESS_RAD:
            return math.copysign(ENDLESS_RAD, stated)
    return limit.number(end, 0.0)


def _velocity_limit(limit: Node | None) -> float:
    """Of a <limit>, rad/s or m/s; infinite where none is known, for which exporters write 0, inf, or what nothing reaches."""
    if limit is None or limit.element.get("velocity", "").strip().lower() in ("inf", "infinity"):
        return np.inf
    stated = limit.number("velocity", 0.0)
    return stated if 0.0 < stated < UNLIMITED_VELOCITY else np.inf


def _following(node: Node) -> Following | None:
    mimic = node.one("mimic")
    if mimic is None:
        return None
    return Following(mimic.text("joint"), mimic.number("multiplier", 1.0), mimic.number("offset", 0.0))


def _direction(node: Node) -> tuple[float, float, float]:
    axis = node.one("axis")
    direction = np.array((1.0, 0.0, 0.0) if axis is None else axis.numbers("xyz", 3, (1.0, 0.0, 0.0)))
    length = float(np.linalg.norm(direction))
    if axis is not None and not length > 1e-9:
        raise axis.error("a direction of non-zero length", direction.tolist(), "xyz")
    x, y, z = (direction / length).tolist()
    return x, y, z


def _without_floating(name: str, node: Node, joints: list[Joint], links: dict[str, Node], shapes: list[Shape]) -> list[Joint]:
    """Joints and links without an empty root that only carries a floating joint: every root floats."""
    (floating,) = (joint for joint in joints if joint.name == name)
    root = floating.parent
    others = [joint for joint in joints if joint is not floating and root in (joint.parent, joint.child)]
    if others or any(shape.link == root for shape in shapes):
        raise node.error("a joint of another type: the root floats, nothing else can", "floating", "type")
    del links[root]
    return [joint for joint in joints if joint is not floating]


def _check_axis_names(joints: list[Joint], nodes: dict[str, Node]) -> None:
    owner: dict[str, str] = dict.fromkeys(ROOT_DOF_NAMES, "the root")
    for joint in joints:
        for axis in joint.axes:
            if axis.name in owner:
                raise nodes[joint.name].error(f"a name of its own ({owner[axis.name]} has this one)", axis.name, "name")
            owner[axis.name] = f"joint '{joint.name}'"


def _check_leaders(joints: list[Joint], nodes: dict[str, Node]) -> None:
    axes = [axis for joint in joints for axis in joint.axes]
    circle = followers_in_circle(axes)
    for joint in joints:
        for axis in joint.axes:
            if axis.mimic is None:
                continue
            others = sorted(other.name for other in axes if other.name != axis.name)
            expected = "a joint that does not follow this one" if axis.name in circle else ""
            if axis.mimic.leader not in others:
                expected = f"another joint that moves, one of {others}"
            if expected:
                raise nodes[joint.name].needed("mimic").error(expected, axis.mimic.leader, "joint")
