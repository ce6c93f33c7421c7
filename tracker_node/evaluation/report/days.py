"""Recording days of one person compared: mean and SD of each day over one another, and differences to the first day.

A day is what was measured in one or several runs. Where there are strides in every day, angles are those over strides, else those
of whole runs. Differences have the 95 % interval of B. L. Welch, Biometrika 34 (1947) 28-35, for strides that do not depend on
each other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.stats import t as student

from ...render.palette import CYCLE
from ...report.document import Block, Cell, Chart, Column, Document, DocumentSection, Line, Table, Value
from ...report.metrics_file import made_by, today
from ..motion.gait import N_PARTS
from ..motion.joint_motion import Ranges, ranges
from ..motion.jumps import SIDES
from ..review import Review
from .kinematics import LEAST_RANGE_DEG, STRIDE, STRIDE_ANGLES, STRIDE_MEASURES, mean_line, ranges_of
from .scene import scene

_CONFIDENCE = 0.95
_MEANINGS = (
    ("SD", "standard deviation over strides, over jumps, or where nobody walks over runs, with n - 1."),
    ("Difference", "mean of a day less that of the first day, with half of its 95 % interval (Welch 1947), as if strides did not"
     " depend on each other: what is smaller may be chance. Another day means other clothes and another calibration, too."),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Day:
    """A recording day: its runs."""

    name: str
    reviews: Sequence[Review]

    def angles(self, side: str, name: str) -> np.ndarray:
        """An angle over all strides of a side.

        Parameters
        ----------
        side, name : ``left``, ``knee_flexion``.

        Returns
        -------
        (c, `N_PARTS`) degrees.
        """
        found = [r.gait.strides[side].angles.get(name) for r in self.reviews if r.gait is not None]
        return np.concatenate([np.zeros((0, N_PARTS)), *(curves for curves in found if curves is not None)])

    @cached_property
    def walks(self) -> bool:
        """Whether there are strides."""
        return any(review.gait is not None for review in self.reviews)

    def ranges(self, over_strides: bool) -> dict[str, np.ndarray]:
        """Angle -> its ranges, of strides or of runs."""
        found: dict[str, list[np.ndarray]] = {}
        for review in self.reviews:
            if review.joint_motion is None or (over_strides and review.gait is None):
                continue
            of: dict[str, Ranges] = review.ranges if over_strides else ranges(review.joint_motion)
            for name, one in of.items():
                found.setdefault(name, []).append(one.widths)
        return {name: np.concatenate(widths) for name, widths in found.items()}


def difference(first: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean of ``other`` less that of ``first``.

    Parameters
    ----------
    first, other : (n, ...) and (m, ...).

    Returns
    -------
    difference, half : (...), and half of the 95 % interval, not-a-number where either has less than two.
    """
    means = other.mean(axis=0) - first.mean(axis=0)
    if min(len(first), len(other)) < 2:
        return means, np.full(np.shape(means), np.nan)
    parts = [values.var(axis=0, ddof=1) / len(values) for values in (first, other)]
    total = parts[0] + parts[1]
    freedom = total**2 / np.maximum(parts[0] ** 2 / (len(first) - 1) + parts[1] ** 2 / (len(other) - 1), 1e-300)
    return means, student.ppf(0.5 + 0.5 * _CONFIDENCE, np.maximum(freedom, 1.0)) * np.sqrt(total)


def days_document(days: Sequence[Day]) -> Document:
    """The comparison.

    Parameters
    ----------
    days : two or more; differences are to the first.

    Returns
    -------
    Motion of the first run of each, angles over the stride, figures, quality.
    """
    facts = []
    for day in days:
        runs = ", ".join(str(review.sources.get("run", review.name)) for review in day.reviews)
        facts.append((day.name, f"{len(day.reviews)} run{'s' * (len(day.reviews) != 1)}: {runs}"))
    problems = [f"{day.name}, {review.name}: {said}" for day in days for review in day.reviews for said in review.problems]
    found = [replace(day.reviews[0], name=day.name) for day in days]
    if any(day.walks for day in days):
        problems += [f"{day.name}: no strides, so ranges are those of whole runs" for day in days if not day.walks]
    sections: list[tuple[str, str, list[Block | None]]] = [
        ("view", "The motion", [scene(found)]),
        ("stride", "Angles over the stride", list(_stride_charts(days))),
        ("figures", "Days compared", [_table("measures", "Strides and jumps", _measures(days), days),
                                      _table("ranges", "Ranges of motion", _ranges(days), days)]),
        ("quality", "Quality", [_quality_table(days)]),
    ]  # fmt: skip
    kept = [DocumentSection(key, title, blocks) for key, title, made in sections if (blocks := [b for b in made if b])]
    title = f"Recording days {', '.join(day.name for day in days)}"
    return Document(title, today(), facts, list(dict.fromkeys(problems)), kept, _MEANINGS, made_by())


def days_metrics(days: Sequence[Day]) -> dict[str, float | int]:
    """Mean and SD of each measure by day, and differences to the first day, by key.

    Parameters
    ----------
    days : as of `days_document`.

    Returns
    -------
    ``monday.range_left_knee_flexion_deg_mean`` and so on.
    """
    found: dict[str, float | int] = {}
    for key, _, _, _, of in (*_measures(days), *_ranges(days)):
        for day, values in zip(days, of, strict=True):
            if len(values):
                found |= {f"{day.name}.{key}_mean": float(values.mean()), f"{day.name}.{key}_n": len(values)}
                found |= {f"{day.name}.{key}_sd": float(values.std(ddof=1))} if len(values) > 1 else {}
            if day is not days[0] and len(values) and len(of[0]):
                found[f"{day.name}.{key}_difference"] = float(difference(of[0], values)[0])
    return found


_Measure = tuple[str, str, str, int, list[np.ndarray]]  # key, title, unit, digits, values of each day


def _measures(days: Sequence[Day]) -> list[_Measure]:
    """Those of strides of each side, and heights of jumps."""
    found: list[_Measure] = []
    for title, unit, digits, of in STRIDE_MEASURES:
        for side in SIDES:
            values = [_joined([of(r.gait.strides[side]) for r in day.reviews if r.gait is not None]) for day in days]
            key = f"{title.lower().replace(' ', '_')}_{side}_{unit.replace('%', 'percent')}"
            found.append((key, f"{title}, {side}", unit, digits, values))
    heights = [_joined([np.array([100.0 * jump.take_off_m[0] for jump in r.jumps]) for r in day.reviews]) for day in days]
    found.append(("jump_height_take_off_cm", "Jump height from take-off velocity", "cm", 1, heights))
    return [row for row in found if any(len(values) for values in row[4])]


def _joined(parts: Sequence[np.ndarray]) -> np.ndarray:
    whole = np.concatenate([np.zeros(0), *parts])
    return whole[np.isfinite(whole)]


def _ranges(days: Sequence[Day]) -> list[_Measure]:
    over_strides = all(day.walks for day in days)
    of = [day.ranges(over_strides) for day in days]
    moving = {name for day in days for review in day.reviews for name in ranges_of(review)}  # others the body does not have
    names = [name for name in dict.fromkeys(name for found in of for name in found) if name in moving]
    units = {
        name: unit
        for day in days
        for r in day.reviews
        if (m := r.joint_motion)
        for name, unit in zip(m.names, m.units, strict=True)
    }
    shown = {name: ("deg", "°", 1.0) if units[name] == "deg" else ("mm", "mm", 1e3) for name in names}
    return [
        (f"range_{name}_{shown[name][0]}", name.replace("_", " "), shown[name][1], 1,
         [shown[name][2] * _joined([found.get(name, np.zeros(0))]) for found in of]) for name in names
    ]  # fmt: skip


def _table(key: str, title: str, measures: Sequence[_Measure], days: Sequence[Day]) -> Table | None:
    """A row a measure: mean, SD and number of each day, then the others' differences to the first."""
    columns = [Column("measure", is_text=True), Column("", is_text=True)]
    columns += [Column(name, 0 if name == "n" else 1, day.name) for day in days for name in ("mean", "SD", "n")]
    columns += [Column(name, group=f"{day.name} less {days[0].name}") for day in days[1:] for name in ("difference", "±")]
    rows: list[list[Value]] = []
    for _, name, unit, digits, of in measures:
        row: list[Value] = [name, unit]
        for values in of:
            sd = float(values.std(ddof=1)) if len(values) > 1 else None
            row += [Cell(float(values.mean()) if len(values) else None, digits=digits), Cell(sd, digits=digits), len(values)]
        for values in of[1:]:
            both = difference(of[0], values) if len(values) and len(of[0]) else (np.nan, np.nan)
            row += [Cell(float(value), digits=digits) for value in both]
        rows.append(row)
    over = "over the strides of each day" if all(day.walks for day in days) else "over runs"
    note = f"Ranges {over}. Filter: {_filters(days)}." if key == "ranges" else ""
    return Table(key, title, note, columns, rows) if rows else None


def _filters(days: Sequence[Day]) -> str:
    known = [review.joint_motion for day in days for review in day.reviews]
    return "; ".join(dict.fromkeys(motion.filter for motion in known if motion is not None))


def _stride_charts(days: Sequence[Day]) -> Iterator[Chart]:
    """Each angle of the legs: all days over one another, then the differences to the first."""
    filters = _filters(days)
    for name in STRIDE_ANGLES:
        for side in SIDES:
            curves = [day.angles(side, name) for day in days]
            if (
                sum(len(of) > 0 for of in curves) < 2
                or max(np.ptp(of.mean(axis=0)) for of in curves if len(of)) < LEAST_RANGE_DEG
            ):
                continue
            title, key = f"{name.replace('_', ' ').capitalize()}, {side}", f"{side}_{name}"
            drawn = [(day, of, CYCLE[i % len(CYCLE)]) for i, (day, of) in enumerate(zip(days, curves, strict=True)) if len(of)]
            lines = [mean_line(f"{day.name} ({len(of)})", of, color) for day, of, color in drawn]
            note = "Mean and one standard deviation over strides, whose number stands beside the day."
            yield Chart(key, title, note, STRIDE, "degrees", lines, y_min=None, filter=filters)
            if not len(curves[0]):
                continue
            part, lines = np.linspace(0.0, 100.0, N_PARTS), []
            for day, of, color in drawn[1:]:
                change, half = difference(curves[0], of)
                spread = half if np.isfinite(half).any() else None
                lines.append(Line(f"{day.name} less {days[0].name}", part, change, color, 2.0, spread=spread))
            note = "Band: 95 % interval of the difference."
            levels = [(0.0, "no difference")]
            yield Chart(
                f"{key}_difference",
                f"{title}: difference",
                note,
                STRIDE,
                "degrees",
                lines,
                levels=levels,
                y_min=None,
                filter=filters,
            )


def _quality_table(days: Sequence[Day]) -> Table:
    """A row a run: how it was tracked."""
    columns = [Column("day", is_text=True), Column("run", is_text=True), Column("image sets", 0), Column("lost", 0)]
    columns += [
        Column("without a state", 0),
        Column("residual", 2),
        Column("", is_text=True),
        Column("strides", 0),
        Column("jumps", 0),
    ]
    rows: list[list[Value]] = []
    for day in days:
        for r in day.reviews:
            known = r.run.residual[r.run.has_state]
            strides = 0 if r.gait is None else sum(len(foot.starts_s) for foot in r.gait.strides.values())
            row: list[Value] = [day.name, r.name, r.image_sets, int(r.said_lost.sum()), int((~r.run.has_state).sum())]
            rows.append([*row, float(known.mean()) if len(known) else None, r.run.residual_unit, strides, len(r.jumps)])
    return Table("runs", "Runs", "", columns, rows)
