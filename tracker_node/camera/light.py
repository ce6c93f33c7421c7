"""Lights of a scene, in world axes: what a renderer shades a body with (Lambert).

A surface of color c that lights reach with factor f is seen as c (gain f)^(1/gamma), at most
255: under light of factor one a camera shows the colors that the model states. Lights do not fade with distance, and bodies cast
no shadows. A scene without lights is shown as if f were one everywhere.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

KINDS = ("ambient", "directional", "point", "spot")
AMBIENT, DIRECTIONAL, POINT, SPOT = range(4)
SPOT_EDGE = 0.8  # a spot is at full strength within this fraction of its half angle, and falls to nothing at the angle itself

# Columns of packed lights
KIND, INTENSITY, POSITION, DIRECTION, COS_OUTER, COS_INNER = 0, 1, 4, 7, 10, 11
N_LIGHT_COLUMNS = 12


@dataclass(frozen=True)
class Light:
    """One light.

    Parameters
    ----------
    kind : one of `KINDS`.
    intensity : (r, g, b); a surface that faces a light of intensity one is shown in its own color.
    position : (3,) meters, of a point or spot light.
    direction : (3,) in which a directional or spot light shines; any length.
    half_angle : radians from a spot's axis to the edge of its cone.
    """

    kind: str
    intensity: tuple[float, float, float] = (1.0, 1.0, 1.0)
    position: tuple[float, float, float] | None = None
    direction: tuple[float, float, float] | None = None
    half_angle: float | None = None

    def __post_init__(self):
        if self.kind not in KINDS:
            raise ValueError(f"expected a kind of light, one of {KINDS}, got {self.kind!r}")
        if self.kind in ("point", "spot") and self.position is None:
            raise ValueError(f"expected a position for a {self.kind} light")
        if self.kind in ("directional", "spot") and not (self.direction is not None and np.linalg.norm(self.direction) > 0.0):
            raise ValueError(f"expected a direction of non-zero length for a {self.kind} light, got {self.direction}")
        if self.kind == "spot" and not (self.half_angle is not None and 0.0 < self.half_angle < math.pi):
            raise ValueError(f"expected a half angle in (0, pi) radians for a spot light, got {self.half_angle}")
        if min(self.intensity) < 0.0:
            raise ValueError(f"expected an intensity >= 0, got {self.intensity}")


def pack_lights(lights: Sequence[Light]) -> np.ndarray:
    """(n, `N_LIGHT_COLUMNS`) float64 for the kernels; unit directions; one ambient light of intensity one when there is none."""
    lights = lights or (Light("ambient"),)
    packed = np.zeros((len(lights), N_LIGHT_COLUMNS))
    for row, light in zip(packed, lights, strict=True):
        row[KIND] = KINDS.index(light.kind)
        row[INTENSITY : INTENSITY + 3] = light.intensity
        if light.position is not None:
            row[POSITION : POSITION + 3] = light.position
        if light.direction is not None:
            row[DIRECTION : DIRECTION + 3] = np.asarray(light.direction) / np.linalg.norm(light.direction)
        if light.half_angle is not None:
            row[COS_OUTER], row[COS_INNER] = math.cos(light.half_angle), math.cos(SPOT_EDGE * light.half_angle)
    return packed
