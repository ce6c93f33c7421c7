"""How a body moves: joint angles and velocities over time, ranges, symmetry, strides, feet on the floor, jumps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from ...render.palette import BLACK, BLUE, CYCLE, PURPLE, RED
from ...render.palette import SIDES as SIDE_COLORS
from ...report.document import Cell, Chart, Column, Curve, Line, Strip, Strips, Table, Value, sign_of
from ..motion.gait import N_PARTS, Strides
from ..motion.joint_motion import HANGS_DEG, Ranges, side_of, symmetry_index, without_side
from ..motion.jumps import SIDES
from ..review import Review

_ASKED = ("hip", "knee", "ankle", "spine", "neck", "shoulder", "elbow", "wrist")  # in this order, then others
ANGLES, VELOCITIES = "joint angles", "angular velocities"
STRIDE = "part of the stride [%]"
_STILL = 1e-2  # degrees, or meters: an angle that moves less is fixed
LEAST_RANGE_DEG = 1.0  # over the stride: an angle that moves less is not drawn
_STEP, _SWING = BLACK, "#c9d1d8"
_SYMMETRY = (
    "100 (L - R) / ((L + R) / 2) %, 0 where both sides are alike (Robinson, Herzog and Nigg 1987); none for means below 5°"
)
# Angles over the stride: those of the ISB, or of bodies without them of the model
STRIDE_ANGLES = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion", "hip_adduction", "hip_abduction")


def joint_curves(reviews: Sequence[Review]) -> Iterator[Curve]:
    """Every joint's angles, then every joint's velocities, both sides and all runs in one."""
    for group, per in ((ANGLES, ""), (VELOCITIES, "/s")):
        panels: dict[str, dict[str, list[Line]]] = {}
        units: dict[str, str] = {}
        for i, review in enumerate(reviews):
            found = review.joint_motion
            if found is None:
                continue
            for k, (joint, name) in enumerate(zip(found.joints, found.names, strict=True)):
                if not _moves(found.values[:, k]):
                    continue
                side, joint = side_of(joint), without_side(joint)
                values = (found.values if group == ANGLES else found.velocities)[:, k]
                label, color, dashed = _look(review.name, side, i, len(reviews))
                units.setdefault(joint, sign_of(found.units[k]))
                of = panels.setdefault(joint, {}).setdefault(_axis_of(joint, name), [])
                of.append(Line(label, found.times_s, values, color, 1.6, dashed))
        filters = "; ".join(dict.fromkeys(r.joint_motion.filter for r in reviews if r.joint_motion is not None))
        for joint, axes in sorted(panels.items(), key=lambda item: _ASKED.index(item[0]) if item[0] in _ASKED else len(_ASKED)):
            lines = [(axis, sorted(of, key=lambda line: line.label)) for axis, of in axes.items()]
            yield Curve(group, joint, f"{units[joint]}{per}", lines, filters)


def _moves(values: np.ndarray) -> bool:
    """Whether an angle is known, and one that the body has: a knee that is a hinge has no adduction."""
    known = values[np.isfinite(values)]
    return len(known) > 0 and float(np.ptp(known)) > _STILL


def _look(run: str, side: str, i: int, runs: int) -> tuple[str, str, bool]:
    """Label, color and dashes of a line: a color a side, or where there are several runs a color a run."""
    if runs == 1:
        return side or run, SIDE_COLORS.get(side, BLUE), False
    return f"{run}, {side}" if side else run, CYCLE[i % len(CYCLE)], side == "right"


def _axis_of(joint: str, name: str) -> str:
    words = without_side(name).replace("_", " ")
    return words.removeprefix(joint).strip() or words


def ranges_of(review: Review) -> dict[str, Ranges]:
    """Of all angles that move, or whose other side does."""
    found = review.joint_motion
    if found is None:
        return {}
    moving = {name for k, name in enumerate(found.names) if _moves(found.values[:, k])}
    return {name: one for name, one in review.ranges.items() if moving & {name, _other_side(name)}}


def range_tables(review: Review) -> list[Table]:
    """Ranges of motion and largest speeds, of both sides with symmetry, then of the trunk."""
    found = review.joint_motion
    if found is None or not found.names:
        return []
    walks, of = review.cycles is not None, ranges_of(review)
    paired = [name for name in dict.fromkeys(map(without_side, of)) if all(f"{side}_{name}" in of for side in SIDES)]
    single = [name for name in of if without_side(name) not in paired or not side_of(name)]
    over = "Mean and SD over the strides of a side, of the trunk those of the left foot." if walks else "Over the whole run."
    note = f"{over} Filter: {found.filter}."
    if any(name.endswith("shoulder_elevation") for name in of):
        note += f" An arm's plane of elevation and rotation are left out within {HANGS_DEG:.0f}° of hanging or straight up."
    made: list[Table] = []
    for key, title, per, measures in (
        ("ranges", "Ranges of motion", "", (("lowest", "lowest"), ("highest", "highest"), ("range", "widths"))),
        ("speeds", "Largest angular velocities", "/s", (("fastest", "fastest"),)),
    ):
        for single_key, names, sides in (("", paired, SIDES), ("single_", single, ("",))):
            columns = [Column("angle", is_text=True)]
            for side in sides:
                titles = [*(column for column, _ in measures), *(["SD"] if walks else [])]
                columns += [Column(column, 0 if per else 1, f"{side} [°{per}]".strip()) for column in titles]
            columns += [Column("symmetry [%]", 0)] if len(sides) == 2 else []
            rows: list[list[Value]] = []
            for name in names:
                own = [f"{side}_{name}" if side else name for side in sides]
                slides = found.units[found.names.index(own[0])] == "m"
                unit, factor = (f" [mm{per}]", 1e3) if slides else ("", 1.0)
                rows.append([name.replace("_", " ") + unit, *_range_row([of[each] for each in own], measures, walks, factor)])
            if rows:
                said = note if not made else ""
                said += f" Symmetry: {_SYMMETRY}." if len(sides) == 2 and not per else ""
                more = "" if len(sides) == 2 else ", joints without sides"
                made.append(Table(f"{single_key}{key}_{review.name}", f"{title}{more}", said, columns, rows))
    return made


def _other_side(name: str) -> str:
    side = side_of(name)
    return f"{SIDES[side == SIDES[0]]}_{without_side(name)}" if side else name


def _range_row(both: Sequence[Ranges], measures: Sequence[tuple[str, str]], walks: bool, factor: float) -> list[Value]:
    """Means of one side, or of both, times a factor; SD and symmetry of the last measure."""
    row: list[Value] = []
    last = measures[-1][1]
    for one in both:
        row += [factor * _mean(getattr(one, what)) for _, what in measures]
        row += [factor * _sd(getattr(one, last))] if walks else []
    if len(both) == 2:
        row.append(symmetry_index(_mean(getattr(both[0], last)), _mean(getattr(both[1], last))))
    return row


def _mean(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def _sd(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(known.std(ddof=1)) if len(known) > 1 else float("nan")


def event_strips(review: Review) -> Strips | None:
    """When each foot is on the floor, and swings of strides, and jumps; None where none of these is found."""
    strips = []
    for side, foot in review.contacts.items():
        strips += [Strip(f"{side} foot", each.start_s, each.end_s, "on the floor", _STEP) for each in foot.contacts]
        if review.gait is not None:
            swings = zip(review.gait.strides[side].offs_s, review.gait.strides[side].ends_s, strict=True)
            strips += [Strip(f"{side} foot", float(off), float(end), "swing", _SWING) for off, end in swings]
    strips += [Strip("jumps", jump.take_off_s, jump.landing_s, "in the air", PURPLE) for jump in review.jumps]
    rows = list(dict.fromkeys(strip.row for strip in strips))
    note = "Feet on the floor, swings of whole strides, and jumps."
    return Strips(f"events_{review.name}", "Events", note, rows, strips) if strips else None


def gait_table(review: Review) -> Table | None:
    """Measures of the strides of either foot, mean and standard deviation; None where nobody walks."""
    gait = review.gait
    if gait is None:
        return None
    rows: list[list[Value]] = []
    for title, unit, digits, of in STRIDE_MEASURES:
        values = [of(gait.strides[side]) for side in SIDES]
        means = [_mean(v) for v in values]
        row: list[Value] = [title]
        for mean, v in zip(means, values, strict=True):
            row += [Cell(mean, digits=digits), Cell(_sd(v), digits=digits)]
        rows.append([*row, Cell(means[0] / means[1], digits=2), symmetry_index(means[0], means[1], least=0.0), unit])
    counts = " and ".join(f"{len(gait.strides[side].starts_s)} of the {side} foot" for side in SIDES)
    steps = gait.metrics()["cadence_per_min"]
    note = (
        f"Whole ones: {counts}; {steps:.0f} steps a minute, {gait.speed_m_s:.2f} m/s over ground. A foot touches the floor where"
        " its heel is farthest before the pelvis, and leaves it where its toes are farthest behind (Zeni et al. 2008); 6 Hz"
        " low-pass. Symmetry index as below."
    )
    columns = [Column("measure", is_text=True)]
    columns += [Column(title, group=side) for side in SIDES for title in ("mean", "SD")]
    columns += [Column("left / right"), Column("symmetry [%]"), Column("", is_text=True)]
    return Table(f"gait_{review.name}", "Strides", note, columns, rows)


STRIDE_MEASURES: tuple[tuple[str, str, int, Callable[[Strides], np.ndarray]], ...] = (
    ("Stride time", "s", 2, lambda foot: foot.times_s),
    ("Step time", "s", 2, lambda foot: foot.steps_s),
    ("Stride length", "m", 2, lambda foot: foot.lengths_m),
    ("Stance", "%", 1, lambda foot: 100.0 * foot.stance),
)


def gait_charts(review: Review) -> list[Chart]:
    """Angles of the legs over the stride, means of both sides with one standard deviation; none where nobody walks."""
    gait, found = review.gait, []
    if gait is None:
        return []
    said = review.joint_motion.filter if review.joint_motion is not None else review.treatment
    for name in STRIDE_ANGLES:
        lines = []
        for side in SIDES:
            curves = gait.strides[side].angles.get(name)
            if curves is not None and np.ptp(curves.mean(axis=0)) >= LEAST_RANGE_DEG:
                lines.append(mean_line(side, curves, SIDE_COLORS[side]))
        if lines:
            title, note = name.replace("_", " ").capitalize(), "Mean and one standard deviation over strides."
            key = f"gait_{name}_{review.name}"
            found.append(Chart(key, title, note, STRIDE, "degrees", lines, y_min=None, filter=said))
    return found


def mean_line(label: str, curves: np.ndarray, color: str) -> Line:
    """Mean of curves (c, `N_PARTS`) over the stride, in a band of one standard deviation.

    Parameters
    ----------
    label : of the line.
    curves : one each stride.
    color : of the line.

    Returns
    -------
    A line; without a band where there is one curve alone.
    """
    spread = curves.std(axis=0, ddof=1) if len(curves) > 1 else None
    return Line(label, np.linspace(0.0, 100.0, N_PARTS), curves.mean(axis=0), color, 2.0, spread=spread)


_HEIGHTS = "rise of the center of mass [cm]", "from take-off velocity [cm]", "from time in the air [cm]"


def jump_table(review: Review) -> Table | None:
    """Every jump with its height in three ways; None without one."""
    if not review.jumps:
        return None
    columns = [Column("take-off [s]", 2), Column("in the air [s]", 2)]
    groups = (*_HEIGHTS, "velocity at take-off [m/s]", "falls at [m/s²]")
    columns += [Column(title, 1 if group in _HEIGHTS else 2, group) for group in groups for title in ("", "±")]
    rows: list[list[Value]] = []
    for jump in review.jumps:
        heights = [100.0 * value for pair in (jump.rise_m, jump.take_off_m, jump.air_m) for value in pair]
        rows.append([jump.take_off_s, jump.landing_s - jump.take_off_s, *heights, *jump.velocity_m_s, *jump.fall_m_s2])
    note = (
        "A jump is where both feet are off the floor and the center of mass (de Leva 1996) falls on a parabola. Rise: its highest"
        " point less its place at take-off; from velocity: v² / 2g; from time: g T² / 8, too high where one lands deeper than one"
        " took off (Linthorne 2001). ±: one standard deviation, of the instants (an image / √12, more where feet do not tell"
        " them), of what the parabola leaves, and of a fall at another rate. Far from 9.81 m/s²,"
        " the body's size or the rate is wrong."
    )
    return Table(f"jumps_{review.name}", "Jumps", note, columns, rows)


def jump_chart(review: Review) -> Chart | None:
    """Height of the center of mass, jumps shaded; None without one."""
    center = review.center_m
    if not review.jumps or center is None:
        return None
    line = Line("center of mass", center[0], 100.0 * center[1][:, 2], BLACK, 1.6)
    bands = [(jump.take_off_s, jump.landing_s) for jump in review.jumps]
    note = "Shaded: in the air."
    return Chart(
        f"center_{review.name}", "Height of the center of mass", note, y_label="[cm]", lines=[line], bands=bands, y_min=None,
        filter=review.treatment,
    )  # fmt: skip


_WEIGHED = (
    "Inverse kinematics of OpenSim's model {model}: {n} of our landmarks are its markers, weighing {how}. What is left says how"
    " well its size and joints suit the body; good models stay below 20 mm rms and 40 mm (Hicks et al. 2015)."
)


def opensim_table(review: Review) -> Table | None:
    """Distance of each marker of OpenSim's model to its landmark; None where that was not asked for."""
    found = review.opensim
    if found is None:
        return None
    columns = [Column("marker", is_text=True), *(Column(title) for title in ("rms [mm]", "mean [mm]", "maximum [mm]"))]
    rows: list[list[Value]] = []
    for marker, errors in zip(found.markers, 1e3 * found.errors_m.T, strict=True):
        known = errors[np.isfinite(errors)]
        figures = (float(np.sqrt(np.mean(known**2))), float(known.mean()), float(known.max())) if len(known) else (None,) * 3
        rows.append([marker.replace("_", " "), *figures])
    return Table(f"opensim_{review.name}", "Markers of OpenSim's model", "", columns, rows)


def opensim_chart(review: Review) -> Chart | None:
    """Residual of OpenSim's inverse kinematics over time."""
    found = review.opensim
    if found is None or not np.isfinite(found.errors_m).any():
        return None
    known = np.isfinite(found.errors_m).all(axis=1)
    worst = np.where(known, np.where(known[:, None], found.errors_m, 0.0).max(axis=1), np.nan)
    parts = (("rms of the markers", found.rms_m, BLUE), ("farthest marker", worst, RED))
    lines = [Line(label, *review.over_time(1e3 * values), color, 1.4) for label, values, color in parts]
    how = "the inverse squares of their standard deviations" if found.weighted else "all alike, for the run tells no covariances"
    return Chart(
        f"opensim_residual_{review.name}", "Residual of OpenSim's inverse kinematics",
        _WEIGHED.format(model=found.model, n=len(found.markers), how=how), y_label="[mm]", lines=lines, filter=review.treatment,
    )  # fmt: skip


def opensim_curves(reviews: Sequence[Review]) -> Iterator[Curve]:
    """Coordinates that OpenSim has found, of all runs whose models have them."""
    panels: dict[tuple[str, str], list[Line]] = {}
    for i, review in enumerate(reviews):
        if review.opensim is None:
            continue
        for name, unit, values in zip(review.opensim.coordinates, review.opensim.units, review.opensim.values.T, strict=True):
            scale, sign = (np.degrees(1.0), "°") if unit == "rad" else (1e3, "mm") if unit == "m" else (1.0, unit)
            line = Line(review.name, *review.over_time(scale * values), CYCLE[i % len(CYCLE)])
            panels.setdefault((name, sign), []).append(line)
    said = "; ".join(dict.fromkeys(review.treatment for review in reviews if review.opensim is not None))
    for (name, sign), lines in panels.items():
        yield Curve("coordinates of OpenSim", name.replace("_", " "), sign, [("", lines)], said)
