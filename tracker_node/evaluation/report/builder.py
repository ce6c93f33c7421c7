"""The report of one or many runs: ``report.json``, ``report.html`` that needs nothing beside it, ``report.pdf``, CSV files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ...loaders.whole_file import write_whole
from ...model.configuration import ROOT_NAMES, variable_names
from ...model.humans.masses import mass_center
from ...render.palette import BLACK, CYCLE
from ...report.document import Block, Curve, Curves, Document, DocumentSection, Line, Pictures, file_name, write_figure_files
from ...report.html import render_html
from ...report.metrics_file import made_by, today, write_metrics
from ...report.pdf import write_pdf
from ..masks.silhouettes import Picture, contact_sheet
from ..motion.inverse_kinematics import write_coordinates
from ..pose_metrics import ROWS
from ..review import Review
from . import charts, kinematics, summary, tables
from .scene import scene
from .summary import Target

REPORT_JSON, REPORT_HTML, REPORT_PDF = "report.json", "report.html", "report.pdf"

MEANINGS = (
    ("Joint error (MPJPE)", "distance between tracked and true joint center, averaged over all joints and sets. The truth is"
     " interpolated linearly at the time of every set; sets outside its time are not judged."),
    ("Offset-free", "two ways of finding a joint center differ by an offset that is fixed in the body. The mean difference of"
     " every landmark is subtracted, in the axes of its own segment (of the parent for a landmark on a last segment, whose own"
     " turning is hardly observed). The same in world axes stands beside it: there an offset cannot turn with the body."),
    ("PA-MPJPE", "the joint error after every set has been moved, turned and resized onto its truth: joint angles alone."),
    ("PCK", "fraction of the joints within a distance of truth."),
    ("Lost", "is judged from truth: a tracker's own TRACKING does not count, its own LOST does."),
    ("NEES", "error squared over what the covariance says. Far above 1 the covariance is too small, far below too large."),
    ("IoU", "area common to both masks over area covered by either. The reference masks were made from the images alone."),
    ("Residual", "says how well the model explains the images, not how near it is to the truth."),
    ("Triangulated 2D detections", "where they serve as truth, are themselves off by 3 to 5 cm, and their bones change length:"
     " an error of that size says no more about the tracker."),
)  # fmt: skip


@dataclass(frozen=True)
class ReportOptions:
    """``targets`` by key without the run's name; ``figure_files``: also write every table and chart as CSV and JSON."""

    targets: Mapping[str, Target] = field(default_factory=dict)
    figure_files: bool = False
    pdf: bool = True


def write_report(
    output: str | Path,
    reviews: Sequence[Review],
    options: ReportOptions | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> dict[str, float | int]:
    """Write the report of one or many runs.

    Parameters
    ----------
    output : folder, which is made.
    reviews : the first run is the one that others are compared with.
    options : targets, and which files.
    progress : is given a sentence now and then.

    Returns
    -------
    All metrics by key.
    """
    options = options or ReportOptions()
    metrics = {key: value for review in reviews for key, value in review.metrics().items()}
    write_document(Path(output), _document_of(reviews, options.targets), metrics, options, progress)
    for review in reviews:
        if review.opensim is not None:
            name = "opensim.mot" if len(reviews) == 1 else f"opensim_{file_name(review.name)}.mot"
            write_coordinates(review.opensim, Path(output) / name)
    return metrics


def write_document(
    output: Path,
    document: Document,
    metrics: Mapping[str, float | int],
    options: ReportOptions,
    progress: Callable[[str], None] = lambda text: None,
) -> None:
    """Write ``report.json``, ``report.html``, and as the options say ``report.pdf`` and ``figures/``.

    Parameters
    ----------
    output : folder, which is made.
    document, metrics : what is written.
    options : which files.
    progress : is given a sentence now and then.
    """
    output.mkdir(parents=True, exist_ok=True)
    write_metrics(output / REPORT_JSON, metrics)
    progress("writing the page")
    write_whole(output / REPORT_HTML, render_html(document))
    if options.figure_files:
        progress("writing charts and tables")
        write_figure_files(output, document)
    if options.pdf:
        write_pdf(output / REPORT_PDF, document, progress)


def _document_of(reviews: Sequence[Review], targets: Mapping[str, Target]) -> Document:
    """The report of the runs as a document."""
    names = ", ".join(review.name for review in reviews)
    title = f"Comparison of {names}" if len(reviews) > 1 else f"Evaluation of {names}"
    sections = [
        DocumentSection(key, heading, kept)
        for key, heading, blocks in _sections(reviews, targets)
        if (kept := [b for b in blocks if b])
    ]
    problems = [f"{review.name}: {said}" if len(reviews) > 1 else said for review in reviews for said in review.problems]
    return Document(title, today(), _facts(reviews), list(dict.fromkeys(problems)), sections, MEANINGS, made_by())


def _facts(reviews: Sequence[Review]) -> list[tuple[str, str]]:
    """(label, text): first what all runs have in common."""
    each = [_facts_of(review) for review in reviews]
    if len(reviews) == 1:
        return each[0]
    common = [fact for fact in each[0] if all(fact in facts for facts in each)]
    own = [
        (f"{review.name}, {label}", text)
        for review, facts in zip(reviews, each, strict=True)
        for label, text in facts
        if (label, text) not in common
    ]
    return [*common, *own]


def _facts_of(review: Review) -> list[tuple[str, str]]:
    facts = list(review.sources.items())
    if review.joints is not None:
        lag, estimated = review.joints.lag_images, review.joints.lag_was_estimated
        how = "estimated: of all between -2 and 2 images it leaves the least offset-free error" if estimated else "as stated"
        facts.append(("lag", f"row i of the truth belongs to image i {lag:+.2f}, one constant for the run, {how}"))
        if review.joints.lost_limbs:
            facts.append(("lost limbs", ", ".join(review.joints.lost_limbs)))
    return facts


def _sections(reviews: Sequence[Review], targets: Mapping[str, Target]) -> Iterator[tuple[str, str, list[Block | None]]]:
    """(key, heading, blocks) in their order; what could not be measured is None."""
    yield "view", "The motion", [scene(reviews)]
    yield "curves", "Curves", [curves(reviews)]
    yield "events", "Events", _titled(reviews, [
        [kinematics.event_strips(r), kinematics.jump_table(r), kinematics.jump_chart(r), kinematics.gait_table(r),
         *kinematics.gait_charts(r)] for r in reviews
    ])  # fmt: skip
    yield "ranges", "Ranges and symmetry", _titled(reviews, [kinematics.range_tables(review) for review in reviews])
    yield "quality", "Quality", [
        charts.status_strips(reviews), tables.loss_table(reviews), *_each(reviews, charts.limb_strips),
        *charts.residual_charts(reviews), *_each(reviews, kinematics.opensim_chart), *_each(reviews, kinematics.opensim_table),
        *_titled(reviews, [list(charts.covariance_charts(review)) for review in reviews]),
        *_each(reviews, charts.nees_chart), *_each(reviews, tables.nees_table), *_each(reviews, charts.silhouette_chart),
    ]  # fmt: skip
    yield "joints", "Errors of joints", [
        charts.error_chart(reviews), charts.joint_bars(reviews), summary.comparison_table(reviews),
        *_each(reviews, tables.joint_table), *_each(reviews, charts.joint_map), charts.pck_chart(reviews),
        *_each(reviews, tables.offset_table),
    ]  # fmt: skip
    yield "dofs", "Errors of degrees of freedom", [summary.dof_comparison_table(reviews), *_each(reviews, tables.dof_table)]
    yield "segments", "Errors of segments", [
        *_each(reviews, tables.direction_table), *_each(reviews, tables.segment_table), *_each(reviews, tables.bone_table),
        *_each(reviews, charts.rigid_chart),
    ]  # fmt: skip
    yield "summary", "Figures", [
        summary.summary_table(reviews, targets), summary.parameter_table(reviews), tables.timing_table(reviews),
        *charts.effort_charts(reviews),
    ]  # fmt: skip
    yield "pictures", "Pictures", list(contact_sheets(reviews))


def _each(reviews: Sequence[Review], make: Callable[[Review], Block | None]) -> list[Block | None]:
    """A block per run, the run's name in its title where there are several."""
    return _titled(reviews, [[make(review)] for review in reviews])


def _titled(reviews: Sequence[Review], made: Sequence[Sequence[Block | None]]) -> list[Block | None]:
    found: list[Block | None] = []
    for review, blocks in zip(reviews, made, strict=True):
        several = len(reviews) > 1
        found += [replace(b, title=f"{b.title}: {review.name}") if several and b is not None else b for b in blocks]
    return found


_TRUTH = "truth"


def curves(reviews: Sequence[Review]) -> Curves:
    """Joint angles and their velocities, then every landmark and degree of freedom, of all runs and of the truth."""
    found: dict[tuple[str, str], Curve] = {}
    for i, review in enumerate(reviews):
        color = CYCLE[i % len(CYCLE)]
        for curve in (*_landmark_curves(review, color), *_dof_curves(review, color)):
            before = found.get((curve.group, curve.name))
            if before is not None:
                pairs = zip(before.panels, curve.panels, strict=True)
                filters = "; ".join(dict.fromkeys((before.filter, curve.filter)))
                panels = [(title, _together(a, b)) for (title, a), (_, b) in pairs]
                curve = Curve(curve.group, curve.name, curve.unit, panels, filters)
            found[curve.group, curve.name] = curve
    of_joints = [*kinematics.joint_curves(reviews), *kinematics.opensim_curves(reviews)]
    return Curves("curves", "Curves", _against(reviews), [*of_joints, *_compared_first(list(found.values()))])


def _against(reviews: Sequence[Review]) -> str:
    what = "Angles of joints (of people after the ISB) and their velocities, landmarks, and the model's degrees of freedom"
    if any(review.joints or review.states for review in reviews):
        return f"{what}; the last two against the truth."
    return f"{what}, of one run beside the other." if len(reviews) > 1 else f"{what}."


def _compared_first(curves: Sequence[Curve]) -> list[Curve]:
    """In each group those with truth before those without."""
    compared = {id(curve): any(line.label == _TRUTH for _, lines in curve.panels for line in lines) for curve in curves}
    groups = list(dict.fromkeys(curve.group for curve in curves))
    return sorted(curves, key=lambda curve: (groups.index(curve.group), not compared[id(curve)]))


def _together(lines: Sequence[Line], more: Sequence[Line]) -> list[Line]:
    """The truth, where one knows it, then all other lines; the truth of ``more`` serves beyond that of ``lines``."""
    truths = [line for line in (*lines, *more) if line.label == _TRUTH]
    rest = [line for line in (*lines, *more) if line.label != _TRUTH]
    return [_continued(*truths), *rest] if len(truths) == 2 else [*truths, *rest]


def _continued(a: Line, b: Line) -> Line:
    """``a``, and ``b`` before and after it, with breaks between them."""
    known = a.x[np.isfinite(a.y)]
    if not len(known):
        return b
    first, last = known[0], known[-1]
    pieces = [(b, b.x < first), (a, (a.x >= first) & (a.x <= last)), (b, b.x > last)]
    x = np.concatenate([[*line.x[part], line.x[part][-1]] for line, part in pieces if part.any()])
    y = np.concatenate([[*line.y[part], np.nan] for line, part in pieces if part.any()])
    return replace(a, x=x[:-1], y=y[:-1])


def _dof_curves(review: Review, color: str) -> Iterator[Curve]:
    names = variable_names(review.model)
    states, shown = review.states, {}
    if states is not None:
        shown = {key: states.names.index(ROWS.get(key, key)) for key in names if ROWS.get(key, key) in states.names}
    for k, name in enumerate(names):
        length = name in ROOT_NAMES[:3] or name in review.model.chain.slides
        y = review.variables[:, k] * (1e3 if length else np.degrees(1.0))
        lines = []
        if states is not None and name in shown:
            y = states.tracked[:, shown[name]]
            true = np.where(states.valid[:, shown[name]], states.truth[:, shown[name]], np.nan)
            lines = [Line(_TRUTH, *review.over_time(true), BLACK, 1.4, True)]
        lines.append(Line(review.name, *review.over_time(y), color))
        yield Curve("degrees of freedom", name.replace("_", " "), "mm" if length else "°", [("", lines)], review.treatment)


def _landmark_curves(review: Review, color: str) -> Iterator[Curve]:
    names, points = review.model.landmark_names, review.landmarks_m
    e, center = review.joints, mass_center(names, points)
    if center is not None:
        of_axes = ([Line(review.name, *review.over_time(1e3 * center[:, axis]), color)] for axis in range(3))
        yield Curve("landmarks", "center of mass", "mm", list(zip("xyz", of_axes, strict=True)), review.treatment)
    for m, name in enumerate(names):
        panels = []
        for axis in range(3):
            lines = []
            if e is not None and name in e.joints:
                j = e.joints.index(name)
                true = np.where(e.raw.valid[:, j], 1e3 * e.truth_m[:, j, axis], np.nan)
                lines.append(Line(_TRUTH, *review.over_time(true), BLACK, 1.4, True))
            lines.append(Line(review.name, *review.over_time(1e3 * points[:, m, axis]), color))
            panels.append(("xyz"[axis], lines))
        yield Curve("landmarks", name.replace("_", " "), "mm", panels, review.treatment)


_KINDS = (
    ("overlay", "Contact sheet", "The tracked body drawn into the images{rows}; left limbs blue, right limbs orange."),
    ("mask", "Target through mask", "What the images show where the body is said to be{rows}: there it shows itself alone."),
)


def contact_sheets(reviews: Sequence[Review]) -> Iterator[Pictures]:
    """The body over its images, and the images through its mask; side by side where runs show the same images."""
    alike = len({tuple((p.kind, p.camera, p.number) for p in review.pictures) for review in reviews}) == 1
    for kind, title, note in _KINDS:
        sheets = [contact_sheet([picture for picture in review.pictures if picture.kind == kind]) for review in reviews]
        if not any(sheets):
            continue
        if alike and len(reviews) > 1:
            columns = [
                [(f"{review.name}: {_caption(picture)}", picture.bgr) for row in sheet for picture in row]
                for review, sheet in zip(reviews, sheets, strict=True)
            ]
            side_by_side = note.format(rows=", a run a column")
            yield Pictures(kind, f"{title}, side by side", side_by_side, list(zip(*columns, strict=True)))
            continue
        for review, sheet in zip(reviews, sheets, strict=True):
            rows = [[(_caption(picture), picture.bgr) for picture in row] for row in sheet]
            if rows:
                of = f": {review.name}" if len(reviews) > 1 else ""
                yield Pictures(f"{kind}_{review.name}", f"{title}{of}", note.format(rows=", a time step a row"), rows)


def _caption(picture: Picture) -> str:
    return f"{picture.camera}, image {picture.number}"
