"""Signals of a motion, filtered without lag, and their velocities and accelerations, stretch by stretch between gaps.

The filter is that of biomechanics: a Butterworth low-pass of second order run forward and backward, which makes it one of fourth
order without phase. Derivatives are those of the quintic spline through the filtered samples, whose own error is far below that
of differences.

Sources: D. A. Winter, Biomechanics and Motor Control of Human Movement, 4th ed. (2009), chapter 3, for the filter's corrected
cutoff and its choice by residual analysis; H. J. Woltring, Adv. Eng. Software 8 (1986) 104-113, for quintic splines.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from ...model.kinematic_chain import N_ROOT_DOF
from ...runs.motion import RunMotion

SHORTEST = 10  # samples: in shorter stretches nothing is filtered or derived
_TWO_PASSES = (2.0**0.5 - 1.0) ** 0.25  # Winter: a filter run twice has its -3 dB point at this fraction of its cutoff
MOST_OF_RATE = 0.45  # of the rate: cutoffs end here
_TAIL_SHARE = 0.5  # cutoffs above this fraction of the highest one are taken to remove noise alone


def lowpass(values: np.ndarray, valid: np.ndarray, rate_hz: float, cutoffs_hz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Signals without what is faster than their cutoffs.

    Parameters
    ----------
    values : (n, k) at a constant rate.
    valid : (n,).
    rate_hz : of the samples.
    cutoffs_hz : (k,), where half of the power is left; below 0.45 of the rate.

    Returns
    -------
    filtered : (n, k), zeros where not valid.
    valid : (n,): False also in stretches of less than `SHORTEST` samples.
    """
    result, good = np.zeros_like(values), np.zeros_like(valid)
    for stretch in stretches(valid):
        good[stretch] = True
        for cutoff in np.unique(cutoffs_hz):
            columns = cutoffs_hz == cutoff
            result[stretch, columns] = _two_passes(values[stretch][:, columns], rate_hz, float(cutoff))
    return result, good


def _two_passes(values: np.ndarray, rate_hz: float, cutoff_hz: float) -> np.ndarray:
    warped = np.tan(np.pi * cutoff_hz / rate_hz) / _TWO_PASSES
    sections = butter(2, 2.0 * np.arctan(warped) / np.pi, output="sos")
    padding = min(len(values) - 1, max(SHORTEST - 1, int(np.ceil(rate_hz / cutoff_hz))))
    return sosfiltfilt(sections, values, axis=0, padlen=padding)


def residual_cutoffs_hz(values: np.ndarray, valid: np.ndarray, rate_hz: float) -> np.ndarray:
    """Cutoffs by Winter's residual analysis.

    What a filter removes of white noise falls in a straight line with its cutoff, to none at half the rate. The line through the
    upper cutoffs' residuals, taken back to 0 Hz, is the rms of all noise; the cutoff is where the filter removes just that much,
    so that signal lost and noise let through are equal. A signal without noise gets the highest cutoff.

    Parameters
    ----------
    values : (n, k) at a constant rate.
    valid : (n,).
    rate_hz : of the samples.

    Returns
    -------
    (k,) Hz.
    """
    cutoffs = np.linspace(0.01, MOST_OF_RATE, 60) * rate_hz
    removed = np.array([_removed_rms(values, valid, rate_hz, cutoff) for cutoff in cutoffs])  # (60, k)
    tail = cutoffs >= _TAIL_SHARE * cutoffs[-1]
    slopes, noise = np.polyfit(cutoffs[tail], removed[tail], 1)
    chosen = np.full(values.shape[1], cutoffs[-1])
    for column in range(values.shape[1]):
        below = np.flatnonzero(removed[:, column] <= noise[column])
        if slopes[column] < 0.0 and len(below):
            chosen[column] = cutoffs[below[0]]
    return chosen


def _removed_rms(values: np.ndarray, valid: np.ndarray, rate_hz: float, cutoff_hz: float) -> np.ndarray:
    filtered, good = lowpass(values, valid, rate_hz, np.full(values.shape[1], cutoff_hz))
    return np.sqrt(np.mean((values - filtered)[good] ** 2, axis=0)) if good.any() else np.zeros(values.shape[1])


def derivatives(values: np.ndarray, valid: np.ndarray, rate_hz: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First and second derivatives in time.

    Parameters
    ----------
    values : (n, k) at a constant rate.
    valid : (n,).
    rate_hz : of the samples.

    Returns
    -------
    first, second : (n, k), per second and per second squared.
    valid : (n,), as of `lowpass`.
    """
    first, second, good = np.zeros_like(values), np.zeros_like(values), np.zeros_like(valid)
    for stretch in stretches(valid):
        good[stretch] = True
        times = np.arange(stretch.stop - stretch.start) / rate_hz
        spline = make_interp_spline(times, values[stretch], k=5, axis=0)
        first[stretch], second[stretch] = spline.derivative(1)(times), spline.derivative(2)(times)
    return first, second, good


def stretches(valid: np.ndarray) -> Iterator[slice]:
    """Where at least `SHORTEST` samples follow each other without a gap."""
    for stretch in np.ma.flatnotmasked_contiguous(np.ma.array(valid, mask=~valid)):
        if stretch.stop - stretch.start >= SHORTEST:
            yield stretch


@dataclass(frozen=True, eq=False)
class StateKinematics:
    """A motion that has been filtered, with its derivatives.

    ``velocity``, ``acceleration`` (n, n_dof) are in the tangent of `model.configuration.State`: the root's rotation about the
    axes of the world. ``cutoffs_hz`` (n_dof + 1,): root translation, root quaternion, joints.
    """

    motion: RunMotion
    velocity: np.ndarray
    acceleration: np.ndarray
    cutoffs_hz: np.ndarray


def state_kinematics(motion: RunMotion, cutoff_hz: float | None = None) -> StateKinematics:
    """Filter the states of a motion: segments keep their lengths, and landmarks follow from the states.

    Parameters
    ----------
    motion : at a constant rate.
    cutoff_hz : one for all degrees of freedom; None: for each the one that `residual_cutoffs_hz` chooses.

    Returns
    -------
    The filtered motion and its derivatives.

    Raises
    ------
    ValueError : stamps that are not at a constant rate, or a cutoff that is not below 0.45 of it.
    """
    if not motion.uniform:
        raise ValueError("expected a motion at a constant rate")
    if cutoff_hz is not None and not 0.0 < cutoff_hz <= MOST_OF_RATE * motion.rate_hz:
        raise ValueError(f"expected a cutoff in (0, {MOST_OF_RATE * motion.rate_hz:.4g}] Hz, got {cutoff_hz}")
    rotation, joints = slice(3, 7), slice(7, None)
    signals = np.concatenate([motion.values[:, :3], _continuous_xyzw(motion), motion.values[:, N_ROOT_DOF:]], axis=1)
    cutoffs = np.full(signals.shape[1], cutoff_hz or 0.0)
    if cutoff_hz is None:
        cutoffs = residual_cutoffs_hz(signals, motion.valid, motion.rate_hz)
        cutoffs[rotation] = cutoffs[rotation].max()
    smooth, valid = lowpass(signals, motion.valid, motion.rate_hz, cutoffs)
    smooth[~valid, 6] = 1.0
    smooth[:, rotation] /= np.linalg.norm(smooth[:, rotation], axis=1, keepdims=True)
    first, second, _ = derivatives(smooth, valid, motion.rate_hz)
    turns = Rotation.from_quat(smooth[:, rotation])
    values = np.concatenate([smooth[:, :3], turns.as_rotvec(), smooth[:, joints]], axis=1)
    velocity, acceleration = (
        np.concatenate([d[:, :3], _turning(smooth[:, rotation], d[:, rotation]), d[:, joints]], axis=1) for d in (first, second)
    )
    filtered = replace(motion, values=np.where(valid[:, None], values, 0.0), valid=valid)
    return StateKinematics(filtered, velocity, acceleration, cutoffs)


def _continuous_xyzw(motion: RunMotion) -> np.ndarray:
    """Quaternions (n, 4) of the root, each in the half of the sphere that the one before it lies in."""
    quaternions = Rotation.from_rotvec(motion.values[:, 3:6]).as_quat()
    signs = np.sign(np.sum(quaternions[1:] * quaternions[:-1], axis=1))
    return quaternions * np.concatenate([[1.0], np.cumprod(np.where(signs == 0.0, 1.0, signs))])[:, None]


def _turning(q_xyzw: np.ndarray, rate_xyzw: np.ndarray) -> np.ndarray:
    """Vector part of 2 dq q* (n, 3): angular velocity about the world's axes for dq of first order, acceleration for second."""
    v, w = q_xyzw[:, :3], q_xyzw[:, 3:]
    dv, dw = rate_xyzw[:, :3], rate_xyzw[:, 3:]
    return 2.0 * (dv * w - dw * v - np.cross(dv, v))
