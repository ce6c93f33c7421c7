"""Human motions as world rotations of segments, and a procedural one that needs no file.

Axes of a segment are those of the body that stands with hanging arms: x forward, y left, z up; there every rotation is identity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation, Slerp

from ...geometry import so3

# Each segment after its parent; the names are those of the links of the tracker's human.
SEGMENT_PARENTS = {
    "pelvis": "", "torso": "pelvis", "head": "torso",
    "right_thigh": "pelvis", "right_shank": "right_thigh", "right_foot": "right_shank",
    "right_upper_arm": "torso", "right_forearm": "right_upper_arm",
    "left_thigh": "pelvis", "left_shank": "left_thigh", "left_foot": "left_shank",
    "left_upper_arm": "torso", "left_forearm": "left_upper_arm",
}  # fmt: skip
SEGMENTS = tuple(SEGMENT_PARENTS)

LEG_LENGTH = 0.25 * (1.686184 + 1.639480)  # meters from hip to ankle of the clips' skeleton (which is 4 times metric)
PROCEDURAL = "swing"
LONG_RUN, LONG_RUN_CLIPS = "long_run", ("dance_b", "kick", "dance_a", "spinkick", "spin")
LONG_RUN_IMAGES, LONG_RUN_RADIUS_M = 700, 1.5  # at 30 Hz; where six cameras see all of the body
BLEND_S = 0.3
_DRIFT_S = 3.0  # paths are straightened over so long where they would lead out of the room


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion sampled at a constant rate.

    Parameters
    ----------
    name : for messages and file names.
    rate_hz : images per second.
    root_positions : (n, 3) meters, world with Z up: the point midway between the hips.
    rotations : (n, 13, 3, 3) ``R_world_segment`` in the order of `SEGMENTS`, body axes.
    leg_length : meters from hip to ankle of the skeleton for which the root positions hold.
    """

    name: str
    rate_hz: float
    root_positions: np.ndarray
    rotations: np.ndarray
    leg_length: float = LEG_LENGTH

    def __len__(self) -> int:
        return len(self.root_positions)

    @property
    def times_s(self) -> np.ndarray:
        """(n,) seconds from the first image."""
        return np.arange(len(self)) / self.rate_hz

    def of(self, segment: str) -> np.ndarray:
        """(n, 3, 3) world rotations of one segment."""
        return self.rotations[:, SEGMENTS.index(segment)]

    def centered(self) -> Motion:
        """The same motion moved horizontally, so that the middle of its extent is above the world's origin."""
        positions = self.root_positions.copy()
        positions[:, :2] -= 0.5 * (positions[:, :2].min(axis=0) + positions[:, :2].max(axis=0))
        return replace(self, root_positions=positions)


def chained(local: dict[str, np.ndarray]) -> np.ndarray:
    """World rotations (n, 13, 3, 3) from each segment's rotation (n, 3, 3) in its parent's axes."""
    world: dict[str, np.ndarray] = {}
    for segment, parent in SEGMENT_PARENTS.items():
        world[segment] = world[parent] @ local[segment] if parent else local[segment]
    return np.stack([world[segment] for segment in SEGMENTS], axis=1)


def heading(rotation: np.ndarray) -> np.ndarray:
    """The part of a rotation that turns about the world's vertical (swing-twist)."""
    return so3.exp([0.0, 0.0, 2.0 * np.arctan2(rotation[1, 0] - rotation[0, 1], 1.0 + np.trace(rotation))])


def swing(rate_hz: float = 30.0, n_images: int = 60) -> Motion:
    """A procedural motion: slow steps, swinging arms, the right arm raised once; smooth in every angle.

    Parameters
    ----------
    rate_hz : images per second.
    n_images : of the motion.

    Returns
    -------
    The motion.
    """
    t = np.arange(n_images) / rate_hz
    phase = 2.0 * np.pi * 0.8 * t
    raised = 0.5 - 0.5 * np.cos(2.0 * np.pi * t / max(2.0, t[-1] if n_images > 1 else 2.0))
    forward = np.array([0.0, -1.0, 0.0])  # a flexion swings what hangs to the front
    angles = {
        "pelvis": (np.array([0.0, 0.0, 1.0]), 0.08 * np.sin(phase)),
        "torso": (np.array([0.0, 0.0, 1.0]), -0.16 * np.sin(phase)),
        "head": (np.array([0.0, 0.0, 1.0]), 0.25 * np.sin(0.5 * phase)),
    }
    for side, sign in (("right", 1.0), ("left", -1.0)):
        step = sign * np.sin(phase)
        lift = np.maximum(0.0, np.cos(phase + (0.0 if sign > 0 else np.pi))) ** 2
        angles[f"{side}_thigh"] = (forward, 0.35 * step + 0.15 * lift)
        angles[f"{side}_shank"] = (-forward, 0.12 + 0.6 * lift)
        angles[f"{side}_foot"] = (forward, 0.1 * step)
        angles[f"{side}_upper_arm"] = (forward, -0.35 * step)
        angles[f"{side}_forearm"] = (forward, 0.35 + 0.15 * step)
    angles["right_upper_arm"] = (forward, -0.35 * np.sin(phase) * (1.0 - raised) + 1.7 * raised)
    local = {s: Rotation.from_rotvec(a[:, None] * axis).as_matrix() for s, (axis, a) in angles.items()}
    # Hanging arms stand off the trunk by a few degrees.
    for side, sign in (("right", 1.0), ("left", -1.0)):
        local[f"{side}_upper_arm"] = local[f"{side}_upper_arm"] @ so3.exp([-0.12 * sign, 0.0, 0.0])
    ordered = {s: local[s] for s in SEGMENTS}
    roots = np.stack([0.35 * t, 0.02 * np.sin(phase), 0.86 + 0.01 * np.cos(2.0 * phase)], axis=1)
    return Motion(PROCEDURAL, float(rate_hz), roots, chained(ordered))


def joined(motions: Sequence[Motion], n_images: int, name: str) -> Motion:
    """Motions, repeated in their order, as one.

    The end of each fades into the beginning of the next over `BLEND_S`; the next is turned about the vertical and moved
    horizontally so that both roots agree, heading and place, in the middle of it.

    Parameters
    ----------
    motions : of one rate and one skeleton.
    n_images : of the result.
    name : of the result.

    Returns
    -------
    The motion.

    Raises
    ------
    ValueError : motions of different rates or legs, or shorter than two blends.
    """
    first = motions[0]
    n_blend = max(2, round(BLEND_S * first.rate_hz))
    if any((m.rate_hz, m.leg_length) != (first.rate_hz, first.leg_length) for m in motions):
        raise ValueError("expected motions of one rate and one skeleton")
    if min(map(len, motions)) < 2 * n_blend:
        raise ValueError(f"expected motions of at least {2 * n_blend} images, got {min(map(len, motions))}")
    result = first
    following = 1
    while len(result) < n_images:
        result = _faded(result, motions[following % len(motions)], n_blend)
        following += 1
    return replace(result, name=name, root_positions=result.root_positions[:n_images], rotations=result.rotations[:n_images])


def _faded(a: Motion, b: Motion, n: int) -> Motion:
    """``a``, whose last ``n`` images fade into the first ``n`` of ``b``, and the rest of ``b``."""
    end, middle = len(a) - n + n // 2, n // 2
    turn = heading(a.of("pelvis")[end]) @ heading(b.of("pelvis")[middle]).T
    shift = a.root_positions[end] - turn @ b.root_positions[middle]
    shift[2] = 0.0
    positions, rotations = b.root_positions @ turn.T + shift, turn @ b.rotations
    weight = np.linspace(0.0, 1.0, n + 2)[1:-1]
    weight = weight * weight * (3.0 - 2.0 * weight)
    here, there = _local(a.rotations[-n:]), _local(rotations[:n])
    mixed = {segment: _between(here[segment], there[segment], weight) for segment in SEGMENTS}
    between = (1.0 - weight)[:, None] * a.root_positions[-n:] + weight[:, None] * positions[:n]
    return replace(
        a,
        root_positions=np.concatenate([a.root_positions[:-n], between, positions[n:]]),
        rotations=np.concatenate([a.rotations[:-n], chained(mixed), rotations[n:]]),
    )


def _local(rotations: np.ndarray) -> dict[str, np.ndarray]:
    """Inverse of `chained`."""
    world = dict(zip(SEGMENTS, np.swapaxes(rotations, 0, 1), strict=True))
    return {s: np.swapaxes(world[p], 1, 2) @ world[s] if p else world[s] for s, p in SEGMENT_PARENTS.items()}


def _between(a: np.ndarray, b: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Rotations (n, 3, 3) on the shortest way from ``a`` to ``b``."""
    return np.stack([
        Slerp([0.0, 1.0], Rotation.from_matrix(np.stack(pair)))(w).as_matrix() for *pair, w in zip(a, b, weight, strict=True)
    ])  # fmt: skip


def within(motion: Motion, radius_m: float) -> Motion:
    """The motion about the world's origin, its slow drift taken out as far as the root would be too far away.

    Parameters
    ----------
    motion : any.
    radius_m : largest horizontal distance of the root from the origin.

    Returns
    -------
    The motion.
    """
    path = motion.root_positions[:, :2] - np.median(motion.root_positions[:, :2], axis=0)
    drift = gaussian_filter1d(path, _DRIFT_S * motion.rate_hz, axis=0, mode="nearest")
    fraction = 0.0
    while np.linalg.norm(path - fraction * drift, axis=1).max() > radius_m and fraction < 1.0:
        fraction += 0.05
    positions = motion.root_positions.copy()
    positions[:, :2] = path - fraction * drift
    return replace(motion, root_positions=positions)
