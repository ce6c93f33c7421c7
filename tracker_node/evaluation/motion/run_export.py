"""A run written in the format of another program: options checked, motion prepared, file written.

CSV: a run's motion as tables for spreadsheets and pandas: one row per time step, empty cells in gaps.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from ...loaders.csv_file import CsvWriter, exact
from ...loaders.motion.trc import METERS_PER_UNIT
from ...loaders.whole_file import whole_file
from ...model.articulated import ArticulatedModel
from ...model.humans.masses import mass_center
from ...runs.data import RunData
from ...runs.motion import LOST, RunMotion, at_constant_rate, motion_of_run
from .coordinates import model_coordinates, opensim_coordinates
from .export import AT_CONSTANT_RATE, ExportOptions
from .export import FORMATS as WRITERS
from .isb_angles import isb_angles
from .kinematics import SHORTEST, StateKinematics, derivatives, state_kinematics

FORMATS = ("trc", "mot", "sto", "c3d", "bvh", "tum", "csv")
WHERE = "export"  # what a `FileFormatError` of these options names as the file
_Y_UP = ("trc", "mot", "sto", "bvh")  # formats whose readers expect y up
_MILLIMETRES = ("c3d",)
_USED_BY = {  # option -> formats that it says something about
    "landmarks": ("trc", "c3d", "bvh", "csv"),
    "marker_names": ("trc", "c3d", "csv"),
    "coordinates": ("mot", "sto", "csv"),
    "isb_angles": ("c3d", "csv"),
    "link": ("tum",),
    "length": ("trc", "c3d", "bvh", "csv"),
    "angle": ("mot", "sto", "c3d", "csv"),
}
_CHOICES = {  # option -> its values, beside None
    "marker_names": ("model", "openpose"),
    "coordinates": ("model", "opensim"),
    "lost": LOST,
    "up": ("y", "z"),
    "length": ("m", "cm", "mm"),
    "angle": ("deg", "rad"),
}
_LIMB_GAPS = ("trc", "c3d", "csv")  # formats that can leave out a single landmark


@dataclass(frozen=True)
class ExportRequest:
    """What of a run is written, and how; the defaults are those of the format.

    Parameters
    ----------
    landmarks : names; empty: all of the model (BVH: none).
    marker_names : "model", or "openpose" for the names of OpenPose and Pose2Sim.
    coordinates : "model", or "opensim" for coordinates of OpenSim's models of a person.
    isb_angles : also joint angles after the ISB, in C3D and CSV.
    link : whose pose is written to TUM files; empty: the root.
    lost : one of `runs.motion.LOST`.
    up : "y" or "z"; None: y for TRC, MOT, STO, BVH and OpenSim's coordinates, else z.
    length : "m", "cm" or "mm"; None: mm for C3D, else m.
    angle : "deg" or "rad"; None: deg.
    rate_hz : resample to this rate; None: the run's.
    filter_hz : cutoff of the low-pass filter; "auto": by residual analysis; None: no filter.
    """

    landmarks: tuple[str, ...] = ()
    marker_names: str | None = None
    coordinates: str | None = None
    isb_angles: bool = False
    link: str | None = None
    lost: str = "gap"
    up: str | None = None
    length: str | None = None
    angle: str | None = None
    rate_hz: float | None = None
    filter_hz: float | str | None = None

    def options(self, to: str) -> ExportOptions:
        """The options of a format.

        Raises
        ------
        FileFormatError : naming an option that the format has no use for, or a value that is not known.
        """
        for name, choices in _CHOICES.items():
            if getattr(self, name) not in (None, *choices):
                raise FileFormatError(WHERE, name, f"one of {', '.join(choices)}", getattr(self, name))
        for name, formats in _USED_BY.items():
            if getattr(self, name) and to not in formats:
                raise FileFormatError(WHERE, name, f"{' or '.join(formats)} where it is given", to)
        if self.lost == "limbs" and to not in _LIMB_GAPS:
            raise FileFormatError(WHERE, "lost", f"{' or '.join(_LIMB_GAPS)} where it is 'limbs'", to)
        y_up = (self.up or ("y" if to in _Y_UP or self.coordinates == "opensim" else "z")) == "y"
        if self.coordinates == "opensim" and not y_up:
            raise FileFormatError(WHERE, "up", "y, as OpenSim's coordinates have it", "z")
        return ExportOptions(
            y_up=y_up,
            unit=self.length or ("mm" if to in _MILLIMETRES else "m"),
            degrees=self.angle != "rad",
            landmarks=self.landmarks,
            openpose_names=self.marker_names == "openpose",
            link=self.link or "",
            opensim=self.coordinates == "opensim",
            isb_angles=self.isb_angles,
        )


@dataclass(frozen=True, eq=False)
class Exported:
    """What was written: the motion in the file, and what was changed or is missing in it, a sentence each."""

    motion: RunMotion
    options: ExportOptions
    notes: list[str]


def format_of(to: str | None, output: Path) -> str:
    """The format that is asked for by name, by the output's suffix, or by both alike.

    Parameters
    ----------
    to : one of `FORMATS`, or None.
    output : path of the file to write.

    Returns
    -------
    One of `FORMATS`.

    Raises
    ------
    FileFormatError : they contradict each other, or neither names one.
    """
    named = output.suffix.lower().removeprefix(".")
    if to is None and named not in FORMATS:
        raise FileFormatError(WHERE, "to", f"one of {', '.join(FORMATS)}, or an output with such a suffix", output)
    if to is not None and to not in FORMATS:
        raise FileFormatError(WHERE, "to", f"one of {', '.join(FORMATS)}", to)
    if to is not None and named in FORMATS and to != named:
        expected = f"the format that the output's suffix names, {named}, or another output"
        raise FileFormatError(WHERE, "to", expected, f"{to} for {output}")
    return to or named


def export_run(run: RunData, model: ArticulatedModel, output: Path, to: str, request: ExportRequest) -> Exported:
    """Write the motion of a run; folders above ``output`` are made, a file there is overwritten.

    Parameters
    ----------
    run, model : states, and the body that they are of.
    output : file; for CSV the folder of the tables.
    to : one of `FORMATS`.
    request : what is written.

    Returns
    -------
    What the file holds.

    Raises
    ------
    FileFormatError : an option that the format has no use for, or a run without a state.
    UnknownNameError : a landmark or a link that the body does not have.
    """
    options = request.options(to)
    motion, notes = _at_rate(motion_of_run(run, model, request.lost), to, request)
    kinematics = None
    if request.filter_hz is not None:
        kinematics = _filtered(motion, request.filter_hz)
        motion, cutoffs = kinematics.motion, kinematics.cutoffs_hz
        notes.append(f"states filtered at {cutoffs.min():.3g} to {cutoffs.max():.3g} Hz")
    output.parent.mkdir(parents=True, exist_ok=True)
    return Exported(motion, options, notes + _write(motion, output, to, options, kinematics))


def _at_rate(motion: RunMotion, to: str, request: ExportRequest) -> tuple[RunMotion, list[str]]:
    """At a constant rate where the format, the filter or the user wants one; and what was done for that."""
    rate_hz = request.rate_hz
    if rate_hz is not None and not 0.0 < rate_hz <= 1e6:
        raise FileFormatError(WHERE, "rate_hz", "a rate above 0 Hz", rate_hz)
    if rate_hz is None and request.filter_hz is None and to not in AT_CONSTANT_RATE:
        return motion, []
    motion, done = at_constant_rate(motion, rate_hz)
    return motion, [done]


def _filtered(motion: RunMotion, cutoff: float | str) -> StateKinematics:
    try:
        found = state_kinematics(motion, None if cutoff == "auto" else float(cutoff))
    except ValueError as error:
        raise FileFormatError(WHERE, "filter_hz", "'auto' or a cutoff in Hz", f"{cutoff} ({error})") from None
    if not found.motion.valid.any():
        expected = f"a run with at least {SHORTEST} sets without a gap"
        raise FileFormatError(WHERE, "filter_hz", expected, f"shorter stretches ({len(motion)} sets)")
    return found


def _write(motion: RunMotion, output: Path, to: str, options: ExportOptions, kinematics: StateKinematics | None) -> list[str]:
    if to != "csv":
        return WRITERS[to](motion, output, options)
    found = tables(motion, options, kinematics)
    write_tables(motion, output, found)
    return ["tables: " + ", ".join(f"{table.name}.csv" for table in found)]


_DERIVATIVES = ("velocities", "accelerations")
TABLES = (  # every name that a table can have
    "landmarks", *(f"landmark_{name}" for name in _DERIVATIVES), "coordinates", *(f"state_{name}" for name in _DERIVATIVES),
    "isb_angles", *(f"isb_angle_{name}" for name in _DERIVATIVES),
    "center_of_mass", *(f"center_of_mass_{name}" for name in _DERIVATIVES),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class MotionTable:
    """Columns (n, k) of one file, with their validity (n, k); their names end in their units."""

    name: str
    columns: tuple[str, ...]
    values: np.ndarray
    valid: np.ndarray


def write_tables(motion: RunMotion, folder: Path, tables: list[MotionTable]) -> None:
    """Write ``<name>.csv`` of each table: ``stamp_ns``, ``time_s`` since the first row, and the columns.

    Those of `TABLES` that are not among them are deleted: they would be of another export, maybe in other axes and units.

    Parameters
    ----------
    motion : its stamps and times.
    folder : is made.
    tables : with a row for each state of the motion.

    Raises
    ------
    OSError : not all of them can be written. Unless they could and only taking the places of the earlier ones failed, the
        folder is as it was.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:  # each takes the place of an earlier one when all are written, and on the disk
        for table in tables:
            _write_table(motion, table, stack.enter_context(whole_file(folder / f"{table.name}.csv")))
    for name in set(TABLES) - {table.name for table in tables}:
        (folder / f"{name}.csv").unlink(missing_ok=True)


def _write_table(motion: RunMotion, table: MotionTable, path: Path) -> None:
    with CsvWriter(path, ("stamp_ns", "time_s", *table.columns)) as writer:
        for stamp, time_s, values, good in zip(motion.stamps_ns, motion.times_s, table.values, table.valid, strict=True):
            cells = [exact(value) if ok else "" for value, ok in zip(values, good, strict=True)]
            writer.write_rows([[int(stamp), exact(time_s), *cells]])


def tables(motion: RunMotion, options: ExportOptions, kinematics: StateKinematics | None = None) -> list[MotionTable]:
    """Landmarks, a person's center of mass, coordinates, and on request angles after the ISB, with their derivatives.

    Velocities of the state are those of its tangent: angular velocity of the root about the file's axes.

    Parameters
    ----------
    motion : states over time; that of ``kinematics``, where there are any.
    options : axes, units, and what is written.
    kinematics : the filtered motion, whose derivatives are written too; None: no derivatives.

    Returns
    -------
    Of `TABLES`, those that are asked for.
    """
    return list(_tables(motion, options, kinematics))


def _tables(motion: RunMotion, options: ExportOptions, kinematics: StateKinematics | None) -> Iterator[MotionTable]:
    length, angle = 1.0 / METERS_PER_UNIT[options.unit], 180.0 / np.pi if options.degrees else 1.0
    points = (length * motion.landmarks_m()[:, options.columns(motion.model)] @ options.axes.T).reshape(len(motion), -1)
    names = [f"{label}_{axis}" for label in options.labels(motion.model) for axis in "xyz"]
    valid = np.repeat(motion.landmarks_valid()[:, options.columns(motion.model)], 3, axis=1)
    yield from _with_derivatives(motion, "landmark", "landmarks", names, [options.unit] * len(names), points, valid, kinematics)
    center = mass_center(motion.model.landmark_names, motion.landmarks_m() @ options.axes.T)
    if center is not None:
        known = np.repeat(np.asarray(motion.landmarks_valid().all(axis=1))[:, None], 3, axis=1)
        yield from _with_derivatives(
            motion, "center_of_mass", "center_of_mass", list("xyz"), [options.unit] * 3, length * center, known, kinematics
        )
    found = opensim_coordinates(motion) if options.opensim else model_coordinates(motion, options.y_up)
    scale = {"m": (options.unit, length), "rad": (options.angle_unit, angle)}
    columns = tuple(f"{name}_{scale[unit][0]}" for name, unit in zip(found.names, found.units, strict=True))
    whole = np.repeat(motion.valid[:, None], len(columns), axis=1)
    yield MotionTable("coordinates", columns, found.values * [scale[unit][1] for unit in found.units], whole)
    if kinematics is not None:
        yield from _state_derivatives(motion, options, kinematics, scale)
    if options.isb_angles:
        names, radians, valid = isb_angles(motion).columns()
        units = [options.angle_unit] * len(names)
        yield from _with_derivatives(motion, "isb_angle", "isb_angles", names, units, angle * radians, valid, kinematics)


def _state_derivatives(
    motion: RunMotion, options: ExportOptions, kinematics: StateKinematics, scale: dict[str, tuple[str, float]]
) -> Iterator[MotionTable]:
    chain = motion.model.chain
    units = [scale[unit] for unit in chain.dof_units]
    for name, values, per in (("velocities", kinematics.velocity, "s"), ("accelerations", kinematics.acceleration, "s2")):
        turned = values.copy()
        turned[:, :3], turned[:, 3:6] = values[:, :3] @ options.axes.T, values[:, 3:6] @ options.axes.T
        columns = tuple(f"{dof}_{unit}_per_{per}" for dof, (unit, _) in zip(chain.dof_names, units, strict=True))
        valid = np.repeat(motion.valid[:, None], len(columns), axis=1)
        yield MotionTable(f"state_{name}", columns, turned * [factor for _, factor in units], valid)


def _with_derivatives(
    motion: RunMotion,
    one: str,
    name: str,
    names: list[str],
    units: list[str],
    values: np.ndarray,
    valid: np.ndarray,
    kinematics: StateKinematics | None,
) -> Iterator[MotionTable]:
    pairs = list(zip(names, units, strict=True))
    yield MotionTable(name, tuple(f"{column}_{unit}" for column, unit in pairs), values, valid)
    if kinematics is None:
        return
    first, second, good = derivatives(values, motion.valid, motion.rate_hz)
    good = valid & good[:, None]
    yield MotionTable(f"{one}_velocities", tuple(f"{column}_{unit}_per_s" for column, unit in pairs), first, good)
    yield MotionTable(f"{one}_accelerations", tuple(f"{column}_{unit}_per_s2" for column, unit in pairs), second, good)
