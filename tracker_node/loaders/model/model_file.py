"""What a model file may hold, and what must fit together in it."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from ...errors import repeated
from ...model.articulated import DEFAULT_COLOR_RGB
from ...model.kinematic_chain import ROOT_DOF_NAMES
from ...model.shapes.nurbs import N_AROUND, RING_SPACING, Loft, Section
from ...model.shapes.primitives import BOX_FACES
from ..file_model import BODY, FileModel, Number, PositiveNumber, are_numbers, checked, floats, is_number, numbers, problem

LEAST_RANGE = 1e-6  # degrees or meters between an axis's limits; radians and back must not close it
Vector = numbers(3)


def _are_limits(value: Any) -> bool:
    return are_numbers(value, 2) and value[1] - value[0] > LEAST_RANGE


def _is_color(value: Any) -> bool:
    return isinstance(value, (list, tuple)) and len(value) == 3 and all(type(v) is int and 0 <= v <= 255 for v in value)


PositiveVector = Annotated[
    tuple[float, float, float], checked("3 positive numbers (meters)", lambda v: are_numbers(v, 3) and min(v) > 0, floats)
]
PositivePair = Annotated[
    tuple[float, float], checked("2 positive numbers (meters)", lambda v: are_numbers(v, 2) and min(v) > 0, floats)
]
Color = Annotated[tuple[int, int, int], checked("[r, g, b], whole numbers of 0..255", _is_color, tuple)]
Degrees = Annotated[tuple[float, float], checked("[lower, upper] in degrees with lower < upper", _are_limits, floats)]
Meters = Annotated[tuple[float, float], checked("[lower, upper] in meters with lower < upper", _are_limits, floats)]
RingSpacing = Annotated[float, checked("a number >= 0.001 (meters)", lambda v: is_number(v) and v >= 0.001, float)]


_TELLING_AXES, _RADIANS = 3, 6.5  # as many axes that all turn by less, a whole turn in radians


class MimicEntry(FileModel):
    """Position = multiplier * that of the leading axis + offset, in radians and meters but for ``offset_deg``."""

    axis: str
    multiplier: Number = 1.0
    offset_deg: Number = 0.0
    offset_m: Number = 0.0


class AxisEntry(FileModel):
    """One degree of freedom of a joint: a turn, or with ``limits_m`` a slide."""

    name: str
    direction: Vector  # type: ignore[valid-type]
    limits_deg: Degrees = (-180.0, 180.0)
    neutral_deg: Number = 0.0
    limits_m: Meters | None = None
    neutral_m: Number = 0.0
    stiffness: Number = 0.0
    mimic: MimicEntry | None = None

    @model_validator(mode="before")
    @classmethod
    def _refuse_follows(cls, values: Any) -> Any:
        if isinstance(values, dict) and "follows" in values:
            raise problem("its present name, mimic (`tracker_node migrate` rewrites files)", values["follows"], "follows")
        return values

    @model_validator(mode="after")
    def _sound(self) -> AxisEntry:
        if not np.linalg.norm(self.direction) > 1e-9:
            raise problem("a direction of non-zero length", self.direction, "direction")
        given = self.model_fields_set
        for other in ("limits_deg", "neutral_deg") if self.slides else ("neutral_m",):
            if other in given:
                raise problem("degrees of an axis that turns, or limits_m of one that slides", "both kinds", other)
        field, what = ("neutral_m", "a length") if self.slides else ("neutral_deg", "an angle")
        (lower, upper), neutral = self.limits_m or self.limits_deg, getattr(self, field)
        if not lower <= neutral <= upper:
            raise problem(f"{what} within the limits [{lower:g}, {upper:g}]", neutral, field)
        if self.stiffness < 0.0:
            raise problem("a number >= 0", self.stiffness, "stiffness")
        if self.mimic is not None:
            wrong = "offset_deg" if self.slides else "offset_m"
            if wrong in self.mimic.model_fields_set:
                raise problem("an offset in the axis's own unit", wrong, f"mimic.{wrong}")
        return self

    @property
    def slides(self) -> bool:
        return self.limits_m is not None


class Placed(FileModel):
    """Something with a place in the frame of a link."""

    xyz: Vector = (0.0, 0.0, 0.0)  # type: ignore[valid-type]
    rpy_deg: Vector = (0.0, 0.0, 0.0)  # type: ignore[valid-type]


class JointEntry(Placed):
    """A joint: where it sits in its parent, and its axes in the order in which they turn."""

    parent: str
    child: str
    axes: tuple[AxisEntry, ...] = ()


class _ShapeBase(Placed):
    link: str
    color_rgb: Color = DEFAULT_COLOR_RGB


class ConeEntry(_ShapeBase):
    """Truncated elliptical cone along z; give ``length`` (from z = 0) or ``z1`` and ``z2``, ``taper`` or ``end_scale``."""

    type: Literal["truncated_elliptical_cone"]
    a: PositiveNumber
    b: PositiveNumber
    taper: Number | None = None
    end_scale: PositiveNumber | None = None
    length: PositiveNumber | None = None
    z1: Number | None = None
    z2: Number | None = None

    @model_validator(mode="after")
    def _sound(self) -> ConeEntry:
        given = [name for name in ("z1", "z2") if getattr(self, name) is not None]
        if (self.length is not None) == bool(given):
            raise problem("either length or z1 and z2", "both" if given else "neither", "length")
        if len(given) == 1:
            raise problem("z1 and z2", f"only {given[0]}", "z2" if given == ["z1"] else "z1")
        z1, z2 = self.span
        if not z1 < z2:
            raise problem("z1 < z2", [z1, z2], "z2")
        if self.taper is not None and self.end_scale is not None:
            raise problem("either taper or end_scale", "both", "end_scale")
        if self.end_scale is not None and z2 == 0.0:
            raise problem("taper (end_scale is relative to z = 0, which is the end itself)", self.end_scale, "end_scale")
        if min(1.0 + self.taper_per_m * z for z in self.span) <= 0.0:
            raise problem("a cone without its tip: 1 + taper z > 0 from z1 to z2", self.taper_per_m, "taper")
        return self

    @property
    def span(self) -> tuple[float, float]:
        """Both ends on the axis, meters."""
        return (0.0, self.length) if self.length is not None else (self.z1, self.z2)  # type: ignore[return-value]

    @property
    def taper_per_m(self) -> float:
        """k of the half-axes a (1 + k z), b (1 + k z)."""
        if self.end_scale is not None:
            return (self.end_scale - 1.0) / self.span[1]
        return self.taper if self.taper is not None else 0.0


class EllipsoidEntry(_ShapeBase):
    type: Literal["ellipsoid"]
    radii: PositiveVector


class BoxEntry(_ShapeBase):
    """Box; a face of its own color or with a texture is named by the axis that points out of it."""

    type: Literal["box"]
    size: PositiveVector
    face_colors_rgb: dict[str, Color] = Field(default_factory=dict)
    textures: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _sound(self) -> BoxEntry:
        for field, faces in (("face_colors_rgb", self.face_colors_rgb), ("textures", self.textures)):
            for face in faces:
                if face not in BOX_FACES:
                    raise problem(f"a face, one of {list(BOX_FACES)}", face, field)
        return self


class MeshEntry(_ShapeBase):
    """Mesh file, with its colors; ``texture`` is a texture to put in the place of the file's own."""

    type: Literal["mesh"]
    file: str
    scale: PositiveNumber = 1.0
    texture: str | None = None


class SectionEntry(FileModel):
    """Stadium across z."""

    z: Number
    half_x: PositiveNumber
    half_y: PositiveNumber
    x: Number = 0.0
    y: Number = 0.0


class LoftEntry(_ShapeBase):
    """Solid through stadium cross-sections in the order of z, with a dome on either end."""

    type: Literal["lofted"]
    sections: tuple[SectionEntry, ...] = Field(min_length=2)
    domes: PositivePair
    vertices_around: Annotated[int, Field(ge=8, le=1024)] = N_AROUND
    ring_spacing: RingSpacing = RING_SPACING

    @model_validator(mode="after")
    def _sound(self) -> LoftEntry:
        for i, (below, above) in enumerate(pairwise(self.sections)):
            if not below.z < above.z:
                raise problem(f"a section above the one before it (z > {below.z:g})", above.z, f"sections.{i + 1}.z")
        return self

    @property
    def loft(self) -> Loft:
        """What the model's code makes of it."""
        return Loft(tuple(Section(s.z, s.half_x, s.half_y, s.x, s.y) for s in self.sections), self.domes)


ShapeEntry = Annotated[ConeEntry | EllipsoidEntry | BoxEntry | MeshEntry | LoftEntry, Field(discriminator="type")]


class LandmarkEntry(FileModel):
    link: str
    xyz: Vector  # type: ignore[valid-type]


class DescribedFile(FileModel):
    """A model file that names a robot description, and which of its geometries is seen."""

    KIND: ClassVar[str] = BODY

    urdf: str
    geometry: Literal["visual", "collision"] = "visual"


class ModelFile(FileModel):
    """A whole model file."""

    KIND: ClassVar[str] = BODY

    name: str
    links: tuple[str, ...] = Field(min_length=1)
    joints: dict[str, JointEntry] = Field(default_factory=dict)
    shapes: dict[str, ShapeEntry] = Field(default_factory=dict)
    landmarks: dict[str, LandmarkEntry] = Field(default_factory=dict)
    symmetric: bool = False
    clothed: bool = False

    @model_validator(mode="after")
    def _fits_together(self) -> ModelFile:
        if twice := repeated(self.links):
            raise problem("each link once", twice, "links")
        for kind, references in (
            ("joints", {f"{n}.{end}": getattr(j, end) for n, j in self.joints.items() for end in ("parent", "child")}),
            ("shapes", {f"{n}.link": s.link for n, s in self.shapes.items()}),
            ("landmarks", {f"{n}.link": m.link for n, m in self.landmarks.items()}),
        ):
            for field, link in references.items():
                if link not in self.links:
                    raise problem(f"a link, one of {sorted(self.links)}", link, f"{kind}.{field}")
        self._check_tree()
        self._check_axis_names()
        self._check_limits()
        moving = sorted(name for name, joint in self.joints.items() if joint.axes)
        if self.symmetric and moving:
            raise problem("false of a body with joints: only things may be found in another turn", moving, "symmetric")
        return self

    def _check_limits(self) -> None:
        """No body has only joints that hardly turn, but many a file has radians."""
        axes = [axis for joint in self.joints.values() for axis in joint.axes]
        stated = [axis.limits_deg for axis in axes if "limits_deg" in axis.model_fields_set]
        largest = max((max(map(abs, limits)) for limits in stated), default=0.0)
        if len(stated) >= _TELLING_AXES and largest < _RADIANS:
            raise problem("degrees", f"limits of at most {largest:g}, which are radians", "joints.limits_deg")

    def _check_tree(self) -> None:
        parent_of: dict[str, str] = {}
        joint_to: dict[str, str] = {}
        for name, joint in self.joints.items():
            if joint.child in joint_to:
                expected = f"a link that no other joint carries (joint '{joint_to[joint.child]}' does)"
                raise problem(expected, joint.child, f"joints.{name}.child")
            parent_of[joint.child], joint_to[joint.child] = joint.parent, name
        for link in self.links:
            path = [link]
            while path[-1] in parent_of:
                path.append(parent_of[path[-1]])
                if path[-1] in path[:-1]:
                    cycle = path[path.index(path[-1]) :]
                    field = f"joints.{joint_to[cycle[0]]}.parent"
                    raise problem("a tree", "the cycle " + " -> ".join(reversed(cycle)), field)
        roots = [link for link in self.links if link not in parent_of]
        if len(roots) > 1:
            raise problem(f"one root; a joint to each other link than '{roots[0]}'", roots, "links")

    def _check_axis_names(self) -> None:
        seen: dict[str, str] = dict.fromkeys(ROOT_DOF_NAMES, "the root")
        for name, joint in self.joints.items():
            for i, axis in enumerate(joint.axes):
                if axis.name in seen:
                    expected = f"a name of its own ({seen[axis.name]} has this one)"
                    raise problem(expected, axis.name, f"joints.{name}.axes.{i}.name")
                seen[axis.name] = f"joint '{name}'"
        for name, joint in self.joints.items():
            for i, axis in enumerate(joint.axes):
                others = [other for other in seen if other not in (axis.name, *ROOT_DOF_NAMES)]
                if axis.mimic is not None and axis.mimic.axis not in others:
                    expected = f"another axis, one of {sorted(others)}"
                    raise problem(expected, axis.mimic.axis, f"joints.{name}.axes.{i}.mimic.axis")
