"""Humans built from body measures: one of 18 parts and 40 degrees of freedom (the part list of Knossow et al. 2008), and a fuller
one for gait laboratories.

Six degrees of freedom of the root (pelvis) and 34 joint angles: head 2, torso 3, abdomen 3, clavicles 2 x 3, shoulders 2 x 3,
elbows 2 x 2, hips 2 x 3, knees 2 x 2. Hands are fixed to forearms, feet to shanks; with ankles, feet bend up and down (42). The
fuller human has ankles and wrists of two axes, toes, a head that turns, and hands and feet of several shapes (51).

Neutral is standing with the arms hanging and palms inward; every link's axes are then those of the body: x forward, y left, z
up. A link's origin is the joint that carries it. Axes of the right side are those of the left mirrored, so equal angles on both
sides are a symmetric pose, and names say what a positive angle does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...geometry import se3, so3
from ..articulated import ArticulatedModel, Landmark, Shape
from ..kinematic_chain import Joint, KinematicChain, axes_in_degrees
from ..shapes.primitives import Ellipsoid, Primitive, TruncatedCone
from . import extremities
from .extremities import Part
from .measures import HumanMeasures

SIDES = (("left", 1.0), ("right", -1.0))  # name, and sign of y
TRUNK_LINKS = ("pelvis", "abdomen", "torso", "head")
LIMB_LINKS = ("clavicle", "upper_arm", "forearm", "hand", "thigh", "shank", "foot")
_DIAGONAL = 1.0 / np.sqrt(2.0)

# Weak pull to neutral, 1/rad^2: turning a nearly round part about its own axis hardly moves its contours.
ROLL_STIFFNESS = 200.0
CLAVICLE_STIFFNESS = 100.0
TRUNK_STIFFNESS = 20.0
LIMB_STIFFNESS = 1.0

# Axes of the left side: name, direction, limits in degrees, stiffness. Limits are those of gymnasts and kickers, wider than the
# norms of clinics (American Academy of Orthopaedic Surgeons), so that the tracker is not stopped short by a soft part.
_LEFT_AXES: dict[str, tuple[tuple[str, tuple[float, float, float], tuple[float, float], float], ...]] = {
    "clavicle": (
        ("clavicle_protraction", (0.0, 0.0, -1.0), (-30.0, 40.0), CLAVICLE_STIFFNESS),
        ("clavicle_elevation", (1.0, 0.0, 0.0), (-20.0, 45.0), CLAVICLE_STIFFNESS),
        ("clavicle_axial_rotation", (0.0, 1.0, 0.0), (-30.0, 30.0), ROLL_STIFFNESS),
    ),
    # The three revolutes lose one direction when the arm points along the first axis: level, and forward across the body or
    # backward and out. T-pose, arms overhead, in front and behind are far from that.
    "shoulder": (
        ("shoulder_elevation_front", (_DIAGONAL, -_DIAGONAL, 0.0), (-90.0, 200.0), LIMB_STIFFNESS),
        ("shoulder_elevation_back", (_DIAGONAL, _DIAGONAL, 0.0), (-85.0, 85.0), LIMB_STIFFNESS),
        ("shoulder_internal_rotation", (0.0, 0.0, -1.0), (-120.0, 120.0), ROLL_STIFFNESS),
    ),
    "elbow": (
        ("elbow_flexion", (0.0, -1.0, 0.0), (-5.0, 155.0), LIMB_STIFFNESS),
        ("elbow_pronation", (0.0, 0.0, -1.0), (-95.0, 95.0), ROLL_STIFFNESS),
    ),
    "hip": (
        ("hip_flexion", (0.0, -1.0, 0.0), (-40.0, 140.0), LIMB_STIFFNESS),
        ("hip_abduction", (1.0, 0.0, 0.0), (-45.0, 80.0), LIMB_STIFFNESS),
        ("hip_internal_rotation", (0.0, 0.0, -1.0), (-70.0, 70.0), ROLL_STIFFNESS),
    ),
    "knee": (
        ("knee_flexion", (0.0, 1.0, 0.0), (-10.0, 160.0), LIMB_STIFFNESS),
        ("knee_internal_rotation", (0.0, 0.0, -1.0), (-40.0, 40.0), ROLL_STIFFNESS),
    ),
}
_ANKLE_AXES = (("ankle_dorsiflexion", (0.0, -1.0, 0.0), (-60.0, 45.0), LIMB_STIFFNESS),)
_TRUNK_AXES = {
    "abdomen": (
        ("abdomen_flexion", (0.0, 1.0, 0.0), (-40.0, 75.0), TRUNK_STIFFNESS),
        ("abdomen_bend_right", (1.0, 0.0, 0.0), (-35.0, 35.0), TRUNK_STIFFNESS),
        ("abdomen_turn_left", (0.0, 0.0, 1.0), (-35.0, 35.0), TRUNK_STIFFNESS),
    ),
    "torso": (
        ("torso_flexion", (0.0, 1.0, 0.0), (-35.0, 50.0), TRUNK_STIFFNESS),
        ("torso_bend_right", (1.0, 0.0, 0.0), (-35.0, 35.0), TRUNK_STIFFNESS),
        ("torso_turn_left", (0.0, 0.0, 1.0), (-40.0, 40.0), TRUNK_STIFFNESS),
    ),
    # Two, as the paper has: those that move the head's outline. Its turn about the neck does not.
    "neck": (
        ("head_flexion", (0.0, 1.0, 0.0), (-70.0, 65.0), LIMB_STIFFNESS),
        ("head_bend_right", (1.0, 0.0, 0.0), (-50.0, 50.0), LIMB_STIFFNESS),
    ),
}
# What each human has beside, or instead of, these axes
_ANKLES = {"ankle": _ANKLE_AXES}
_GAIT: dict[str, tuple] = {
    "neck": (*_TRUNK_AXES["neck"], ("head_turn_left", (0.0, 0.0, 1.0), (-85.0, 85.0), ROLL_STIFFNESS)),
    "wrist": (
        ("wrist_flexion", (-1.0, 0.0, 0.0), (-80.0, 85.0), LIMB_STIFFNESS),
        ("wrist_ulnar_deviation", (0.0, 1.0, 0.0), (-25.0, 40.0), LIMB_STIFFNESS),
    ),
    "ankle": (*_ANKLE_AXES, ("ankle_inversion", (-1.0, 0.0, 0.0), (-25.0, 40.0), LIMB_STIFFNESS)),
    "toes": (("toes_extension", (0.0, -1.0, 0.0), (-30.0, 75.0), LIMB_STIFFNESS),),
}
# How far axes are from neutral, degrees: a prior that counts where images tell little, such as how a trunk's bend is shared by
# hips and spine. Of the two joints of a spine 13 forward, 12 aside, 10 about: near the root mean squares in a captured walk,
# dance, kick and jump (14.7, 12.9, 8.9). Of others, our own estimates for what people do standing and walking.
_GAIT_SPREADS_DEG = {
    "abdomen_flexion": 9.0, "torso_flexion": 9.0, "abdomen_bend_right": 8.5, "torso_bend_right": 8.5,
    "abdomen_turn_left": 7.0, "torso_turn_left": 7.0, "head_turn_left": 30.0,
    "clavicle_protraction": 8.0, "clavicle_elevation": 10.0, "clavicle_axial_rotation": 10.0,
    "wrist_flexion": 25.0, "wrist_ulnar_deviation": 12.0, "knee_internal_rotation": 8.0,
    "ankle_inversion": 10.0, "toes_extension": 15.0,
}  # fmt: skip
_STIFFNESS_OF_RADIAN = 18.0  # of a spread of one radian, where `motion.neutral_angle` has its default
_SKIN, _SHIRT, _SHORTS = (205, 160, 135), (70, 110, 160), (60, 60, 75)
_COLORS = {
    "pelvis": _SHORTS, "hips": _SHORTS, "abdomen": _SHIRT, "torso": (90, 130, 180), "head": _SKIN, "neck": (190, 145, 120),
    "left_clavicle": (80, 140, 150), "left_upper_arm": (215, 140, 90), "left_forearm": (230, 170, 110), "left_hand": _SKIN,
    "right_clavicle": (90, 120, 190), "right_upper_arm": (120, 170, 90), "right_forearm": (150, 200, 120), "right_hand": _SKIN,
    "left_thigh": (190, 90, 90), "left_shank": (220, 130, 130), "left_foot": (150, 70, 70),
    "right_thigh": (90, 150, 120), "right_shank": (130, 190, 160), "right_foot": (60, 110, 90),
    **{f"{side}_{name}": color for side, _ in SIDES for name, color in (
        ("palm", _SKIN), ("fingers", (220, 150, 125)), ("thumb", (185, 140, 115)),
    )},
    "left_heel": (120, 50, 50), "left_midfoot": (150, 70, 70), "left_toes": (185, 95, 95),
    "right_heel": (40, 85, 70), "right_midfoot": (60, 110, 90), "right_toes": (85, 140, 115),
}  # fmt: skip


@dataclass(frozen=True)
class _Side:
    """Adds the side's name, and mirrors points of the left side to it."""

    name: str
    sign: float

    def point(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        return (x, self.sign * y, z)


def human_model(measures: HumanMeasures | None = None, ankles: bool = False) -> ArticulatedModel:
    """Body of a person.

    Parameters
    ----------
    measures : meters; None for a man of 1.75 m.
    ankles : feet turn up and down. Who tracks heels and toes needs them: on stiff ankles these pull knees off by 5 cm in a squat.

    Returns
    -------
    18 links, 40 degrees of freedom, or 42.
    """
    return _built("human", measures or HumanMeasures(), _ANKLES if ankles else {})


def gait_human(measures: HumanMeasures | None = None) -> ArticulatedModel:
    """Body of a person whose feet, hands and head move as those of `human_model` do not.

    Its trunk has the same three parts: pelvis, ``abdomen`` (lumbar spine), ``torso`` (thorax).

    Parameters
    ----------
    measures : meters; None for a man of 1.75 m.

    Returns
    -------
    20 links, 51 degrees of freedom.
    """
    axes = {**_LEFT_AXES, **_TRUNK_AXES, **_GAIT}
    return _built("gait_human", measures or HumanMeasures(), {name: tuple(map(_spread, rows)) for name, rows in axes.items()})


def _spread(row: tuple) -> tuple:
    """A row of the tables with the stiffness that the spread of the axis stands for."""
    name, direction, limits, stiffness = row
    spread = _GAIT_SPREADS_DEG.get(name)
    return name, direction, limits, stiffness if spread is None else round(_STIFFNESS_OF_RADIAN / np.deg2rad(spread) ** 2, 1)


def _built(name: str, m: HumanMeasures, changes: Mapping[str, tuple]) -> ArticulatedModel:
    """The human with some joints' axes changed; where toes move, hands and feet are of several shapes."""
    axes, detailed = {**_LEFT_AXES, **_TRUNK_AXES, **changes}, "toes" in changes
    limb_links = (*LIMB_LINKS, "toes") if detailed else LIMB_LINKS
    links = TRUNK_LINKS + tuple(f"{side}_{link}" for side, _ in SIDES for link in limb_links)
    joints = _trunk_joints(m, axes)
    shapes = _trunk_shapes(m, detailed)
    landmarks = [
        Landmark("neck", "torso", (m.neck_x, 0.0, m.neck_z)),
        Landmark("head", "head", (m.head_x, 0.0, m.head_top)),
        Landmark("nose", "head", (m.head_x + m.head_radii[0] + 0.010, 0.0, m.head_top - 0.075 * m.stature)),
    ]
    for side_name, sign in SIDES:
        side = _Side(side_name, sign)
        joints += _limb_joints(m, side, axes)
        shapes += _limb_shapes(m, side, detailed)
        landmarks += _limb_landmarks(m, side, detailed)
    return ArticulatedModel(name, KinematicChain(links, tuple(joints)), tuple(shapes), tuple(landmarks))


def _at(x: float, y: float, z: float) -> np.ndarray:
    return se3.from_rotation_translation(np.eye(3), np.array([x, y, z]))


def _trunk_joints(m: HumanMeasures, axes: Mapping[str, tuple]) -> list[Joint]:
    return [
        Joint("abdomen", "pelvis", "abdomen", _at(m.spine_x, 0.0, m.pelvis_length), axes_in_degrees(axes["abdomen"])),
        Joint("torso", "abdomen", "torso", _at(0.0, 0.0, m.abdomen_length), axes_in_degrees(axes["torso"])),
        Joint("neck", "torso", "head", _at(m.neck_x, 0.0, m.neck_z), axes_in_degrees(axes["neck"])),
    ]


def _limb_joints(m: HumanMeasures, side: _Side, axes: Mapping[str, tuple]) -> list[Joint]:
    places = [
        ("clavicle", "torso", "clavicle", (m.clavicle_x, m.clavicle_y, m.clavicle_z)),
        ("shoulder", "clavicle", "upper_arm", (m.shoulder_x, m.clavicle_length, 0.0)),
        ("elbow", "upper_arm", "forearm", (0.0, 0.0, -m.upper_arm_length)),
        ("wrist", "forearm", "hand", (0.0, 0.0, -m.forearm_length)),
        ("hip", "pelvis", "thigh", (0.0, m.hip_half_width, 0.0)),
        ("knee", "thigh", "shank", (0.0, 0.0, -m.thigh_length)),
        ("ankle", "shank", "foot", (0.0, 0.0, -m.shank_length)),
    ]
    if "toes" in axes:
        places.append(("toes", "foot", "toes", extremities.ball_of_foot(m)))
    joints = []
    for name, parent, child, place in places:
        parent = parent if parent in TRUNK_LINKS else f"{side.name}_{parent}"
        own = axes_in_degrees(axes.get(name, ()), f"{side.name}_", side.sign)
        joints.append(Joint(f"{side.name}_{name}", parent, f"{side.name}_{child}", _at(*side.point(*place)), own))
    return joints


def _shape(name: str, link: str, primitive: Primitive, T_link_shape: np.ndarray) -> Shape:
    return Shape(name, link, primitive, T_link_shape, _COLORS[name])


def _cone(bottom: tuple[float, float], top: float, z1: float, z2: float) -> TruncatedCone:
    """Upright cone: half-axes ``bottom`` (forward, sideways) at z1, the ``top``-fold of them at z2."""
    k = (top - 1.0) / (z2 - top * z1)  # from (1 + k z2) = top (1 + k z1)
    scale = 1.0 + k * z1
    return TruncatedCone(bottom[0] / scale, bottom[1] / scale, k, z1, z2)


def _trunk_shapes(m: HumanMeasures, detailed: bool) -> list[Shape]:
    overlap = m.overlap
    pelvis = _cone(m.buttock_radii, m.waist_radii[1] / m.buttock_radii[1], -m.crotch_depth, m.pelvis_length + overlap)
    hips = _shape("pelvis", "pelvis", pelvis, _at(0.5 * m.spine_x, 0.0, 0.0))
    if detailed:
        # Round, since clothes hide how it is tilted: straight sides of a cone would tell what they do not know
        low, high = -1.25 * m.crotch_depth, m.pelvis_length + 1.1 * overlap
        hips = _shape(
            "hips", "pelvis", Ellipsoid((*m.buttock_radii, 0.5 * (high - low))), _at(0.5 * m.spine_x, 0.0, 0.5 * (high + low))
        )
    abdomen = _cone(m.waist_radii, m.chest_base_radii[1] / m.waist_radii[1], -overlap, m.abdomen_length + overlap)
    torso = _cone(m.chest_base_radii, m.chest_radii[1] / m.chest_base_radii[1], -overlap, m.chest_top)
    neck = TruncatedCone(m.neck_radius, m.neck_radius, m.neck_taper / m.scale, -m.neck_depth, m.head_top - 1.5 * m.head_radii[2])
    head = Ellipsoid(m.head_radii)
    tilt = np.arctan2(m.head_x, m.head_top - m.head_radii[2])
    neck_place = se3.from_rotation_translation(so3.exp([0.0, float(tilt), 0.0]), np.zeros(3))
    return [
        hips,
        _shape("abdomen", "abdomen", abdomen, _at(-0.5 * m.spine_x, 0.0, 0.0)),
        _shape("torso", "torso", torso, _at(0.0, 0.0, 0.0)),
        _shape("neck", "head", neck, neck_place),
        _shape("head", "head", head, _at(m.head_x, 0.0, m.head_top - m.head_radii[2])),
    ]


def _limb_shapes(m: HumanMeasures, side: _Side, detailed: bool) -> list[Shape]:
    overlap = m.overlap
    sideways = se3.from_rotation_translation(so3.exp([-side.sign * np.pi / 2, 0.0, 0.0]), np.zeros(3))  # z to the side
    sideways[0, 3] = 0.5 * m.shoulder_x
    girdle = _cone(m.clavicle_radii, m.deltoid_scale, -m.clavicle_y, m.clavicle_length + 0.4 * overlap)
    arm, forearm, thigh, shank = m.upper_arm_radii, m.forearm_radii, m.thigh_radii, m.shank_radii
    straight = np.eye(4)
    parts = (
        Part("clavicle", "clavicle", girdle, sideways),
        Part("upper_arm", "upper_arm", _limb(arm, m.elbow_scale, m.upper_arm_length, 1.2 * overlap, 0.5 * overlap), straight),
        Part("forearm", "forearm", _limb(forearm, m.wrist_scale, m.forearm_length, 0.5 * overlap, 0.5 * overlap), straight),
        *(_mirrored(part, side) for part in (extremities.hand if detailed else extremities.plain_hand)(m)),
        Part("thigh", "thigh", _limb(thigh, m.knee_scale, m.thigh_length, 1.2 * overlap, 0.7 * overlap), straight),
        Part("shank", "shank", _limb(shank, m.ankle_scale, m.shank_length, 0.7 * overlap, 0.5 * overlap), straight),
        *(_mirrored(part, side) for part in (extremities.foot if detailed else extremities.plain_foot)(m)),
    )
    return [_shape(f"{side.name}_{p.name}", f"{side.name}_{p.link}", p.primitive, p.T_link_shape) for p in parts]


def _mirrored(part: Part, side: _Side) -> Part:
    """The part of the left side, or its mirror image; its shape is its own in its planes."""
    mirror = np.diag([1.0, side.sign, 1.0, 1.0])
    return Part(part.name, part.link, part.primitive, mirror @ part.T_link_shape @ mirror + 0.0)


def _limb(radii: tuple[float, float], end_scale: float, length: float, above: float, below: float) -> TruncatedCone:
    """Hanging cone: half-axes ``radii`` at its joint (z = 0), the ``end_scale``-fold at z = -length, longer at both ends."""
    return TruncatedCone(radii[0], radii[1], (1.0 - end_scale) / length, -length - below, above)


def _limb_landmarks(m: HumanMeasures, side: _Side, detailed: bool) -> list[Landmark]:
    """Joint centers belong to the parts that carry the joints, so no part's turn about its own axis moves them."""
    rows = (
        ("shoulder", "clavicle", (m.shoulder_x, m.clavicle_length, 0.0)),
        ("elbow", "upper_arm", (0.0, 0.0, -m.upper_arm_length)),
        ("wrist", "forearm", (0.0, 0.0, -m.forearm_length)),
        *(extremities.hand_landmarks(m) if detailed else ()),
        ("knee", "thigh", (0.0, 0.0, -m.thigh_length)),
        ("ankle", "shank", (0.0, 0.0, -m.shank_length)),
        *extremities.foot_landmarks(m, detailed),
    )
    landmarks = [Landmark(f"{side.name}_hip", "pelvis", side.point(0.0, m.hip_half_width, 0.0))]
    for name, link, place in rows:
        landmarks.append(Landmark(f"{side.name}_{name}", f"{side.name}_{link}", side.point(*place)))
    return landmarks
