"""Shapes and landmarks of hands and feet: an ellipsoid each, or parts that one can tell apart.

Positions are those of the left side in the frame of the part's link, neutral pose: the hand hangs from the wrist with the palm
inward and the thumb forward, the foot stands under the ankle. Fractions of the hand's length, the foot's length and the ankle's
height are our own, after drawings of grown-ups; hand and foot together measure what `HumanMeasures` says.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...geometry import se3, so3
from ..shapes.primitives import Ellipsoid, Primitive, TruncatedCone
from .measures import HumanMeasures

Place = tuple[float, float, float]
_PALM = 0.54  # of the hand's length, from the wrist to the knuckles
_PALM_WIDENS = 1.5  # from the wrist to the knuckles
_BALL = 0.72  # of the foot's length, from the heel to the joints of the toes
_FOOT_PITCH, _THUMB_SPREAD, _THUMB_IN = np.deg2rad(8.0), np.deg2rad(22.0), np.deg2rad(12.0)


@dataclass(frozen=True, eq=False)
class Part:
    """A shape of the left side: its name and link without the side, and ``T_link_shape`` (4, 4) of it."""

    name: str
    link: str
    primitive: Primitive
    T_link_shape: np.ndarray


def plain_hand(m: HumanMeasures) -> list[Part]:
    """One ellipsoid."""
    return [Part("hand", "hand", Ellipsoid(m.hand_radii), _at(0.0, 0.0, -0.80 * m.hand_radii[2]))]


def plain_foot(m: HumanMeasures) -> list[Part]:
    """One ellipsoid."""
    x, z = m.foot_radii[0] - m.heel_behind_ankle, m.foot_radii[2] - m.ankle_height
    return [Part("foot", "foot", Ellipsoid(m.foot_radii), _at(x, 0.0, z))]


def hand(m: HumanMeasures) -> list[Part]:
    """Palm, fingers together, thumb."""
    half_breadth, half_depth, half_length = m.hand_radii
    palm, fingers = 2.0 * _PALM * half_length, 2.0 * (1.0 - _PALM) * half_length
    wrist = (0.97 * half_breadth / _PALM_WIDENS, 0.85 * half_depth / _PALM_WIDENS)
    cone = TruncatedCone(*wrist, (1.0 - _PALM_WIDENS) / palm, -palm, 0.2 * m.overlap)
    thumb_length = 0.38 * half_length
    thumb = so3.exp([0.0, -_THUMB_SPREAD, 0.0]) @ so3.exp([-_THUMB_IN, 0.0, 0.0])
    return [
        Part("palm", "hand", cone, np.eye(4)),
        Part("fingers", "hand", Ellipsoid((0.88 * half_breadth, 0.6 * half_depth, 0.5 * fingers + 0.15 * palm)),
             _at(0.0, 0.0, -palm - 0.5 * fingers + 0.15 * palm)),
        Part("thumb", "hand", Ellipsoid((0.13 * half_length, 0.13 * half_length, thumb_length)),
             se3.from_rotation_translation(thumb, np.array([0.88 * half_breadth, -0.3 * half_depth, -0.62 * palm]))),
    ]  # fmt: skip


def foot(m: HumanMeasures) -> list[Part]:
    """Heel, foot to the ball, toes."""
    half_length, half_width, _ = m.foot_radii
    height, ball = m.ankle_height, ball_of_foot(m)
    heel = Ellipsoid((0.27 * half_length, 0.68 * half_width, 0.5 * height))
    long, low = 0.80 * half_length, 0.40 * height
    pitched = se3.from_rotation_translation(
        so3.exp([0.0, _FOOT_PITCH, 0.0]), np.array([0.98 * long - m.heel_behind_ankle, 0.0, 1.2 * low - height])
    )
    toes = 2.0 * half_length - m.heel_behind_ankle - ball[0]
    flat = 0.23 * height
    return [
        Part("heel", "foot", heel, _at(heel.radii[0] - m.heel_behind_ankle, 0.0, -0.5 * height)),
        Part("midfoot", "foot", Ellipsoid((long, 0.94 * half_width, low)), pitched),
        Part("toes", "toes", Ellipsoid((0.76 * toes, half_width, flat)), _at(0.24 * toes, 0.0, flat - height - ball[2])),
    ]


def ball_of_foot(m: HumanMeasures) -> Place:
    """Middle of the joints about which toes bend, from the ankle."""
    return (2.0 * _BALL * m.foot_radii[0] - m.heel_behind_ankle, 0.0, -0.75 * m.ankle_height)


def hand_landmarks(m: HumanMeasures) -> list[tuple[str, str, Place]]:
    """Knuckles of index and little finger, joint in the thumb: (name, link, place)."""
    half_breadth, half_depth, half_length = m.hand_radii
    knuckles = -2.0 * _PALM * half_length
    return [
        ("index", "hand", (0.65 * half_breadth, 0.0, knuckles)),
        ("pinky", "hand", (-0.75 * half_breadth, 0.0, 0.9 * knuckles)),
        ("thumb", "hand", (1.10 * half_breadth, -0.4 * half_depth, 0.78 * knuckles)),
    ]


def foot_landmarks(m: HumanMeasures, toes_move: bool) -> list[tuple[str, str, Place]]:
    """Toes and heel: (name, link, place), the same points in the neutral pose wherever they belong to.

    Parameters
    ----------
    m : measures.
    toes_move : the big toe belongs to the toes; without such a link, to the foot.

    Returns
    -------
    In the frames of the links.
    """
    sole, toe, half_width = -m.ankle_height, 2.0 * m.foot_radii[0] - m.heel_behind_ankle, m.foot_radii[1]
    big = (0.93 * toe, -0.5 * half_width, 0.75 * sole)
    if toes_move:
        x, y, z = ball_of_foot(m)
        big = (big[0] - x, big[1] - y, big[2] - z)
    return [
        ("big_toe", "toes" if toes_move else "foot", big),
        ("small_toe", "foot", (0.72 * toe, 0.8 * half_width, 0.8 * sole)),
        ("heel", "foot", (-0.85 * m.heel_behind_ankle, 0.0, 0.7 * sole)),
    ]


def _at(x: float, y: float, z: float) -> np.ndarray:
    return se3.from_rotation_translation(np.eye(3), np.array([x, y, z]))
