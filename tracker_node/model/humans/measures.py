"""Measures of the human body, meters, and the names under which other programs know its landmarks.

Lengths are fractions of stature: Drillis & Contini (1966), *Body segment parameters*, as tabulated in Winter (2009),
*Biomechanics and Motor Control of Human Movement*, fig. 4.1. Girths, breadths and depths are rounded means of the men of
Gordon et al. (1989), *1988 Anthropometric Survey of U.S. Army Personnel* (mean stature 1.756 m), scaled with stature.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields, replace

SURVEY_STATURE = 1.756  # meters, mean of the men of the 1988 survey
REFERENCE_STATURE = 1.75
CHILDREN_M = (0.8, 1.75)
# Height, depth and breadth of heads over stature grow like powers of the stature, of 40 children and 30 adults of anny 0.6.2
# (Brégier et al., ECCV 2026): 2 % beside that. The rest grows alike, within 3 %.
_HEAD_SLOPES = (-0.36, -0.46, -0.54)
_UPRIGHT = (
    "thigh_length", "shank_length", "ankle_height", "pelvis_length", "abdomen_length", "neck_z", "chest_top", "clavicle_z",
    "crotch_depth",
)  # fmt: skip


def _share(fraction: float) -> float:
    return round(fraction * REFERENCE_STATURE, 4)


def _surveyed(value: float) -> float:
    return round(value * REFERENCE_STATURE / SURVEY_STATURE, 4)


def _radius(girth: float) -> float:
    """Radius of a circle of that girth."""
    return _surveyed(girth / (2.0 * math.pi))


@dataclass(frozen=True)
class HumanMeasures:
    """All lengths in meters, for a man of 1.75 m unless said otherwise; `of_stature` scales them all."""

    stature: float = REFERENCE_STATURE
    # Legs and arms: fractions of stature
    thigh_length: float = _share(0.530 - 0.285)
    shank_length: float = _share(0.285 - 0.039)
    ankle_height: float = _share(0.039)
    hip_half_width: float = _share(0.048)  # joint centers: nearer than the 0.191 / 2 of the trochanters
    upper_arm_length: float = _share(0.186)
    forearm_length: float = _share(0.146)
    # Trunk: hip joints at 0.530, L5/S1 at 0.585, T12/L1 at 0.655, shoulders at 0.818, C7 at 0.850 of stature
    spine_x: float = -0.010  # the spine stands behind the line of the hips
    pelvis_length: float = _share(0.585 - 0.530)
    abdomen_length: float = _share(0.655 - 0.585)
    neck_x: float = 0.0
    neck_z: float = _share(0.850 - 0.655)
    chest_top: float = _share(0.805 - 0.655)
    clavicle_x: float = 0.010
    clavicle_y: float = 0.020
    clavicle_z: float = _share(0.818 - 0.655)
    # Shoulder joints lie 2 cm inside the acromia (biacromial breadth 0.397)
    clavicle_length: float = round(_surveyed(0.397 / 2) - 0.020 - 0.020, 4)
    shoulder_x: float = -0.005
    head_x: float = 0.022  # the head's center is in front of C7
    head_top: float = _share(1.0 - 0.850)  # above C7
    crotch_depth: float = _share(0.530 - 0.475)  # below the hip joints
    # Half-axes (forward, sideways) of trunk sections: depths and breadths
    buttock_radii: tuple[float, float] = (_surveyed(0.246 / 2), _surveyed(0.342 / 2))
    waist_radii: tuple[float, float] = (_surveyed(0.222 / 2), _surveyed(0.302 / 2))
    chest_base_radii: tuple[float, float] = (_surveyed(0.222 / 2), _surveyed(0.294 / 2))
    chest_radii: tuple[float, float] = (_surveyed(0.243 / 2), _surveyed(0.322 / 2))
    # Shoulder girdle at the breast bone (forward, upward), and what of it is left at the shoulder
    clavicle_radii: tuple[float, float] = (0.070, 0.055)
    deltoid_scale: float = 0.80
    neck_radius: float = _radius(0.379)  # at C7
    neck_taper: float = -0.6  # per meter at the reference stature
    neck_depth: float = 0.095  # how far the neck reaches into the chest
    head_radii: tuple[float, float, float] = (_surveyed(0.197 / 2), _surveyed(0.152 / 2), _share(0.130 / 2))
    # Limb sections at their upper joint, and the share left at the lower one
    upper_arm_radii: tuple[float, float] = (_radius(0.345), _radius(0.320))
    elbow_scale: float = 0.80
    forearm_radii: tuple[float, float] = (_radius(0.290), _radius(0.260))
    wrist_scale: float = 0.62
    hand_radii: tuple[float, float, float] = (_surveyed(0.090 / 2), 0.022, _surveyed(0.194 / 2))
    thigh_radii: tuple[float, float] = (_radius(0.597), _radius(0.570))
    knee_scale: float = 0.65
    shank_radii: tuple[float, float] = (_radius(0.385), _radius(0.375))
    ankle_scale: float = 0.60
    foot_radii: tuple[float, float, float] = (_surveyed(0.270 / 2), _surveyed(0.101 / 2), 0.036)
    heel_behind_ankle: float = 0.055
    overlap: float = 0.030  # how far a part reaches into its neighbor, so that the outline has no gap

    def __post_init__(self):
        if not 0.4 <= self.stature <= 3.0:
            raise ValueError(f"expected a stature of 0.4 to 3 meters, got {self.stature}")

    @property
    def scale(self) -> float:
        """Stature as a multiple of the reference."""
        return self.stature / REFERENCE_STATURE

    @classmethod
    def of_stature(cls, stature: float) -> HumanMeasures:
        """Every length scaled to a stature (meters); ratios stay."""
        reference = cls()
        scale = stature / reference.stature
        scaled: dict[str, object] = {}
        for field in fields(cls):
            value = getattr(reference, field.name)
            if field.name.endswith(("_scale", "_taper")):
                continue
            scaled[field.name] = tuple(scale * v for v in value) if isinstance(value, tuple) else scale * value
        return replace(reference, **scaled)  # type: ignore[arg-type]

    @classmethod
    def of_child(cls, stature: float) -> HumanMeasures:
        """A child's measures: a larger head than that of a small adult, legs and trunk share the rest of the stature (meters)."""
        if not CHILDREN_M[0] <= stature <= CHILDREN_M[1]:
            raise ValueError(f"expected a child's stature of {CHILDREN_M[0]} to {CHILDREN_M[1]} meters, got {stature}")
        m = cls.of_stature(stature)
        high, deep, broad = (m.scale**slope for slope in _HEAD_SLOPES)
        rest = (stature - high * m.head_top) / (stature - m.head_top)
        upright = {name: rest * getattr(m, name) for name in _UPRIGHT}
        depth, breadth, height = m.head_radii
        head = (deep * depth, broad * breadth, high * height)
        return replace(m, head_top=high * m.head_top, head_radii=head, **upright)


_PAIRED = {
    "Shoulder": "shoulder", "Elbow": "elbow", "Wrist": "wrist", "Hip": "hip", "Knee": "knee", "Ankle": "ankle",
    "BigToe": "big_toe", "SmallToe": "small_toe", "Heel": "heel",
}  # fmt: skip

# Marker names of OpenPose and Pose2Sim TRC files -> landmarks of config/models/human.yaml
LANDMARK_OF_MARKER: dict[str, str] = {
    "Neck": "neck",
    "Head": "head",
    "Nose": "nose",
    **{f"L{marker}": f"left_{landmark}" for marker, landmark in _PAIRED.items()},
    **{f"R{marker}": f"right_{landmark}" for marker, landmark in _PAIRED.items()},
}
MARKER_OF_LANDMARK: dict[str, str] = {landmark: marker for marker, landmark in LANDMARK_OF_MARKER.items()}


_OF_JOINT_CENTER = {  # of Plug-in Gait, whose LKNE and LANK are on the skin
    f"{side}{letter}JC": f"{name}_{joint}"
    for side, name in (("L", "left"), ("R", "right"))
    for letter, joint in zip("SEWHKA", ("shoulder", "elbow", "wrist", "hip", "knee", "ankle"), strict=True)
}
_MOST_NAMES = 10


def landmark_of_marker(marker: str) -> str:
    """Landmark of a marker; a marker that is not in the tables keeps its own name."""
    return LANDMARK_OF_MARKER.get(marker) or _OF_JOINT_CENTER.get(marker, marker)


def unused_markers(markers: Sequence[str], landmarks: Collection[str]) -> str:
    """A sentence on the markers that are no landmarks, or nothing.

    Parameters
    ----------
    markers : names in a file.
    landmarks : of the body.

    Returns
    -------
    Sentence, with the first ten names.
    """
    unknown = [name for name in markers if landmark_of_marker(name) not in landmarks]
    if not unknown:
        return ""
    more = f" and {len(unknown) - _MOST_NAMES} more" * (len(unknown) > _MOST_NAMES)
    return f"{len(unknown)} of {len(markers)} markers are no landmarks of the body: {', '.join(unknown[:_MOST_NAMES])}{more}"


# The side in a name: left_knee, knee_L, knee.right; or leftKnee, LKnee, kneeLeft
_SIDE = re.compile(
    r"(?<![^_\-. ])(?i:left|right|l|r)(?![^_\-. ])|^(?:left|right|Left|Right|l|r|L|R)(?=[A-Z][a-z])|(?<=[a-z])(?:Left|Right|L|R)$"
)
_OTHER_SIDE = {"left": "right", "right": "left", "l": "r", "r": "l"}


def mirrored_name(name: str) -> str:
    """The same part or point of the other side: ``left_knee`` for ``right_knee``, ``paw_R`` for ``paw_L``; others stay."""
    found = _SIDE.search(name)
    if found is None:
        return name
    side = found.group()
    other = _OTHER_SIDE[side.lower()]
    other = other.upper() if side.isupper() else other.capitalize() if side[0].isupper() else other
    return name[: found.start()] + other + name[found.end() :]


def mirrored_rows(names: Sequence[str]) -> tuple[int, ...]:
    """Where the same point of the other side is among these; its own place of one that has none there."""
    rows = {name: row for row, name in enumerate(names)}
    return tuple(rows.get(mirrored_name(name), row) for row, name in enumerate(names))
