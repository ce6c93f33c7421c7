"""Measures of one man, as Yeadon's inertia model asks for them, and the stadium cross-sections they stand for.

Yeadon, M. R. (1990), *The simulation of aerial movement II: a mathematical inertia model of the human body*, J. Biomech. 23,
describes a body by lengths, girths, breadths and depths at fixed levels. The numbers are those of the subject "male3" who comes
with the Python package yeadon 2.0.1 (C. Dembia et al., file misc/samplemeasurements/male3.txt), left and right averaged; only
the greatest girth of the calf is the right leg's alone, since the left one's (28.8 cm, with 40 cm at the knee) is a slip.
His stature comes to 1.81 m.
"""

from __future__ import annotations

import math

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
