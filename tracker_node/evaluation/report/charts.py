"""The charts of the report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...model.kinematic_chain import N_ROOT_DOF
from ...render.palette import BLACK, BLUE, CYCLE, GREEN, ORANGE, RED, STATES
from ...report.document import Bars, Chart, HeatMap, Line, Strip, Strips, strips_of
from ...tracking.estimate import LimbStatus, Status
from .. import pose_metrics
from ..metrics import LOST_JOINT_M
from ..motion.joint_motion import UNFILTERED
from ..review import Review

STATUS_COLORS = {status: STATES[status.name.lower()] for status in Status}
LIMB_COLORS = {status: STATES[status.name.lower()] for status in LimbStatus}
TRUTH_COLORS = {"near": STATES["tracking"], "lost": STATES["lost"], "no truth": STATES["unseen"]}


def status_strips(reviews: Sequence[Review]) -> Strips:
    """What every tracker said of itself, and what the truth says."""
    rows: list[str] = []
    strips: list[Strip] = []
    colors = {status.name.lower(): color for status, color in STATUS_COLORS.items()}
    for review in reviews:
        before = f"{review.name}: " if len(reviews) > 1 else ""
        if review.joints is not None:
            rows.append(f"{before}in all")
            strips += _judged_strips(rows[-1], review)
        rows.append(f"{before}tracker's own")
        own = [Status(int(status)).name.lower() for status in review.run.status]
        strips += strips_of(rows[-1], own, review.times_s, review.period_s, colors)
    note = (
        "What the tracker says of itself. In all, a set is lost without a state, where the tracker says so, or with a joint more"
        " than 200 mm from truth; of smaller bodies that are no people, as much of their size."
    )
    return Strips("status", "Status", note, rows, strips)


def _judged_strips(row: str, review: Review) -> list[Strip]:
    """Lost, near, or without truth; a set without any state is lost."""
    times, lost, known = review.lost_over_time()
    said = np.where(lost, "lost", np.where(known, "near", "no truth"))
    found: list[Strip] = []
    for strip in strips_of(row, said.tolist(), times, review.period_s, TRUTH_COLORS):
        joined = bool(found) and found[-1].label == strip.label  # a gap, of which only the ends are among the times
        found[-1:] = [replace(found[-1], end=strip.end)] if joined else [*found[-1:], strip]
    return found


def limb_strips(review: Review) -> Strips | None:
    """Status of every limb over time; None for a run without details."""
    details = review.run.details
    if details is None or not details.limbs:
        return None
    colors = {status.name.lower(): color for status, color in LIMB_COLORS.items()}
    strips: list[Strip] = []
    rows = [limb.replace("_", " ") for limb in details.limbs]
    for row, numbers in zip(rows, details.limb_status.T, strict=True):
        labels = [LimbStatus(int(number)).name.lower() for number in numbers]
        strips += strips_of(row, labels, review.times_s, review.period_s, colors)
    note = "What the tracker says of each limb, named by its last link: the angles of a lost one must not be used."
    return Strips(f"limbs_{review.name}", "Limbs", note, rows, strips)


def error_chart(reviews: Sequence[Review]) -> Chart | None:
    """Mean and worst joint of every set."""
    judged = [(i, review, review.joints) for i, review in enumerate(reviews) if review.joints is not None]
    lines: list[Line] = []
    for i, review, joints in judged:
        color, name = CYCLE[i % len(CYCLE)], f"{review.name}: " if len(reviews) > 1 else ""
        errors = np.where(joints.raw.valid, 1e3 * joints.raw.errors_m, -np.inf).max(axis=1)
        worst = np.where(np.isfinite(errors), errors, np.nan)
        lines.append(Line(f"{name}mean", *review.over_time(joints.raw.per_set_mm()), color, 2.0))
        lines.append(Line(f"{name}worst joint", *review.over_time(worst), RED if len(reviews) == 1 else color, 1.0, True))
        if len(reviews) == 1:
            lines.append(Line("mean without offsets", *review.over_time(joints.offset_free.per_set_mm()), GREEN, 1.2))
    bands = _lost_bands(judged[0][1]) if len(reviews) == 1 and judged else []
    top = max((float(np.nanmax(line.y, initial=0.0)) for line in lines), default=0.0)
    lost_mm = 1e3 * LOST_JOINT_M * max((joints.length_scale for _, _, joints in judged), default=1.0)
    levels = [(lost_mm, "a joint beyond this loses the set")] if top > 0.5 * lost_mm else []
    note = "Distance to truth." + (" Shaded: lost sets." if bands else "")
    return (
        Chart(
            "errors",
            "Joint error over time",
            note,
            y_label="error [mm]",
            lines=lines,
            bands=bands,
            levels=levels,
            filter=_treatment(reviews),
        )
        if lines
        else None
    )


def _lost_bands(review: Review) -> list[tuple[float, float]]:
    return [(strip.start, strip.end) for strip in _judged_strips("", review) if strip.label == "lost"]


def joint_bars(reviews: Sequence[Review]) -> Bars | None:
    """Mean error of every joint: of one run with and without offsets, of several as tracked."""
    judged = [(i, review, review.joints) for i, review in enumerate(reviews) if review.joints is not None]
    if not judged:
        return None
    names = list(dict.fromkeys(joint for _, _, joints in judged for joint in joints.joints))
    if len(reviews) == 1:
        e = judged[0][2]
        parts = (("as tracked", e.raw, BLUE), ("without offset, in the segment", e.offset_free, GREEN),
                 ("without offset, in the world", e.offset_free_world, ORANGE))  # fmt: skip
        series = [(label, errors.per_joint_mm(), color) for label, errors, color in parts]
    else:
        series = []
        for i, review, joints in judged:
            of = dict(zip(joints.joints, joints.raw.per_joint_mm(), strict=True))
            series.append((review.name, np.array([of.get(name, np.nan) for name in names]), CYCLE[i % len(CYCLE)]))
    note = "Mean distance to truth. A constant offset is a matter of where a joint sits on the body, not of tracking."
    return Bars("joint_errors", "Joint error per joint", note, [n.replace("_", " ") for n in names], series, "mean error [mm]")


def joint_map(review: Review) -> HeatMap | None:
    """Error of every joint in every set."""
    e = review.joints
    if e is None or not e.raw.valid.any():
        return None
    times, errors = review.over_time(np.where(e.raw.valid, 1e3 * e.raw.errors_m, np.nan))
    top = max(5.0, float(np.nanpercentile(errors, 99)))
    rows = [joint.replace("_", " ") for joint in e.joints]
    return HeatMap(
        f"joint_map_{review.name}",
        "Every joint over time",
        "Blank where there is no truth, or no state.",
        times,
        rows,
        errors,
        "error [mm]",
        top,
    )


def pck_chart(reviews: Sequence[Review]) -> Chart | None:
    """Fraction of the joints within a distance of truth, over that distance."""
    thresholds = np.linspace(0.0, 0.3, 121)
    lines: list[Line] = []
    for i, review in enumerate(reviews):
        e = review.joints
        if e is None:
            continue
        color, name = CYCLE[i % len(CYCLE)], f"{review.name}: " if len(reviews) > 1 else ""
        parts = ((f"{name}as tracked", e.raw, False), (f"{name}without offsets", e.offset_free, True))
        for label, errors, dashed in parts:
            lines.append(
                Line(label, 1e3 * thresholds, pose_metrics.pck(errors.errors_m, errors.valid, thresholds), color, 1.8, dashed)
            )
    note = "Percentage of correct keypoints: fraction of all judged joints that lie within a distance of truth."
    return Chart("pck", "PCK", note, "distance [mm]", "fraction", lines, y_max=1.0, filter=_treatment(reviews)) if lines else None


def residual_charts(reviews: Sequence[Review]) -> Iterator[Chart]:
    """Rms residual: of all cameras, and of each camera of every run."""
    units = " or ".join(sorted({review.run.residual_unit for review in reviews}))
    note = "Distance of the predicted contours from those seen, or difference of colors, after the fit."
    whole = [_line(i, review, review.run.residual, reviews) for i, review in enumerate(reviews)]
    if len(reviews) > 1:
        yield Chart("residuals", "Residuals", note, y_label=f"rms [{units}]", lines=whole, filter=UNFILTERED)
    for review in reviews:
        run, name = review.run, f" of {review.name}" if len(reviews) > 1 else ""
        seen = np.where(run.camera_residuals > 0, run.camera_residuals, np.nan)
        lines = [Line(camera, *review.over_time(seen[:, i]), CYCLE[i % len(CYCLE)], 1.1) for i, camera in enumerate(run.cameras)]
        lines.append(Line("all cameras", *review.over_time(run.residual), BLACK, 2.0))
        yield Chart(
            f"residuals_{review.name}",
            f"Residuals{name} per camera",
            note,
            y_label=f"rms [{run.residual_unit}]",
            lines=lines,
            filter=UNFILTERED,
        )


def effort_charts(reviews: Sequence[Review]) -> Iterator[Chart]:
    """Iterations and milliseconds per set."""
    counts = [np.where(review.run.has_state, review.run.iterations, np.nan) for review in reviews]
    lines = [_line(i, review, counts[i], reviews) for i, review in enumerate(reviews)]
    yield Chart(
        "iterations", "Iterations", "Steps of the optimizer per image set.", y_label="iterations", lines=lines, filter=UNFILTERED
    )
    lines = []
    for i, review in enumerate(reviews):
        if review.run.details is None:
            continue
        stages = range(3) if len(reviews) == 1 else (2,)
        for stage in stages:
            name = ("observe", "optimize", "total")[stage] if len(reviews) == 1 else review.name
            color = CYCLE[i % len(CYCLE)] if len(reviews) > 1 else (CYCLE[5], GREEN, BLACK)[stage]
            lines.append(Line(name, *review.over_time(review.run.details.timings_ms[:, stage]), color, 1.3))
    if lines:
        yield Chart(
            "times",
            "Time per image set",
            "Wall-clock; logarithmic.",
            y_label="[ms]",
            lines=lines,
            y_min=None,
            log_y=True,
            filter=UNFILTERED,
        )


def nees_chart(review: Review) -> Chart | None:
    """NEES over time, of landmarks (mean over them) and of the state."""
    lines, levels = [], [(1.0, "right")]
    parts = (("landmarks, mean", review.landmark_nees, BLUE), ("landmarks without offsets", review.landmark_nees_free, GREEN),
             ("state", review.state_nees, ORANGE))  # fmt: skip
    for label, series, color in parts:
        if series is not None:
            known = np.isfinite(series.values)
            values = np.where(known, series.values, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
            lines.append(Line(label, *review.over_time(np.where(known.any(axis=1), values, np.nan)), color, 1.3))
    if review.state_nees is not None:
        low, high = review.state_nees.set_bounds
        levels += [(low, "95 % bound of single states"), (high, "95 % bound of single states")]
    note = "Squared error over what the covariance says; above 1 the tracker is too sure of itself, below it too cautious."
    return (
        Chart(
            f"nees_{review.name}",
            "Consistency over time",
            note,
            y_label="NEES / n",
            lines=lines,
            levels=levels,
            y_min=None,
            log_y=True,
            filter=review.treatment,
        )
        if lines
        else None
    )


def silhouette_chart(review: Review) -> Chart | None:
    """Intersection over union over the images, per camera."""
    scores = review.silhouettes
    if not scores.ious:
        return None
    kinds = ", ".join(f"{camera}: {kind}" for camera, kind in scores.kind.items())
    lines = [
        Line(
            camera,
            np.array(scores.numbers[camera], dtype=float),
            np.array(ious),
            CYCLE[i % len(CYCLE)],
            1.5,
            points=len(ious) < 20,
        )
        for i, (camera, ious) in enumerate(scores.ious.items())
    ]
    note = f"Agreement of the model's mask with reference masks ({kinds})."
    return Chart(
        f"iou_{review.name}", "Silhouettes", note, "image", "intersection over union", lines, y_max=1.0, filter=review.treatment
    )


def rigid_chart(review: Review) -> Chart | None:
    """ADD and ADD-S over time."""
    if review.rigid is None:
        return None
    parts = (("ADD", review.rigid.add_mm, BLUE), ("ADD-S", review.rigid.add_s_mm, GREEN))
    lines = [Line(label, *review.over_time(values), color) for label, values, color in parts]
    note = "Mean distance of the surface's points to where they are, and to the nearest point."
    return Chart(f"add_{review.name}", "Rigid body", note, y_label="[mm]", lines=lines, filter=review.treatment)


def covariance_charts(review: Review) -> Iterator[Chart]:
    """What the tracker says of its own uncertainty: standard deviations of joint angles, and of the pelvis' place."""
    details, units = review.run.details, review.model.chain.dof_units
    if details is None:
        return
    variances = np.diagonal(details.covariances, axis1=1, axis2=2).astype(float)
    known = review.run.has_state & (variances > 0.0).any(axis=1)
    if not known.any():
        return
    sd = np.where(known[:, None], np.sqrt(np.maximum(variances, 0.0)), np.nan)
    turning = [k for k in range(N_ROOT_DOF, len(units)) if units[k] == "rad"]
    note = "One standard deviation, as the tracker states it; a limb that is hidden is known less and less."
    if turning:
        degrees = np.degrees(sd[:, turning])
        parts = (("median of the joints", np.median(degrees, axis=1), BLUE), ("least known joint", degrees.max(axis=1), RED))
        lines = [Line(label, *review.over_time(values), color, 1.3) for label, values, color in parts]
        yield Chart(
            f"angle_sd_{review.name}", "Uncertainty of joint angles", note, y_label="SD [°]", lines=lines, filter=review.treatment
        )
    lines = [Line(axis, *review.over_time(1e3 * sd[:, k]), CYCLE[k], 1.3) for k, axis in enumerate("xyz")]
    yield Chart(
        f"root_sd_{review.name}", "Uncertainty of the root's place", note, y_label="SD [mm]", lines=lines, filter=review.treatment
    )


def _treatment(reviews: Sequence[Review]) -> str:
    return "; ".join(dict.fromkeys(review.treatment for review in reviews))


def _line(i: int, review: Review, values: np.ndarray, reviews: Sequence[Review]) -> Line:
    return Line(review.name, *review.over_time(values), CYCLE[i % len(CYCLE)] if len(reviews) > 1 else BLUE, 1.4)
