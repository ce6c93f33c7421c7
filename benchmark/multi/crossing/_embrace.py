"""Two people breast to breast, their arms around each other: those of the first over the shoulders, of the second below the arms.

How far apart they stand, and where arms and hands lie, follows from their skins.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product

import numpy as np
from scipy.spatial.transform import Rotation

from benchmark.clothed.person._body import MARKERS, Body
from benchmark.clothed.person._posing import Pose, skin
from benchmark.multi.crossing._surfaces import ARM_JOINTS, Surface, gaps, is_arm
from benchmark.multi.crossing._walker import SIDES, Stance, Walker, stance

_GAP_M = 0.02  # between skins, filled by clothes
_OUT_DEG = (6.0, -3.0)  # legs: feet of the second stand between those of the first
# What is tried of an arm: wrist off the back and beside the spine; elbow so much upward as outward.
_OFF_M, _BESIDE_M, _LIFTS = (0.03, 0.06, 0.1), (0.02, 0.08, 0.14, 0.2), (-1.5, -0.7, -0.3, 0.0, 0.3, 0.7)
_BELOW_M = ((0.07, 0.035), (0.24, 0.05))  # hands below the other's shoulders: their middle, and the left one below that
_BACK_VERTICES, _ROUNDS, _WRIST_RAD, _STRETCH = 60, 4, 0.9, 0.985


def embraced(walkers: Sequence[Walker]) -> tuple[float, list[Stance]]:
    """How far apart two people stand, meters, and their stances."""
    bodies = [walker.body for walker in walkers]
    leaning = {"torso": (-7, 11, 0), "head": (4, -4, 0), "upper_arm": (60, -42, 0), "shank": (0, 8, 0)}  # heads side by side
    stances = [stance(**leaning, thigh=(out, -4, 0), foot=(-out, -4, 0)) for out in _OUT_DEG]
    near, far = 0.1, 0.8
    while far - near > 0.004:
        middle = 0.5 * (near + far)
        poses = [_facing(walker, i, middle, stances[i]) for i, walker in enumerate(walkers)]
        near, far = (near, middle) if gaps(bodies, poses, arms=False).min() > _GAP_M else (middle, far)
    for i, j in ((0, 1), (1, 0)):
        stances[i] = _Embracing(walkers[i], i, far, bodies[j], _facing(walkers[j], j, far, stances[j])).around(stances[i])
    return far, stances


def _facing(walker: Walker, i: int, apart: float, stance: Stance) -> Pose:
    """One of a pair that face each other along x."""
    return walker.stand(stance, np.array([(i - 0.5) * apart, 0.0]), np.pi * i)


class _Embracing:
    """One of a pair, who puts the arms around the other.

    Parameters
    ----------
    walker, i, apart : as of `_facing`.
    other, pose : who is embraced.
    """

    def __init__(self, walker: Walker, i: int, apart: float, other: Body, pose: Pose):
        self._walker, self._i, self._apart = walker, i, apart
        vertices = skin(other, pose, other.vertices)
        self._other, self._trunk = Surface(vertices, other.faces), vertices[~is_arm(other)]
        self._shoulders = pose.markers[[MARKERS.index("LShoulder"), MARKERS.index("RShoulder")]].mean(axis=0)
        self._scale = other.stature / 1.75
        self._forward, self._left = np.eye(3)[:2] * (1.0 - 2.0 * i)

    def around(self, stance: Stance) -> Stance:
        """The stance with those arms that enter the other least, hands on the back."""
        body = self._walker.body
        for side, _ in SIDES:
            own = body.weight_of(*(f"{side}_{joint}" for joint in ARM_JOINTS)) > 0.5
            hand = body.weight_of(f"{side}_wrist")[own] > 0.5

            def cost(tried: Stance, own: np.ndarray = own, hand: np.ndarray = hand) -> float:
                distances = self._other.distances(skin(body, self._pose(tried), body.vertices)[own])
                return 2.0 * max(0.0, -float(distances.min())) + 0.5 * float(np.abs(distances[hand]).mean())

            choices = product(_OFF_M, _BESIDE_M, _LIFTS)
            stance = min((self._with_arm(stance, side, *choice) for choice in choices), key=cost)
        return stance

    def _pose(self, stance: Stance) -> Pose:
        return _facing(self._walker, self._i, self._apart, stance)

    def _with_arm(self, stance: Stance, side: str, off: float, beside: float, lift: float) -> Stance:
        """The stance with one arm around the other, the hand along the back."""
        sign, found, body = dict(SIDES)[side], dict(stance.local), self._walker.body
        lengths = [float(np.linalg.norm(body.joint(f"{side}_{a}") - body.joint(f"{side}_{b}"))) for a, b in pairwise(ARM_JOINTS)]
        ends = [MARKERS.index(f"{side[0].upper()}{name}") for name in ("Shoulder", "Wrist")]
        torso = np.diag([1.0 - 2.0 * self._i, 1.0 - 2.0 * self._i, 1.0]) @ found["pelvis"] @ found["torso"]
        target, pole = self._place(sign, beside, off), sign * self._left + [0.0, 0.0, lift]
        wanted = target
        for i in range(_ROUNDS):  # the shoulder moves with the arm
            shoulder, wrist = self._pose(Stance(found)).markers[ends]
            wanted = wanted + 0.7 * (target - wrist) * (i > 0)
            upper, fore = _reaching(wanted - shoulder, lengths, pole)
            found[f"{side}_upper_arm"], found[f"{side}_forearm"] = torso.T @ upper, upper.T @ fore
        return Stance(found, stance.hands | {side: _hand(fore.T @ (-sign * self._left))})

    def _place(self, sign: float, beside: float, off: float) -> np.ndarray:
        """(3,) of a wrist on the other's back."""
        middle, half = _BELOW_M[self._i]
        place = self._shoulders + self._left * sign * beside - [0.0, 0.0, self._scale * (middle + half * sign)]
        depth = (self._trunk - place) @ self._forward
        away = np.linalg.norm(self._trunk - place - np.outer(depth, self._forward), axis=1)
        return place + self._forward * (float(depth[np.argsort(away)[:_BACK_VERTICES]].max()) + off)


def _hand(fingers: np.ndarray) -> np.ndarray:
    """Turn (3, 3) of a hand in the forearm's axes towards a direction (3,), as far as wrists do."""
    axis = np.cross([0.0, 0.0, -1.0], fingers)
    sine = float(np.linalg.norm(axis))
    return Rotation.from_rotvec(min(np.arctan2(sine, -fingers[2]), _WRIST_RAD) * axis / max(sine, 1e-9)).as_matrix()


def _reaching(way: np.ndarray, lengths: Sequence[float], pole: np.ndarray) -> list[np.ndarray]:
    """World rotations (3, 3) of upper arm and forearm, of these lengths, that lead a way (3,), the elbow towards the pole."""
    a, b = lengths
    direction = way / np.linalg.norm(way)
    reach = min(float(np.linalg.norm(way)), _STRETCH * (a + b))
    along = (a * a - b * b + reach * reach) / (2.0 * reach)
    out = pole - (pole @ direction) * direction
    elbow = along * direction + np.sqrt(a * a - along * along) * out / np.linalg.norm(out)
    upper, fore = elbow / a, (reach * direction - elbow) / b
    lateral = np.cross(fore, upper)  # elbows bend about this
    lateral /= np.linalg.norm(lateral)
    return [np.stack([np.cross(lateral, -bone), lateral, -bone], axis=1) for bone in (upper, fore)]
