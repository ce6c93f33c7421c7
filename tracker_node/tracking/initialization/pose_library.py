"""Poses to begin a search with.

A body whose axes have the names of the human's gets poses that people are found in; any body gets its neutral pose and
samples between its limits.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...model.articulated import ArticulatedModel
from ...model.humans.measures import mirrored_name
from ...model.kinematic_chain import KinematicChain
from ...optimize.robust_start import scrambled_halton

_WIDEST = 1.2  # radians from neutral that axes without narrow limits are sampled in

# Degrees by the name of the axis, without a side: both sides. Signs and zeros are those of docs/formats.md.
_ARMS_OUT = {"shoulder_elevation_front": 60.0, "shoulder_elevation_back": 30.0}
_LEVEL = {"shoulder_elevation_front": 90.0, "shoulder_elevation_back": 45.0}
_FORWARD = {"shoulder_elevation_front": 80.0, "shoulder_elevation_back": -40.0}
_UP = {"shoulder_elevation_front": 165.0}
_CROUCH = {"hip_flexion": 75.0, "knee_flexion": 90.0, "abdomen_flexion": 25.0}
_BOW = {"hip_flexion": 35.0, "abdomen_flexion": 40.0, "torso_flexion": 25.0}
_POSTURES: tuple[dict[str, float], ...] = (
    {},
    _ARMS_OUT,
    _LEVEL,
    _FORWARD,
    _UP,
    {"elbow_flexion": 90.0},
    {"shoulder_elevation_front": 40.0, "shoulder_elevation_back": 30.0, "elbow_flexion": 70.0, "hip_abduction": 15.0},
    {**_LEVEL, "hip_abduction": 25.0},
    _CROUCH,
    {**_CROUCH, **_FORWARD},
    _BOW,
    {**_BOW, **_LEVEL},
    {"hip_flexion": 80.0, "knee_flexion": 80.0},
)
# Of the left side, then of the right; each is taken the other way round as well.
_ONE_SIDED: tuple[tuple[dict[str, float], dict[str, float]], ...] = (
    ({"hip_flexion": 25.0, "shoulder_elevation_front": -15.0}, {"hip_flexion": -15.0, "knee_flexion": 25.0, **_ARMS_OUT}),
    ({"hip_flexion": 40.0, "knee_flexion": 45.0}, {"hip_flexion": -10.0, "knee_flexion": 15.0}),
    (_UP, {}),
    (_LEVEL, {}),
    ({"hip_flexion": 75.0, "knee_flexion": 20.0, **_ARMS_OUT}, _ARMS_OUT),
    ({"hip_abduction": 45.0, **_LEVEL}, _LEVEL),
    ({"hip_flexion": 60.0, "knee_flexion": 90.0}, {}),
)


def other_side(names: Sequence[str]) -> np.ndarray:
    """Index of the axis of the other side for each axis, its own where a name begins with neither ``left_`` nor ``right_``."""
    index = {name: i for i, name in enumerate(names)}
    return np.array([index.get(mirrored_name(name), i) for i, name in enumerate(names)], dtype=np.int64)


def reachable(chain: KinematicChain) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper angles (n_axes,) that are worth trying: within the limits, and not far from neutral on stiff axes."""
    neutral = np.array([axis.neutral for axis in chain.axes])
    stiffness = np.array([axis.stiffness for axis in chain.axes])
    wide = np.where(stiffness > 1.0, 0.5, np.pi)
    return np.maximum(chain.lower, neutral - wide), np.minimum(chain.upper, neutral + wide)


def library_poses(model: ArticulatedModel, n_random: int, seed: int) -> np.ndarray:
    """Joint angles of typical and of random poses.

    Parameters
    ----------
    model : the body.
    n_random, seed : number of random ones, and their seed.

    Returns
    -------
    (n, n_axes) the neutral ones first, each pose once.
    """
    chain = model.chain
    neutral = np.array([axis.neutral for axis in chain.axes])
    rows = [neutral]
    sided = [(both, both) for both in _POSTURES]
    sided += [pair for left, right in _ONE_SIDED for pair in ((left, right), (right, left))]
    for left, right in sided:
        row = neutral.copy()
        for i, axis in enumerate(chain.axes):
            own = left if axis.name.startswith("left_") else right
            row[i] += np.deg2rad(own.get(axis.name.removeprefix("left_").removeprefix("right_"), 0.0))
        rows.append(row)
    if chain.n_axes:
        low, high = reachable(chain)
        low, high = np.maximum(low, neutral - _WIDEST), np.minimum(high, neutral + _WIDEST)
        unit = scrambled_halton(n_random, chain.n_axes, seed)
        rows += list(low + unit * (high - low))
    clipped = np.clip(np.array(rows).reshape(len(rows), chain.n_axes), chain.lower, chain.upper)
    _, first = np.unique(clipped, axis=0, return_index=True)
    return clipped[np.sort(first)]
