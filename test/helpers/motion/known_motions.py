"""A person whose walk, and whose jump, are known exactly: angles, strides, velocity at take-off."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from helpers.bodies.stick_person import Motion
from tracker_node.evaluation.motion.jumps import GRAVITY
from tracker_node.geometry import se3
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.masses import mass_center

STRIDE_S, SPEED_M_S = 1.1, 1.25
HIP_DEG, KNEE_DEG, ELBOW_DEG = (24.0, 20.0), (30.0, 24.0), (12.0, 12.0)  # amplitudes, left and right
HIP_MEAN_DEG, KNEE_MEAN_DEG = 4.0, 32.0
TURN_DEG = 5.0  # of the torso


def walk(seconds: float = 8.0, rate_hz: float = 60.0, scale: float = 1.0, noise_deg: float = 0.0, seed: int = 1) -> Motion:
    """Angles are sines of the stride, the right side half a stride after the left.

    Parameters
    ----------
    seconds, rate_hz : how long, how often.
    scale : of the amplitudes of hips and knees.
    noise_deg : standard deviation of what is added to every joint in every set.
    seed : of that.

    Returns
    -------
    States of the human with ankles.
    """
    model, rng = human_model(ankles=True), np.random.default_rng(seed)
    times = np.arange(round(seconds * rate_hz)) / rate_hz
    states = []
    for t in times:
        state = State.neutral(model)
        q = state.joint_positions
        for side, late, k in (("left", 0.0, 0), ("right", 0.5, 1)):
            phase = 2.0 * np.pi * (t / STRIDE_S - late)
            hip, knee, elbow = (np.radians(of[k]) for of in (HIP_DEG, KNEE_DEG, ELBOW_DEG))
            q[model.chain.axis_index(f"{side}_hip_flexion")] = np.radians(HIP_MEAN_DEG) + scale * hip * np.cos(phase)
            q[model.chain.axis_index(f"{side}_knee_flexion")] = np.radians(KNEE_MEAN_DEG) + scale * knee * np.cos(phase + 2.0)
            q[model.chain.axis_index(f"{side}_elbow_flexion")] = np.radians(40.0) + elbow * np.cos(phase)
        q[model.chain.axis_index("torso_turn_left")] = np.radians(TURN_DEG) * np.sin(2.0 * np.pi * t / STRIDE_S)
        q += np.radians(noise_deg) * rng.standard_normal(len(q))
        root = se3.from_rotation_translation(np.eye(3), np.array([SPEED_M_S * t, 0.0, 0.95]))
        states.append(State(root, q))
    return Motion(model, np.round(times * 1e9).astype(np.int64), tuple(states))


PUSH_S, STILL_S, SQUAT_RAD = 0.28, 0.5, 0.75


def jump(velocity_m_s: float = 2.6, rate_hz: float = 60.0, times: int = 1, noise_m: float = 0.0, seed: int = 1) -> Motion:
    """Somebody crouches, pushes off, flies stretched, and lands as he took off: ``times`` times.

    Until take-off the feet stand on the floor at z = 0, and the center of mass goes up as a cubic of time that ends with this
    velocity and the acceleration of gravity.

    Parameters
    ----------
    velocity_m_s : upward, of the center of mass at take-off: it rises by its square over 2 g.
    rate_hz : how often.
    times : how many jumps.
    noise_m : standard deviation of what is added to the root's place in every set.
    seed : of that.

    Returns
    -------
    States of the human with ankles.
    """
    model, rng = human_model(ankles=True), np.random.default_rng(seed)
    air = 2.0 * velocity_m_s / GRAVITY
    one = STILL_S + PUSH_S + air + PUSH_S
    stamps = np.arange(round((times * one + STILL_S) * rate_hz)) / rate_hz
    top = _center_z(model, 0.0)
    states = []
    for t in stamps:
        since = t - STILL_S - PUSH_S - one * min(int(t / one), times - 1)  # the take-off
        if 0.0 <= since <= air:
            state = _standing(model, 0.0)
            state.T_world_root[2, 3] += velocity_m_s * since - 0.5 * GRAVITY * since**2
        else:
            before = since if since < 0.0 else air - since  # landing is the take-off backward
            state = _standing(model, _crouch(model, _height(before, top, velocity_m_s, _center_z(model, SQUAT_RAD))))
        state.T_world_root[:3, 3] += noise_m * rng.standard_normal(3)
        states.append(state)
    return Motion(model, np.round(stamps * 1e9).astype(np.int64), tuple(states))


def _height(t: float, top: float, velocity: float, low: float) -> float:
    """Center of mass, ``t`` <= 0 seconds from take-off: a quartic that meets velocity and gravity, from rest ``low``."""
    s = max(t, -PUSH_S)
    # z = top + v s - g s^2 / 2 + a s^3 + b s^4, z'(-P) = 0, z(-P) = low
    known = top - velocity * PUSH_S - 0.5 * GRAVITY * PUSH_S**2
    slope = velocity + GRAVITY * PUSH_S
    a, b = np.linalg.solve([[-(PUSH_S**3), PUSH_S**4], [3.0 * PUSH_S**2, -4.0 * PUSH_S**3]], [low - known, -slope])
    return top + velocity * s - 0.5 * GRAVITY * s**2 + a * s**3 + b * s**4


def _standing(model: ArticulatedModel, bend: float) -> State:
    """Feet level and on the floor, knees bent by twice ``bend``."""
    state = State.neutral(model)
    for side in ("left", "right"):
        for name, angle in (("hip_flexion", bend), ("knee_flexion", 2.0 * bend), ("ankle_dorsiflexion", bend)):
            state.joint_positions[model.chain.axis_index(f"{side}_{name}")] = angle
    toe = Configuration(model, state).landmarks_world[model.landmark_index("left_big_toe")]
    state.T_world_root[:3, 3] -= toe
    return state


def _center_z(model: ArticulatedModel, bend: float) -> float:
    points = Configuration(model, _standing(model, bend)).landmarks_world
    return float(mass_center(model.landmark_names, points)[2])


def _crouch(model: ArticulatedModel, height: float) -> float:
    """Bend that puts the center of mass there."""
    off = [_center_z(model, bend) - height for bend in (0.0, 1.3)]
    return brentq(lambda bend: _center_z(model, bend) - height, 0.0, 1.3, xtol=1e-7) if off[0] * off[1] < 0 else 0.0
