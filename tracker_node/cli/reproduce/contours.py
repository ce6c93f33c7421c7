"""``tracker_node reproduce contours``: silhouettes, edges and their sum, and the sliding term (Knossow et al., Figs 3 to 6)."""

from __future__ import annotations

import argparse
from pathlib import Path

SUMMARY = "the contour paper's error by silhouettes, edges and their sum, tracking by each, and the Jacobian without sliding"
EXAMPLE = "tracker_node reproduce contours --output out/reproduce/contours"

CLIPS = ("cones", "mannequin", "balancing")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("-o", "--output", default="out/reproduce/contours", metavar="DIR", help="folder of the results (default: %(default)s)")
    add(
        "--clips", nargs="+", choices=CLIPS, metavar="NAME",
        help=f"only these of {', '.join(CLIPS)} (default: all that are to be had; quick: the first two)",
    )  # fmt: skip
    add("--recordings", default="out/synthetic", metavar="DIR", help="where rendered clips are kept (default: %(default)s)")
    add(
        "--motions", metavar="DIR",
        help="captured clips, humanoid3d_<name>.txt, for the mannequin's kick (default: bullet_motions in the folder that"
        " TRACKER_SHARED_DATA names; without them it swings its limbs)",
    )  # fmt: skip
    add(
        "--sample", default="out/demo/sample", metavar="DIR",
        help="the Balancing clip as `tracker_node sample` prepares it, made if it is not there (default: %(default)s)",
    )  # fmt: skip
    add("--quick", action="store_true", help="six small images of each clip: shows that it runs, the figures mean little")


def run(args: argparse.Namespace) -> int:
    from ...experiments.contour.experiment import make_clips, run_contours

    clips = make_clips(args.clips, Path(args.recordings), args.motions, lambda: _sample(Path(args.sample)), args.quick)
    run_contours(Path(args.output), clips, args.quick)
    return 0


def _sample(folder: Path) -> Path:
    """The folder of the Balancing sample, prepared if it is not whole."""
    from ...calibration.balancing import is_prepared
    from ...errors import TrackerError
    from ..sample import prepare

    if not is_prepared(folder) and prepare(folder) != 0:
        raise TrackerError(f"{folder}: the Balancing sample could not be prepared")
    return folder
