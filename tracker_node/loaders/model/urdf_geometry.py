"""What a link of a robot description looks like: its geometry as shapes, with their colors."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...model.articulated import DEFAULT_COLOR_RGB, Shape
from ...model.shapes.primitives import Box, Ellipsoid, Mesh, Primitive, TruncatedCone
from .mesh_file import read_mesh
from .urdf_xml import Node

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
    """Shapes of a link from its ``kind`` of geometry, "visual" or "collision", in the link's frame.

    Names are unique within the link only.
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

    A package is looked for among the folders above the URDF and where ROS has its packages.
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
