"""``tracker_node rig check``: what is wrong with a rig, from a few seconds of its images."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

SUMMARY = (
    "say what is wrong with a rig, from a few seconds of images in which something moves; exit status 1 if anything is, 3 if"
    " nothing was found but the cameras could not be compared"
)
EXAMPLE = "tracker_node rig check rig.yaml videos/cam01.mp4 videos/cam02.mp4 --output out/check"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("rig", metavar="RIG", help="rig.yaml")
    parser.add_argument(
        "inputs",
        metavar="INPUT",
        nargs="*",
        help="a bag, or a video or image folder for each camera in the order of the rig, or camera=source (default: the"
        " rig's own sources)",
    )
    parser.add_argument("--seconds", type=float, default=4.0, metavar="S", help="how much is processed (default: %(default)s)")
    parser.add_argument(
        "-o", "--output", default="rig_check", metavar="DIR", help="folder for an image per camera, index.html and"
        " findings.json (default: %(default)s)",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    from ...doctor.diagnosis import examine
    from ...doctor.input import record, with_inputs
    from ...doctor.report import JSON, write_examination
    from ...errors import SourceError
    from ...loaders.rig.rig_yaml import load_rig

    if not 0.0 < args.seconds <= 600.0:
        raise SourceError("--seconds", f"expected a number in (0, 600], got {args.seconds:g}")
    rig = with_inputs(load_rig(args.rig), args.inputs)
    if Path(args.output).is_file():
        raise SourceError(args.output, "expected a folder to write to, got a file")
    output = Path(args.output)
    if output.is_dir() and any(output.iterdir()) and not (output / JSON).exists():
        raise SourceError(args.output, f"holds other files (and no {JSON} of an earlier check), which are not overwritten")
    recordings = record(rig, args.seconds, lambda camera: print(f"looking at the images of {camera}", file=sys.stderr))
    print("comparing the cameras", file=sys.stderr, flush=True)
    examination = examine(rig, recordings)
    page = write_examination(args.output, rig, recordings, examination)
    for finding in examination.findings:
        print(f"- {finding.sentence}")
    for note in examination.notes:
        print(note)
    found = f"{len(examination.findings)} found." if examination.findings else "Nothing found in what was checked."
    print("Nothing found." if examination.compared and not examination.findings else found, f"See {page}")
    if examination.findings:
        return 1
    return 0 if examination.compared else 3
