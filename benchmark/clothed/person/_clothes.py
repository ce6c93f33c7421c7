"""Clothes of a body: where shirt, trousers, shoes and hair lie, how far they stand off, and their colors and patterns.

A garment is a signed distance (meters, positive inside) at every vertex, interpolated within triangles, so that hems are sharp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from benchmark.clothed.person._body import Body
from benchmark.clothed.render._noise import TABLE, noise
from tracker_node.synthesis.scenes.rasterizer import vertex_normals

SHIRT, TROUSERS, SHOES, HAIR = range(4)
SKIN = 4
PLAIN, STRIPES, HOOPS, CHECKS = range(4)
PATTERNS = ("plain", "stripes", "hoops", "checks")
_RAMP_M = 0.03  # over which cloth comes off the skin at a hem
_SIDES = ("left", "right")


@dataclass(frozen=True, eq=False)
class Outfit:
    """What a person wears. Colors are sRGB between 0 and 1.

    Parameters
    ----------
    colors : (5, 3) of shirt, trousers, shoes, hair, skin.
    second_colors : (5, 3) of the pattern.
    patterns : (5,) of `PATTERNS`.
    pattern_m : (5,) width of a stripe, meters.
    thickness_m : (4,) by which shirt, trousers, shoes and hair stand off the skin.
    wrinkles_m : (4,) size of the loose fabric's noise.
    sleeve, trouser_leg : where they end: 0 shoulder or hip, 1 wrist or ankle.
    hem_m : the shirt's lower end above the hip joints; negative: it hangs over the thighs.
    hair_low : how far hair comes down the neck, between 0 and 1; negative: none at all.
    near_wall, near_floor : whether the shirt has been drawn near a wall's color, and trousers near the floor's.
    """

    colors: np.ndarray
    second_colors: np.ndarray
    patterns: np.ndarray
    pattern_m: np.ndarray
    thickness_m: np.ndarray
    wrinkles_m: np.ndarray
    sleeve: float = 0.4
    trouser_leg: float = 0.95
    hem_m: float = 0.05
    hair_low: float = 0.3
    near_wall: bool = False
    near_floor: bool = False


@dataclass(frozen=True, eq=False)
class Dressed:
    """A body in clothes.

    Parameters
    ----------
    body, outfit : of whom, what.
    rest, normals : (n, 3) vertices in the rest pose with clothes, meters, and their normals.
    garments : (n, 4) float32 signed distances, positive inside.
    tints : (n, 3) float32 factors of the color: eyes, brows, lips.
    """

    body: Body
    outfit: Outfit
    rest: np.ndarray
    normals: np.ndarray
    garments: np.ndarray
    tints: np.ndarray

    def wrinkled(self, phase: float) -> np.ndarray:
        """(n, 3) vertices in the rest pose, the loose fabric's noise at a phase (about one per fold that forms)."""
        offset = noise(TABLE, self.rest * 14.0 + np.array([0.0, 0.0, phase]))
        inside = np.clip(self.garments / _RAMP_M, 0.0, 1.0) * self.outfit.wrinkles_m
        return self.rest + self.normals * (inside.max(axis=1) * offset)[:, None]


def dress(body: Body, outfit: Outfit) -> Dressed:
    """Put clothes on a body.

    Parameters
    ----------
    body : in its rest pose.
    outfit : what it wears.

    Returns
    -------
    The body in clothes.
    """
    garments = np.stack([_shirt(body, outfit), _trousers(body, outfit), _shoes(body), _hair(body, outfit)], axis=1)
    garments[:, TROUSERS] = np.where(garments[:, SHOES] > 0.0, -0.02, garments[:, TROUSERS])
    inside = np.clip(garments / _RAMP_M, 0.0, 1.0)
    rest = _smoothed(body, np.maximum(inside[:, SHIRT], inside[:, TROUSERS]), 6)
    rest = _smoothed(body, inside[:, SHOES], 25, rest)
    off = (inside * outfit.thickness_m).max(axis=1)
    rest = rest + vertex_normals(rest, body.faces) * off[:, None]
    rest[:, 2] = np.maximum(rest[:, 2], body.vertices[:, 2].min() - 0.004)  # soles stay flat
    return Dressed(body, outfit, rest, vertex_normals(rest, body.faces), garments.astype(np.float32), _tints(body, outfit))


def _smoothed(body: Body, weight: np.ndarray, rounds: int, vertices: np.ndarray | None = None) -> np.ndarray:
    """Vertices drawn towards their neighbors where the weight is large, (n, 3): cloth spans hollows, shoes hide toes."""
    result = body.vertices.copy() if vertices is None else vertices
    n = len(result)
    pairs = np.concatenate([body.faces[:, [0, 1]], body.faces[:, [1, 2]], body.faces[:, [2, 0]]])
    neighbors = sparse.csr_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    neighbors = ((neighbors + neighbors.T) > 0).astype(np.float64)
    mean = sparse.diags(1.0 / np.maximum(np.asarray(neighbors.sum(axis=1)).ravel(), 1.0)) @ neighbors
    for _ in range(rounds):
        result = result + 0.5 * weight[:, None] * (mean @ result - result)
    return result


def _along(body: Body, first: str, middle: str, last: str, side: str) -> tuple[np.ndarray, float]:
    """(n,) meters along a limb's two bones, and their length."""
    a, b, c = (body.joint(f"{side}_{name}") for name in (first, middle, last))
    upper, lower = np.linalg.norm(b - a), np.linalg.norm(c - b)
    on_upper = (body.vertices - a) @ (b - a) / upper
    on_lower = upper + (body.vertices - b) @ (c - b) / lower
    fraction = np.clip(on_upper / upper, 0.0, 1.0)
    blend = np.clip((fraction - 0.9) / 0.1, 0.0, 1.0)
    return (1.0 - blend) * on_upper + blend * on_lower, float(upper + lower)


def _limb(body: Body, names: tuple[str, ...], side: str) -> np.ndarray:
    return body.weight_of(*(f"{side}_{name}" for name in names)) > 0.5


def _shirt(body: Body, outfit: Outfit) -> np.ndarray:
    z = body.vertices[:, 2]
    neck, hip = body.joint("neck"), body.joint("left_hip")[2]
    scale = body.stature / 1.75
    to_neck = np.linalg.norm(body.vertices - neck, axis=1)
    inside = np.minimum(z - hip - outfit.hem_m * scale, np.maximum(to_neck - 0.085 * scale, neck[2] - 0.05 * scale - z))
    inside = np.where(body.weight_of("head") > 0.3, -0.05, inside)
    for side in _SIDES:
        along, length = _along(body, "shoulder", "elbow", "wrist", side)
        arm = _limb(body, ("shoulder", "elbow", "wrist"), side)
        inside = np.where(arm, outfit.sleeve * length - along, inside)
    return inside


def _trousers(body: Body, outfit: Outfit) -> np.ndarray:
    z = body.vertices[:, 2]
    waist = body.joint("left_hip")[2] + 0.13 * body.stature / 1.75
    inside = waist - z
    for side in _SIDES:
        along, length = _along(body, "hip", "knee", "ankle", side)
        leg = _limb(body, ("hip", "knee", "ankle"), side)
        inside = np.where(leg, np.minimum(inside, outfit.trouser_leg * length - along), inside)
        inside = np.where(_limb(body, ("clavicle", "shoulder", "elbow", "wrist"), side), -0.1, inside)
    return inside


def _shoes(body: Body) -> np.ndarray:
    ankle = body.joint("left_ankle")[2]
    inside = np.full(len(body.vertices), -0.1)
    for side in _SIDES:
        foot = _limb(body, ("ankle", "knee"), side)
        inside = np.where(foot, ankle + 0.01 - body.vertices[:, 2], inside)
    return inside


def _hair(body: Body, outfit: Outfit) -> np.ndarray:
    if outfit.hair_low < 0.0:
        return np.full(len(body.vertices), -0.1)
    crown, nose, neck = body.crown, body.nose, body.joint("neck")
    face = crown[2] - nose[2]  # about 0.14 m
    x, _, z = body.vertices.T
    hairline = crown[2] - 0.33 * face
    behind = nose[0] - 0.75 * face  # ears are about there
    low = nose[2] + 0.35 * face - outfit.hair_low * 1.1 * (nose[2] - neck[2] + 0.35 * face)
    # The border runs from the hairline in front down to `low` at the back.
    border = np.clip((behind - x) / (0.25 * face), 0.0, 1.0) * (low - hairline) + hairline
    inside = z - border
    return np.where(body.weight_of("head", "neck") > 0.5, inside, -0.1)


def _tints(body: Body, outfit: Outfit) -> np.ndarray:
    """Eyes, brows and lips darken the skin: (n, 3)."""
    tints = np.ones((len(body.vertices), 3))
    nose, crown = body.nose, body.crown
    face = crown[2] - nose[2]
    p = (body.vertices - nose) / face
    front = (body.weight_of("head") > 0.5) & (p[:, 0] > -0.55)
    if body.eyes.any():
        eye_z = (body.vertices[body.eyes, 2].mean() - nose[2]) / face
        brows = front & (np.abs(p[:, 2] - eye_z - 0.17) < 0.035) & (np.abs(p[:, 1]) > 0.1) & (np.abs(p[:, 1]) < 0.42)
        tints[brows] = outfit.colors[HAIR] / np.maximum(outfit.colors[SKIN], 0.05)
        iris = body.eyes & (np.abs(np.abs(p[:, 1]) - np.abs(p[body.eyes, 1]).mean()) < 0.05)
        tints[body.eyes] = np.array([0.92, 0.9, 0.88]) / np.maximum(outfit.colors[SKIN], 0.05)
        tints[iris] = 0.12
    lips = front & (np.abs(p[:, 2] + 0.3) < 0.06) & (np.abs(p[:, 1]) < 0.2) & (p[:, 0] > -0.28)
    tints[lips] *= np.array([0.85, 0.6, 0.6])
    return np.clip(tints, 0.0, 4.0).astype(np.float32)


