"""``tracker_node export``: a run in the files of other programs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from .arguments.run_images import named_file, refuse_to_overwrite

if TYPE_CHECKING:
    from ..errors import FileFormatError
    from ..evaluation.motion.run_export import Exported

SUMMARY = "write a run as TRC, MOT, STO, C3D, BVH, TUM or CSV for other programs"
EXAMPLE = (
    "tracker_node export out/run --to trc --output run.trc\n"
    "  tracker_node export out/run --to csv --filter auto --isb-angles --output run_tables"
)
FORMATS = ("trc", "mot", "sto", "c3d", "bvh", "tum", "csv")  # of `evaluation.motion.run_export`, which takes long to import
_ANGLES = ("mot", "sto", "c3d", "csv", "bvh")  # formats that hold angles
_OPTIONS = {"rate_hz": "--rate", "filter_hz": "--filter"}  # the others are named as the fields are


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("run", metavar="RUN",
        help="folder written by track or pipeline, a folder smoothed in it, or a bag with tracked states")  # fmt: skip
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
        help="states that are lost or not found yet: a gap (default), or kept as they stand; limbs (trc, c3d,"
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
    from ..errors import FileFormatError
    from ..evaluation.motion.run_export import WHERE, ExportRequest, export_run, format_of
    from ..loaders.model.model_yaml import load_model
    from ..runs.load import load_run

    output = Path(args.output)
    try:
        to = format_of(args.to, output)
        request = ExportRequest(
            landmarks=tuple(args.landmarks or ()),
            marker_names=args.marker_names,
            coordinates=args.coordinates,
            isb_angles=args.isb_angles,
            link=args.link,
            lost=args.lost,
            up=args.up,
            length=args.length,
            angle=args.angle,
            rate_hz=args.rate,
            filter_hz=args.cutoff,
        )
        request.options(to)
        if output.is_dir() and to == "csv":
            if any(output.iterdir()) and not args.force:
                expected = "a folder that is empty or not there yet, or --force"
                raise FileFormatError("command line", "--output", expected, args.output)
        else:
            refuse_to_overwrite(args, output)
        tracked = load_run(args.run, args.topic)
        model_path = named_file(args, tracked.info, "model")
        model = load_model(model_path)
        tracked.check_model(model, model_path)
        _say(args.output, to, export_run(tracked, model, output, to, request))
    except FileFormatError as error:
        raise _on_the_command_line(error, args) if error.file == WHERE else error from None
    return 0


def _on_the_command_line(error: FileFormatError, args: argparse.Namespace) -> FileFormatError:
    """The same error, with the option under the name that it has here."""
    from ..errors import FileFormatError

    option = _OPTIONS.get(error.field, f"--{error.field.replace('_', '-')}")
    got = error.got
    if option == "--to":
        got = f"--to {args.to} -o {args.output}" if args.to else f"-o {args.output}"
    return FileFormatError("command line", option, error.expected, got)


def _say(output: str, to: str, written: Exported) -> None:
    motion, options, notes = written.motion, written.options, written.notes
    missing = int((~motion.valid).sum())
    up, gaps = "y" if options.y_up else "z", f"{missing} of them without a state" if missing else "none without a state"
    units = [options.unit, *([options.angle_unit] if to in _ANGLES else [])]
    print(f"wrote {output}: {len(motion)} time step{'s' * (len(motion) != 1)}, {gaps}; {up} up, {', '.join(units)}")
    if motion.unknown_links is not None:
        limbs = motion.landmarks_valid()[motion.valid][:, options.columns(motion.model)]
        notes = [*notes, f"{int((~limbs).sum())} of {limbs.size} landmarks are gaps, since their limbs are lost or not seen"]
    for note in notes:
        print(f"  {note}", file=sys.stderr)
