"""Shapes of body parts, each in its own frame, metres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class TruncatedCone:
    """Truncated elliptical cone X = (a (1 + k z) cos t, b (1 + k z) sin t, z), z in [z1, z2] (Knossow et al., eq. 4).

    ``a``, ``b`` are the half-axes at z = 0 (metres), ``k`` the taper per metre; 1 + k z > 0 on [z1, z2]. Flat caps close it.
    """

    a: float
    b: float
    k: float
    z1: float
    z2: float

    def __post_init__(self):
        if not (self.a > 0 and self.b > 0 and self.z2 > self.z1):
            raise ValueError(f"expected a, b > 0 and z1 < z2, got {self}")
        if min(1 + self.k * self.z1, 1 + self.k * self.z2) <= 0:
            raise ValueError(f"expected 1 + k z > 0 on [z1, z2], got {self}")

    @classmethod
    def from_end_radii(cls, length: float, radii_start: tuple[float, float], radii_end: tuple[float, float]) -> TruncatedCone:
        """Cone from z = 0 to ``length``; both ends must have the same aspect ratio (the cone has one taper)."""
        ratio = radii_end[0] / radii_start[0]
        if abs(radii_end[1] / radii_start[1] - ratio) > 1e-6:
            raise ValueError(f"expected end radii in one ratio to the start radii, got {radii_start} and {radii_end}")
        return cls(radii_start[0], radii_start[1], (ratio - 1.0) / length, 0.0, length)


@dataclass(frozen=True)
class Ellipsoid:
    """Axis-aligned ellipsoid about its frame's origin with half-axes ``radii`` (3,) in metres."""

    radii: tuple[float, float, float]

    def __post_init__(self):
        if len(self.radii) != 3 or min(self.radii) <= 0:
            raise ValueError(f"expected three positive radii, got {self.radii}")


@dataclass(frozen=True)
class Box:
    """Axis-aligned box about its frame's origin with full edge lengths ``size`` (3,) in metres."""

    size: tuple[float, float, float]

    def __post_init__(self):
        if len(self.size) != 3 or min(self.size) <= 0:
            raise ValueError(f"expected three positive edge lengths, got {self.size}")


@dataclass(frozen=True)
class Mesh:
    """Triangle mesh: ``vertices`` (n, 3) metres, ``faces`` (m, 3) vertex indices, counter-clockwise seen from outside."""

    vertices: np.ndarray
    faces: np.ndarray

    def __post_init__(self):
        vertices = np.array(self.vertices, dtype=np.float64)
        faces = np.array(self.faces, dtype=np.int32)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
            raise ValueError(f"expected vertices (n, 3) and faces (m, 3), got {vertices.shape} and {faces.shape}")
        if faces.size and (faces.min() < 0 or faces.max() >= len(vertices)):
            raise ValueError(f"expected face indices in [0, {len(vertices)}), got up to {faces.max()}")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)


Primitive = TruncatedCone | Ellipsoid | Box | Mesh
