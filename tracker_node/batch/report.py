"""One report over all trials: which were tracked, what was measured over them, and which stand out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import numpy as np

from ..evaluation.report.builder import ReportOptions, write_document
from ..evaluation.report.summary import Metric, described
from ..render.palette import BLUE, GREEN
from ..report.document import Bars, Block, Cell, Column, Document, DocumentSection, Table, Value
from ..report.metrics_file import made_by, today
from ..tracking.estimate import known_sets
from .work import FAILED_STATE, Outcome

FEWEST = 5  # trials, of fewer none stands out
STANDS_OUT = 3.5  # modified z-score, of Iglewicz and Hoaglin, How to Detect and Handle Outliers, 1993
_NAMED = 3  # trials at most that a note names, of more it counts them
_TO_SIGMA = 0.6745  # median absolute deviation of a normal distribution, in standard deviations

_MEANINGS = (
    ("SD", "standard deviation over trials, with n - 1."),
    ("Outlier", f"a trial more than {STANDS_OUT} times 1.48 median absolute deviations from the median of all, where there are"
     f" {FEWEST} or more; look at it before the means are used."),
    ("Range", "highest less lowest value of a joint's angle (or way) in a trial, as in its own report: of somebody who walks the"
     " mean over strides; sets that are lost left out."),
)  # fmt: skip


@dataclass(frozen=True)
class Spread:
    """A quantity over trials; ``outliers``: names of those that stand out."""

    n: int
    mean: float
    sd: float
    lowest: float
    highest: float
    outliers: tuple[str, ...]


def spread_over(values: Mapping[str, float | int | None]) -> Spread:
    """Mean and spread of a quantity over trials.

    Parameters
    ----------
    values : by the trial's name; None and not-a-number are left out.

    Returns
    -------
    The spread; not-a-number where no trial has a value, SD where only one has.
    """
    known = {name: float(value) for name, value in values.items() if value is not None and np.isfinite(value)}
    x = np.array(list(known.values()))
    if not len(x):
        return Spread(0, np.nan, np.nan, np.nan, np.nan, ())
    sd = float(x.std(ddof=1)) if len(x) > 1 else float("nan")
    return Spread(len(x), float(x.mean()), sd, float(x.min()), float(x.max()), _outliers(known))


def _outliers(values: Mapping[str, float]) -> tuple[str, ...]:
    """Names whose modified z-score is beyond `STANDS_OUT`."""
    x = np.array(list(values.values()))
    off = np.abs(x - np.median(x))
    scale = float(np.median(off)) or 1.2533 * _TO_SIGMA * float(off.mean())  # where most are alike, by the mean deviation
    if len(x) < FEWEST or scale <= 1e-9 * max(float(np.abs(x).max()), 1e-300):
        return ()
    return tuple(name for name, far in zip(values, _TO_SIGMA * off / scale > STANDS_OUT, strict=True) if far)


def write_batch_report(
    output: Path, outcomes: Sequence[Outcome], pdf: bool = True, progress: Callable[[str], None] = lambda text: None
) -> dict[str, float | int]:
    """Write ``report.json``, ``report.html`` and ``report.pdf`` of a batch.

    Parameters
    ----------
    output : its folder.
    outcomes : of its trials.
    pdf : write that, too.
    progress : is given a sentence now and then.

    Returns
    -------
    Metrics by key: counts, and mean and SD of each metric over trials.
    """
    metrics = _metrics(outcomes)
    write_document(output, _document(outcomes, output), metrics, ReportOptions(pdf=pdf), progress)
    return metrics


def _metrics(outcomes: Sequence[Outcome]) -> dict[str, float | int]:
    failed = sum(outcome.state == FAILED_STATE for outcome in outcomes)
    found: dict[str, float | int] = {"batch.trials": len(outcomes), "batch.failed": failed}
    for key in _keys(outcomes):
        spread = spread_over({outcome.name: outcome.metrics.get(key) for outcome in outcomes})
        found |= {f"batch.{key}_mean": spread.mean, f"batch.{key}_sd": spread.sd}
    return found


def _document(outcomes: Sequence[Outcome], output: Path) -> Document:
    tracked = [outcome for outcome in outcomes if outcome.state != FAILED_STATE]
    subjects = list(dict.fromkeys(outcome.subject for outcome in outcomes if outcome.subject))
    facts = [("trials", str(len(outcomes))), ("tracked", str(len(tracked))), ("failed", str(len(outcomes) - len(tracked)))]
    facts += [("subjects", ", ".join(subjects))] if subjects else []
    over = _over_trials(tracked, subjects)
    problems = [f"{outcome.name} failed: {outcome.reason}" for outcome in outcomes if outcome.state == FAILED_STATE]
    problems += [f"{outcome.name}: {problem}" for outcome in tracked for problem in outcome.problems]
    problems += _notes(tracked)
    by = sorted({outcome.version for outcome in tracked})
    if len(by) > 1:
        problems.append(f"Trials were tracked by versions {' and '.join(by)}: figures may differ for that alone (--again).")
    sections: list[tuple[str, str, list[Block | None]]] = [
        ("trials", "Trials", [_trial_table(outcomes, output), *_bars(tracked)]),
        ("over", "Over trials", [over]),
        ("ranges", "Ranges of motion", [_range_table(tracked, subjects)]),
    ]
    kept = [DocumentSection(key, title, blocks) for key, title, made in sections if (blocks := [b for b in made if b])]
    return Document(f"{len(outcomes)} trials", today(), facts, problems, kept, _MEANINGS, made_by())


def _notes(tracked: Sequence[Outcome]) -> list[str]:
    """What is worth knowing, once for all trials that it is said of."""
    of: dict[str, list[str]] = {}
    for outcome in tracked:
        for note in outcome.notes:
            of.setdefault(note, []).append(outcome.name)
    return [f"{', '.join(names) if len(names) <= _NAMED else f'{len(names)} trials'}: {note}" for note, names in of.items()]


def _keys(outcomes: Sequence[Outcome], body: str = "") -> list[str]:
    """Of all metrics that any trial has; those of a body without its name."""
    keys = (key for outcome in outcomes for key in outcome.metrics if key.startswith(_of(body)))
    return list(dict.fromkeys(key.removeprefix(_of(body)) for key in keys))


def _bodies(outcomes: Sequence[Outcome]) -> list[str]:
    """Names of all bodies; "" of one that is alone."""
    return list(dict.fromkeys(body for outcome in outcomes for body in outcome.by_body or ("",)))


def _of(body: str) -> str:
    """Before the keys of a body's metrics."""
    return f"{body}." if body else ""


def _described(outcomes: Sequence[Outcome]) -> list[tuple[Metric, str, str]]:
    """(metric, key, title) of what is known of each body, with its name where trials have several."""
    return [
        (metric, _of(body) + key, f"{body}: {title}" if body else title)
        for body in _bodies(outcomes) for metric, key, title in described(_keys(outcomes, body))
    ]  # fmt: skip


def _trial_table(outcomes: Sequence[Outcome], output: Path) -> Table:
    """A row a trial, and body: what became of it; its name leads to its report, or to its folder."""
    bodies = _bodies(outcomes)
    own = dict.fromkeys(key for body in bodies for key in _keys(outcomes, body))
    shown = [
        (metric, key, title)
        for metric, key, title in described(own)
        if key in ("lost_sets", "mpjpe_mm", "mpjpe_offset_free_mm", "said_lost_sets", "residual_px", "total_ms_p50")
    ]
    several = any(bodies)
    columns = [Column("trial", is_text=True), Column("subject", is_text=True), *[Column("body", is_text=True)] * several]
    columns += [Column("sets", 0), Column("tracking [%]")]
    columns += [Column(f"{title} [{metric.unit}]" if metric.unit else title, metric.digits) for metric, _, title in shown]
    columns += [Column("took [s]")]
    rows: list[list[Value]] = []
    for outcome in outcomes:
        failed = outcome.state == FAILED_STATE
        for body, counts in (outcome.by_body or {"": outcome.status_counts}).items():
            tracking = 100.0 * counts.get("TRACKING", 0) / n if (n := sum(counts.values())) else None
            folder = f"{outcome.name}/{body}/" if body else f"{outcome.name}/"
            page = f"{folder}report.html"
            link = "" if failed else quote(page if (output / page).is_file() else folder)
            mark = "bad" if failed or not known_sets(counts) else "warn" if outcome.problems or counts.get("LOST") else "good"
            row: list[Value] = [Cell(outcome.name, mark, link=link), outcome.subject, *[body] * several]
            row += [outcome.image_sets or None, tracking, *(_number(outcome.metrics.get(_of(body) + key)) for _, key, _ in shown)]
            rows.append([*row, outcome.wall_s])
    note = (
        "The folder of a trial, of its name, holds its bag, tables and run.json, and a report where the trial says what it is"
        " compared with. What is red has failed, or its body was in no set TRACKING or DEGRADED; what is orange has"
        " warnings above, or LOST sets."
    )
    return Table("trials", "Trials", note, columns, rows)


def _number(value: float | int | None) -> float | None:
    return None if value is None else float(value)


def _bars(tracked: Sequence[Outcome]) -> list[Block | None]:
    """How trials compare in what matters first: error where there is truth, else residual."""
    found: list[Block | None] = []
    rows = [(outcome, body) for outcome in tracked for body in outcome.by_body or ("",)]
    names = [f"{outcome.name} {body}".rstrip() for outcome, body in rows]
    for key, title, unit, color in (("mpjpe_mm", "Joint error", "mm", BLUE), ("residual_px", "Residual", "px", GREEN)):
        values = np.array([float(outcome.metrics.get(_of(body) + key) or np.nan) for outcome, body in rows])
        if np.isfinite(values).any():
            found.append(Bars(key, title, "", names, [(title, values, color)], f"{title} [{unit}]"))
    return found


def _over_trials(tracked: Sequence[Outcome], subjects: Sequence[str]) -> Table | None:
    """Mean and SD of the metrics over all trials, and over those of each subject."""
    known = _described(tracked)
    if not known:
        return None
    rows: list[list[Value]] = []
    for metric, key, title in known:
        values = {outcome.name: outcome.metrics.get(key) for outcome in tracked}
        spread = spread_over(values)
        if not spread.n:
            continue
        digits = max(metric.digits, 1)  # means of what is counted are no whole numbers
        rows.append([
            title, spread.n, *(Cell(value, digits=digits) for value in (spread.mean, spread.sd)),
            *(Cell(value, digits=metric.digits) for value in (spread.lowest, spread.highest)),
            *_by_subject(tracked, subjects, values, digits),
            metric.unit, Cell(", ".join(spread.outliers), "bad" if spread.outliers else ""),
        ])  # fmt: skip
    columns = [Column("metric", is_text=True), Column("n", 0), *(Column(name) for name in ("mean", "SD", "lowest", "highest"))]
    columns += [Column(title, group=subject) for subject in _of_several(subjects) for title in ("mean", "SD")]
    columns += [Column("", is_text=True), Column("outliers", is_text=True)]
    return Table("over", "Metrics over trials", "", columns, rows)


def _range_table(tracked: Sequence[Outcome], subjects: Sequence[str]) -> Table | None:
    """Range of each joint's angles in a trial, over trials."""
    names = dict.fromkeys(name for outcome in tracked for name in outcome.ranges)
    if not names:
        return None
    rows: list[list[Value]] = []
    for name in names:
        ends = {outcome.name: outcome.ranges[name] for outcome in tracked if name in outcome.ranges}
        widths = {trial: highest - lowest for trial, (lowest, highest) in ends.items()}
        spread, (lowest, highest) = spread_over(widths), np.mean(list(ends.values()), axis=0)
        rows.append([
            name.replace("_", " "), spread.n, spread.mean, spread.sd, float(lowest), float(highest),
            *_by_subject(tracked, subjects, widths, 1),
            Cell(", ".join(spread.outliers), "bad" if spread.outliers else ""),
        ])  # fmt: skip
    columns = [Column("angle", is_text=True), Column("n", 0), Column("range"), Column("SD"), Column("lowest"), Column("highest")]
    columns += [Column(title, group=subject) for subject in _of_several(subjects) for title in ("range", "SD")]
    columns += [Column("outliers", is_text=True)]
    note = "Degrees, for sliding joints meters; lowest and highest are means over trials."
    return Table("ranges", "Ranges of motion over trials", note, columns, rows)


def _of_several(subjects: Sequence[str]) -> Sequence[str]:
    return subjects if len(subjects) > 1 else ()


def _by_subject(
    tracked: Sequence[Outcome], subjects: Sequence[str], values: Mapping[str, float | int | None], digits: int
) -> list[Value]:
    """Mean and SD for each subject, where there are several."""
    found: list[Value] = []
    for subject in _of_several(subjects):
        spread = spread_over({o.name: values.get(o.name) for o in tracked if o.subject == subject})
        found += [Cell(spread.mean, digits=digits), Cell(spread.sd, digits=digits)]
    return found
