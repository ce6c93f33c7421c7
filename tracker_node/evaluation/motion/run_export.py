"""A run written in the format of another program: options checked, motion prepared, file written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ...errors import FileFormatError
from ...model.articulated import ArticulatedModel
from ...runs.data import RunData
from ...runs.motion import LOST, RunMotion, at_constant_rate, motion_of_run
from .export import AT_CONSTANT_RATE, ExportOptions
from .export import FORMATS as WRITERS
from .export_csv import tables, write_tables
from .kinematics import SHORTEST, StateKinematics, state_kinematics

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
                raise wrong(name, f"one of {', '.join(choices)}", getattr(self, name))
        for name, formats in _USED_BY.items():
            if getattr(self, name) and to not in formats:
                raise wrong(name, f"{' or '.join(formats)} where it is given", to)
        if self.lost == "limbs" and to not in _LIMB_GAPS:
            raise wrong("lost", f"{' or '.join(_LIMB_GAPS)} where it is 'limbs'", to)
        y_up = (self.up or ("y" if to in _Y_UP or self.coordinates == "opensim" else "z")) == "y"
        if self.coordinates == "opensim" and not y_up:
            raise wrong("up", "y, as OpenSim's coordinates have it", "z")
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
        raise wrong("to", f"one of {', '.join(FORMATS)}, or an output with such a suffix", output)
    if to is not None and to not in FORMATS:
        raise wrong("to", f"one of {', '.join(FORMATS)}", to)
    if to is not None and named in FORMATS and to != named:
        raise wrong("to", f"the format that the output's suffix names, {named}, or another output", f"{to} for {output}")
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


def wrong(option: str, expected: str, got: object) -> FileFormatError:
    """The error of an option.

    Parameters
    ----------
    option : name of a field of `ExportRequest`, or ``to``.
    expected, got : as `FileFormatError` has them.

    Returns
    -------
    The error, to be raised.
    """
    return FileFormatError(WHERE, option, expected, got)


def _at_rate(motion: RunMotion, to: str, request: ExportRequest) -> tuple[RunMotion, list[str]]:
    """At a constant rate where the format, the filter or the user wants one; and what was done for that."""
    rate_hz = request.rate_hz
    if rate_hz is not None and not 0.0 < rate_hz <= 1e6:
        raise wrong("rate_hz", "a rate above 0 Hz", rate_hz)
    if rate_hz is None and request.filter_hz is None and to not in AT_CONSTANT_RATE:
        return motion, []
    motion, done = at_constant_rate(motion, rate_hz)
    return motion, [done]


def _filtered(motion: RunMotion, cutoff: float | str) -> StateKinematics:
    try:
        found = state_kinematics(motion, None if cutoff == "auto" else float(cutoff))
    except ValueError as error:
        raise wrong("filter_hz", "'auto' or a cutoff in Hz", f"{cutoff} ({error})") from None
    if not found.motion.valid.any():
        expected = f"a run with at least {SHORTEST} sets without a gap"
        raise wrong("filter_hz", expected, f"shorter stretches ({len(motion)} sets)")
    return found


def _write(
    motion: RunMotion, output: Path, to: str, options: ExportOptions, kinematics: StateKinematics | None
) -> list[str]:
    if to != "csv":
        return WRITERS[to](motion, output, options)
    found = tables(motion, options, kinematics)
    write_tables(motion, output, found)
    return ["tables: " + ", ".join(f"{table.name}.csv" for table in found)]
