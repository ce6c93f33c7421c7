"""The tables of the report."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...report.document import Column, Table, Value, sign_of
from ..metrics import SPREAD_TITLES, Spread, intervals, spread_of
from ..review import PERCENTILES, Review


def joint_table(review: Review) -> Table | None:
    """Errors per joint, before and after the constant offset."""
    if review.joints is None:
        return None
    names = review.joints.joints
    rows: list[list[Value]] = [[name.replace("_", " "), *_both(*review.joint_spreads(j))] for j, name in enumerate(names)]
    rows.append(["all joints", *_both(*review.joint_spreads())])
    note = "Distance between tracked and true joint; the constant offset of each is fixed in its segment."
    return Table(f"joints_{review.name}", "Errors per joint [mm]", note, _spread_columns("joint"), rows)


def direction_table(review: Review) -> Table | None:
    """Errors of the lines from joint to joint: direction, and middle."""
    found = review.directions
    if found is None:
        return None
    columns = [Column("segment", is_text=True)]
    parts = (
        ("direction [°]", found.angle_deg), ("without offsets [°]", found.free_angle_deg),
        ("middle [mm]", found.middle_mm), ("without offsets [mm]", found.free_middle_mm),
    )  # fmt: skip
    for group, _ in parts:
        columns += [Column(title, group=group) for title in SPREAD_TITLES]
    rows: list[list[Value]] = []
    for b, (start, end) in enumerate(found.bones):
        spreads = [spread_of(values[:, b], found.valid[:, b]) for _, values in parts]
        rows.append([f"{start} – {end}".replace("_", " "), *(v for spread in spreads for v in spread.row)])
    note = "Lines between two joints. Directions do not see a turn about the line itself."
    return Table(f"segments_{review.name}", "Errors per segment, from joints", note, columns, rows)


def segment_table(review: Review) -> Table | None:
    """Errors of the segments' frames against true states."""
    found = review.segments
    if found is None:
        return None
    parts = (
        ("position [mm]", found.position_mm), ("without offset [mm]", found.free_position_mm),
        ("orientation [°]", found.angle_deg), ("without offset [°]", found.free_angle_deg),
    )  # fmt: skip
    columns = [Column("segment", is_text=True)]
    for group, _ in parts:
        columns += [Column(title, 2, group) for title in SPREAD_TITLES]
    rows: list[list[Value]] = []
    for k, name in enumerate(found.names):
        spreads = [spread_of(values[found.valid, k]) for _, values in parts]
        rows.append([name.replace("_", " "), *(v for spread in spreads for v in spread.row)])
    note = "Origin and axes of each segment's frame; the constant offset is one pose fixed in the segment."
    return Table(f"poses_{review.name}", "Errors per segment, from states", note, columns, rows)


def dof_table(review: Review) -> Table | None:
    """Errors per degree of freedom in the layout of the color paper's Table 1, then the same without the constant offset."""
    found = review.states
    if found is None:
        return None
    before, after = "as tracked", "without constant offset"
    titles = ("maximum", "rms", "mean", "p95")
    columns = [Column("variable", is_text=True), Column("range of motion", 0), Column("", is_text=True)]
    columns += [Column(title, 2, before) for title in titles]
    columns += [Column("offset", 2), *(Column(title, 2, after) for title in titles)]
    rows: list[list[Value]] = []
    for k, (name, unit) in enumerate(zip(found.names, found.units, strict=True)):
        raw, free = found.spreads(k)
        row: list[Value] = [name.replace("_", " "), found.range_of_motion(k), sign_of(unit), *_as_paper(raw)]
        rows.append([*row, found.offset(k), *_as_paper(free)])
    note = (
        "Rows, range of motion, maximum and rms as in Table 1 of Trewartha, Yeadon and Knight: position of the root, then its"
        " somersault, tilt and twist; below them the angles of the joints."
    )
    return Table(f"dofs_{review.name}", "Errors per degree of freedom", note, columns, rows)


def loss_table(reviews: Sequence[Review]) -> Table | None:
    """Every series of lost sets, in all and by the tracker's own word; None where there is none."""
    rows: list[list[Value]] = []
    for review in reviews:
        sources: list[tuple[str, np.ndarray, np.ndarray, np.ndarray | None]] = []
        if review.joints is not None:
            sources.append(("in all", *review.lost_over_time()))
        sources.append(("tracker's own", review.times_s, review.said_lost, None))
        for by, times, lost, known in sources:
            for loss in intervals(lost, known):
                first, last = float(times[loss.first]), float(times[loss.last])
                end = "" if loss.ended else "not found again"
                rows.append([review.name, by, first, last, round((last - first) / review.period_s) + 1, end])
    columns = [Column("run", is_text=True), Column("lost", is_text=True), Column("from [s]", 2), Column("to [s]", 2)]
    columns += [Column("image sets", 0), Column("", is_text=True)]
    note = "Times since image 0. In all: without a state, by the tracker's own word, or by truth."
    return Table("losses", "Lost intervals", note, columns, rows) if rows else None


def timing_table(reviews: Sequence[Review]) -> Table | None:
    """Percentiles of the milliseconds per stage; None where no run has them."""
    rows: list[list[Value]] = []
    for review in reviews:
        for stage, values in review.timings.items():
            rows.append([review.name, stage, *map(float, np.percentile(values, PERCENTILES)), float(values.max()), len(values)])
    columns = [Column("run", is_text=True), Column("stage", is_text=True), *(Column(f"p{p} [ms]", 2) for p in PERCENTILES)]
    columns += [Column("max [ms]", 2), Column("image sets", 0)]
    note = "observe: images to evidence; optimize: evidence to state; total: image set to finished estimate, searches included."
    return Table("timing", "Time per stage", note, columns, rows) if rows else None


def nees_table(review: Review) -> Table | None:
    """NEES of every landmark, with bounds."""
    raw, free = review.landmark_nees, review.landmark_nees_free
    if raw is None or free is None:
        return None
    columns = [Column("landmark", is_text=True)]
    for group in ("as tracked", "without constant offset"):
        columns += [Column(title, 2, group) for title in ("mean", "low", "high")] + [Column("", group=group, is_text=True)]
    rows: list[list[Value]] = []
    for j, name in enumerate(raw.names):
        cells: list[Value] = [name.replace("_", " ")]
        for series in (raw, free):
            mean, (low, high) = float(series.means[j]), map(float, series.bounds[j])
            cells += [mean, low, high, _consistent(mean, low, high)]
        rows.append(cells)
    note = (
        "A third of e' P⁻¹ e: 1 where the covariance is right. Low and high are the 95 % bounds of the mean, for as many"
        " independent image sets as the errors of this run come to. The errors of the truth count too."
    )
    return Table(f"nees_table_{review.name}", "Covariance consistency per landmark", note, columns, rows)


def offset_table(review: Review) -> Table | None:
    """Constant offsets of the joints."""
    e = review.joints
    if e is None:
        return None
    columns = [Column("joint", is_text=True), Column("segment", is_text=True), *(Column(f"{axis} [mm]") for axis in "xyz")]
    columns.append(Column("length [mm]"))
    rows: list[list[Value]] = [
        [joint.replace("_", " "), frame, *map(float, offset), float(np.linalg.norm(offset))]
        for joint, frame, offset in zip(e.joints, e.offset_frames, 1e3 * e.offsets_m, strict=True)
    ]
    note = (
        "Tracked minus true position, mean over the run, in the axes of the segment named: what the offset-free metrics leave"
        " out, the difference between two opinions on where a joint center lies."
    )
    return Table(f"offsets_{review.name}", "Constant offsets", note, columns, rows)


def bone_table(review: Review) -> Table | None:
    """Lengths of the bones, tracked and true, with their spread."""
    if review.joints is None or not review.joints.bones.bones:
        return None
    b = review.joints.bones
    columns = [Column("bone", is_text=True), Column("mean", group="tracked [mm]"), Column("spread", group="tracked [mm]")]
    columns += [Column("mean", group="truth [mm]"), Column("spread", group="truth [mm]")]
    values = zip(b.bones, b.estimate_mean_mm, b.estimate_std_mm, b.truth_mean_mm, b.truth_std_mm, strict=True)
    rows: list[list[Value]] = [[f"{start} – {end}".replace("_", " "), *map(float, numbers)] for (start, end), *numbers in values]
    note = "A rigid body keeps its lengths; what varies in the truth is the truth's own noise. Spread: standard deviation."
    return Table(f"bones_{review.name}", "Bone lengths", note, columns, rows)


def _spread_columns(what: str) -> list[Column]:
    groups = ("as tracked", "without constant offset")
    return [Column(what, is_text=True), *(Column(title, group=group) for group in groups for title in SPREAD_TITLES)]


def _both(raw: Spread, free: Spread) -> list[float]:
    return [*raw.row, *free.row]


def _as_paper(spread: Spread) -> tuple[float, float, float, float]:
    return spread.max, spread.rms, spread.mean, spread.p95


def _consistent(mean: float, low: float, high: float) -> str:
    if not math.isfinite(mean):
        return ""
    return "within" if low <= mean <= high else "too sure" if mean > high else "too cautious"
