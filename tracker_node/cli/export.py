"""``tracker_node export``: a run in the files of other programs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from .arguments.run_images import named_file, refuse_to_overwrite

if TYPE_CHECKING:
    from ..evaluation.motion.export_options import ExportOptions
    from ..evaluation.motion.kinematics import StateKinematics
    from ..runs.motion import RunMotion

SUMMARY = "write a run as TRC, MOT, STO, C3D, BVH, TUM or CSV for other programs"
EXAMPLE = (
    "tracker_node export out/run --to trc --output run.trc\n"
    "  tracker_node export out/run --to csv --filter auto --isb-angles --output run_tables"
)
FORMATS = ("trc", "mot", "sto", "c3d", "bvh", "tum", "csv")
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
_LIMB_GAPS = ("trc", "c3d", "csv")  # formats that can leave out a single landmark


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("run", metavar="RUN",
        help="folder written by track_offline or pipeline, a folder smoothed in it, or a bag with tracked states")  # fmt: skip
    add("--to", choices=FORMATS, help="the format (default: by the output's suffix); csv writes several tables into a folder")
    add("-o", "--output", required=True, metavar="PATH", help="file to write (csv: folder)")
    add("--model", metavar="FILE", help="body model; default: what run.json names")
    add("--topic", help="topic of the states, where a bag has several")
    add("--force", action="store_true", help="overwrite the output; csv: also delete the tables of an earlier export")
    what = parser.add_argument_group("what goes in")
    what.add_argument("--landmarks", nargs="+", metavar="NAME", help="trc, c3d, csv: only these landmarks (default: all);"
        " bvh: joints of their own for these (default: none)")  # fmt: skip
    what.add_argument(
        "--marker-names", choices=("model", "openpose"),
        help="trc, c3d, csv: landmarks under the model's names (right_knee), or those of OpenPose and Pose2Sim (RKnee) where they"
        " have one",
    )  # fmt: skip
    what.add_argument(
        "--coordinates", choices=("model", "opensim"),
        help="mot, sto, csv: the model's degrees of freedom, or coordinates of OpenSim's models of a person (hip_flexion_r)",
    )  # fmt: skip
    what.add_argument("--isb-angles", action="store_true", help="c3d, csv: also joint angles after the ISB recommendations")
    what.add_argument("--link", metavar="NAME", help="tum: the link whose pose is written (default: the root)")
    what.add_argument(
        "--lost", choices=("gap", "limbs", "keep"), default="gap",
        help="states that are lost or still being looked for: a gap (default), or kept as they stand; limbs (trc, c3d,"
        " csv): landmarks and ISB angles of single limbs that are lost or not seen are gaps, too",
    )  # fmt: skip
    how = parser.add_argument_group("axes, units, rate")
    how.add_argument("--up", choices=("y", "z"), help="axis that points up (default: y for trc, mot, sto and bvh, else z)")
    how.add_argument(
        "--length", choices=("m", "cm", "mm"), help="trc, c3d, bvh, csv: unit of lengths (default: mm for c3d, else m)"
    )
    how.add_argument("--angle", choices=("deg", "rad"), help="mot, sto, c3d, csv: unit of angles (default: deg)")
    how.add_argument("--rate", type=float, metavar="HZ", help="resample to this rate (default: the run's)")
    how.add_argument(
        "--filter", metavar="HZ|auto", dest="cutoff",
        help="low-pass the states without lag (Butterworth, fourth order) at this cutoff, or each degree of freedom at the one"
        " that a residual analysis chooses; csv then also has velocities and accelerations",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    from ..loaders.model.model_yaml import load_model
    from ..runs.data import load_run
    from ..runs.motion import motion_of_run

    output = Path(args.output)
    args.to = _format_of(args.to, output)
    options = _options(args)
    if output.is_dir() and args.to == "csv":
        if any(output.iterdir()) and not args.force:
            raise _wrong("--output", "a folder that is empty or not there yet, or --force", args.output)
    else:
        refuse_to_overwrite(args, output)
    tracked = load_run(args.run, args.topic)
    model_path = named_file(args, tracked.info, "model")
    model = load_model(model_path)
    tracked.check_model(model, model_path)
    motion, notes = _prepared(args, motion_of_run(tracked, model, args.lost))
    kinematics = None
    if args.cutoff is not None:
        kinematics = _filtered(args.cutoff, motion)
        motion = kinematics.motion
        cutoffs = kinematics.cutoffs_hz
        notes.append(f"states filtered at {cutoffs.min():.3g} to {cutoffs.max():.3g} Hz")
    output.parent.mkdir(parents=True, exist_ok=True)
    notes += _write(args.to, motion, output, options, kinematics)
    _say(args, motion, options, notes)
    return 0


def _format_of(to: str | None, output: Path) -> str:
    """The format that is asked for by name, by the output's suffix, or by both alike.

    Raises
    ------
    FileFormatError : they contradict each other, or neither says one.
    """
    named = output.suffix.lower().removeprefix(".")
    if to is None and named not in FORMATS:
        raise _wrong("--to", f"one of {', '.join(FORMATS)}, or an output with such a suffix", f"-o {output}")
    if to is not None and named in FORMATS and to != named:
        raise _wrong("--to", f"the format that the output's suffix names, {named}, or another output", f"--to {to} -o {output}")
    return to or named


def _options(args: argparse.Namespace) -> ExportOptions:
    from ..evaluation.motion.export_options import ExportOptions

    y_up = (args.up or ("y" if args.to in _Y_UP or args.coordinates == "opensim" else "z")) == "y"
    for name, formats in _USED_BY.items():
        if getattr(args, name) and args.to not in formats:
            raise _wrong(f"--{name.replace('_', '-')}", f"{' or '.join(formats)} where it is given", f"--to {args.to}")
    if args.lost == "limbs" and args.to not in _LIMB_GAPS:
        raise _wrong("--lost", f"{' or '.join(_LIMB_GAPS)} where it is 'limbs'", f"--to {args.to}")
    if args.coordinates == "opensim" and not y_up:
        raise _wrong("--up", "y, as OpenSim's coordinates have it", "z")
    return ExportOptions(
        y_up=y_up,
        unit=args.length or ("mm" if args.to in _MILLIMETRES else "m"),
        degrees=args.angle != "rad",
        landmarks=tuple(args.landmarks or ()),
        openpose_names=args.marker_names == "openpose",
        link=args.link or "",
        opensim=args.coordinates == "opensim",
        isb_angles=args.isb_angles,
    )


def _prepared(args: argparse.Namespace, motion: RunMotion) -> tuple[RunMotion, list[str]]:
    """At a constant rate where the format, the filter or the user wants one; and what was done for that."""
    from ..evaluation.motion.export import AT_CONSTANT_RATE
    from ..runs.motion import at_constant_rate

    if args.rate is not None and not 0.0 < args.rate <= 1e6:
        raise _wrong("--rate", "a rate above 0 Hz", args.rate)
    if args.rate is None and args.cutoff is None and args.to not in AT_CONSTANT_RATE:
        return motion, []
    motion, done = at_constant_rate(motion, args.rate)
    return motion, [done]


def _filtered(cutoff: str, motion: RunMotion) -> StateKinematics:
    from ..evaluation.motion.kinematics import SHORTEST, state_kinematics

    try:
        found = state_kinematics(motion, None if cutoff == "auto" else float(cutoff))
    except ValueError as error:
        raise _wrong("--filter", "'auto' or a cutoff in Hz", f"{cutoff} ({error})") from None
    if not found.motion.valid.any():
        raise _wrong("--filter", f"a run with at least {SHORTEST} sets without a gap", f"shorter stretches ({len(motion)} sets)")
    return found


def _write(
    to: str, motion: RunMotion, output: Path, options: ExportOptions, kinematics: StateKinematics | None
) -> list[str]:
    from ..evaluation.motion.export import FORMATS as WRITERS
    from ..evaluation.motion.export_csv import tables, write_tables

    if to != "csv":
        return WRITERS[to](motion, output, options)
    found = tables(motion, options, kinematics)
    write_tables(motion, output, found)
    return ["tables: " + ", ".join(f"{table.name}.csv" for table in found)]


def _say(args: argparse.Namespace, motion: RunMotion, options: ExportOptions, notes: list[str]) -> None:
    missing = int((~motion.valid).sum())
    up, gaps = "y" if options.y_up else "z", f"{missing} of them without a state" if missing else "none without a state"
    units = [options.unit, *([options.angle_unit] if args.to in (*_USED_BY["angle"], "bvh") else [])]
    print(f"wrote {args.output}: {len(motion)} instant{'s' * (len(motion) != 1)}, {gaps}; {up} up, {', '.join(units)}")
    if motion.unknown_links is not None:
        limbs = motion.landmarks_valid()[motion.valid][:, options.columns(motion.model)]
        notes = [*notes, f"{int((~limbs).sum())} of {limbs.size} landmarks are gaps, since their limbs are lost or not seen"]
    for note in notes:
        print(f"  {note}", file=sys.stderr)


def _wrong(option: str, expected: str, got: object):
    from ..errors import FileFormatError

    return FileFormatError("command line", option, expected, got)
