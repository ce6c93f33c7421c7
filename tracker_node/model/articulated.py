"""A body: kinematic chain, shapes on its links, named landmarks."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..errors import UnknownNameError
from ..geometry import se3
from .kinematic_chain import KinematicChain
from .shapes.capsules import inner_capsules
from .shapes.primitives import END, START, Primitive

DEFAULT_COLOR_RGB = (180, 180, 180)  # of a shape whose color nobody has stated


@dataclass(frozen=True)
class Shape:
    """A primitive fixed to a link at ``T_link_shape`` (4, 4), with a color (r, g, b) in 0..255."""

    name: str
    link: str
    primitive: Primitive
    T_link_shape: np.ndarray = field(default_factory=lambda: np.eye(4))
    color_rgb: tuple[int, int, int] = DEFAULT_COLOR_RGB

    def __post_init__(self):
        if not se3.is_rigid(self.T_link_shape):
            raise ValueError(f"shape '{self.name}': expected a rigid T_link_shape, got {self.T_link_shape}")

    @property
    def has_color(self) -> bool:
        """False for a shape whose color nobody has stated (it is shown in gray)."""
        own = ("face_colors_rgb", "textures", "vertex_colors_rgb", "texture")
        return tuple(self.color_rgb) != DEFAULT_COLOR_RGB or any(getattr(self.primitive, name, None) is not None for name in own)


@dataclass(frozen=True)
class Landmark:
    """A named point (joint center, marker) fixed to ``link`` at ``position`` (3,) meters."""

    name: str
    link: str
    position: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class ArticulatedModel:
    """A body that can be posed. A rigid object is one link without joints.

    ``symmetric``: turns that map the body onto itself do not matter. ``clothed``: the shapes are those that images show, clothes
    included, as of a body that was fitted to images.
    """

    name: str
    chain: KinematicChain
    shapes: tuple[Shape, ...]
    landmarks: tuple[Landmark, ...] = ()
    symmetric: bool = False
    clothed: bool = False

    shape_links: np.ndarray = field(init=False, repr=False, compare=False)  # (n_shapes,) link index
    Ts_link_shape: np.ndarray = field(init=False, repr=False, compare=False)  # (n_shapes, 4, 4)
    landmark_links: np.ndarray = field(init=False, repr=False, compare=False)  # (n_landmarks,)
    landmark_positions: np.ndarray = field(init=False, repr=False, compare=False)  # (n_landmarks, 3)

    def __post_init__(self):
        set_ = object.__setattr__
        chain = self.chain
        set_(self, "shape_links", np.array([chain.link_index(s.link) for s in self.shapes], dtype=np.int64))
        set_(self, "Ts_link_shape", np.array([s.T_link_shape for s in self.shapes], dtype=np.float64).reshape(-1, 4, 4))
        set_(self, "landmark_links", np.array([chain.link_index(m.link) for m in self.landmarks], dtype=np.int64))
        set_(self, "landmark_positions", np.array([m.position for m in self.landmarks], dtype=np.float64).reshape(-1, 3))

    def __repr__(self) -> str:
        """In a line: all arrays of a person's are 20 000 characters."""
        counts = f"{len(self.chain.links)} links, {self.n_dof} degrees of freedom, {len(self.shapes)} shapes"
        return f"<{type(self).__name__} {self.name!r}: {counts}, {len(self.landmarks)} landmarks>"

    @property
    def landmark_names(self) -> tuple[str, ...]:
        return tuple(landmark.name for landmark in self.landmarks)

    @property
    def has_colors(self) -> bool:
        """False for a body on which no shape has a stated color: there is nothing that color could tell."""
        return any(shape.has_color for shape in self.shapes)

    @cached_property
    def capsules(self) -> tuple[np.ndarray, ...]:
        """Round cones within each shape (`inner_capsules`), (n, 8) in the frame of its link; worked out once, when first asked
        for: those of a mesh take a moment."""
        result = []
        for shape in self.shapes:
            rows = inner_capsules(shape.primitive)
            for at in (START, END):
                rows[:, at : at + 3] = se3.apply(shape.T_link_shape, rows[:, at : at + 3])
            result.append(rows)
        return tuple(result)

    def landmark_index(self, name: str) -> int:
        if name not in self.landmark_names:
            raise UnknownNameError("landmark", name, self.landmark_names)
        return self.landmark_names.index(name)

    @property
    def n_dof(self) -> int:
        return self.chain.n_dof
