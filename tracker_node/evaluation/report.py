"""``report.json`` and one ``report.html`` that needs nothing beside it."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path

import cv2
import jinja2
import numpy as np

from .evaluate import Evaluation
from .metrics_file import command_line, cpu, versions, write_metrics
from .plots import all_plots
from .silhouettes import Picture, contact_sheet

REPORT_JSON, REPORT_HTML = "report.json", "report.html"


@dataclass(frozen=True)
class Figure:
    """How a figure of the summary reads: ``key`` may end in ``*`` for a family; ``unit`` is shown behind the value."""

    key: str
    title: str
    unit: str
    meaning: str
    digits: int = 1


FIGURES = (
    Figure("image_sets", "Image sets", "", "instants that there should be a state for", 0),
    Figure("judged_sets", "Judged sets", "", "of these, with truth at their instant", 0),
    Figure("lost_sets", "Lost sets", "", "no state, status LOST, or any joint more than 200 mm from truth", 0),
    Figure("lost_limbs", "Lost limbs", "", "end joint more than 150 mm off for 5 sets running, or at the end", 0),
    Figure("mpjpe_mm", "Joint error (MPJPE)", "mm", "mean distance of all joints, lag taken out"),
    Figure("mpjpe_offset_free_mm", "… offset-free, segment", "mm", "one constant offset per landmark in its segment removed"),
    Figure("mpjpe_offset_free_world_mm", "… offset-free, world", "mm", "the same with offsets constant in the world"),
    Figure("mpjpe_no_lag_correction_mm", "… lag left in", "mm", "rows of the truth taken at the stamps as they are"),
    Figure("lag_images", "Lag", "images", "constant delay of the images behind the truth", 2),
    Figure("iou_*", "Silhouette IoU", "", "overlap of model mask and reference mask, 1 is perfect", 3),
    Figure("residual_px", "Residual", "px", "rms distance of predicted and seen contours, all cameras", 2),
    Figure("residual_px_*", "Residual", "px", "of one camera", 2),
    Figure("iterations", "Iterations", "", "steps of the optimizer per set, mean", 2),
    Figure("bone_length_std_mm", "Bone lengths, spread", "mm", "standard deviation over the run, mean of the bones"),
    Figure("truth_bone_length_std_mm", "… of the truth", "mm", "the truth's own inconstancy"),
)


@dataclass(frozen=True)
class Target:
    """A bound for a figure: ``at_most`` or at least ``value``."""

    value: float
    at_most: bool

    def met_by(self, figure: float) -> bool:
        return figure <= self.value if self.at_most else figure >= self.value

    def __str__(self) -> str:
        return f"{'≤' if self.at_most else '≥'} {self.value:g}"


def parse_target(text: str) -> tuple[str, Target]:
    """``mpjpe_mm<=60`` or ``iou_cam03>=0.8``. Raises ValueError for anything else."""
    for sign, at_most in (("<=", True), (">=", False)):
        key, found, value = text.partition(sign)
        if found:
            return key.strip(), Target(float(value), at_most)
    raise ValueError(f"expected KEY<=NUMBER or KEY>=NUMBER, got {text!r}")


@dataclass(frozen=True)
class ReportContext:
    """What stands around the figures: sources by label, and what could not be shown."""

    sources: Mapping[str, str]
    problems: Sequence[str] = ()
    targets: Mapping[str, Target] | None = None  # by key without the name


def write_report(
    output: str | Path, evaluation: Evaluation, pictures: Sequence[Picture], context: ReportContext
) -> dict[str, float | int]:
    """Write ``report.json`` and ``report.html`` into the folder ``output``, and return the figures."""
    output = Path(output)
    output.mkdir(parents=True, exist_ok=True)
    figures = evaluation.metrics()
    write_metrics(output / REPORT_JSON, figures)
    (output / REPORT_HTML).write_text(render_html(evaluation, pictures, context), encoding="utf-8")
    return figures


def render_html(evaluation: Evaluation, pictures: Sequence[Picture], context: ReportContext) -> str:
    """The page, with every plot and picture inside."""
    source = files(__package__).joinpath("templates/report.html.j2").read_text(encoding="utf-8")
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined)
    return environment.from_string(source).render(
        name=evaluation.name,
        summary=summary_rows(evaluation, context.targets or {}),
        plots=[(title, text, _data_uri("image/svg+xml", svg.encode())) for title, text, svg in all_plots(evaluation)],
        offsets=_offset_rows(evaluation),
        sheet=_sheet(pictures),
        lost_limbs=evaluation.lost_limbs,
        lag=evaluation.lag_images,
        lag_was_estimated=evaluation.lag_was_estimated,
        sources=context.sources,
        problems=context.problems,
        command=command_line(),
        versions=versions(),
        cpu=cpu(),
        made=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    )


@dataclass(frozen=True)
class SummaryRow:
    """One line of the summary; ``light`` is good, bad or none (no target)."""

    title: str
    key: str
    value: str
    unit: str
    target: str
    light: str
    meaning: str


def summary_rows(evaluation: Evaluation, targets: Mapping[str, Target]) -> list[SummaryRow]:
    """The figures that `FIGURES` describes, in its order, then targets for others."""
    values = {key.removeprefix(f"{evaluation.name}."): value for key, value in evaluation.metrics().items()}
    rows = []
    for figure in FIGURES:
        family = figure.key.endswith("*")
        stem = figure.key.rstrip("*")
        for key in [k for k in values if (k.startswith(stem) if family else k == figure.key)]:
            title = f"{figure.title} {key.removeprefix(stem)}" if family else figure.title
            rows.append(_summary_row(figure, f"{evaluation.name}.{key}", title, values[key], targets.get(key)))
    shown = {row.key for row in rows}
    for key, target in targets.items():  # a target that nothing was measured for is missed
        if f"{evaluation.name}.{key}" not in shown:
            other = Figure(key, key, "", "" if key in values else "was not measured", 3)
            rows.append(_summary_row(other, f"{evaluation.name}.{key}", key, values.get(key, math.nan), target))
    return rows


def _summary_row(figure: Figure, key: str, title: str, value: float, target: Target | None) -> SummaryRow:
    known = math.isfinite(value)
    light = "none" if target is None else "good" if known and target.met_by(value) else "bad"
    text = f"{value:.{figure.digits}f}" if known else "–"
    return SummaryRow(title, key, text, figure.unit, str(target or ""), light, figure.meaning)


def _offset_rows(e: Evaluation) -> list[tuple[str, str, list[str], str]]:
    """(joint, segment, x y z, length) in millimetres."""
    rows = []
    for joint, frame, offset in zip(e.joints, e.offset_frames, 1e3 * e.offsets_m, strict=True):
        rows.append((joint, frame, [f"{v:z.0f}" for v in offset], f"{np.linalg.norm(offset):.0f}"))
    return rows


def _sheet(pictures: Sequence[Picture]) -> list[list[tuple[str, str, str]]]:
    """(caption, data URI, width over height) in rows."""
    rows = []
    for row in contact_sheet(pictures):
        cells = []
        for picture in row:
            ok, data = cv2.imencode(".jpg", picture.bgr, [cv2.IMWRITE_JPEG_QUALITY, 80])
            if ok:
                aspect = f"{picture.bgr.shape[1] / picture.bgr.shape[0]:.4f}"
                uri = _data_uri("image/jpeg", data.tobytes())
                cells.append((f"{picture.camera}, image {picture.number}", uri, aspect))
        rows.append(cells)
    return rows


def _data_uri(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"
