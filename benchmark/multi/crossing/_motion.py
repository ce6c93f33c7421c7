"""Two people's motion: they pass each other closely, turn about, embrace while they turn around each other, and part."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d

from benchmark.clothed.person._body import Body
from benchmark.clothed.person._posing import Pose
from benchmark.multi.crossing._embrace import embraced
from benchmark.multi.crossing._surfaces import gaps
from benchmark.multi.crossing._walker import RATE_HZ, Walker, Way, about_z

N_SETS = 150
PHASES = {"crossing": (12, 32), "turning about": (36, 60), "embrace": (84, 120), "parting": (124, 150)}
"""First image set of each part of the motion, and the first after it."""

_PASS_S, _SPEED_M_S = 0.73, 1.2
_TURN_ABOUT_S, _MEET_S, _PART_S = (1.15, 1.95), 2.65, (4.1, 5.0)
_ROUND_S, _ROUND_DEG = (2.75, 3.95), (100.0, 150.0)  # the pair turns
_OPEN_S, _CLOSE_S, _RELEASE_S, _LOWER_S = (1.8, 2.35), (2.4, 2.8), (3.95, 4.3), (4.3, 4.85)
_SMOOTH_S, _AWAY_M = 0.1, 0.8  # corners of the way; how far each has come back in the end
_PASS_M, _STEP_M, _PASS_GAP_M = 0.4, 0.02, 0.02  # between hips, at least; between skins


def draw_poses(bodies: Sequence[Body], clips: Path, rng: np.random.Generator) -> list[list[Pose]]:
    """Poses of two people, about the world's origin.

    Parameters
    ----------
    bodies : two; arms of the first go over the other's shoulders.
    clips : folder of the captured clips.
    rng : directions and steps.

    Returns
    -------
    Of each person a pose an image set.
    """
    walkers = [Walker(body, clips, rng.uniform(0.0, 1.0)) for body in bodies]
    turn, sense = about_z(rng.uniform(-np.pi, np.pi)), float(rng.choice([-1.0, 1.0]))
    round_rad = sense * np.deg2rad(rng.uniform(*_ROUND_DEG))
    apart, stances = embraced(walkers)

    def posed(side: float, rows: Sequence[int]) -> list[list[Pose]]:
        ways = _ways(apart, side, sense, round_rad)
        return [walker.follow(way, stance, rows) for walker, way, stance in zip(walkers, ways, stances, strict=True)]

    side, crossing = _PASS_M, range(*PHASES["crossing"])
    while min(gaps(bodies, poses).min() for poses in zip(*posed(side, crossing), strict=True)) < _PASS_GAP_M:
        side += _STEP_M  # arms swing
    return [[Pose(turn @ p.transforms, p.markers @ turn.T) for p in poses] for poses in posed(side, range(N_SETS))]


def _ways(apart: float, side: float, sense: float, round_rad: float) -> list[Way]:
    """Ways of both; the second's is the first's turned by half a turn.

    Parameters
    ----------
    apart : between the two in the embrace, meters.
    side : between them where they pass.
    sense : +1: each passes the other on its right, -1: on its left.
    round_rad : by which they turn around each other.

    Returns
    -------
    The ways.
    """
    margin = round(RATE_HZ)
    t = (np.arange(N_SETS + 2 * margin) - margin) / RATE_HZ
    y, back, near = -0.5 * side * sense, -np.pi * sense, 0.5 * apart
    gone = _SPEED_M_S * (_TURN_ABOUT_S[0] - _PASS_S)
    at, *columns = np.array([  # s, x, y, facing
        (-1.0, -_SPEED_M_S * (_PASS_S + 1.0), 1.2 * y, 0.0), (_PASS_S, 0.0, y, 0.0), (_TURN_ABOUT_S[0], gone, 0.8 * y, 0.0),
        (_TURN_ABOUT_S[1], gone + 0.15, 0.0, back), (_MEET_S, near, 0.0, back), (_PART_S[0], near, 0.0, back),
        (_PART_S[1], near + _AWAY_M, 0.0, back),
    ]).T  # fmt: skip
    x, y, facing = (gaussian_filter1d(np.interp(t, at, column), _SMOOTH_S * RATE_HZ) for column in columns)
    turn = round_rad * _ramp(t, _ROUND_S)
    places = np.einsum("nij,nj->ni", about_z(turn)[:, :2, :2], np.stack([x, y], axis=1))
    opened, closed = _ramp(t, _OPEN_S) - _ramp(t, _LOWER_S), _ramp(t, _CLOSE_S) - _ramp(t, _RELEASE_S)
    shown = slice(margin, margin + N_SETS)
    return [
        Way(sign * places[shown], (facing + turn + about)[shown], opened[shown], closed[shown])
        for sign, about in ((1.0, 0.0), (-1.0, np.pi))
    ]


def _ramp(t: np.ndarray, ends: tuple[float, float]) -> np.ndarray:
    x = np.clip((t - ends[0]) / (ends[1] - ends[0]), 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)
