"""Summary of the report: metrics with their meaning, targets, and how runs differ."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from ...report.document import Cell, Column, Table, Value, sign_of
from ..review import Review

LOWER, HIGHER = -1, 1


@dataclass(frozen=True)
class Metric:
    """How a metric of the summary reads: ``key`` may end in ``*`` for a family; ``better`` is the sign of an improvement."""

    key: str
    title: str
    unit: str
    meaning: str
    digits: int = 1
    better: int = LOWER
    about: str = ""


MOTION, FOUND, TRUTH, SURE, TIME = QUESTIONS = (
    "How does the body move?", "Is it found in every image set?", "How near is it to the truth?",
    "How sure is it, and how well does it explain the images?", "How long does it take?",
)  # fmt: skip


def _about(question: str, *metrics: Metric) -> tuple[Metric, ...]:
    return tuple(replace(metric, about=question) for metric in metrics)


_REST = "All other metrics"
METRICS = (
    *_about(
        MOTION,
        Metric("cadence_per_min", "Cadence", "steps/min", "of somebody who walks", 1, 0),
        Metric("walking_speed_m_s", "Walking speed", "m/s", "of the pelvis over ground", 2, 0),
        Metric("stride_time_s_*", "Stride time", "s", "from touching the floor to touching it again, mean of a foot", 2, 0),
        Metric("stride_length_m_*", "Stride length", "m", "way of the heel", 2, 0),
        Metric("stance_percent_*", "Stance", "%", "part of the stride with the foot on the floor", 1, 0),
        Metric("contacts_*", "Contacts", "", "times that a foot is on the floor", 0, 0),
        Metric("contact_percent_*", "On the floor", "%", "part of the time in which a foot is known", 1, 0),
        Metric("jumps", "Jumps", "", "both feet off the floor, and the center of mass falls", 0, 0),
        Metric("jump_height_rise_m", "Jump height", "m", "rise of the center of mass from take-off to its highest, mean", 3, 0),
        Metric("jump_height_take_off_m", "… from take-off velocity", "m", "v² / 2g, mean", 3, 0),
        Metric("jump_height_air_m", "… from time in the air", "m", "g T² / 8, mean", 3, 0),
    ),
    *_about(
        FOUND,
        Metric("image_sets", "Image sets", "", "time steps that there should be a state for", 0, 0),
        Metric("judged_sets", "Judged sets", "", "of these, with truth at their time", 0, 0),
        Metric("lost_sets", "Lost sets", "", "no state, status LOST, or a joint 200 mm off; if smaller, as much of its size", 0),
        Metric("lost_limbs", "Lost limbs", "", "end joint more than 150 mm off for 5 sets running, or at the end", 0),
        Metric("losses", "Losses", "", "series of lost sets", 0),
        Metric(
            "reacquisition_s_median", "… until found again", "s", "from the first lost set to the first tracked one, median", 2
        ),
        Metric("not_reacquired", "… not found again", "", "losses that last until the truth or the run ends", 0),
        Metric(
            "sets_without_state", "Without a state", "", "the body had not been found yet, or there is no result for the set", 0
        ),
        Metric("said_lost_sets", "Said to be lost", "", "sets with status LOST", 0),
        Metric("said_degraded_sets", "Said to be degraded", "", "sets with status DEGRADED", 0),
        Metric("said_reacquisition_s_median", "… until found again", "s", "from LOST to another status, median", 2),
    ),
    *_about(
        TRUTH,
        Metric("mpjpe_mm", "Joint error (MPJPE)", "mm", "mean distance of all joints, lag taken out"),
        Metric("mpjpe_rms_mm", "… rms", "mm", "root of the mean square"),
        Metric("mpjpe_p95_mm", "… 95th percentile", "mm", "95 of 100 errors are at most so large"),
        Metric("mpjpe_max_mm", "… maximum", "mm", "the largest error of any joint in any set"),
        Metric("mpjpe_offset_free_mm", "… offset-free, segment", "mm", "one constant offset per landmark in its segment removed"),
        Metric("mpjpe_offset_free_world_mm", "… offset-free, world", "mm", "the same with offsets constant in the world"),
        Metric("mpjpe_no_lag_correction_mm", "… lag left in", "mm", "rows of the truth taken at the stamps as they are"),
        Metric("pa_mpjpe_mm", "PA-MPJPE", "mm", "each set moved, turned and resized onto its truth first"),
        Metric("pck_50mm", "PCK at 50 mm", "", "fraction of the joints within 50 mm of truth", 3, HIGHER),
        Metric("pck_150mm", "PCK at 150 mm", "", "fraction of the joints within 150 mm of truth", 3, HIGHER),
        Metric("pck_auc_150mm", "PCK, area to 150 mm", "", "mean fraction over thresholds from 0 to 150 mm", 3, HIGHER),
        Metric("segment_direction_deg", "Segment directions", "°", "angle between tracked and true line from joint to joint", 2),
        Metric("segment_angle_deg", "Segment orientations", "°", "angle between tracked and true frames of the segments", 2),
        Metric("joint_angle_deg", "Joint angles", "°", "size of the error of the joints' angles, mean", 2),
        Metric("root_5cm_5deg", "5 cm 5°", "", "fraction of the sets whose root is within both of truth", 3, HIGHER),
        Metric("add_mm", "ADD", "mm", "mean distance of the surface's points to where they are", 2),
        Metric("add_s_mm", "ADD-S", "mm", "the same to the nearest point of the surface", 2),
        Metric("lag_images", "Lag", "images", "constant delay of the images behind the truth", 2, 0),
        Metric("iou_*", "Silhouette IoU", "", "overlap of model mask and reference mask, 1 is perfect", 3, HIGHER),
    ),
    *_about(
        SURE,
        Metric(
            "landmark_nees", "NEES of landmarks", "", "squared error over what the covariance says: 1 where it is right", 2, 0
        ),
        Metric("landmark_nees_offset_free", "… offset-free", "", "the same without constant offsets in the segments", 2, 0),
        Metric("state_nees", "NEES of the state", "", "the same of all degrees of freedom together", 2, 0),
        Metric("residual_px", "Residual", "px", "rms distance of predicted and seen contours, all cameras", 2, 0),
        Metric("residual_px_*", "Residual", "px", "of one camera", 2, 0),
        Metric("residual_gray_levels", "Residual", "gray levels", "rms difference of colors or texture, all cameras", 2, 0),
        Metric("residual_gray_levels_*", "Residual", "gray levels", "of one camera", 2, 0),
        Metric("opensim_marker_rms_mm", "Markers of OpenSim", "mm", "rms distance to the landmarks, mean of the sets", 1, 0),
        Metric("opensim_marker_max_mm", "… largest", "mm", "of any marker in any set", 1, 0),
        Metric("bone_length_std_mm", "Bone lengths, spread", "mm", "standard deviation over the run, mean of the bones", 1, 0),
        Metric("truth_bone_length_std_mm", "… of the truth", "mm", "the truth's own inconstancy", 1, 0),
    ),
    *_about(
        TIME,
        Metric("iterations", "Iterations", "", "steps of the optimizer per set, mean", 2),
        Metric("total_ms_p50", "Time per image set", "ms", "median"),
        Metric("total_ms_p95", "… 95th percentile", "ms", ""),
        Metric("total_ms_p99", "… 99th percentile", "ms", "with the compilation of a first start, if the run begins with it"),
    ),
)


@dataclass(frozen=True)
class Target:
    """A bound for a metric: ``at_most`` or at least ``value``."""

    value: float
    at_most: bool

    def met_by(self, metric: float) -> bool:
        return metric <= self.value if self.at_most else metric >= self.value

    def __str__(self) -> str:
        return f"{'≤' if self.at_most else '≥'} {self.value:g}"


def parse_target(text: str) -> tuple[str, Target]:
    """``mpjpe_mm<=60`` or ``iou_cam03>=0.8``. Raises ValueError for anything else."""
    for sign, at_most in (("<=", True), (">=", False)):
        key, found, value = text.partition(sign)
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if found and key.strip() and math.isfinite(number):
            return key.strip(), Target(number, at_most)
    raise ValueError(f"expected KEY<=NUMBER or KEY>=NUMBER, got {text!r}")


def described(keys: Iterable[str]) -> list[tuple[Metric, str, str]]:
    """(metric, key, title) of the keys that `METRICS` describes, in its order."""
    found, keys = [], list(keys)
    for metric in METRICS:
        stem, family = metric.key.rstrip("*"), metric.key.endswith("*")
        for key in keys:
            if key.startswith(stem) if family else key == stem:
                found.append((metric, key, f"{metric.title} {key.removeprefix(stem)}" if family else metric.title))
    return found


def summary_table(reviews: Sequence[Review], targets: Mapping[str, Target]) -> Table:
    """All metrics by what they answer, those that `METRICS` does not describe last; differences to the first run.

    Parameters
    ----------
    reviews : one column each.
    targets : by key without the run's name.

    Returns
    -------
    A row a metric that any run has.
    """
    values = [_bare(review) for review in reviews]
    keys = described(dict.fromkeys(key for run in values for key in run))
    shown = {key for _, key, _ in keys}
    known = {key for run in values for key in run}
    for key in targets.keys() - shown:  # a target that nothing was measured for is missed
        asked = Metric(key, key, "", "" if key in known else "was not measured", 3, about=TRUTH)
        keys.insert(sum(metric.about in QUESTIONS[:3] for metric, _, _ in keys), (asked, key, key))
    others_too = sorted(known - shown - targets.keys())
    keys += [(Metric(key, key.replace("_", " "), "", "", 3, 0, _REST), key, key) for key in others_too]
    counts = Counter(metric.about for metric, _, _ in keys)
    parts = [(question, counts[question], question == _REST) for question in (*QUESTIONS, _REST) if counts[question]]
    others = [review.name for review in reviews[1:]]
    columns = [Column("metric", is_text=True), *(Column("value" if not others else review.name) for review in reviews)]
    if len(others) == 1:
        columns.append(Column("difference"))
    else:
        columns += [Column(name, group=f"difference to {reviews[0].name}") for name in others]
    columns += [Column("", is_text=True), *([Column("target")] if targets else [])]
    columns += [Column("meaning", is_text=True), Column("key", is_text=True)]
    alike = [all(run.get(key) == values[0].get(key) for key in ("image_sets", "judged_sets")) for run in values]
    rows = [_summary_row(metric, key, title, [run.get(key) for run in values], targets, alike) for metric, key, title in keys]
    if not others:
        rows = [[*row[:-1], Cell(f"{reviews[0].name}.{key}", "code")] for row, (_, key, _) in zip(rows, keys, strict=True)]
    note = "" if not others else f"Differences are to {reviews[0].name}; the word beside one says which way it is."
    if not all(alike):
        note += " Counts of runs with other numbers of image sets have none."
    return Table("summary", "Metrics", note, columns, rows, parts)


def _summary_row(
    metric: Metric, key: str, title: str, values: Sequence[float | None], targets: Mapping[str, Target], alike: Sequence[bool]
) -> list[Value]:
    """``alike``: which of the runs have as many image sets as the first, so that counts tell which is better."""
    target = targets.get(key)
    row: list[Value] = [title]
    for value in values:
        met = target is not None and value is not None and target.met_by(value)  # not-a-number meets nothing
        mark = "" if target is None else "good" if met else "bad"
        row.append(Cell(None if value is None else float(value), mark, metric.digits))
    for value, comparable in zip(values[1:], alike[1:], strict=True):
        compared = comparable or metric.digits > 0
        row.append(_difference(metric if compared else replace(metric, better=0), values[0], value))
    row += [metric.unit, *([str(target or "")] if targets else []), metric.meaning, Cell(key, "code")]
    return row


def _difference(metric: Metric, first: float | None, other: float | None) -> Cell:
    """Signed, with a word for which of the two is better; none where they do not differ at the metric's digits."""
    if first is None or other is None or not (math.isfinite(first) and math.isfinite(other)):
        return Cell(None)
    change = round(float(other) - float(first), metric.digits)
    text = f"{change:+z.{metric.digits}f}"
    if change == 0 or metric.better == 0:
        return Cell(text if change else f"{0:.{metric.digits}f}")
    better = change * metric.better > 0
    return Cell(f"{text} {'better' if better else 'worse'}", "better" if better else "worse")


def _bare(review: Review) -> dict[str, float | int]:
    return {key.removeprefix(f"{review.name}."): value for key, value in review.metrics().items()}


def comparison_table(reviews: Sequence[Review]) -> Table | None:
    """Mean error per joint of all runs, with differences to the first; None where there is nothing to compare."""
    judged = [(review, review.joints) for review in reviews if review.joints is not None]
    if len(judged) < 2:
        return None
    metric = Metric("", "", "mm", "")
    means = [dict(zip(joints.joints, joints.raw.per_joint_mm(), strict=True)) for _, joints in judged]
    names = list(dict.fromkeys(name for run in means for name in run))
    first = judged[0][0].name
    columns = [Column("joint", is_text=True), *(Column(review.name, group="mean error [mm]") for review, _ in judged)]
    columns += [Column(review.name, group=f"difference to {first}") for review, _ in judged[1:]]
    rows: list[list[Value]] = [
        [name.replace("_", " "), *(run.get(name) for run in means)]
        + [_difference(metric, means[0].get(name), run.get(name)) for run in means[1:]]
        for name in names
    ]
    return Table("joints_compared", "Joints compared", "", columns, rows)


def dof_comparison_table(reviews: Sequence[Review]) -> Table | None:
    """Rms error per degree of freedom of all runs, with differences to the first."""
    judged = [(review, review.states) for review in reviews if review.states is not None]
    if len(judged) < 2:
        return None
    rms = [{(n, u): s.spreads(k)[0].rms for k, (n, u) in enumerate(zip(s.names, s.units, strict=True))} for _, s in judged]
    names = list(dict.fromkeys(name for run in rms for name in run))
    columns = [Column("variable", is_text=True), Column("", is_text=True), *(Column(r.name, 2, "rms error") for r, _ in judged)]
    columns += [Column(r.name, 2, f"difference to {judged[0][0].name}") for r, _ in judged[1:]]
    metric = Metric("", "", "", "", 2)
    rows: list[list[Value]] = []
    for name in names:
        differences = [_difference(metric, rms[0].get(name), run.get(name)) for run in rms[1:]]
        rows.append([name[0].replace("_", " "), sign_of(name[1]), *(run.get(name) for run in rms), *differences])
    return Table("dofs_compared", "Degrees of freedom compared", "", columns, rows)


def parameter_table(reviews: Sequence[Review]) -> Table | None:
    """Tracker parameters in which the runs differ, of those that have a ``run.json``, which a recorder's bag alone has not."""
    both = [(review.name, review.run.info.get("parameters")) for review in reviews]
    known = {name: parameters for name, parameters in both if isinstance(parameters, dict)}
    names = dict.fromkeys(name for run in known.values() for name in run)
    rows: list[list[Value]] = [
        [name, *(str(run.get(name, "–")) for run in known.values())]
        for name in names
        if len({str(run.get(name)) for run in known.values()}) > 1
    ]
    columns = [Column("parameter", is_text=True), *(Column(name, is_text=True) for name in known)]
    return Table("parameters", "Parameters that differ", "", columns, rows) if rows else None
