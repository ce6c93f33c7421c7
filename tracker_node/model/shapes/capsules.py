"""Round cones inside of shapes, for telling whether parts of a body have run into each other.

Those made here lie *within* their shape, so that parts which only touch, or overlap a little as flesh does, are not taken to
collide: wholly, except for meshes, where their spheres stick out by up to 4 % of their radius (in the tests) since room is made
for them between samples of the surface. Flat shapes get three side by side, meshes up to five (`mesh_capsules`).
"""

from __future__ import annotations

import numpy as np

from .mesh_capsules import capsules_in_mesh
from .primitives import Box, Ellipsoid, Primitive, TruncatedCone
from .round_cones import END, N_CAPSULE, START

_ROUND = 1.15  # half-axes of a smaller ratio count as equal
_REACH = 0.75  # how far towards the sharp end of an ellipse's axis a circle in it is put, as a fraction of the farthest


def inner_capsules(primitive: Primitive) -> np.ndarray:
    """(n, `N_CAPSULE`) round cones (start, its radius, end, its radius) in the shape's frame, meters."""
    if isinstance(primitive, TruncatedCone):
        return _in_cone(primitive)
    if isinstance(primitive, Ellipsoid):
        return _in_ellipsoid(np.array(primitive.radii))
    if isinstance(primitive, Box):
        return _in_box(0.5 * np.array(primitive.size))
    return capsules_in_mesh(primitive)


def _in_cone(cone: TruncatedCone) -> np.ndarray:
    wide, narrow = max(cone.a, cone.b), min(cone.a, cone.b)
    across = np.array([1.0, 0.0]) if cone.a >= cone.b else np.array([0.0, 1.0])
    middle = 0.5 * (cone.z1 + cone.z2)
    rows = []
    for offset in _offsets(wide, narrow):
        # The largest circle about a point of the ellipse's long axis; a sphere there is cut by the mantle's slope
        radius = narrow * np.sqrt(1.0 - offset**2 / max(wide**2 - narrow**2, 1e-300)) if offset else narrow
        radius /= np.hypot(1.0, cone.k * wide)
        low, high = (cone.z1 + radius) / (1.0 - radius * cone.k), (cone.z2 - radius) / (1.0 + radius * cone.k)
        if low > high:  # flat as a coin
            low = high = middle
        row = np.empty(N_CAPSULE)
        for at, z in ((START, low), (END, high)):
            scale = 1.0 + cone.k * z
            row[at : at + 3] = *(scale * offset * across), z
            row[at + 3] = min(radius * scale, z - cone.z1, cone.z2 - z)
        rows.append(row)
    return np.array(rows)


def _in_ellipsoid(radii: np.ndarray) -> np.ndarray:
    short, middle, long = (int(i) for i in np.argsort(radii))
    S, M, L = radii[short], radii[middle], radii[long]

    def sphere(along: float, aside: float) -> np.ndarray:
        """Center and radius of the largest sphere about a point in the plane of the two longer axes, which touches where the
        shortest axis leads: S^2 (1 - along^2 / (L^2 - S^2) - aside^2 / (M^2 - S^2))."""
        left = 1.0 - (along**2 / (L**2 - S**2) if along else 0.0) - (aside**2 / (M**2 - S**2) if aside else 0.0)
        center = np.zeros(3)
        center[long], center[middle] = along, aside
        return np.append(center, S * np.sqrt(left))

    rows = []
    for aside in _offsets(M, S):
        farthest = (L**2 - S**2) / L
        reach = 0.0 if L < _ROUND * S else farthest * (_REACH if aside == 0.0 else 0.8 * _REACH)
        ends = [sphere(along, aside) for along in (-reach, 0.0, reach)]
        pairs = [(ends[0], ends[1]), (ends[1], ends[2])] if reach else [(ends[1], ends[1])]
        rows += [np.concatenate(pair) for pair in pairs]
    return np.array(rows)


def _in_box(half: np.ndarray) -> np.ndarray:
    short, middle, long = (int(i) for i in np.argsort(half))
    radius = half[short]
    aside = half[middle] - radius
    rows = []
    for offset in [0.0] if half[middle] < _ROUND * radius else [-aside, 0.0, aside]:
        row = np.zeros(N_CAPSULE)
        for at, sign in ((START, -1.0), (END, 1.0)):
            row[at + long], row[at + middle], row[at + 3] = sign * (half[long] - radius), offset, radius
        rows.append(row)
    return np.array(rows)


def _offsets(wide: float, narrow: float) -> list[float]:
    """Where on the long axis of an ellipse circles are put."""
    if wide < _ROUND * narrow:
        return [0.0]
    aside = _REACH * (wide**2 - narrow**2) / wide
    return [-aside, 0.0, aside]
