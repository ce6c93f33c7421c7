"""``tracker_node reproduce``: the experiments of the papers (Trewartha, Yeadon & Knight; contours: Knossow et al.)."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..arguments.verbs import Subverb, add_subverbs, run_subverb

SUMMARY = "repeat an experiment of the papers that the trackers come from: its table or figures, beside what was published"
EXAMPLE = "tracker_node reproduce table1 --output out/reproduce/table1"


CLIPS = ("cones", "mannequin", "balancing")


def _add_contours_arguments(parser: argparse.ArgumentParser) -> None:
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


def _run_contours(args: argparse.Namespace) -> int:
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


def _add_convergence_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("-o", "--output", default="out/reproduce/convergence", metavar="DIR", help="folder of the results (default: %(default)s)")
    add("--trials", type=int, default=44, metavar="N", help="starts for each size of the start's error (default: %(default)s)")
    add("--quick", action="store_true", help="few small images and starts: shows that it runs, the figures mean nothing")


def _run_convergence(args: argparse.Namespace) -> int:
    from ...errors import FileFormatError
    from ...experiments.somersault.experiments import run_convergence

    if args.trials < 1:
        raise FileFormatError("command line", "--trials", "at least 1", args.trials)
    run_convergence(Path(args.output), args.trials, args.quick)
    return 0


def _add_cross_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-o", "--output", default="out/reproduce/cross", metavar="DIR", help="folder of results (%(default)s)")
    parser.add_argument("--seed", type=int, default=20, help="of noise, background, lights and control points (%(default)s)")
    parser.add_argument("--quick", action="store_true", help="three fields of each throw, two ways to track: a first look")


def _run_cross(args: argparse.Namespace) -> int:
    from ...experiments.cross.experiment import run_cross

    run_cross(Path(args.output), args.seed, args.quick)
    return 0


def _add_figures_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("-o", "--output", default="out/reproduce/figures", metavar="DIR", help="folder of the images (default: %(default)s)")
    add("--rig", metavar="RIG", help="rig.yaml for the plan view (default: the cameras around the wooden cross)")
    add("--quick", action="store_true", help="small images")


def _run_figures(args: argparse.Namespace) -> int:
    from ...experiments.figures import draw_figures

    draw_figures(Path(args.output), args.rig, args.quick)
    return 0


def _add_table1_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-o", "--output", default="out/reproduce/table1", metavar="DIR", help="folder of results (%(default)s)")
    parser.add_argument("--quick", action="store_true", help="three small images: shows that it runs, the figures mean nothing")


def _run_table1(args: argparse.Namespace) -> int:
    from ...experiments.somersault.experiments import run_table1

    run_table1(Path(args.output), args.quick)
    return 0


SUBVERBS = (
    Subverb(
        "contours",
        "the contour paper's error by silhouettes, edges and their sum, tracking by each, and the Jacobian without sliding",
        "tracker_node reproduce contours --output out/reproduce/contours",
        _add_contours_arguments,
        _run_contours,
    ),
    Subverb(
        "convergence",
        "score against each variable around the truth, widths of its valley, and from how far each optimizer finds back",
        "tracker_node reproduce convergence --output out/reproduce/convergence",
        _add_convergence_arguments,
        _run_convergence,
    ),
    Subverb(
        "cross",
        "film a thrown wooden cross as interlaced video, track it by color, and hold it against truth and digitizing",
        "tracker_node reproduce cross --output out/reproduce/cross",
        _add_cross_arguments,
        _run_cross,
    ),
    Subverb(
        "figures",
        "draw both bodies and how far their surfaces lie apart, the five panels of a match, and the plan view of the cameras",
        "tracker_node reproduce figures --output out/reproduce/figures",
        _add_figures_arguments,
        _run_figures,
    ),
    Subverb(
        "table1",
        "track a somersault of 11 synthetic images and three cameras by color; errors beside the paper's Table 1",
        "tracker_node reproduce table1 --output out/reproduce/table1",
        _add_table1_arguments,
        _run_table1,
    ),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_subverbs(parser, SUBVERBS)


run = run_subverb
