"""Angles of the joints and their velocities over time, filtered as is said, with ranges over cycles and symmetry.

Angles are those of the ISB of a person (`isb_angles`), of other bodies those of the model's joints. They come from filtered
states, so that segments keep their lengths; velocities are those of the quintic spline through them (`kinematics`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import ModelError
from ...runs.motion import RunMotion
from .isb_angles import isb_angles
from .kinematics import derivatives, state_kinematics

AUTO, NO_FILTER = CUTOFFS = ("auto", "none")
UNFILTERED = "not filtered"
SMOOTHED = "smoothed by its own covariance (Rauch-Tung-Striebel)"
SIDES = ("left", "right")
HANGS_DEG = 15.0  # of elevation: nearer to hanging, or to straight up, an arm's plane of elevation and rotation say nothing
_LEAST_MEAN = 5.0  # degrees: of smaller ranges no symmetry index is given, which noise would rule


@dataclass(frozen=True, eq=False)
class JointMotion:
    """k angles at n time steps, a constant period apart; not-a-number in gaps.

    Attributes
    ----------
    times_s : (n,) since the first time step.
    joints : (k,) joint of each angle, ``left hip``. names : (k,) ``left_hip_flexion``. units : (k,) "deg" or "m".
    values : (n, k) degrees, or meters where something slides.
    velocities : (n, k) the same per second; not-a-number too in stretches shorter than `SHORTEST`.
    filter : what was done against noise, for people.
    """

    times_s: np.ndarray
    joints: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray
    velocities: np.ndarray
    filter: str

    def of(self, name: str) -> np.ndarray:
        """(n,) values of an angle."""
        return self.values[:, self.names.index(name)]


@dataclass(frozen=True, eq=False)
class Ranges:
    """Of one angle, c cycles: (c,) lowest, highest, and largest speed in each."""

    lowest: np.ndarray
    highest: np.ndarray
    fastest: np.ndarray

    @property
    def widths(self) -> np.ndarray:
        """(c,) highest less lowest."""
        return self.highest - self.lowest


def joint_motion(motion: RunMotion, cutoff_hz: float | str = AUTO, smoothed: bool = False) -> JointMotion:
    """Angles and velocities of a motion.

    Parameters
    ----------
    motion : at a constant rate.
    cutoff_hz : of the Butterworth filter, or `NO_FILTER`; `AUTO`: by residual analysis, and no filter where states are smoothed.
    smoothed : its states have been smoothed.

    Returns
    -------
    Without a filter where no stretch is as long as `SHORTEST`.

    Raises
    ------
    ValueError : a cutoff that is not below 0.45 of the rate, or a rate that is not constant.
    """
    said = treatment(smoothed)
    if cutoff_hz != NO_FILTER and not (smoothed and cutoff_hz == AUTO):
        found = state_kinematics(motion, None if cutoff_hz == AUTO else float(cutoff_hz))
        if found.motion.valid.any():
            motion, said = found.motion, filter_text(found.cutoffs_hz, cutoff_hz == AUTO) + (f"; {SMOOTHED}" if smoothed else "")
    joints, names, units, values, valid = _angles(motion)
    first, _, good = derivatives(values, motion.valid, motion.rate_hz)
    known = np.where(valid, values, np.nan)
    speeds = np.where(valid & good[:, None], first, np.nan)
    return JointMotion(motion.times_s, joints, names, units, known, speeds, said)


def treatment(smoothed: bool) -> str:
    """What has been done to the states of a run against noise."""
    return SMOOTHED if smoothed else UNFILTERED


def filter_text(cutoffs_hz: np.ndarray, chosen: bool) -> str:
    """What the filter of `kinematics` is, for a plot.

    Parameters
    ----------
    cutoffs_hz : (k,).
    chosen : by residual analysis.

    Returns
    -------
    One line.
    """
    low, high = f"{cutoffs_hz.min():.3g}", f"{cutoffs_hz.max():.3g}"
    span = low if low == high else f"{low}–{high}"
    how = " (residual analysis)" if chosen else ""
    return f"Butterworth, 4th order, no lag, {span} Hz{how}"


def _angles(motion: RunMotion) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...], np.ndarray, np.ndarray]:
    """Joints, names, units (k,), values and validity (n, k)."""
    try:
        found = isb_angles(motion)
    except ModelError:
        axes = motion.model.chain.axes
        turns = np.array([axis.unit == "rad" for axis in axes], dtype=bool)
        values = motion.values[:, -len(axes) :] if axes else np.zeros((len(motion), 0))
        values = values * np.where(turns, np.degrees(1.0), 1.0)
        of = [joint.name for joint in motion.model.chain.joints for _ in joint.axes]
        joints = tuple(name.replace("_", " ") for name in of)
        valid = np.repeat(motion.valid[:, None], len(axes), axis=1)
        return joints, tuple(axis.name for axis in axes), tuple("deg" if turn else "m" for turn in turns), values, valid
    joints = tuple(_words(joint) for joint in found.joints for _ in range(3))
    names = tuple(name for triple in found.names for name in triple)
    values = np.degrees(found.radians).reshape(len(motion), -1)
    valid = np.repeat(found.valid, 3, axis=1)
    for elevation in (k for k, name in enumerate(names) if name.endswith("shoulder_elevation")):
        away = np.abs(np.sin(np.radians(values[:, elevation]))) >= np.sin(np.radians(HANGS_DEG))
        valid[:, [elevation - 1, elevation + 1]] &= away[:, None]
    return joints, names, ("deg",) * len(names), values, valid


def _words(joint: str) -> str:
    """``LeftHip`` as ``left hip``."""
    return "".join(f" {letter.lower()}" if letter.isupper() else letter for letter in joint).strip()


def side_of(name: str) -> str:
    """``left`` or ``right``, whichever a name begins with; empty for the trunk."""
    return next((side for side in SIDES if name.startswith((f"{side}_", f"{side} "))), "")


def without_side(name: str) -> str:
    """A name without the side that it begins with."""
    side = side_of(name)
    return name[len(side) + 1 :] if side else name


def ranges(found: JointMotion, cycles: Mapping[str, Sequence[tuple[float, float]]] | None = None) -> dict[str, Ranges]:
    """Ranges and speeds of every angle.

    Parameters
    ----------
    found : angles over time.
    cycles : side -> (start, end) in seconds, of which the left ones are also the trunk's; None: the whole motion is one.

    Returns
    -------
    By name; no cycles where an angle is known in none.
    """
    everything = [(-np.inf, np.inf)]
    measured = {}
    for k, name in enumerate(found.names):
        rows = []
        for start, end in everything if cycles is None else cycles.get(side_of(name) or SIDES[0], ()):
            inside = (found.times_s >= start) & (found.times_s <= end)
            values, speeds = (series[inside & np.isfinite(series[:, k]), k] for series in (found.values, found.velocities))
            if len(values):
                rows.append((values.min(), values.max(), np.abs(speeds).max() if len(speeds) else np.nan))
        measured[name] = Ranges(*np.array(rows, dtype=float).reshape(-1, 3).T)
    return measured


def symmetry_index(left: float, right: float, least: float = _LEAST_MEAN) -> float:
    """Left less right over their mean, in percent: 0 where both are alike, between -200 and 200 for measures above 0.

    Source: R. O. Robinson, W. Herzog, B. M. Nigg, "Use of force platform variables to quantify the effects of chiropractic
    manipulation on gait symmetry", Journal of Manipulative and Physiological Therapeutics 10 (1987) 172-176, here left first.

    Parameters
    ----------
    left, right : the same measure of both sides.
    least : mean below which there is none.

    Returns
    -------
    Percent, or not-a-number.
    """
    mean = 0.5 * (left + right)
    return 100.0 * (left - right) / mean if mean >= least else float("nan")
