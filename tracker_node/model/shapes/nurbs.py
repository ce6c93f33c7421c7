"""Solids lofted through stadium cross-sections: bicubic B-spline surfaces (NURBS whose weights are all one).

A stadium is a rectangle with two half discs at its ends, the shape by which Yeadon (1990, J. Biomech. 23) measures sections of
the body. Around, the surface is a periodic cubic B-spline through points of the stadium; along, a cubic one through the sections
and through the elliptical domes that close both ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
import scipy  # imports its modules when they are first used: bodies without lofts start 0.1 s sooner

from .primitives import Mesh

DEGREE = 3
N_STADIUM_POINTS = 24  # of a section, that the surface goes through
N_AROUND = 48  # vertices of a ring of the mesh
RING_SPACING = 0.020  # meters between rings of the mesh, at most
SECTION_SPACING = 0.040  # meters; between sections farther apart others are put, so that the surface does not swing
_MOST_BETWEEN, _MOST_RINGS = 50, 500  # sections put between two, rings of a mesh: for solids of any size
_DOME_ANGLES = np.deg2rad([30.0, 60.0, 90.0])


@dataclass(frozen=True)
class Section:
    """Stadium across the z axis at ``z``, of half-widths ``half_x``, ``half_y`` about (``x``, ``y``); meters."""

    z: float
    half_x: float
    half_y: float
    x: float = 0.0
    y: float = 0.0

    def __post_init__(self):
        if not (self.half_x > 0.0 and self.half_y > 0.0):
            raise ValueError(f"expected half-widths > 0, got {self}")


@dataclass(frozen=True)
class Loft:
    """Sections in the order of z, and the heights of the domes below the first and above the last (meters)."""

    sections: tuple[Section, ...]
    domes: tuple[float, float]

    def __post_init__(self):
        heights = [section.z for section in self.sections]
        if len(heights) < 2 or any(b <= a for a, b in pairwise(heights)):
            raise ValueError(f"expected at least two sections with rising z, got z = {heights}")
        if len(self.domes) != 2 or min(self.domes) <= 0.0:
            raise ValueError(f"expected two domes of positive height, got {self.domes}")


@dataclass(frozen=True, eq=False)
class LoftedSolid(Mesh):
    """The mesh of a loft, which remembers what it is made from (`loft_mesh`)."""

    loft: Loft | None = None
    n_around: int = N_AROUND
    ring_spacing: float = RING_SPACING


@dataclass(frozen=True, eq=False)
class SplineSurface:
    """Tensor product of cubic B-splines: ``control`` (n, m, 3) meters, ``knots_along`` (n + 4,), ``knots_around`` (m + 4,).

    Parameters: u along the axis from 0 to 1, v around it from 0 to 1.
    """

    control: np.ndarray
    knots_along: np.ndarray
    knots_around: np.ndarray

    def evaluate(self, u: np.ndarray, v: np.ndarray, du: int = 0, dv: int = 0) -> np.ndarray:
        """Points on a grid, or their derivatives.

        Parameters
        ----------
        u, v : (n,) along the axis and (m,) around it, 0..1.
        du, dv : orders of the derivatives.

        Returns
        -------
        (n, m, 3) meters.
        """
        lines = scipy.interpolate.BSpline(self.knots_along, self.control, DEGREE)(u, nu=du)  # (len(u), m, 3)
        return np.moveaxis(scipy.interpolate.BSpline(self.knots_around, np.moveaxis(lines, 1, 0), DEGREE)(v, nu=dv), 0, 1)


def stadium_points(half_x: float, half_y: float, n: int = N_STADIUM_POINTS) -> np.ndarray:
    """Points at equal distances along a stadium, from (half_x, 0) towards +y.

    Parameters
    ----------
    half_x, half_y : half-widths, meters.
    n : number of points, a multiple of 4.

    Returns
    -------
    (n, 2) meters.
    """
    if half_y > half_x:
        return np.roll(stadium_points(half_y, half_x, n), n // 4, axis=0) @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    radius, flat = half_y, half_x - half_y  # of the ends; half the straight part
    quarter = 0.5 * np.pi * radius + flat
    s = np.arange(n // 4) * (quarter / (n // 4))
    angle = np.minimum(s / radius, 0.5 * np.pi)
    x = flat + radius * np.cos(angle) - np.maximum(s - 0.5 * np.pi * radius, 0.0)
    first = np.column_stack([x, radius * np.sin(angle)])
    # The second quarter is the first one mirrored in y, run backwards; the other half is this one turned by 180 degrees.
    second = np.vstack([[0.0, radius], first[:0:-1] * [-1.0, 1.0]])
    half = np.vstack([first, second])
    return np.vstack([half, -half])


def loft_surface(loft: Loft) -> SplineSurface:
    """The surface through all sections of ``loft``, closed at both ends."""
    rings = _rings(loft)  # (n, m, 3)
    knots_around, interpolation = _around()
    lines = np.einsum("mk,nkd->nmd", interpolation, rings)
    steps = np.linalg.norm(np.diff(rings, axis=0), axis=2).mean(axis=1)
    u = np.append(0.0, np.cumsum(steps)) / steps.sum()
    along = scipy.interpolate.make_interp_spline(u, lines, DEGREE, axis=0)
    return SplineSurface(along.c, along.t, knots_around)


def loft_mesh(loft: Loft, n_around: int = N_AROUND, ring_spacing: float = RING_SPACING) -> LoftedSolid:
    """The surface as triangles with vertex normals: rings across the axis, and a vertex on either end.

    Parameters
    ----------
    loft : sections and domes.
    n_around : vertices of a ring.
    ring_spacing : meters between rings, at most; on the domes they are three times as near.

    Returns
    -------
    Mesh that remembers its loft.

    Raises
    ------
    ValueError : sections whose surface has no direction somewhere.
    """
    surface = loft_surface(loft)
    u = _ring_parameters(loft, surface, ring_spacing)
    v = np.arange(n_around) / n_around
    points = surface.evaluate(u, v)
    normals = np.cross(surface.evaluate(u, v, dv=1), surface.evaluate(u, v, du=1))
    lengths = np.linalg.norm(normals, axis=2, keepdims=True)
    if not np.all(lengths > 0.0):
        raise ValueError(f"expected sections whose surface has a direction everywhere, got {loft}")
    normals /= lengths
    ends = surface.evaluate(np.array([0.0, 1.0]), np.zeros(1))[:, 0]
    n_rings = len(u)
    vertices = np.vstack([points.reshape(-1, 3), ends])
    normals = np.vstack([normals.reshape(-1, 3), [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]])
    here = np.arange(n_around)
    beside = np.roll(here, -1)
    bottom, top = n_rings * n_around, n_rings * n_around + 1
    faces = [np.column_stack([np.full(n_around, bottom), beside, here])]
    for ring in range(n_rings - 1):
        a, b = ring * n_around, (ring + 1) * n_around
        faces.append(np.column_stack([a + here, a + beside, b + beside]))
        faces.append(np.column_stack([a + here, b + beside, b + here]))
    last = (n_rings - 1) * n_around
    faces.append(np.column_stack([last + here, last + beside, np.full(n_around, top)]))
    return LoftedSolid(vertices, np.vstack(faces), normals=normals, loft=loft, n_around=n_around, ring_spacing=ring_spacing)


@cache
def _around() -> tuple[np.ndarray, np.ndarray]:
    """Knots of the periodic splines, and the matrix that makes control points (m, .) of the points of a ring."""
    unit = np.eye(N_STADIUM_POINTS)
    spline = scipy.interpolate.make_interp_spline(
        np.linspace(0.0, 1.0, N_STADIUM_POINTS + 1), np.vstack([unit, unit[:1]]), DEGREE, bc_type="periodic"
    )
    return spline.t, spline.c


def _rings(loft: Loft) -> np.ndarray:
    """(n, N_STADIUM_POINTS, 3) points that the surface goes through, from one end to the other."""
    values = np.array([(s.z, s.half_x, s.half_y, s.x, s.y) for s in _refined(loft.sections)])
    low, high = values[0], values[-1]
    rows = [_dome(low, -loft.domes[0], a) for a in _DOME_ANGLES[::-1]]
    rows += [(*row, 1.0) for row in values]
    rows += [_dome(high, loft.domes[1], a) for a in _DOME_ANGLES]
    rings = np.empty((len(rows), N_STADIUM_POINTS, 3))
    for ring, (z, half_x, half_y, x, y, scale) in zip(rings, rows, strict=True):
        ring[:, :2] = stadium_points(half_x, half_y) * scale + (x, y)
        ring[:, 2] = z
    return rings


def _dome(row: np.ndarray, height: float, angle: float) -> tuple[float, ...]:
    """The section ``row`` carried up (or down) an elliptical dome, with the fraction of its width that is left there."""
    scale = 0.0 if angle == _DOME_ANGLES[-1] else float(np.cos(angle))
    return (row[0] + height * np.sin(angle), *row[1:], scale)


def _refined(sections: tuple[Section, ...]) -> list[Section]:
    """The sections and others between them, by monotone cubic interpolation of their measures."""
    values = np.array([(s.z, s.half_x, s.half_y, s.x, s.y) for s in sections])
    at = [values[0, 0]]
    for low, high in pairwise(values[:, 0]):
        n = int(min(np.ceil((high - low) / SECTION_SPACING), _MOST_BETWEEN))
        at += list(np.linspace(low, high, n + 1)[1:])
    between = scipy.interpolate.PchipInterpolator(values[:, 0], values[:, 1:])(at)
    return [Section(z, *row) for z, row in zip(at, between, strict=True)]


def _ring_parameters(loft: Loft, surface: SplineSurface, spacing: float) -> np.ndarray:
    """u of the rings: every section's own and others between, none on the ends."""
    fine = np.linspace(0.0, 1.0, 401)
    z = surface.evaluate(fine, np.zeros(1))[:, 0, 2]
    z = np.maximum.accumulate(z)
    low, high = loft.sections[0].z, loft.sections[-1].z
    n = int(min(np.ceil((high - low) / spacing), _MOST_RINGS))
    angles = np.deg2rad([75.0, 60.0, 45.0, 30.0, 15.0])
    wanted = np.concatenate([
        low - loft.domes[0] * np.sin(angles), np.linspace(low, high, n + 1), high + loft.domes[1] * np.sin(angles[::-1]),
    ])  # fmt: skip
    return np.interp(wanted, z, fine)
