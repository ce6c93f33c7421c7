"""``tracker_node calibrate time``: clocks of free-running cameras from what moves in their images."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ..arguments.run_images import refuse_to_overwrite
from .body import check

SUMMARY = "find by how much the clocks of free-running cameras differ, from what moves in their images; nobody has to be tracked"
EXAMPLE = (
    "tracker_node calibrate time --rig rig.yaml -o rig_timed.yaml\n"
    "  tracker_node calibrate time --rig rig.yaml --max-offset 10 --seconds 120 -o rig_timed.yaml"
)
_RUNNER_UP = 0.8  # two offsets that agree about as well are reported


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--rig", required=True, metavar="RIG", help="rig.yaml with the sources; offsets that it has are started from")
    add("-o", "--output", default="rig_timed.yaml", metavar="FILE", help="rig to write (default: %(default)s)")
    add("--max-offset", type=float, default=2.0, metavar="S", help="largest offset to search, seconds (default: %(default)s)")
    add("--seconds", type=float, default=60.0, metavar="S", help="how much of each source is read (default: %(default)s)")
    add("--no-drift", action="store_true", help="offsets only; drift is estimated in recordings of 20 s or more")
    add(
        "--whole-images", action="store_true",
        help="compare how much moves altogether, for cameras whose places are not known yet; far less sharp",
    )  # fmt: skip
    add("--report", metavar="FILE", help="where to write the metrics as JSON (default: beside the output, .json)")
    add("--force", action="store_true", help="overwrite the output and the report")
    add("--quiet", action="store_true", help="no progress on stderr")


def run(args: argparse.Namespace) -> int:
    from ...calibration.clocks.motion import measured_motions
    from ...calibration.clocks.offsets import ClockOptions, estimate_clocks, with_clocks
    from ...loaders.rig.rig_yaml import build_rig, read_rig_file, write_rig_file
    from ...report.metrics_file import write_metrics

    check(0.0 < args.max_offset < 1e5, "--max-offset", "a positive number of seconds", args.max_offset)
    check(1.0 <= args.seconds < 1e5, "--seconds", "at least 1", args.seconds)
    report = Path(args.report or Path(args.output).with_suffix(".json"))
    refuse_to_overwrite(args, args.output, report)
    rig_file = read_rig_file(args.rig)
    rig = build_rig(rig_file, Path(args.rig).parent)
    check(len(rig) > 1, "--rig", "a rig of two cameras at least", f"{len(rig)}")
    motions = measured_motions(rig, args.seconds, args.whole_images, None if args.quiet else _print_progress)
    clocks = estimate_clocks(motions, ClockOptions(args.max_offset, drift=not args.no_drift))
    write_rig_file(with_clocks(rig_file, clocks, motions), args.output, base_dir=Path(args.rig).parent)
    write_metrics(report, clocks.metrics())
    print_table(clocks)
    print(f"wrote {args.output} and {report}")
    return 0


def _print_progress(camera: str, images: int) -> None:
    print(f"calibrate time: {camera}: {images} images read", file=sys.stderr, flush=True)


def print_table(clocks) -> None:
    """What has been found, as a table."""
    print(f"{'camera':12} {'offset ms':>18} {'drift ppm':>18} {'correlation':>12} {'runner-up':>10}")
    for name, c in clocks.cameras.items():
        offset = f"{1e3 * c.offset_s:8.2f} +- {1e3 * c.offset_sigma_s:6.2f}"
        drift = f"{1e6 * c.drift:8.1f} +- {1e6 * c.drift_sigma:6.1f}" if c.drift_sigma else "not estimated"
        print(f"{name:12} {offset:>18} {drift:>18} {c.correlation:12.2f} {c.runner_up:10.2f}")
    for name, c in clocks.cameras.items():
        if c.runner_up > _RUNNER_UP:
            print(f"note: another offset of {name} agrees nearly as well; film something that does not repeat itself")
