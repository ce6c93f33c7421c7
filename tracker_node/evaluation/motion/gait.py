"""Strides of somebody who walks: when the feet touch the floor and leave it, and joint angles over the stride.

A foot touches the floor where its heel is farthest before the pelvis, and leaves it where its toes are farthest behind (Zeni,
Richards & Higginson, "Two simple methods for determining gait events during treadmill and overground walking using kinematic
data", Gait & Posture 27 (2008) 710-714). Before and behind are by the hips, so that it does not matter where one walks to, or
whether the floor moves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from .jumps import ENDS, SIDES, Contact, FootContacts, find_contacts, foot_names

N_PARTS = 101  # of a stride, 0 to 100 %
_CUTOFF_HZ, _HEADING_HZ = 6.0, 0.5
_SWING_M = 0.2  # a foot swings at least so far beside the pelvis
_STRIDE_S = (0.5, 2.5)
_STANCE = (0.45, 0.8)  # of a walk: who runs, or swings the legs in the air, has less
_LEAST_WAY_M = 0.1  # over ground
_FEWEST_STRIDES = 2  # of each foot, of fewer nobody is said to walk
_SAME_S = 0.15  # from a stride to a contact that is the same


@dataclass(frozen=True, eq=False)
class Strides:
    """Of one foot, n strides: from touching the floor to touching it again.

    Attributes
    ----------
    starts_s, offs_s, ends_s : (n,) when it touches the floor, leaves it, and touches it again.
    lengths_m : (n,) way of the heel over ground; not-a-number on a treadmill, where it has none.
    steps_s : (n,) from the other foot's touching the floor to this one's, at the end; not-a-number where that is not known.
    angles : name without the side -> (n, `N_PARTS`) in degrees.
    """

    starts_s: np.ndarray
    offs_s: np.ndarray
    ends_s: np.ndarray
    lengths_m: np.ndarray
    steps_s: np.ndarray
    angles: Mapping[str, np.ndarray]

    @property
    def times_s(self) -> np.ndarray:
        """(n,) how long they take."""
        return self.ends_s - self.starts_s

    @property
    def stance(self) -> np.ndarray:
        """(n,) parts of the strides in which the foot is on the floor."""
        return (self.offs_s - self.starts_s) / self.times_s


@dataclass(frozen=True, eq=False)
class Gait:
    """Strides of both feet, and how fast the body goes over ground, meters a second."""

    strides: Mapping[str, Strides]
    speed_m_s: float

    def metrics(self) -> dict[str, float | int]:
        """Means by key."""
        both = np.concatenate([foot.steps_s for foot in self.strides.values()])
        found: dict[str, float | int] = {"cadence_per_min": 60.0 / float(np.nanmean(both)), "walking_speed_m_s": self.speed_m_s}
        for side, foot in self.strides.items():
            found[f"strides_{side}"] = len(foot.starts_s)
            found[f"stride_time_s_{side}"] = float(foot.times_s.mean())
            known = foot.lengths_m[np.isfinite(foot.lengths_m)]
            found[f"stride_length_m_{side}"] = float(known.mean()) if len(known) else float("nan")
            found[f"stance_percent_{side}"] = 100.0 * float(foot.stance.mean())
            found[f"step_time_s_{side}"] = float(np.nanmean(foot.steps_s))
        return found


def find_gait(
    times_s: np.ndarray, points: Mapping[str, np.ndarray], angles_deg: Mapping[str, np.ndarray], rate_hz: float
) -> Gait | None:
    """Strides in a motion.

    Parameters
    ----------
    times_s : (n,) at a constant rate; gaps are not-a-number in ``points``.
    points : landmark -> (n, 3) meters, z up; of the hips, and of heels and big toes, or ankles in their place.
    angles_deg : degree of freedom -> (n,); those whose names begin with a side are cut into strides.
    rate_hz : of the times.

    Returns
    -------
    None where nobody walks, or landmarks are missing.
    """
    named = foot_names(points)
    if not named or not {"left_hip", "right_hip"} <= points.keys() or len(times_s) < 3:
        return None
    feet = {place: points[name] for place, name in named.items()}
    hips = points["left_hip"], points["right_hip"]
    middle = 0.5 * (hips[0] + hips[1])
    valid = np.isfinite(np.concatenate([middle, *feet.values()], axis=1)).all(axis=1)
    across = _smooth((hips[0] - hips[1])[:, :2], valid, rate_hz, _HEADING_HZ)
    ahead = np.column_stack([across[:, 1], -across[:, 0]]) / np.maximum(np.linalg.norm(across, axis=1), 1e-9)[:, None]
    events = {}
    for side in SIDES:
        before = {end: np.sum((feet[side, end] - middle)[:, :2] * ahead, axis=1)[:, None] for end in ENDS}
        heel, toe = (_smooth(before[end], valid, rate_hz, _CUTOFF_HZ)[:, 0] for end in ENDS)
        events[side] = _peaks(times_s, heel, valid, rate_hz), _peaks(times_s, -toe, valid, rate_hz)
    strides = {}
    for side, other in zip(SIDES, SIDES[::-1], strict=True):
        found = _strides(times_s, valid, *events[side], events[other][0], feet[side, "heel"], _own(angles_deg, side))
        if len(found.starts_s) < _FEWEST_STRIDES or not _STANCE[0] <= float(np.median(found.stance)) <= _STANCE[1]:
            return None
        strides[side] = found
    return Gait(strides, _speed(times_s, middle, strides))


def foot_contacts(times_s: np.ndarray, points: Mapping[str, np.ndarray], gait: Gait | None) -> dict[str, FootContacts]:
    """When each foot is on the floor: by strides, on a treadmill, too, and beside them by where it stands.

    Parameters
    ----------
    times_s, points : as of `find_gait`.
    gait : what that has found.

    Returns
    -------
    By side; see `find_contacts`.
    """
    found = find_contacts(times_s, points)
    if gait is None:
        return found
    return {side: replace(foot, contacts=_beside(gait.strides[side], foot.contacts)) for side, foot in found.items()}


def _beside(foot: Strides, contacts: Sequence[Contact]) -> tuple[Contact, ...]:
    """Those of the strides, and what is left of others before, between and after them."""
    result = [Contact(float(start), float(off)) for start, off in zip(foot.starts_s, foot.offs_s, strict=True)]
    spans = list(zip(foot.starts_s.tolist(), foot.ends_s.tolist(), strict=True))
    ends = [end for _, end in spans if not any(abs(end - start) < 1e-6 for start, _ in spans)]  # that no stride follows
    for each in contacts:
        near = [end for end in ends if abs(each.start_s - end) < _SAME_S]
        cut = replace(each, start_s=near[0], comes=True) if near else each
        if cut.end_s > cut.start_s and not any(cut.start_s < end - 1e-6 and cut.end_s > start for start, end in spans):
            result.append(cut)
    return tuple(sorted(result, key=lambda each: each.start_s))


def _own(angles_deg: Mapping[str, np.ndarray], side: str) -> dict[str, np.ndarray]:
    return {name.removeprefix(f"{side}_"): values for name, values in angles_deg.items() if name.startswith(f"{side}_")}


def _smooth(values: np.ndarray, valid: np.ndarray, rate_hz: float, cutoff_hz: float) -> np.ndarray:
    """(n, k) without what is faster, by a Gaussian that leaves half of the power at the cutoff, from what is known alone."""
    sigma = np.sqrt(np.log(2.0)) / (2.0 * np.pi * cutoff_hz) * rate_hz
    reach = min(int(np.ceil(4.0 * sigma)), (len(values) - 1) // 2)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    known = np.maximum(np.convolve(valid.astype(float), weights, "same"), 1e-12)
    return np.column_stack([np.convolve(np.where(valid, column, 0.0), weights, "same") / known for column in values.T])


def _peaks(times_s: np.ndarray, values: np.ndarray, valid: np.ndarray, rate_hz: float) -> np.ndarray:
    """Times of the highest places of a swing, between the samples: between two of them it goes down by `_SWING_M` at least."""
    peaks, high, low, rising = [], -1, 0, True
    for i in np.flatnonzero(valid).tolist():
        if rising and (high < 0 or values[i] > values[high]):
            high = i
        elif rising and values[i] < values[high] - _SWING_M:
            peaks.append(high)
            low, rising = i, False
        elif not rising and values[i] < values[low]:
            low = i
        elif not rising and values[i] > values[low] + _SWING_M:
            high, rising = i, True
    at = np.array([k for k in peaks if 0 < k < len(values) - 1 and valid[k - 1 : k + 2].all()], dtype=int)
    before, here, after = values[at - 1], values[at], values[at + 1]
    bend = before - 2.0 * here + after
    part = np.where(np.abs(bend) > 1e-12, 0.5 * (before - after) / np.where(bend == 0.0, 1.0, bend), 0.0)
    return times_s[at] + np.clip(part, -0.5, 0.5) / rate_hz


def _strides(
    times_s: np.ndarray, valid: np.ndarray, strikes_s: np.ndarray, offs_s: np.ndarray, others_s: np.ndarray, heel: np.ndarray,
    angles_deg: Mapping[str, np.ndarray],
) -> Strides:  # fmt: skip
    """Between strikes that follow each other with one off between them, nothing of which is missing."""
    kept, steps = [], []
    for start, end in pairwise(strikes_s):
        off = offs_s[(offs_s > start) & (offs_s < end)]
        inside = (times_s >= start) & (times_s <= end)
        if _STRIDE_S[0] <= end - start <= _STRIDE_S[1] and len(off) == 1 and valid[inside].all():
            kept.append((start, off[0], end))
            other = others_s[(others_s > start) & (others_s < end)]
            steps.append(end - other[-1] if len(other) else np.nan)
    starts, offs, ends = np.array(kept).reshape(-1, 3).T
    at = [np.column_stack([np.interp(t, times_s, heel[:, axis]) for axis in range(2)]) for t in (starts, ends)]
    parts = starts[:, None] + (ends - starts)[:, None] * np.linspace(0.0, 1.0, N_PARTS)
    angles = {name: np.interp(parts, times_s, values) for name, values in angles_deg.items()}
    lengths = np.linalg.norm(at[1] - at[0], axis=1)
    return Strides(starts, offs, ends, np.where(lengths < _LEAST_WAY_M, np.nan, lengths), np.array(steps), angles)


def _speed(times_s: np.ndarray, middle: np.ndarray, strides: Mapping[str, Strides]) -> float:
    """Of the pelvis over ground, mean over all strides."""
    ways, times = [], []
    for foot in strides.values():
        ends = [np.column_stack([np.interp(t, times_s, middle[:, a]) for a in range(2)]) for t in (foot.starts_s, foot.ends_s)]
        ways.append(np.linalg.norm(ends[1] - ends[0], axis=1).sum())
        times.append(foot.times_s.sum())
    return float(sum(ways) / sum(times))
