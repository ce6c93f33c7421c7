"""Procedural motions of a person on the spot: boxing guard, squat, waving and turning, sitting down, crossed arms.

Root positions are the path of the middle between the feet: the poser puts the body on its feet.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from tracker_node.synthesis.motions.motion import LEG_LENGTH, SEGMENTS, Motion, chained

_RATE_HZ = 30.0
_SIDES = (("left", 1.0), ("right", -1.0))
_FULL_TURN_S = 1.6  # for half a turn on the spot


def guard(n_images: int, rng: np.random.Generator) -> Motion:
    """Boxing on the toes: fists before the chin, arms before the trunk, now and then a straight punch.

    Parameters
    ----------
    n_images : at 30 Hz.
    rng : of rhythm and punches.

    Returns
    -------
    The motion.
    """
    t = np.arange(n_images) / _RATE_HZ
    bounce = np.sin(2.0 * np.pi * rng.uniform(1.4, 2.0) * t + rng.uniform(0.0, 6.0))
    sway = np.sin(2.0 * np.pi * rng.uniform(0.3, 0.6) * t + rng.uniform(0.0, 6.0))
    jabs = {side: _pulses(n_images, rng, 0.45, 1.6) for side, _ in _SIDES}
    a = _still(n_images)
    a["pelvis"][:, 2] = 0.35 + 0.15 * sway
    a["torso"] += np.stack([0.08 * sway, 0.12 + 0.04 * bounce, 0.25 * (jabs["right"] - jabs["left"])], axis=1)
    a["head"][:, 2] = -0.3 - 0.2 * (jabs["right"] - jabs["left"])
    for side, sign in _SIDES:
        jab = jabs[side]
        _arm(a, side, sign, raised=0.75 + 0.75 * jab, out=0.25 - 0.1 * jab, inward=0.35 - 0.1 * jab, bent=2.1 - 1.95 * jab)
        _leg(a, side, sign, raised=0.25 + 0.15 * sign + 0.06 * bounce, bent=0.5 + 0.12 * bounce, out=0.12)
    return _motion("guard", a, 0.1 * sway[:, None] * rng.normal(size=2))


def squat(n_images: int, rng: np.random.Generator) -> Motion:
    """Down and up, arms stretched forward or crossed while down.

    Parameters
    ----------
    n_images : at 30 Hz.
    rng : of depth, period and arms.

    Returns
    -------
    The motion.
    """
    t = np.arange(n_images) / _RATE_HZ
    down = (0.5 - 0.5 * np.cos(2.0 * np.pi * t / rng.uniform(1.6, 2.4))) * rng.uniform(0.85, 1.0)
    crossed = rng.random() < 0.3
    a = _still(n_images)
    a["pelvis"][:, 1] = 0.5 * down
    a["torso"][:, 1] = 0.35 * down
    a["head"][:, 1] = -0.5 * down
    for side, sign in _SIDES:
        if crossed:
            _arm(a, side, sign, raised=0.9 * down, out=0.1, inward=0.9 * down, bent=0.2 + 1.6 * down)
        else:
            _arm(a, side, sign, raised=1.9 * down, out=0.1, inward=0.1, bent=0.2)
        _leg(a, side, sign, raised=2.1 * down, bent=2.1 * down, out=0.18 + 0.15 * down)
    return _motion("squat", a, np.zeros((n_images, 2)))


def wave_and_turn(n_images: int, rng: np.random.Generator) -> Motion:
    """Waving with one arm, then half a turn on the spot in small steps, waving again.

    Parameters
    ----------
    n_images : at 30 Hz.
    rng : of side, rhythm and direction.

    Returns
    -------
    The motion.
    """
    t = np.arange(n_images) / _RATE_HZ
    middle, half = 0.5 * t[-1], min(0.5 * _FULL_TURN_S, 0.3 * t[-1] + 1e-9)
    turning = _smooth((t - middle + half) / (2.0 * half))
    steps = np.sin(np.pi * np.clip((t - middle + half) / (2.0 * half), 0.0, 1.0) * 4.0)
    direction = rng.choice([-1.0, 1.0])
    side, sign = _SIDES[rng.integers(2)]
    a = _still(n_images)
    a["pelvis"][:, 2] = direction * np.pi * turning
    a["head"][:, 2] = direction * 0.5 * np.sin(np.pi * turning)
    up = 1.0 - 0.85 * np.sin(np.pi * turning)
    for name, s in _SIDES:
        _arm(a, name, s, raised=0.1, out=0.1, inward=0.0, bent=0.25)
        lift = np.maximum(0.0, s * steps)
        _leg(a, name, s, raised=0.1 + 0.35 * lift, bent=0.12 + 0.7 * lift, out=0.05)
    waving = 0.45 * np.sin(2.0 * np.pi * rng.uniform(1.2, 1.8) * t)
    _arm(a, side, sign, raised=0.3 * up, out=1.5 * up + 0.1, inward=-1.3 * up, bent=0.25 + (1.15 + waving) * up)
    return _motion("wave_and_turn", a, np.zeros((n_images, 2)))


def sit(n_images: int, rng: np.random.Generator) -> Motion:
    """Sitting down on a stool, some gestures, standing up.

    Parameters
    ----------
    n_images : at 30 Hz.
    rng : of gestures and times.

    Returns
    -------
    The motion.
    """
    t = np.arange(n_images) / (n_images - 1.0 if n_images > 1 else 1.0)
    seated = _smooth((t - 0.1) / 0.25) * (1.0 - _smooth((t - 0.72) / 0.25))
    bow = np.sin(np.pi * seated)
    gesture = gaussian_filter1d(rng.normal(size=(n_images, 4)), 8.0, axis=0, mode="nearest") * 2.0
    a = _still(n_images)
    a["pelvis"][:, 1] = 0.35 * bow - 0.05 * seated
    a["torso"][:, 1] = 0.35 * bow + 0.1 * seated
    a["torso"][:, 2] = 0.2 * seated * gesture[:, 0]
    a["head"][:, 2] = 0.4 * seated * gesture[:, 1]
    for i, (side, sign) in enumerate(_SIDES):
        move = np.abs(gesture[:, 2 + i]) * seated
        _arm(a, side, sign, raised=0.15 + 0.45 * seated + 0.5 * move, out=0.12, inward=0.3 * seated, bent=0.25 + 0.9 * seated)
        _leg(a, side, sign, raised=1.5 * seated + 0.35 * bow, bent=1.5 * seated + 0.3 * bow, out=0.1)
    return _motion("sit", a, np.zeros((n_images, 2)))


def cross_arms(n_images: int, rng: np.random.Generator) -> Motion:
    """Arms crossed before the chest, the trunk turning and leaning, arms opened once.

    Parameters
    ----------
    n_images : at 30 Hz.
    rng : of rhythm and which arm is above.

    Returns
    -------
    The motion.
    """
    t = np.arange(n_images) / _RATE_HZ
    opened = _pulses(n_images, rng, 0.7, 2.5)
    lean = np.sin(2.0 * np.pi * rng.uniform(0.25, 0.45) * t + rng.uniform(0.0, 6.0))
    above = rng.choice([-1.0, 1.0])
    a = _still(n_images)
    a["pelvis"][:, 2] = 0.25 * lean
    a["torso"] += np.stack([0.08 * lean, 0.05 + 0.05 * lean, 0.3 * lean], axis=1)
    a["head"][:, 2] = -0.4 * lean
    for side, sign in _SIDES:
        higher = 0.16 * (sign == above)
        shut = 1.0 - opened
        _arm(a, side, sign, raised=0.35 + 0.25 * shut + higher * shut, out=0.25 + 0.2 * opened,
             inward=0.95 * shut - 0.2 * opened, bent=0.4 + 1.3 * shut)  # fmt: skip
        _leg(a, side, sign, raised=0.06 + 0.05 * sign * lean, bent=0.1, out=0.08)
    return _motion("cross_arms", a, 0.03 * lean[:, None] * np.ones(2))


def swing_arms(n_images: int, rng: np.random.Generator) -> Motion:
    """Marching on the spot with swinging arms.

    Parameters
    ----------
    n_images : at 30 Hz.
    rng : of the rhythm.

    Returns
    -------
    The motion.
    """
    t = np.arange(n_images) / _RATE_HZ
    phase = 2.0 * np.pi * rng.uniform(0.8, 1.1) * t
    a = _still(n_images)
    a["torso"][:, 2] = 0.15 * np.sin(phase)
    for side, sign in _SIDES:
        step = sign * np.sin(phase)
        lift = np.maximum(0.0, step)
        _arm(a, side, sign, raised=0.6 * step, out=0.1, inward=0.0, bent=0.5 + 0.3 * step)
        _leg(a, side, sign, raised=0.9 * lift, bent=0.05 + 1.2 * lift, out=0.04)
    return _motion("swing", a, np.zeros((n_images, 2)))


def _still(n_images: int) -> dict[str, np.ndarray]:
    """Turns about x, y, z (n, 3) of every segment in its parent, applied in the order z, y, x; zeros: hanging arms."""
    return {segment: np.zeros((n_images, 3)) for segment in SEGMENTS}


def _arm(angles: dict[str, np.ndarray], side: str, sign: float, *, raised, out, inward, bent) -> None:
    """Set an arm: raised forward, out to the side, turned inward about its length, bent in the elbow; radians."""
    turns = angles[f"{side}_upper_arm"]
    turns[:, 0], turns[:, 1], turns[:, 2] = sign * np.asarray(out), -np.asarray(raised), -sign * np.asarray(inward)
    angles[f"{side}_forearm"][:, 1] = -np.asarray(bent)


def _leg(angles: dict[str, np.ndarray], side: str, sign: float, *, raised, bent, out) -> None:
    """Set a leg: raised forward, bent in the knee, out to the side; the foot stays level with the pelvis upright."""
    thigh = angles[f"{side}_thigh"]
    thigh[:, 0], thigh[:, 1] = sign * np.asarray(out), -np.asarray(raised) - angles["pelvis"][:, 1]
    angles[f"{side}_shank"][:, 1] = np.asarray(bent)
    angles[f"{side}_foot"][:, 0] = -sign * np.asarray(out)
    angles[f"{side}_foot"][:, 1] = np.asarray(raised) - np.asarray(bent)


def _motion(name: str, angles: dict[str, np.ndarray], path: np.ndarray) -> Motion:
    local = {segment: Rotation.from_euler("XYZ", turns).as_matrix() for segment, turns in angles.items()}
    roots = np.concatenate([path, np.full((len(path), 1), LEG_LENGTH)], axis=1)
    return Motion(name, _RATE_HZ, roots, chained(local))


def _smooth(x: np.ndarray) -> np.ndarray:
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def _pulses(n_images: int, rng: np.random.Generator, length_s: float, every_s: float) -> np.ndarray:
    """(n,) between 0 and 1: smooth pulses of a length, about so far from each other."""
    t = np.arange(n_images) / _RATE_HZ
    result = np.zeros(n_images)
    at = rng.uniform(0.3, every_s)
    while at < t[-1]:
        result = np.maximum(result, np.cos(np.clip((t - at) / length_s, -0.5, 0.5) * np.pi) ** 2)
        at += every_s * rng.uniform(0.7, 1.3)
    return result
