"""Bodies as YAML (``model.yaml``; the format is described in docs/formats.md), and which kind of file a body is in.

Files of other programs are refused by what they are.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from ...errors import FileFormatError, ModelError, WrongKindOfFileError
from ...geometry import se3, so3
from ...model.articulated import ArticulatedModel, Landmark, Shape
from ...model.humans.human import gait_human, human_model
from ...model.humans.segments18 import ellipsoid_human, nurbs_human
from ...model.kinematic_chain import Axis, Following, Joint, KinematicChain
from ...model.shapes.nurbs import N_AROUND, RING_SPACING, LoftedSolid, loft_mesh
from ...model.shapes.primitives import BOX_FACES, Box, Ellipsoid, Mesh, Primitive, TruncatedCone
from ..file_model import validate
from ..whole_file import MEDIA_BYTES, check_regular, read_text
from ..yaml_file import Inline, read_mapping, write_mapping
from .mesh_file import read_mesh, read_texture, write_mesh, write_texture
from .model_file import AxisEntry, BoxEntry, ConeEntry, DescribedFile, EllipsoidEntry, LoftEntry, ModelFile, ShapeEntry
from .urdf import load_urdf

_MESHES = (".obj", ".stl", ".ply", ".glb", ".gltf", ".dae", ".off", ".3mf")
_BEGINNINGS = {
    "<mujoco": "a MuJoCo model", "<sdf": "an SDF model", "<OpenSimDocument": "an OpenSim model", "HIERARCHY": "a BVH file",
}  # fmt: skip
_BEFORE_ROOT = re.compile(r"(?:\s|\ufeff|<\?.*?\?>|<!--.*?-->|<!DOCTYPE[^>]*>)*", re.DOTALL)


def is_robot(path: str | Path) -> bool:
    """True for a robot description (URDF), by suffix or content.

    Raises
    ------
    WrongKindOfFileError : a mesh, or a model of another program.
    FileFormatError : a file that cannot be read.
    """
    file = Path(path)
    if file.suffix.lower() in (".urdf", ".xacro"):
        return True
    if file.suffix.lower() in _MESHES:
        check_regular(path, MEDIA_BYTES)
        body = f"a body; in a model.yaml it belongs under shapes, as `type: mesh, file: {file.name}`"
        raise WrongKindOfFileError(path, "a mesh", body)
    text = read_text(path)
    start = text[_BEFORE_ROOT.match(text).end() :]  # type: ignore[union-attr]
    for beginning, kind in _BEGINNINGS.items():
        if start.startswith(beginning):
            raise WrongKindOfFileError(path, kind, "a body (a model.yaml or a URDF)")
    return start.startswith("<robot")


HUMANS: Mapping[str, Callable[[], ArticulatedModel]] = {  # by words that may stand wherever a model file may be named
    "human": human_model,
    "gait_human": gait_human,
    "ellipsoid_human": ellipsoid_human,
    "nurbs_human": nurbs_human,
}


def load_model(path: str | Path) -> ArticulatedModel:
    """Body of a model file or of a robot description (URDF); meshes and textures are searched relative to its folder.

    A word of `HUMANS`, such as ``gait_human``, is that body, unless a file has this name. A model file may name a
    description, with the geometry that is seen.

    Raises
    ------
    FileFormatError : naming file and field, also for a cycle, an unknown link or a repeated name.
    """
    if is_named(path):
        return HUMANS[Path(path).name]()
    if Path(path).stem in HUMANS and not Path(path).exists():
        raise FileFormatError(path, "(file)", existing_model(path), "no such file")
    if is_robot(path):
        return load_urdf(path)
    content = read_mapping(path)
    if "urdf" in content:
        described = validate(DescribedFile, content, path)
        urdf = Path(path).parent / described.urdf
        if not urdf.is_file():
            raise FileFormatError(path, "urdf", "an existing file", urdf)
        return load_urdf(urdf, described.geometry)
    return _build_model(validate(ModelFile, content, path), path)


def is_named(path: str | Path) -> bool:
    """True for a word that names a body of the package, in whatever folder, where there is no such file."""
    return Path(path).name in HUMANS and not Path(path).exists()


def existing_model(path: str | Path) -> str:
    """What is expected in the place of a model file that is missing: where it is ``human.yaml``, ``human`` may be meant."""
    word = Path(path).stem
    return "an existing file" + (f", or {word}, the name of a body of the package" if word in HUMANS else "")


def _build_model(model_file: ModelFile, path: str | Path) -> ArticulatedModel:
    """Body of a validated file; ``path`` is for messages and for finding meshes and textures."""
    joints = []
    for name, entry in model_file.joints.items():
        axes = tuple(_axis(axis) for axis in entry.axes)
        joints.append(Joint(name, entry.parent, entry.child, transform_of(entry.xyz, entry.rpy_deg), axes))
    try:
        chain = KinematicChain(model_file.links, tuple(joints))
    except ModelError as error:  # the format has named all of these; this is the net below it
        raise FileFormatError(path, "joints", "a tree of all links", str(error)) from None
    shapes = []
    for name, shape in model_file.shapes.items():
        primitive = _primitive(shape, path, f"shapes.{name}")
        shapes.append(Shape(name, shape.link, primitive, transform_of(shape.xyz, shape.rpy_deg), shape.color_rgb))
    landmarks = tuple(Landmark(name, mark.link, mark.xyz) for name, mark in model_file.landmarks.items())
    return ArticulatedModel(model_file.name, chain, tuple(shapes), landmarks, model_file.symmetric, model_file.clothed)


def dump_model(model: ArticulatedModel, path: str | Path, comment: str = "") -> None:
    """Write a body; meshes and textures go beside the file as ``<stem>_<shape>...``.

    Parameters
    ----------
    model, path : body; YAML file.
    comment : lines on top of the file.
    """
    path = Path(path)
    names = [shape.name for shape in model.shapes]
    if len(set(names)) != len(names):
        raise ValueError(f"expected unique shape names, got {names}")
    joints = {}
    for joint in model.chain.joints:
        entry: dict[str, Any] = {"parent": joint.parent, "child": joint.child, **_placed(joint.T_parent_joint)}
        if joint.axes:
            entry["axes"] = [_axis_values(axis) for axis in joint.axes]
        joints[joint.name] = entry
    values: dict[str, Any] = {
        "name": model.name,
        "links": list(model.chain.links),
        "joints": joints,
        "shapes": {shape.name: _shape_values(shape, path) for shape in model.shapes},
        "landmarks": {m.name: {"link": m.link, "xyz": [float(v) for v in m.position]} for m in model.landmarks},
    }
    values |= {name: True for name in ("symmetric", "clothed") if getattr(model, name)}
    validate(ModelFile, values, path)  # never write what could not be read again
    write_mapping(values, path, comment or "Articulated model; the format is described in docs/formats.md.")


def transform_of(xyz: tuple[float, ...], rpy_deg: tuple[float, ...]) -> np.ndarray:
    """Rigid transform of an offset and fixed-axis angles: R = Rz(yaw) Ry(pitch) Rx(roll).

    Parameters
    ----------
    xyz, rpy_deg : meters; roll, pitch, yaw in degrees.

    Returns
    -------
    T_parent_child (4, 4).
    """
    return se3.from_rotation_translation(so3.from_roll_pitch_yaw(np.deg2rad(rpy_deg)), np.array(xyz))


def _axis(entry: AxisEntry) -> Axis:
    direction = np.array(entry.direction) / np.linalg.norm(entry.direction)
    x, y, z = direction.tolist()
    mimic = None
    if entry.mimic is not None:
        offset = entry.mimic.offset_m if entry.slides else float(np.deg2rad(entry.mimic.offset_deg))
        mimic = Following(entry.mimic.axis, entry.mimic.multiplier, offset)
    if entry.limits_m is not None:
        return Axis(entry.name, (x, y, z), *entry.limits_m, entry.neutral_m, entry.stiffness, True, mimic)
    lower, upper = np.deg2rad(entry.limits_deg)
    neutral = float(np.clip(np.deg2rad(entry.neutral_deg), lower, upper))
    return Axis(entry.name, (x, y, z), float(lower), float(upper), neutral, entry.stiffness, False, mimic)


def _axis_values(axis: Axis) -> dict[str, Any]:
    unit, tidy = ("m", float) if axis.prismatic else ("deg", _tidy_deg)
    values: dict[str, Any] = {
        "name": axis.name,
        "direction": [float(v) for v in axis.direction],
        f"limits_{unit}": [tidy(axis.lower), tidy(axis.upper)],
    }
    if axis.neutral != 0.0:
        values[f"neutral_{unit}"] = tidy(axis.neutral)
    if axis.stiffness != 0.0:
        values["stiffness"] = float(axis.stiffness)
    if axis.mimic is not None:
        following = axis.mimic
        values["mimic"] = {"axis": following.leader, "multiplier": float(following.multiplier)}
        if following.offset != 0.0:
            values["mimic"][f"offset_{unit}"] = tidy(following.offset)
    return values


def _tidy_deg(angle: float) -> float:
    """Degrees, without the last digits that the conversion itself makes (35.00000000000001)."""
    return round(float(np.rad2deg(angle)), 11) + 0.0


def _primitive(entry: ShapeEntry, path: str | Path, field: str) -> Primitive:
    if isinstance(entry, ConeEntry):
        z1, z2 = entry.span
        return TruncatedCone(entry.a, entry.b, entry.taper_per_m, z1, z2)
    if isinstance(entry, EllipsoidEntry):
        return Ellipsoid(entry.radii)
    if isinstance(entry, BoxEntry):
        return _box(entry, path, field)
    if isinstance(entry, LoftEntry):
        try:
            return loft_mesh(entry.loft, entry.vertices_around, entry.ring_spacing)
        except ValueError as error:  # sections too near each other for their size, or too far apart
            raise FileFormatError(path, f"{field}.sections", "sections that a surface can go through", str(error)) from None
    folder = Path(path).parent
    texture = None if entry.texture is None else read_texture(folder / entry.texture, path, f"{field}.texture")
    return read_mesh(folder / entry.file, entry.scale, path, f"{field}.file", texture)


def _box(entry: BoxEntry, path: str | Path, field: str) -> Box:
    colors = None
    if entry.face_colors_rgb:
        colors = np.array([entry.face_colors_rgb.get(face, entry.color_rgb) for face in BOX_FACES], dtype=np.uint8)
    textures = None
    if entry.textures:
        folder = Path(path).parent
        by_face = {face: read_texture(folder / file, path, f"{field}.textures.{face}") for face, file in entry.textures.items()}
        textures = tuple(by_face.get(face) for face in BOX_FACES)
    return Box(entry.size, colors, textures)


def _shape_values(shape: Shape, path: Path) -> dict[str, Any]:
    primitive = shape.primitive
    values: dict[str, Any] = {"link": shape.link}
    if isinstance(primitive, TruncatedCone):
        values |= {"type": "truncated_elliptical_cone", "a": primitive.a, "b": primitive.b, "taper": primitive.k}
        values |= {"z1": primitive.z1, "z2": primitive.z2}
    elif isinstance(primitive, Ellipsoid):
        values |= {"type": "ellipsoid", "radii": list(primitive.radii)}
    elif isinstance(primitive, Box):
        values |= _box_values(primitive, _beside(path, shape.name))
    elif isinstance(primitive, LoftedSolid) and primitive.loft is not None:
        values |= _loft_values(primitive)
    elif isinstance(primitive, Mesh):
        file = write_mesh(primitive, _beside(path, shape.name))
        values |= {"type": "mesh", "file": file.name}
    values = {key: float(value) if isinstance(value, np.floating) else value for key, value in values.items()}
    return values | _placed(shape.T_link_shape) | {"color_rgb": [int(c) for c in shape.color_rgb]}


def _beside(path: Path, name: str) -> Path:
    """Stem of the files of a shape of any name: one with a slash must not lead to another folder."""
    return path.with_name(f"{path.stem}_{quote(name, safe=' ')}")


def _box_values(box: Box, stem: Path) -> dict[str, Any]:
    values: dict[str, Any] = {"type": "box", "size": list(box.size)}
    if box.face_colors_rgb is not None:
        values["face_colors_rgb"] = {face: color.tolist() for face, color in zip(BOX_FACES, box.face_colors_rgb, strict=True)}
    textures = dict(zip(BOX_FACES, box.textures or (), strict=False))
    files = {face: stem.with_name(f"{stem.name}_{face}.png") for face, texture in textures.items() if texture is not None}
    for face, file in files.items():
        file.parent.mkdir(parents=True, exist_ok=True)
        write_texture(textures[face], file)  # type: ignore[arg-type]
    return values | ({"textures": {face: file.name for face, file in files.items()}} if files else {})


def _loft_values(solid: LoftedSolid) -> dict[str, Any]:
    sections = []
    for section in solid.loft.sections:  # type: ignore[union-attr]
        row = {name: float(value) for name, value in vars(section).items()}
        sections.append(Inline({name: value for name, value in row.items() if name not in "xy" or value != 0.0}))
    values: dict[str, Any] = {"type": "lofted", "sections": sections, "domes": list(solid.loft.domes)}  # type: ignore[union-attr]
    fineness = {"vertices_around": solid.n_around, "ring_spacing": float(solid.ring_spacing)}
    return values | ({} if (solid.n_around, solid.ring_spacing) == (N_AROUND, RING_SPACING) else fineness)


def _placed(transform: np.ndarray) -> dict[str, Any]:
    values: dict[str, Any] = {"xyz": [float(v) for v in transform[:3, 3]]}
    rpy_deg = np.rad2deg(so3.to_roll_pitch_yaw(transform[:3, :3])) + 0.0
    if rpy_deg.any():
        values["rpy_deg"] = rpy_deg.tolist()
    return values
