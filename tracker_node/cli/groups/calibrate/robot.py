"""``tracker_node calibrate robot``: where a robot stands before the cameras, and the cameras before it (hand-eye calibration)."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ...arguments.run_images import check, refuse_to_overwrite
from ...arguments.verbs import Subverb

_FAR_PX = 3.0  # median distance of the outline after a fit, from which on something else is wrong


def _add_robot_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--rig", type=Path, metavar="FILE", help="rig.yaml: cameras, and the videos or folders they read")
    add("--model", type=Path, metavar="FILE", help="URDF or model.yaml: the robot")
    add(
        "--initial-state", type=Path, metavar="FILE",
        help="state.yaml: about where its base is (within a tenth of its size, and 15 degrees); joints that it says nothing of",
    )  # fmt: skip
    add("--joint-states", type=Path, metavar="PATH", help="CSV file or bag: where its joints are, see tracker_node track")
    add("--joint-states-topic", metavar="TOPIC", help="of the bag (default: /joint_states, or the only one of that type)")
    add("--bag", type=Path, help="take the images from this bag instead of the sources of the rig")
    add("--config", type=Path, metavar="FILE", help="tracker parameters, for how the images are processed (default: built in)")
    add("--sets", type=int, default=20, metavar="N", help="image sets, spread over the recording (default: %(default)s)")
    add(
        "--zeros-sigma-deg", type=float, default=0.5, metavar="DEG",
        help="how far the zeros of its joints may be off, a standard deviation; 0: they are right (default: %(default)s)",
    )  # fmt: skip
    add("-o", "--output", type=Path, default=Path("base.yaml"), metavar="FILE", help="state to write (default: %(default)s)")
    add("--rig-output", type=Path, metavar="FILE", help="also write the rig in the frame of the robot's base")
    add("--report", type=Path, metavar="FILE", help="where to write the metrics as JSON (default: beside the output, .json)")
    add("--force", action="store_true", help="overwrite the output and the report")
    add("--quiet", action="store_true", help="no progress on stderr")


def _run_robot(args: argparse.Namespace) -> int:
    import numpy as np

    from ....calibration.tracked_body.report import robot_metrics, write_robot_report
    from ....calibration.tracked_body.robot_fit import fit_robot, rig_on_base
    from ....loaders.model.model_yaml import load_model
    from ....loaders.model.state_yaml import dump_state, load_state
    from ....loaders.rig.rig_yaml import read_rig_file, write_rig_file
    from ....model.configuration import State
    from ....report.metrics_file import write_metrics
    from ....report.progress import StageProgress
    from ....runs.config_file import load_config
    from ....runs.joint_states import JointStateFile, load_joint_states
    from ....tracking.config import TrackerConfig

    check(args.rig, "--rig", "a file: cameras, and the videos or folders they read")
    check(args.model, "--model", "a file: the robot")
    check(args.initial_state, "--initial-state", "a file: about where the robot's base is")
    check(args.joint_states, "--joint-states", "a CSV file or a bag")
    check(args.sets >= 2, "--sets", "a number of at least 2", args.sets)
    check(0.0 <= args.zeros_sigma_deg < 90.0, "--zeros-sigma-deg", "degrees, 0 or more", args.zeros_sigma_deg)
    report = Path(args.report or Path(args.output).with_suffix(".json"))
    page = report.with_suffix(".html")
    refuse_to_overwrite(args, args.output, report, page, *([args.rig_output] if args.rig_output else []))
    model = load_model(args.model)
    given = load_state(args.initial_state, model)
    config = load_config(args.config) if args.config else TrackerConfig()
    said = load_joint_states(JointStateFile(args.joint_states, args.joint_states_topic), model)
    rig, images = _images(args, config, said, given, model)
    if images.unsaid and not args.quiet:
        print(f"calibrate robot: nothing is said of {', '.join(images.unsaid)}: as in {args.initial_state}")
    sigma_rad = float(np.radians(args.zeros_sigma_deg))
    progress = None if args.quiet else StageProgress("calibrate robot")
    fit = fit_robot(model, rig, images.sets, images.poses, given.T_world_root, config, sigma_rad, progress)
    first = State(fit.T_world_base, fit.states[0].joint_positions)
    dump_state(first, model, args.output, "Where the robot stood; its joints are those of the first image set.")
    if args.rig_output:
        rig_file = read_rig_file(args.rig)
        placed = rig_file.with_extrinsics(rig_on_base(rig, fit)).model_copy(update={"world_frame": model.chain.links[0]})
        write_rig_file(placed, args.rig_output, base_dir=args.rig.parent)
    write_robot_report(page, model, rig, images.sets, fit)
    write_metrics(report, robot_metrics(model, fit))
    _print_place(model, fit)
    print("wrote " + ", ".join(str(path) for path in (args.output, args.rig_output, page, report) if path))
    return 0


def _images(args: argparse.Namespace, config, said, given, model):
    """The cameras for the images, and the images themselves."""
    from contextlib import ExitStack

    from ....loaders.bag.reader import BagReader
    from ....loaders.rig.rig_yaml import load_rig
    from ....runs.image_sets import BagStream, ImageSetStream, SourceStream, rig_of_bag
    from ....runs.joint_states import robot_images

    rig = load_rig(args.rig)
    stream: ImageSetStream
    with ExitStack() as stack:
        if args.bag is None:
            stream = SourceStream(rig, config.synchronizer, rig_file=str(args.rig))
        else:
            reader = stack.enter_context(BagReader(args.bag))
            rig = rig_of_bag(rig, reader)
            stream = BagStream(rig, config.synchronizer, reader)
        return rig, robot_images(stream, stream.n_expected or 0, args.sets, said, rig.names, given, model)


def _print_place(model, fit) -> None:
    """What was found, as a table."""
    from ....calibration.tracked_body.report import robot_table

    first, last = fit.overall
    for what, found in (robot_table(model, fit).table or ())[1:]:
        print(f"{what:40} {found}")
    print(f"all cameras: median {first.median_px:.2f} -> {last.median_px:.2f} px in {len(fit.states)} image sets")
    if last.median_px > _FAR_PX:
        problem = f"its outline is still {last.median_px:.1f} px off, and ± do not hold"
        print(f"calibrate robot: {problem}: did the base move, or do model, rig or joint states not fit?", file=sys.stderr)


SUBVERBS = (
    Subverb(
        "robot",
        "find where a robot's base stands, and the cameras in its frame, from images and its joint states",
        "tracker_node calibrate robot --rig rig.yaml --model arm.urdf --initial-state about.yaml --joint-states moves.csv"
        " -o base.yaml --rig-output rig_on_base.yaml",
        _add_robot_arguments,
        _run_robot,
    ),
)
