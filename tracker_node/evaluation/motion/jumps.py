"""When the feet of a person are on the floor, and jumps: when both are off, and the center of mass falls as everything does.

A foot is on the floor while its heel or its toes are near to where they stand, and hardly slide. Height of a jump is measured in
three ways, which agree where the body's size, its masses and the instants are right:

- *rise*: highest point of the center of mass less its place at take-off;
- *take-off*: v^2 / 2g of its upward velocity v at take-off, the slope there of a parabola that falls at g;
- *air*: g T^2 / 8 of the time T in the air, right where one lands in the pose of the take-off.

Source: N. P. Linthorne, "Analysis of standing vertical jumps using a force platform", Am. J. Phys. 69 (2001) 1198-1204.
Standard deviations come from what the parabola leaves of the center's path, and from the instants, which are known to an image
divided by the root of 12, and where the parabola alone tells them, to the time in which one leaves it unseen. That of the
velocity grows where the center falls at another rate than g.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

GRAVITY = 9.80665
SIDES, ENDS = ("left", "right"), {"heel": "heel", "toe": "big_toe"}  # of bodies; of feet, with the landmark there
_CLEAR_M = 0.025  # a foot so far above where it stands is off the floor
_LOW = 10.0  # percentile of a foot point's height, which is near to where it stands
_RAISED_M = 0.1  # a foot whose lowest heights are so far above the other's never stands
_SLIDES_M_S = 0.5  # faster over the floor than this, a foot swings close above it
_HALF_S = 0.05  # before and after, between which its speed is measured
_BRIEF_S = 0.08  # shorter times on the floor, or off it, are noise
_SHORTEST_S = 0.2
_LINE_S = 0.03  # a foot's way next to the floor that is taken for a straight line
_OFF_M = 0.006  # a center of mass so far off its parabola does not fall any more
_TIPTOE_M = 0.05  # feet of which every point is so far above where it stands, toes too, are in the air, whatever heels do
_MEDIAN = 0.6745  # median of what is normal without its sign, in standard deviations
_FEWEST = 6  # image sets in the air, of which a parabola says something
_FALL = (0.75, 1.25)  # of gravity: what is found of a body that is free
_LEAST_M = 0.05
_ALIKE = (0.6, 1.6)  # height by velocity over that by time: others land far lower than they took off, or run
_FEET = ("heel", "big_toe", "ankle")


@dataclass(frozen=True)
class Jump:
    """One jump; each height in meters with its standard deviation.

    Attributes
    ----------
    take_off_s, landing_s : instants.
    rise_m, take_off_m, air_m : (height, standard deviation).
    velocity_m_s : upward at take-off, and its standard deviation.
    fall_m_s2 : downward acceleration in the air when it is fitted, too, and its standard deviation.
    """

    take_off_s: float
    landing_s: float
    rise_m: tuple[float, float]
    take_off_m: tuple[float, float]
    air_m: tuple[float, float]
    velocity_m_s: tuple[float, float]
    fall_m_s2: tuple[float, float]


@dataclass(frozen=True)
class Contact:
    """A foot on the floor.

    Attributes
    ----------
    start_s, end_s : instants, half way between two image sets; those of the sets themselves at the ends of a recording or a gap.
    comes, leaves : whether it is seen to come down, and to leave: it may stand where a recording, or a gap, begins or ends.
    """

    start_s: float
    end_s: float
    comes: bool = True
    leaves: bool = True


@dataclass(frozen=True)
class FootContacts:
    """What one foot does: ``contacts`` in order of time, and for how long, ``seen_s``, it is known."""

    contacts: tuple[Contact, ...]
    seen_s: float


def foot_names(points: Iterable[str]) -> dict[tuple[str, str], str]:
    """Landmarks of both feet.

    Parameters
    ----------
    points : names of all landmarks.

    Returns
    -------
    (side, "heel" or "toe") -> heel or big toe, or the ankle in place of one that is missing; empty without one.
    """
    there, found = set(points), {}
    for side in SIDES:
        for end, name in ENDS.items():
            found[side, end] = next((each for each in (f"{side}_{name}", f"{side}_ankle") if each in there), "")
    return found if all(found.values()) else {}


def find_contacts(times_s: np.ndarray, points: Mapping[str, np.ndarray]) -> dict[str, FootContacts]:
    """When each foot is on a floor that is level and does not move.

    The floor is where a foot stands, unless that is far above where the other does: it is held up.

    Parameters
    ----------
    times_s : (n,) at a constant rate.
    points : landmark -> (n, 3) meters, z up; not-a-number in gaps.

    Returns
    -------
    By side; without a foot that is hardly ever known.
    """
    names = foot_names(points)
    if not names or len(times_s) < _FEWEST:
        return {}
    feet = {side: np.stack([points[names[side, end]] for end in ENDS], axis=1) for side in SIDES}
    known = {side: np.isfinite(foot).all(axis=(1, 2)) for side, foot in feet.items()}
    feet = {side: foot for side, foot in feet.items() if known[side].sum() >= _FEWEST}
    floors = {side: _floors(foot[known[side], :, 2]) for side, foot in feet.items()}
    alike = all(names["left", end].removeprefix("left") == names["right", end].removeprefix("right") for end in ENDS)
    lowest = np.min(list(floors.values()), axis=0) if floors and alike else None
    for side, own in floors.items():
        floors[side] = own if lowest is None or (own - lowest).max() < _RAISED_M else lowest
    return {side: _contacts_of(times_s, foot, known[side], floors[side]) for side, foot in feet.items()}


def _contacts_of(times_s: np.ndarray, foot: np.ndarray, known: np.ndarray, floor: np.ndarray) -> FootContacts:
    """Of one foot, (n, k, 3) points, known in some sets (n,); ``floor`` (k,) heights at which they stand."""
    period_s = float(np.median(np.diff(times_s)))
    before, after = np.arange(len(foot)), np.arange(len(foot))
    for step in range(1, max(round(_HALF_S / period_s), 1) + 1):  # as far as the foot is known, beside a gap, too
        before[step:] = np.where(known[:-step], np.arange(len(foot) - step), before[step:])
        after[:-step] = np.where(known[step:], np.arange(step, len(foot)), after[:-step])
    way = np.linalg.norm(foot[after, :, :2] - foot[before, :, :2], axis=2)
    still = way < _SLIDES_M_S * (times_s[after] - times_s[before])[:, None]  # one that is seen but once is not known to be
    down = known & (still & (np.abs(foot[..., 2] - floor) < _CLEAR_M)).any(axis=1)
    brief = round(_BRIEF_S / period_s)
    for first, last in _series(known & ~down):  # first, lest what is left of a contact is brief
        inside = first > 0 and last < len(down) - 1 and known[[first - 1, last + 1]].all()
        down[first : last + 1] = inside and last - first + 1 < brief
    found = []
    for first, last in _series(down):
        if last - first + 1 < brief:
            continue
        comes, leaves = first > 0 and bool(known[first - 1]), last < len(down) - 1 and bool(known[last + 1])
        start_s, end_s = times_s[first] - 0.5 * period_s * comes, times_s[last] + 0.5 * period_s * leaves
        found.append(Contact(float(start_s), float(end_s), comes, leaves))
    return FootContacts(tuple(found), period_s * int(known.sum()))


def contact_metrics(feet: Mapping[str, FootContacts]) -> dict[str, float | int]:
    """How often and how long feet are on the floor, by key; empty for a body whose feet are not known."""
    found: dict[str, float | int] = {}
    for side, foot in feet.items():
        found[f"contacts_{side}"] = len(foot.contacts)
        found[f"contact_percent_{side}"] = min(100.0 * sum(c.end_s - c.start_s for c in foot.contacts) / foot.seen_s, 100.0)
    return found


def jump_metrics(jumps: Sequence[Jump]) -> dict[str, float | int]:
    """Means over the jumps by key; none without a jump."""
    if not jumps:
        return {}
    heights = {
        "rise": [j.rise_m[0] for j in jumps],
        "take_off": [j.take_off_m[0] for j in jumps],
        "air": [j.air_m[0] for j in jumps],
    }
    found = {f"jump_height_{way}_m": float(np.mean(values)) for way, values in heights.items()}
    return {"jumps": len(jumps), **found, "jump_fall_m_s2": float(np.mean([j.fall_m_s2[0] for j in jumps]))}


def find_jumps(times_s: np.ndarray, points: Mapping[str, np.ndarray], center: np.ndarray | None) -> list[Jump]:
    """Jumps in a motion; a step or a stride of somebody who runs is too short to be one.

    Parameters
    ----------
    times_s : (n,) increasing.
    points : landmark -> (n, 3) meters, z up; not-a-number in gaps. Heels, big toes and ankles, as many as there are of both feet.
    center : (n, 3) center of mass, not filtered; None of a body without one.

    Returns
    -------
    In order of time; empty where none is found, or feet or center are not known.
    """
    feet = [f"{side}_{part}" for side in SIDES for part in _FEET if f"{side}_{part}" in points]
    if center is None or {name.split("_")[0] for name in feet} != set(SIDES):
        return []
    heights = np.column_stack([points[name][:, 2] for name in feet])
    known = np.isfinite(heights).all(axis=1) & np.isfinite(center).all(axis=1)
    if known.sum() < _FEWEST:
        return []
    clear = (heights - _floors(heights[known])).min(axis=1)
    toes = all(f"{side}_big_toe" in points for side in SIDES)
    found, period_s = [], float(np.median(np.diff(times_s)))
    for first, last in _series(known & (clear > _CLEAR_M)):
        if last - first + 1 < _FEWEST:
            continue
        if first == 0 or last == len(times_s) - 1 or not (known[first - 1] and known[last + 1]):
            continue  # it does not begin or end here
        high = np.flatnonzero(clear[first : last + 1] > _TIPTOE_M) + first if toes else np.array([], dtype=int)
        falls_from, falls_to, late_s = _falling(times_s, center[:, 2], first, last, high)
        start, before_s = _on_floor(times_s, clear, first, 1), 0.0
        if falls_from > first:  # it leaves the floor somewhat after the first set in which it seems to fall
            before_s = min(late_s, times_s[falls_from] - start)
            start = float(times_s[falls_from] + 0.5 * before_s)
        end, after_s = _on_floor(times_s, clear, last, -1), 0.0
        if falls_to < last:
            after_s = min(late_s, end - times_s[falls_to])
            end = float(times_s[falls_to] - 0.5 * after_s)
        sds_s = np.hypot(period_s, [before_s, after_s]) / np.sqrt(12.0)
        air = np.arange(falls_from + (times_s[falls_from] < start), falls_to + 1 - (times_s[falls_to] > end))
        at_take_off = float(np.interp(start, times_s[known], center[known, 2]))
        jump = _jump(times_s[air], center[air, 2], (start, end), at_take_off, sds_s)
        if jump is not None:
            found.append(jump)
    return found


def _floors(heights: np.ndarray) -> np.ndarray:
    """(k,) where each point of the feet stands: the median of its heights (n, k) that are near to the lowest."""
    near = np.abs(heights - np.percentile(heights, _LOW, axis=0, method="lower")) < _CLEAR_M
    return np.nanmedian(np.where(near, heights, np.nan), axis=0)


def _series(there: np.ndarray) -> list[tuple[int, int]]:
    """First and last of every series."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(int)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _falling(times_s: np.ndarray, height: np.ndarray, first: int, last: int, high: np.ndarray) -> tuple[int, int, float]:
    """Of the sets from ``first`` to ``last`` those around the highest, and the ``high`` ones, that lie on one parabola.

    Heels rise long before somebody takes off, and where toes do not bend of their own, the feet's other points say too much. The
    parabola falls about as things do, not just so: of a body whose size or masses are somewhat off, as of all, the center falls
    faster or slower.

    Returns
    -------
    First, last, and how long one who only stands is taken to fall.
    """
    top = first + int(np.argmax(height[first : last + 1]))
    half = max(min(top - first, last - top) // 2, 3)
    known = height[np.isfinite(height)]
    noise = float(np.median(np.abs(np.diff(known, 3)))) / (
        _MEDIAN * np.sqrt(20.0)
    )  # of third differences, which leave little else
    a, b = max(min([top - half, *high[:1]]), first), min(max([top + half, *high[-1:]]), last)
    t = times_s - times_s[top]
    while True:
        fall = np.clip(-2.0 * np.polyfit(t[a : b + 1], height[a : b + 1], 2)[0], *np.multiply(_FALL, GRAVITY))
        path = height + 0.5 * fall * t**2  # a straight line where it falls
        line = np.polyfit(t[a : b + 1], path[a : b + 1], 1)
        off = np.abs(path - np.polyval(line, t))
        bound = max(_OFF_M, 4.0 * noise, 3.0 * float(np.sqrt(np.mean(off[a : b + 1] ** 2))))
        wider = (a - (a > first and off[a - 1] < bound), b + (b < last and off[b + 1] < bound))
        if wider == (a, b):
            return int(a), int(b), float(np.sqrt(2.0 * bound / GRAVITY))
        a, b = wider


def _on_floor(times_s: np.ndarray, clear: np.ndarray, first: int, step: int) -> float:
    """When the foot was on the floor: the line through its heights in the air next to ``first``, taken on to 0."""
    near = [first, first + step]
    while abs(times_s[near[-1] + step] - times_s[first]) <= _LINE_S and clear[near[-1] + step] > _CLEAR_M:
        near.append(near[-1] + step)
    slope, at = np.polyfit(times_s[near] - times_s[first], clear[near], 1)
    reach = step * at / slope if slope * step > 0.0 else 0.0  # how long before the first, or after the last
    return float(times_s[first] - step * min(max(reach, 0.0), _LINE_S))


def _jump(
    times_s: np.ndarray, height: np.ndarray, instants: Sequence[float], at_take_off: float, sds_s: Sequence[float]
) -> Jump | None:
    """None where the center of mass does not fall as a free body, or for too short a time; ``sds_s`` of both instants."""
    start, end = instants
    air = end - start
    if air < _SHORTEST_S or len(times_s) < _FEWEST:
        return None
    t = times_s - start
    free, free_covariance = _fitted(np.column_stack([np.ones_like(t), t, -0.5 * t**2]), height)
    if not _FALL[0] <= free[2] / GRAVITY <= _FALL[1]:
        return None
    (foot, v), covariance = _fitted(np.column_stack([np.ones_like(t), t]), height + 0.5 * GRAVITY * t**2)
    by_velocity, by_time = v**2 / (2.0 * GRAVITY), GRAVITY * air**2 / 8.0
    if v <= 0.0 or by_velocity < _LEAST_M or not _ALIKE[0] <= by_velocity / by_time <= _ALIKE[1]:
        return None
    noise = float(np.sqrt(np.mean((height - (foot + v * t - 0.5 * GRAVITY * t**2)) ** 2)))
    by_instants = v * sds_s[0]  # the path's slope there, and what a velocity is worth in height
    fall_sd = float(np.sqrt(free_covariance[2, 2]))
    # a parabola of the rate that is found begins root of 3 times this faster or slower: v is anywhere up to there
    by_fall = max(abs(float(free[2]) - GRAVITY) - 2.0 * fall_sd, 0.0) * air / np.sqrt(12.0)
    slope = float(np.hypot(np.sqrt(covariance[1, 1]), by_fall))
    return Jump(
        start,
        end,
        (float(foot + by_velocity - at_take_off), float(np.hypot(by_instants, noise))),
        (float(by_velocity), float(np.hypot(by_instants, v / GRAVITY * slope))),
        (by_time, float(GRAVITY * air / 4.0 * np.hypot(sds_s[0], sds_s[1]))),
        (float(v), float(np.hypot(GRAVITY * sds_s[0], slope))),
        (float(free[2]), fall_sd),
    )


def _fitted(columns: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients by least squares, and their covariance by what is left."""
    found, *_ = np.linalg.lstsq(columns, values, rcond=None)
    left = values - columns @ found
    variance = float(left @ left) / max(len(values) - columns.shape[1], 1)
    return found, variance * np.linalg.inv(columns.T @ columns)
