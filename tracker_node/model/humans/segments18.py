"""The body of 18 segments and 57 variables of the color paper: joints, axes, colors, sections, surfaces.

Trewartha, Yeadon & Knight: feet, shanks, thighs, pelvis, torso, chest, shoulders, upper arms, forearms, hands and head; 17 joints
of three degrees of freedom; the pose is that of the *top of the pelvis*. Pelvis, torso and chest meet at the lowest rib and at
the nipples, as in Yeadon's inertia model, whose sections these are (below).

Links have the axes of the body (x forward, y left, z up) in the neutral pose: standing, arms hanging a little off the trunk,
palms inward. Axes of the right side are mirrored: equal angles on both sides are a symmetric pose.

Measures of one man, as Yeadon's inertia model asks for them, and the stadium cross-sections they stand for.

Yeadon, M. R. (1990), *The simulation of aerial movement II: a mathematical inertia model of the human body*, J. Biomech. 23,
describes a body by lengths, girths, breadths and depths at fixed levels. The numbers are those of the subject "male3" who comes
with the Python package yeadon 2.0.1 (C. Dembia et al., file misc/samplemeasurements/male3.txt), left and right averaged; only
the greatest girth of the calf is the right leg's alone, since the left one's (28.8 cm, with 40 cm at the knee) is a slip.
His stature comes to 1.81 m.

Surfaces are an ellipsoid for each segment, the body that tracks in the color paper, or a loft through its cross-sections. An
ellipsoid has the center and the second moments of the segment's measured solid (`nurbs_human`): its length, breadth and depth in
that sense, and another surface. The solid of an arm's or leg's part is that between its joint centers: the domes with which it
reaches into its neighbors are left out.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...geometry import se3, so3
from ..articulated import ArticulatedModel, Landmark, Shape
from ..kinematic_chain import Joint, KinematicChain, axes_in_degrees
from ..shapes.nurbs import N_AROUND, RING_SPACING, Loft, Section, loft_mesh
from ..shapes.primitives import Ellipsoid, Mesh

# Levels of the trunk: meters above the hip joint centers; those of the head above the acromion.
UMBILICUS, LOWEST_RIB, NIPPLE, SHOULDER, ACROMION = 0.176, 0.277, 0.388, 0.493, 0.545
NOSE, ABOVE_EAR, HEAD_TOP = 0.152, 0.208, 0.308
# Girth and breadth
HIP_SECTION, UMBILICUS_SECTION, RIB_SECTION, NIPPLE_SECTION = (0.970, 0.347), (0.865, 0.317), (0.845, 0.285), (0.905, 0.296)
SHOULDER_BREADTH, SHOULDER_DEPTH = 0.343, 0.215  # breadth: between the joint centers
NECK_GIRTH, NOSE_GIRTH, EAR_GIRTH = 0.375, 0.530, 0.600

# Arm: meters below the shoulder's joint center; hand below the wrist's
ELBOW, FOREARM_MAXIMUM, WRIST = 0.2995, 0.350, 0.564
THUMB_BASE, KNUCKLES, FINGERNAILS = 0.049, 0.0805, 0.1545
SHOULDER_GIRTH, MID_ARM_GIRTH, ELBOW_GIRTH, FOREARM_GIRTH = 0.337, 0.2915, 0.278, 0.283
WRIST_SECTION, THUMB_SECTION, KNUCKLE_SECTION, NAIL_SECTION = (0.166, 0.0555), (0.240, 0.0975), (0.2325, 0.0975), (0.1205, 0.047)

# Leg: meters below the hip's joint center; foot in front of the ankle's
CROTCH, KNEE, CALF_MAXIMUM, ANKLE = 0.062, 0.449, 0.559, 0.878
MID_THIGH = 0.5 * (CROTCH + KNEE)
HEEL, BALL, TOENAILS = 0.050, 0.1535, 0.218
ARCH = 0.5 * (HEEL + BALL)
CROTCH_GIRTH, MID_THIGH_GIRTH, KNEE_GIRTH, CALF_GIRTH, ANKLE_GIRTH = 0.617, 0.581, 0.3915, 0.392, 0.2475
ARCH_GIRTH, BALL_SECTION, TOE_SECTION = 0.252, (0.245, 0.1015), (0.215, 0.0965)

# Shares of stature and of breadth for what Yeadon's model does not measure
ANKLE_HEIGHT = 0.070  # 0.039 of stature: Drillis & Contini (1966), in Winter (2009)
HEEL_BEHIND_ANKLE = 0.055
HEAD_LENGTH_TO_BREADTH = 0.197 / 0.152  # means of the men of the 1988 Anthropometric Survey of U.S. Army Personnel


def radius_of(girth: float) -> float:
    """Of a circle."""
    return girth / (2.0 * math.pi)


def stadium_halves(girth: float, breadth: float) -> tuple[float, float]:
    """Stadium of a girth and a breadth: girth = 2 pi r + 4 t, breadth = 2 (r + t).

    Parameters
    ----------
    girth, breadth : meters.

    Returns
    -------
    Half-widths (broad, thin), meters.
    """
    radius = (girth - 2.0 * breadth) / (2.0 * math.pi - 4.0)
    return 0.5 * breadth, radius


def stadium_of_ratio(girth: float, ratio: float) -> tuple[float, float]:
    """Stadium of a girth and a ratio.

    Parameters
    ----------
    girth, ratio : meters; breadth over depth.

    Returns
    -------
    Half-widths (broad, thin), meters.
    """
    radius = girth / (2.0 * math.pi + 4.0 * (ratio - 1.0))
    return ratio * radius, radius


LIMBS = ("shoulder", "upper_arm", "forearm", "hand", "thigh", "shank", "foot")
SIDES = (("left", 1.0), ("right", -1.0))  # name, and sign of y
SEGMENTS = ("pelvis", "torso", "chest", "head", *(f"{side}_{segment}" for side, _ in SIDES for segment in LIMBS))
HIP_HALF_WIDTH = 0.25 * HIP_SECTION[1]  # as Yeadon places it
SHOULDER_HALF_WIDTH = 0.5 * SHOULDER_BREADTH
CLAVICLE = (0.0, 0.030, SHOULDER - NIPPLE + 0.010)  # the inner end of the left shoulder segment, from the chest's origin

# Every color is strong, and neighbors and the two sides differ, both in (r, g, b) and in its fraction of the sum.
COLORS = {
    "pelvis": (235, 205, 40), "torso": (50, 80, 230), "chest": (225, 50, 60), "head": (235, 190, 120),
    "left_shoulder": (50, 190, 70), "left_upper_arm": (235, 60, 200), "left_forearm": (40, 200, 215), "left_hand": (225, 45, 60),
    "right_shoulder": (130, 60, 220), "right_upper_arm": (150, 230, 40), "right_forearm": (245, 120, 30),
    "right_hand": (40, 205, 90),
    "left_thigh": (210, 50, 150), "left_shank": (70, 210, 60), "left_foot": (250, 170, 40),
    "right_thigh": (40, 170, 200), "right_shank": (235, 70, 50), "right_foot": (120, 60, 230),
}  # fmt: skip

_DIAGONAL = 1.0 / np.sqrt(2.0)
_ROLL, _GIRDLE, _TRUNK, _SMALL, _LIMB = 200.0, 100.0, 20.0, 50.0, 1.0  # stiffness, 1/rad^2: weak, and weakest where it shows

# Name, direction (left side), limits in degrees, stiffness[, neutral]. Limits are at least the norms of the American Academy of
# Orthopaedic Surgeons (Joint Motion, 1965), wider where gymnasts are; the third axes of elbow and knee stand for laxity.
_TRUNK_JOINTS = {
    "torso": (
        ("torso_flexion", (0.0, 1.0, 0.0), (-40.0, 60.0), _TRUNK),
        ("torso_bend_right", (1.0, 0.0, 0.0), (-35.0, 35.0), _TRUNK),
        ("torso_turn_left", (0.0, 0.0, 1.0), (-35.0, 35.0), _TRUNK),
    ),
    "chest": (
        ("chest_flexion", (0.0, 1.0, 0.0), (-30.0, 40.0), _TRUNK),
        ("chest_bend_right", (1.0, 0.0, 0.0), (-25.0, 25.0), _TRUNK),
        ("chest_turn_left", (0.0, 0.0, 1.0), (-35.0, 35.0), _TRUNK),
    ),
    "neck": (
        ("head_flexion", (0.0, 1.0, 0.0), (-70.0, 65.0), _LIMB),
        ("head_bend_right", (1.0, 0.0, 0.0), (-50.0, 50.0), _LIMB),
        ("head_turn_left", (0.0, 0.0, 1.0), (-85.0, 85.0), _ROLL),
    ),
}
_LEFT_JOINTS = {
    "clavicle": (
        ("clavicle_protraction", (0.0, 0.0, -1.0), (-30.0, 40.0), _GIRDLE),
        ("clavicle_elevation", (1.0, 0.0, 0.0), (-20.0, 45.0), _GIRDLE),
        ("clavicle_axial_rotation", (0.0, 1.0, 0.0), (-30.0, 30.0), _ROLL),
    ),
    # Diagonal axes: they lose a direction only where the level arm points across the chest or backward and out.
    "shoulder": (
        ("shoulder_elevation_front", (_DIAGONAL, -_DIAGONAL, 0.0), (-90.0, 200.0), _LIMB, 7.0),
        ("shoulder_elevation_back", (_DIAGONAL, _DIAGONAL, 0.0), (-85.0, 85.0), _LIMB, 7.0),
        ("shoulder_internal_rotation", (0.0, 0.0, -1.0), (-120.0, 120.0), _ROLL),
    ),
    "elbow": (
        ("elbow_flexion", (0.0, -1.0, 0.0), (-10.0, 155.0), _LIMB),
        ("elbow_abduction", (1.0, 0.0, 0.0), (-10.0, 20.0), _ROLL),
        ("elbow_pronation", (0.0, 0.0, -1.0), (-95.0, 95.0), _ROLL),
    ),
    "wrist": (
        ("wrist_flexion", (-1.0, 0.0, 0.0), (-75.0, 85.0), _SMALL),
        ("wrist_radial_deviation", (0.0, -1.0, 0.0), (-40.0, 25.0), _SMALL),
        ("wrist_pronation", (0.0, 0.0, -1.0), (-10.0, 10.0), _ROLL),
    ),
    "hip": (
        ("hip_flexion", (0.0, -1.0, 0.0), (-40.0, 140.0), _LIMB),
        ("hip_abduction", (1.0, 0.0, 0.0), (-45.0, 80.0), _LIMB),
        ("hip_internal_rotation", (0.0, 0.0, -1.0), (-70.0, 70.0), _ROLL),
    ),
    "knee": (
        ("knee_flexion", (0.0, 1.0, 0.0), (-10.0, 160.0), _LIMB),
        ("knee_abduction", (1.0, 0.0, 0.0), (-10.0, 10.0), _ROLL),
        ("knee_internal_rotation", (0.0, 0.0, -1.0), (-40.0, 40.0), _ROLL),
    ),
    "ankle": (
        ("ankle_dorsiflexion", (0.0, -1.0, 0.0), (-75.0, 35.0), _SMALL),
        ("ankle_eversion", (1.0, 0.0, 0.0), (-35.0, 20.0), _SMALL),
        ("ankle_internal_rotation", (0.0, 0.0, -1.0), (-30.0, 30.0), _ROLL),
    ),
}  # fmt: skip
# Joint: parent, child, place in the parent (left side)
_TRUNK_PLACES = {
    "torso": ("pelvis", "torso", (0.0, 0.0, 0.0)),
    "chest": ("torso", "chest", (0.0, 0.0, NIPPLE - LOWEST_RIB)),
    "neck": ("chest", "head", (0.0, 0.0, ACROMION - NIPPLE)),
}
_LEFT_PLACES = {
    "clavicle": ("chest", "shoulder", CLAVICLE),
    "shoulder": ("shoulder", "upper_arm", (0.0, SHOULDER_HALF_WIDTH - CLAVICLE[1], SHOULDER - NIPPLE - CLAVICLE[2])),
    "elbow": ("upper_arm", "forearm", (0.0, 0.0, -ELBOW)),
    "wrist": ("forearm", "hand", (0.0, 0.0, ELBOW - WRIST)),
    "hip": ("pelvis", "thigh", (0.0, HIP_HALF_WIDTH, -LOWEST_RIB)),
    "knee": ("thigh", "shank", (0.0, 0.0, -KNEE)),
    "ankle": ("shank", "foot", (0.0, 0.0, KNEE - ANKLE)),
}


def body_chain() -> KinematicChain:
    """18 links, 17 joints, 51 axes."""
    joints = [
        Joint(name, parent, child, _at(place), axes_in_degrees(_TRUNK_JOINTS[name]))
        for name, (parent, child, place) in _TRUNK_PLACES.items()
    ]
    for side, sign in SIDES:
        for name, (parent, child, (x, y, z)) in _LEFT_PLACES.items():
            parent = parent if parent in SEGMENTS else f"{side}_{parent}"
            axes = axes_in_degrees(_LEFT_JOINTS[name], f"{side}_", sign)
            joints.append(Joint(f"{side}_{name}", parent, f"{side}_{child}", _at((x, sign * y, z)), axes))
    return KinematicChain(SEGMENTS, tuple(joints))


def _at(place: tuple[float, float, float]) -> np.ndarray:
    return se3.from_rotation_translation(np.eye(3), np.round(place, 6))


def body_landmarks() -> tuple[Landmark, ...]:
    """Joint centers and a few points of head and feet, under the names of the project."""
    nose_x = 0.020 + stadium_of_ratio(NOSE_GIRTH, HEAD_LENGTH_TO_BREADTH)[0]
    landmarks = [
        Landmark("neck", "chest", (0.0, 0.0, round(ACROMION - NIPPLE, 6))),
        Landmark("head", "head", (0.020, 0.0, HEAD_TOP)),
        Landmark("nose", "head", (round(nose_x + 0.010, 4), 0.0, NOSE)),
    ]
    for side, sign in SIDES:
        landmarks.append(Landmark(f"{side}_hip", "pelvis", (0.0, round(sign * HIP_HALF_WIDTH, 6), -LOWEST_RIB)))
        for name in ("shoulder", "elbow", "wrist", "knee", "ankle"):
            parent, _, (x, y, z) = _LEFT_PLACES[name]
            landmarks.append(Landmark(f"{side}_{name}", f"{side}_{parent}", (x, round(sign * y, 6) + 0.0, round(z, 6))))
        for name, (x, y, z) in (
            ("big_toe", (0.200, -0.022, -0.052)), ("small_toe", (0.155, 0.040, -0.055)), ("heel", (-0.045, 0.0, -0.050)),
        ):  # fmt: skip
            landmarks.append(Landmark(f"{side}_{name}", f"{side}_foot", (x, sign * y + 0.0, z)))
    return tuple(landmarks)


# A shape's z runs along its segment, and x, y as the link's; but of a foot along x (its x down), of a shoulder outward.
_ALONG_FOOT = se3.from_rotation_translation(so3.exp([0.0, 0.5 * np.pi, 0.0]), np.zeros(3))


def body_lofts() -> dict[str, tuple[Loft, np.ndarray]]:
    """Segment -> its loft, and where that sits in the link (T_link_shape)."""
    lofts = {name: (loft, np.eye(4)) for name, loft in _trunk_lofts().items()}
    for side, sign in SIDES:
        outward = se3.from_rotation_translation(so3.exp([-sign * 0.5 * np.pi, 0.0, 0.0]), np.zeros(3))
        places = {"foot": _ALONG_FOOT, "shoulder": outward}
        for name, loft in _limb_lofts(sign).items():
            lofts[f"{side}_{name}"] = (loft, places.get(name, np.eye(4)))
    return {name: lofts[name] for name in SEGMENTS}


def _trunk_lofts() -> dict[str, Loft]:
    hip, waist, rib, nipple = (stadium_halves(*s)[::-1] for s in (HIP_SECTION, UMBILICUS_SECTION, RIB_SECTION, NIPPLE_SECTION))
    depth = 0.5 * SHOULDER_DEPTH
    neck = radius_of(NECK_GIRTH)
    nose, ear = (stadium_of_ratio(girth, HEAD_LENGTH_TO_BREADTH) for girth in (NOSE_GIRTH, EAR_GIRTH))
    return {
        "pelvis": _loft([
            (-LOWEST_RIB - CROTCH, 0.85 * hip[0], 0.75 * hip[1], -0.010), (-LOWEST_RIB, *hip, -0.005),
            (UMBILICUS - LOWEST_RIB, *waist), (0.0, *rib),
        ], (0.030, 0.050)),
        "torso": _loft([(0.0, *rib), (NIPPLE - LOWEST_RIB, *nipple)], (0.050, 0.050)),
        # The shoulder segments make the breadth at the shoulders and above.
        "chest": _loft([
            (0.0, *nipple), (SHOULDER - NIPPLE, depth, 0.75 * SHOULDER_HALF_WIDTH),
            (ACROMION - NIPPLE, 0.57 * depth, 0.45 * SHOULDER_HALF_WIDTH),
        ], (0.050, 0.020)),
        # The neck keeps its girth up to the larynx.
        "head": _loft([
            (0.0, neck, neck), (0.35 * NOSE, neck, neck, 0.006), (NOSE, *nose, 0.020), (ABOVE_EAR, *ear, 0.018),
        ], (0.040, HEAD_TOP - ABOVE_EAR)),
    }  # fmt: skip


def _limb_lofts(sign: float) -> dict[str, Loft]:
    arm, mid_arm, elbow, forearm = (radius_of(g) for g in (SHOULDER_GIRTH, MID_ARM_GIRTH, ELBOW_GIRTH, FOREARM_GIRTH))
    wrist, thumb, knuckle, nail = (stadium_halves(*s) for s in (WRIST_SECTION, THUMB_SECTION, KNUCKLE_SECTION, NAIL_SECTION))
    hip = 0.5 * np.sqrt(stadium_halves(*HIP_SECTION)[1] * HIP_SECTION[1])  # Yeadon: half the trunk's area there
    crotch, mid_thigh, knee, calf, ankle = (
        radius_of(g) for g in (CROTCH_GIRTH, MID_THIGH_GIRTH, KNEE_GIRTH, CALF_GIRTH, ANKLE_GIRTH)
    )
    length = SHOULDER_HALF_WIDTH - CLAVICLE[1]
    inward = -0.007 * sign  # the thighs touch
    return {
        # Its x is forward, its y down (left) or up (right)
        "shoulder": _loft([
            (0.0, 0.080, 0.055), (0.5 * length, 0.075, 0.062, 0.0, 0.008 * sign),
            (length, 1.10 * arm, 1.10 * arm, 0.0, 0.010 * sign),
        ], (0.030, 0.85 * arm)),
        "upper_arm": _loft([
            (-ELBOW, elbow, elbow), (-0.5 * ELBOW, mid_arm, mid_arm), (0.0, arm, arm),
        ], (0.85 * elbow, 0.85 * arm)),
        "forearm": _loft([
            (ELBOW - WRIST, *wrist), (ELBOW - FOREARM_MAXIMUM, forearm, forearm), (0.0, elbow, elbow),
        ], (0.025, 0.85 * elbow)),
        "hand": _loft([
            (-FINGERNAILS, *nail), (-KNUCKLES, *knuckle), (-THUMB_BASE, *thumb), (0.0, *wrist),
        ], (0.015, 0.020)),
        "thigh": _loft([
            (-KNEE, knee, knee), (-MID_THIGH, mid_thigh, mid_thigh), (-CROTCH, crotch, crotch, 0.0, inward),
            (0.0, hip, hip, 0.0, inward),
        ], (0.75 * knee, 0.060)),
        "shank": _loft([
            (KNEE - ANKLE, ankle, ankle), (KNEE - CALF_MAXIMUM, calf, calf, -0.010), (0.0, knee, knee),
        ], (0.025, 0.75 * knee)),
        "foot": _foot_loft(ankle),
    }  # fmt: skip


def _foot_loft(ankle: float) -> Loft:
    """Along the sole, from the heel to the toes: x is down. Distances were measured with pointed toes, from the ankle."""
    sole = ANKLE_HEIGHT
    ball, toe = (stadium_halves(*s) for s in (BALL_SECTION, TOE_SECTION))
    arch_half = 0.034  # its girth with a breadth of 89 mm
    arch_broad = 0.25 * (ARCH_GIRTH - 2.0 * np.pi * arch_half) + arch_half
    rows = []
    for distance, half_height, half_width in (
        (-0.035, 0.030, 0.031), (0.0, 0.038, 0.95 * ankle), (HEEL, 0.040, 0.041), (ARCH, arch_half, arch_broad),
        (BALL, ball[1], ball[0]), (TOENAILS, toe[1], toe[0]),
    ):  # fmt: skip
        drop = sole - half_height
        # Levels in front of the heel lie as far from the ankle as measured: forward, and below it.
        forward = distance if distance <= 0.0 else np.sqrt(distance**2 - min(drop, 0.8 * distance) ** 2)
        rows.append((float(forward), half_height, half_width, drop))
    return _loft(rows, (HEEL_BEHIND_ANKLE - 0.035, 0.012))


def _loft(rows, domes: tuple[float, float]) -> Loft:
    """Rows (z, half_x, half_y[, x[, y]]), rounded to 0.1 mm for the sake of the files."""
    sections = tuple(Section(*(round(float(value), 4) + 0.0 for value in row)) for row in rows)
    return Loft(sections, (round(float(domes[0]), 4), round(float(domes[1]), 4)))


_BETWEEN_JOINTS = ("upper_arm", "forearm", "thigh", "shank")
_FINENESS = (64, 0.010)  # of the solids that are measured
_FLAT = 0.001  # meters: height of a dome that is as good as none


def ellipsoid_human() -> ArticulatedModel:
    """18 ellipsoids, 57 variables; joints, colors and landmarks are those of `nurbs_human`."""
    shapes = []
    for name, (loft, place) in body_lofts().items():
        center, radii = equivalent_ellipsoid(loft_mesh(_counted(name, loft), *_FINENESS))
        offset = se3.from_rotation_translation(np.eye(3), np.round(center, 4))
        x, y, z = np.round(radii, 4).tolist()
        shapes.append(Shape(name, name, Ellipsoid((x, y, z)), place @ offset, COLORS[name]))
    return ArticulatedModel("ellipsoid_human", body_chain(), tuple(shapes), body_landmarks())


def _counted(name: str, loft: Loft) -> Loft:
    return replace(loft, domes=(_FLAT, _FLAT)) if name.endswith(_BETWEEN_JOINTS) else loft


def equivalent_ellipsoid(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Center (3,) and half-axes (3,) along x, y, z of the ellipsoid that has the solid's center and its variances.

    The solid is cut into tetrahedra from the origin to each face; a solid ellipsoid's variance along a half-axis r is r^2 / 5.
    """
    corners = mesh.vertices[mesh.faces]  # (m, 3, 3)
    volumes = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    total = corners.sum(axis=1)
    mean = volumes @ total / (4.0 * volumes.sum())
    squares = volumes @ (total**2 + (corners**2).sum(axis=1)) / (20.0 * volumes.sum())
    return mean, np.sqrt(5.0 * (squares - mean**2))


def nurbs_human(n_around: int = N_AROUND, ring_spacing: float = RING_SPACING) -> ArticulatedModel:
    """18 smooth segments, 57 variables; joints, colors and landmarks are those of `ellipsoid_human`.

    Parameters
    ----------
    n_around, ring_spacing : fineness of the meshes, see `loft_mesh`.

    Returns
    -------
    Body of 18 links.
    """
    shapes = tuple(
        Shape(name, name, loft_mesh(loft, n_around, ring_spacing), place, COLORS[name])
        for name, (loft, place) in body_lofts().items()
    )
    return ArticulatedModel("nurbs_human", body_chain(), shapes, body_landmarks())
