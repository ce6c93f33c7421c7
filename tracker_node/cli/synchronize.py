"""``tracker_node synchronize``: clocks of cameras that were started one by one."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from .arguments.run_images import check, refuse_to_overwrite

SUMMARY = "find by how much the clocks of cameras differ: by what moves, by a clap, flashes, a light, timecode; nobody is tracked"
EXAMPLE = (
    "tracker_node synchronize --rig rig.yaml -o rig_timed.yaml\n"
    "  tracker_node synchronize --rig rig.yaml --by sound --at 0.5 1.0 1.2 -o rig_timed.yaml"
)
_RUNNER_UP = 0.8  # two offsets that agree about as well are reported


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--rig", required=True, metavar="RIG", help="rig.yaml with the sources; offsets that it has are started from")
    add("-o", "--output", default="rig_timed.yaml", metavar="FILE", help="rig to write (default: %(default)s)")
    add(
        "--by", choices=("motion", "sound", "flash", "blinking", "timecode"), default="motion",
        help="what moves (default), the sound tracks of the videos, flashes and lamps that are switched on, a light that blinks,"
        " best at uneven times, or timecode",
    )  # fmt: skip
    add(
        "--at", nargs=3, type=float, metavar=("X", "Y", "Z"),
        help="where the clap was, meters: sound takes 3 ms a meter (default: where the cameras look)",
    )  # fmt: skip
    add("--max-offset", type=float, default=2.0, metavar="S", help="largest offset to search, seconds (default: %(default)s)")
    add("--seconds", type=float, default=60.0, metavar="S", help="how much of each source is read (default: %(default)s)")
    add("--no-drift", action="store_true", help="offsets only; motion tells the drift in recordings of 20 s or more")
    add(
        "--whole-images", action="store_true",
        help="compare how much moves altogether, for cameras whose places are not known yet; far less sharp",
    )  # fmt: skip
    add("--report", metavar="FILE", help="where to write the metrics as JSON (default: beside the output, .json)")
    add("--plot", metavar="FILE", help="picture of the signals (default: beside the output, .png)")
    add("--force", action="store_true", help="overwrite the output, the report and the picture")
    add("--quiet", action="store_true", help="no progress on stderr")


def run(args: argparse.Namespace) -> int:
    from ..calibration.clocks.offsets import ClockOptions, with_clocks
    from ..calibration.clocks.synchronization import MOTION, SOUND, draw_synchronization, synchronized
    from ..loaders.rig.rig_yaml import build_rig, read_rig_file, write_rig_file
    from ..report.metrics_file import write_metrics

    check(0.0 < args.max_offset < 1e5, "--max-offset", "a positive number of seconds", args.max_offset)
    check(1.0 <= args.seconds < 1e5, "--seconds", "at least 1", args.seconds)
    check(args.at is None or args.by == SOUND, "--at", "none without --by sound", args.at)
    check(not args.whole_images or args.by == MOTION, "--whole-images", f"none with --by {args.by}", "it")
    check(not args.no_drift or args.by == MOTION, "--no-drift", f"none with --by {args.by}: only motion tells the drift", "it")
    output = Path(args.output)
    report, plot = Path(args.report or output.with_suffix(".json")), Path(args.plot or output.with_suffix(".png"))
    refuse_to_overwrite(args, args.output, report, plot)
    rig_file = read_rig_file(args.rig)
    rig = build_rig(rig_file, Path(args.rig).parent)
    check(len(rig) > 1, "--rig", "a rig of two cameras at least", f"{len(rig)}")
    options = ClockOptions(args.max_offset, drift=not args.no_drift)
    tell = (lambda camera, what: None) if args.quiet else _print_progress
    found = synchronized(
        rig, args.by, options, args.seconds, whole_images=args.whole_images, place=args.at, progress=tell
    )  # fmt: skip
    write_rig_file(with_clocks(rig_file, found.clocks, found.first_s), args.output, base_dir=Path(args.rig).parent)
    write_metrics(report, found.clocks.metrics())
    draw_synchronization(found, plot)
    print_table(found.clocks)
    print(f"wrote {args.output}, {report} and {plot}")
    return 0


def _print_progress(camera: str, what: str) -> None:
    print(f"synchronize: {camera}: {what} read", file=sys.stderr, flush=True)


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
