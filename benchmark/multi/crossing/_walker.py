"""A person who walks along a way, raises the arms and embraces somebody.

Legs and swinging arms are those of the captured walk, by the way that is made; who stands or turns treads on the spot, and feet
slide a little.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from benchmark.clothed.person._body import JOINTS, MARKERS, Body
from benchmark.clothed.person._posing import Pose, Poser, lowest
from tracker_node.synthesis.motions.deepmimic import find_clip, read_clip
from tracker_node.synthesis.motions.motion import LEG_LENGTH, SEGMENT_PARENTS, SEGMENTS, chained

RATE_HZ = 30.0
SIDES = (("left", 1.0), ("right", -1.0))
LEGS = ("thigh", "shank", "foot")
_WALKING_M_S, _TREAD_M_S = 0.8, 0.1  # full steps from this speed on; treading of 1 rad/s counts as this speed
_CLOSE_STEPS = 0.2  # size of steps in an embrace
_CALM = 2.0  # image sets, by which steps are smoothed


@dataclass(frozen=True, eq=False)
class Stance:
    """Rotations of all segments in their parents', by name, and of hands in the forearms' axes, by side; (3, 3) each."""

    local: dict[str, np.ndarray]
    hands: dict[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Way:
    """Places (n, 2), facing (n,) radians, and how far arms are open and closed around somebody, (n,) between 0 and 1."""

    places: np.ndarray
    facing: np.ndarray
    opened: np.ndarray
    closed: np.ndarray


def stance(**turns: tuple[float, float, float]) -> Stance:
    """Euler angles x, y, z of segments in their parents, degrees; of a limb those of the left, mirrored on the right."""
    local = {name: np.eye(3) for name in SEGMENTS}
    for name in SEGMENTS:
        side, _, limb = name.partition("_")
        mirror = [-1.0, 1.0, -1.0] if side == "right" else [1.0, 1.0, 1.0]
        angles = turns.get(limb or name)
        if angles is not None:
            local[name] = Rotation.from_euler("XYZ", np.multiply(angles, mirror), degrees=True).as_matrix()
    return Stance(local)


STANDING = stance(upper_arm=(4, 3, 0), forearm=(0, -14, 0), thigh=(2, -4, 0), shank=(0, 8, 0), foot=(-2, -4, 0))
OPEN = stance(upper_arm=(60, -42, 0), forearm=(0, -30, 0))


class Walker:
    """A body that walks.

    Parameters
    ----------
    body : whose.
    clips : folder of the captured clips.
    phase : of the first step, between 0 and 1.
    """

    def __init__(self, body: Body, clips: Path, phase: float):
        self.body, self._poser, self._phase = body, Poser(body), phase
        cycle = read_clip(find_clip("walk", clips)).closed().resampled(RATE_HZ)
        world = dict(zip(SEGMENTS, np.swapaxes(cycle.rotations, 0, 1), strict=True))
        self._gait = {s: np.swapaxes(world[p], 1, 2) @ world[s] if p else world[s] for s, p in SEGMENT_PARENTS.items()}
        self._stride = np.ptp(cycle.root_positions[:, 0]) * body.leg_length / LEG_LENGTH

    def follow(self, way: Way, embrace: Stance, rows: Sequence[int]) -> list[Pose]:
        """Poses along a way.

        Parameters
        ----------
        way : where to.
        embrace : when the arms are closed.
        rows : of the way.

        Returns
        -------
        A pose for each row.
        """
        phase, steps = self._steps(way)
        local = {}
        for name in SEGMENTS:
            gait, closed = self._at(name, phase), embrace.local[name]
            if name.endswith(LEGS):
                local[name] = between(between(STANDING.local[name], closed, way.closed), gait, steps)
                continue
            turns = between(STANDING.local[name], gait, steps)
            turns = between(turns, OPEN.local[name], way.opened) if name.endswith("arm") else turns
            local[name] = between(turns, closed, way.closed)
        local["pelvis"] = about_z(way.facing) @ local["pelvis"]
        rotations = chained(local)
        hands = {side: between(np.eye(3), turn, way.closed) for side, turn in embrace.hands.items()}
        return [self._stand(rotations[i], way.places[i], {side: turns[i] for side, turns in hands.items()}) for i in rows]

    def stand(self, stance: Stance, place: np.ndarray, facing: float) -> Pose:
        """A pose on the spot.

        Parameters
        ----------
        stance : which.
        place : (2,) of the hips' middle.
        facing : radians.

        Returns
        -------
        The pose.
        """
        local = {name: turn[None] for name, turn in stance.local.items()}
        local["pelvis"] = about_z(facing) @ local["pelvis"]
        return self._stand(chained(local)[0], place, stance.hands)

    def _steps(self, way: Way) -> tuple[np.ndarray, np.ndarray]:
        """(n,) phase of the walk, and size of its steps between 0 and 1."""
        velocity = np.gradient(way.places, axis=0) * RATE_HZ
        forward = np.stack([np.cos(way.facing), np.sin(way.facing)], axis=1)
        ahead = np.sum(velocity * forward, axis=1)
        on_spot = _TREAD_M_S * np.abs(np.gradient(way.facing)) * RATE_HZ
        aside = np.linalg.norm(velocity - ahead[:, None] * forward, axis=1) + on_spot
        phase = self._phase + np.cumsum(gaussian_filter1d(ahead + aside, 1.5 * _CALM)) / RATE_HZ / self._stride
        size = gaussian_filter1d(np.clip((np.abs(ahead) + aside) / _WALKING_M_S, 0.0, 1.0), _CALM)
        size *= 1.0 - (1.0 - _CLOSE_STEPS) * way.closed
        return phase, gaussian_filter1d(size, _CALM)

    def _at(self, name: str, phase: np.ndarray) -> np.ndarray:
        """(n, 3, 3) rotations of a segment in its parent at phases of the walk (n,)."""
        turns = self._gait[name]
        at = (phase % 1.0) * (len(turns) - 1)
        i = np.minimum(at.astype(int), len(turns) - 2)
        return between(turns[i], turns[i + 1], at - i)

    def _stand(self, rotations: np.ndarray, place: np.ndarray, hands: dict[str, np.ndarray]) -> Pose:
        """A pose on the floor: world rotations (13, 3, 3), hips above (2,), hands turned in the forearms' axes."""
        pose = self._poser.pose(dict(zip(SEGMENTS, rotations, strict=True)), np.array([*place, self.body.leg_length]))
        for side, turn in hands.items():
            forearm, wrist = rotations[SEGMENTS.index(f"{side}_forearm")], pose.markers[MARKERS.index(f"{side[0].upper()}Wrist")]
            held = pose.transforms[JOINTS.index(f"{side}_wrist")]
            held[:, 3] -= wrist
            held[:] = forearm @ turn @ forearm.T @ held
            held[:, 3] += wrist
        return pose.moved(np.array([0.0, 0.0, -lowest(self.body, pose)]))


def between(a: np.ndarray, b: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Rotations on the shortest way.

    Parameters
    ----------
    a, b : (3, 3) or (n, 3, 3).
    weight : (n,) 0: ``a``, 1: ``b``.

    Returns
    -------
    (n, 3, 3).
    """
    first, last = (Rotation.from_matrix(np.broadcast_to(each, (len(weight), 3, 3))) for each in (a, b))
    return (first * Rotation.from_rotvec(weight[:, None] * (first.inv() * last).as_rotvec())).as_matrix()


def about_z(angle: float | np.ndarray) -> np.ndarray:
    """Rotations (..., 3, 3) about the vertical by (...) radians."""
    return Rotation.from_rotvec(np.multiply.outer(angle, [0.0, 0.0, 1.0])).as_matrix()
