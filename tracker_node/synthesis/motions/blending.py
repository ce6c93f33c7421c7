"""Motions one after the other as one: blended where they meet, the root going on from where it was."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation, Slerp

from .procedural import SEGMENT_PARENTS, SEGMENTS, Motion, chained, heading

LONG_RUN, LONG_RUN_CLIPS = "long_run", ("dance_b", "kick", "dance_a", "spinkick", "spin")
LONG_RUN_IMAGES, LONG_RUN_RADIUS_M = 700, 1.5  # at 30 Hz; where six cameras see all of the body
BLEND_S = 0.3
_DRIFT_S = 3.0  # paths are straightened over so long where they would lead out of the room


def joined(motions: Sequence[Motion], n_images: int, name: str, blend_s: float = BLEND_S) -> Motion:
    """``motions``, repeated in their order, as one of ``n_images``.

    The end of each fades into the beginning of the next over ``blend_s``; the next is turned about the vertical and moved
    horizontally so that both roots agree, heading and place, in the middle of it.

    Raises
    ------
    ValueError : motions of different rates or legs, or shorter than two blends.
    """
    first = motions[0]
    n_blend = max(2, round(blend_s * first.rate_hz))
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
    """Inverse of `motions.chained`."""
    world = dict(zip(SEGMENTS, np.swapaxes(rotations, 0, 1), strict=True))
    return {s: np.swapaxes(world[p], 1, 2) @ world[s] if p else world[s] for s, p in SEGMENT_PARENTS.items()}


def _between(a: np.ndarray, b: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Rotations (n, 3, 3) on the shortest way from ``a`` to ``b``."""
    return np.stack([
        Slerp([0.0, 1.0], Rotation.from_matrix(np.stack(pair)))(w).as_matrix() for *pair, w in zip(a, b, weight, strict=True)
    ])  # fmt: skip


def within(motion: Motion, radius_m: float) -> Motion:
    """The same motion about the world's origin, its slow drift taken out as far as the root would be beyond ``radius_m``."""
    path = motion.root_positions[:, :2] - np.median(motion.root_positions[:, :2], axis=0)
    drift = gaussian_filter1d(path, _DRIFT_S * motion.rate_hz, axis=0, mode="nearest")
    share = 0.0
    while np.linalg.norm(path - share * drift, axis=1).max() > radius_m and share < 1.0:
        share += 0.05
    positions = motion.root_positions.copy()
    positions[:, :2] = path - share * drift
    return replace(motion, root_positions=positions)
