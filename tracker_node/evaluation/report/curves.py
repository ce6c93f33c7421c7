"""The curves and the pictures of the report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...model.configuration import ROOT_NAMES, variable_names
from ...report.document import BLACK, CYCLE, Curve, Curves, Line, Pictures
from ..masks.silhouettes import Picture, contact_sheet
from ..review import Review
from ..state_errors import ROWS
from ..truth.states import unwrapped

_TRUTH = "truth"


def curves(reviews: Sequence[Review]) -> Curves:
    """Every degree of freedom and every landmark over time, of all runs and of the truth."""
    found: dict[tuple[str, str], Curve] = {}
    for i, review in enumerate(reviews):
        color = CYCLE[i % len(CYCLE)]
        for curve in (*_dof_curves(review, color), *_landmark_curves(review, color)):
            before = found.get((curve.group, curve.name))
            if before is not None:
                pairs = zip(before.panels, curve.panels, strict=True)
                curve = Curve(curve.group, curve.name, curve.unit, [(title, _together(a, b)) for (title, a), (_, b) in pairs])
            found[curve.group, curve.name] = curve
    return Curves("curves", "Curves", _against(reviews), _compared_first(list(found.values())))


def _against(reviews: Sequence[Review]) -> str:
    what = "Every degree of freedom and every landmark"
    if any(review.joints or review.states for review in reviews):
        return f"{what}, against the truth."
    return f"{what}, of one run beside the other." if len(reviews) > 1 else f"{what}."


def _compared_first(curves: Sequence[Curve]) -> list[Curve]:
    """Groups with truth before those without, and so within each."""
    compared = {id(curve): any(line.label == _TRUTH for _, lines in curve.panels for line in lines) for curve in curves}
    groups = {curve.group for curve in curves if compared[id(curve)]}
    return sorted(curves, key=lambda curve: (curve.group not in groups, not compared[id(curve)]))


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
    values = unwrapped(review.run.values)
    for k, name in enumerate(names):
        length = name in ROOT_NAMES[:3]
        y = values[:, k] * (1e3 if length else np.degrees(1.0))
        lines = []
        if states is not None and name in shown:
            y = states.tracked[:, shown[name]]
            true = np.where(states.valid[:, shown[name]], states.truth[:, shown[name]], np.nan)
            lines = [Line(_TRUTH, *review.over_time(true), BLACK, 1.4, True)]
        lines.append(Line(review.name, *review.over_time(y), color))
        yield Curve("degrees of freedom", name.replace("_", " "), "mm" if length else "°", [("", lines)])


def _landmark_curves(review: Review, color: str) -> Iterator[Curve]:
    names = review.model.landmark_names
    points = np.full((len(review.run), len(names), 3), np.nan)
    for i in np.flatnonzero(review.run.has_state):
        points[i] = review.run.configuration(review.model, int(i)).landmarks_world
    e = review.joints
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
        yield Curve("landmarks", name.replace("_", " "), "mm", panels)


def contact_sheets(review: Review) -> Iterator[Pictures]:
    """The body over its images, and the images through its mask."""
    kinds = (
        (
            "overlay",
            "Contact sheet",
            "The tracked body drawn into the images, a time step a row; left limbs blue, right limbs orange.",
        ),
        ("mask", "Target through mask", "What the images show where the body is said to be: in its place it shows itself alone."),
    )
    for kind, title, note in kinds:
        rows = contact_sheet([picture for picture in review.pictures if picture.kind == kind])
        if rows:
            captioned = [[(_caption(picture), picture.bgr) for picture in row] for row in rows]
            yield Pictures(f"{kind}_{review.name}", title, note, captioned)


def _caption(picture: Picture) -> str:
    return f"{picture.camera}, image {picture.number}"
