"""``tracker_node pipeline``: ingest, tracker, recorder and detector in one command."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..arguments.cameras import tracker_name, with_topics
from ..arguments.recording import add_recording_argument, by_body, evaluation_of, fill_in
from ..arguments.run_images import named_options, nothing_tracked, whole_name
from ..arguments.verbs import run_verb
from .camera_ingest import add_source_arguments, cameras_of, source_options
from .tracker import add_body_arguments

if TYPE_CHECKING:
    from ...loaders.recording_yaml import RecordingFile
    from ...ros.pipeline import Progress
    from ...tracking.config import TrackerConfig

SUMMARY = "run camera_ingest, tracker and recorder together, from cameras to a bag, and evaluate if a recording.yaml says so"
EXAMPLE = """tracker_node pipeline recording.yaml
  tracker_node pipeline --rig rig.yaml --model person.yaml --initial-state start.yaml --bag out/run1/bag --masks"""
RECORDED = ("masks", "overlays", "masked_images", "markers", "images")
BUILT_IN = {
    **{"start": 0, "shrink": 1, "source": [], "capture": [], "split_mb": 0.0, "compression": "none"},
    **dict.fromkeys((*RECORDED, "loop", "real_time"), False),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_body_arguments(parser, required=False)
    add_source_arguments(parser)
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FOLDER", help="folder of the run: bag/, and run.json, which says how it was made"
    )
    parser.add_argument(
        "--bag", type=Path, metavar="FOLDER", help="record states, poses, joints, calibrations and diagnostics to this bag"
    )
    parser.add_argument("--masks", action="store_true", help="record the model's silhouettes too")
    parser.add_argument("--overlays", action="store_true", help="record images with the model drawn over them too")
    parser.add_argument("--masked-images", action="store_true", help="record the images as seen through the body's mask too")
    parser.add_argument("--markers", action="store_true", help="record the body's shapes too, as RViz and Foxglove show them")
    parser.add_argument("--images", action="store_true", help="record the cameras' images too")
    parser.add_argument("--split-mb", type=float, metavar="MB", help="another file of the bag at this size (default: never)")
    parser.add_argument("--compression", choices=("none", "lz4", "zstd"), help="of the bag's messages (default: none)")
    parser.add_argument("--loop", action="store_true", help="begin again at the end, until Ctrl-C")
    parser.add_argument(
        "--real-time",
        action="store_true",
        help="publish at the images' rate and track the newest; otherwise every image set is tracked, as fast as possible",
    )
    parser.add_argument(
        "--keypoints",
        choices=("auto", "on", "off"),
        default="auto",
        help="find people and their points in the images; auto: where the modality keypoints is in use and the extra installed",
    )
    parser.add_argument("--keypoints-weights", type=Path, metavar="FILE", help="as --weights of tracker_node keypoints")
    parser.add_argument("--keypoints-rate", type=float, metavar="HZ", help="as --rate of tracker_node keypoints")
    add_recording_argument(parser, BUILT_IN)


def run(args: argparse.Namespace) -> int:
    from ...errors import TrackerError
    from ...loaders.rig.rig_yaml import load_rig
    from ...ros.ingest.cameras import open_cameras
    from ...ros.pipeline import PipelineOptions, run_pipeline
    from ...runs.writer import asked_of_run, run_of_bag
    from ...tracking.config import KEYPOINTS

    recording = fill_in(args, BUILT_IN)
    if recording is not None:
        _check_points(args, recording)
    if args.bag is None and args.output is not None:
        args.bag = args.output / "bag"
    rig = load_rig(args.rig)
    opened = open_cameras(cameras_of(rig, args), source_options(args))  # the ingest will tell the problems too
    opened.check_trackable(args.real_time)
    n_sets = opened.n_sets(args.loop)
    if args.cameras:
        rig = rig.subset(args.cameras)
    config = _checked_files(rig, args, recording)
    if args.bag is None and any(getattr(args, name) for name in RECORDED):
        switches = ", ".join(f"--{name.replace('_', '-')}" for name in RECORDED)
        raise TrackerError(f"{switches} say what is recorded: give --bag or --output too")
    if args.bag is not None and args.bag.exists():
        raise TrackerError(f"--bag {args.bag}: there is something already")
    folder = run_of_bag(args.bag) if args.bag else None
    asked = {name: value for name, value in named_options(args).items() if name != "bag"}  # images come from no bag
    named = tuple(recording.bodies) if recording is not None else ()
    joining = () if recording is None or recording.joining is None else recording.joining.names
    options = PipelineOptions(
        bodies={} if recording is None else {name: whole_name(file) for name, file in recording.models.items()},
        joining=joining,
        body=[*_body_options(args, list(opened.cameras)), *(["--output", str(folder)] if folder is not None else [])],
        modalities=() if _chosen_by_ros(args) else config.modalities,
        source=_source_options(args),
        sources=dict(args.source),
        cameras=tuple(opened.cameras),
        bag=args.bag,
        masks=args.masks,
        overlays=args.overlays,
        masked_images=args.masked_images,
        markers=args.markers,
        images=args.images,
        detector=_detector_options(args, list(opened.cameras), named, joining, KEYPOINTS in config.modalities),
        own_detector=args.keypoints_table is not None,
        recorder=["--split-mb", str(args.split_mb), "--compression", args.compression],
        lossless=not args.real_time,
        n_expected=n_sets,
        ros_args=with_topics(args.ros_args, rig, {}),
        folder=folder,
        summary=asked_of_run(asked, None if args.ros_args else config, n_sets),
    )
    status, of_bodies, interrupted = run_pipeline(options)
    for name, progress in of_bodies.items():
        if name in joining and not progress.came:
            continue
        counts = ", ".join(f"{n} {status.name}" for status, n in sorted(progress.statuses.items()))
        said = f"{name and f'{name}: '}{progress.sets} image sets: {counts or 'none'}"
        print(said + (f"; bag {args.bag}" if args.bag else ""))
    evaluations = _evaluations(args, recording) if recording is not None and args.bag else []
    if interrupted:
        for arguments in evaluations:
            print(f"not evaluated, as it was ended early; to do it: tracker_node {shlex.join(arguments)}")
        raise KeyboardInterrupt if status == 0 else SystemExit(status)
    untracked = 0 if status else _untracked(by_body(args, recording), of_bodies)
    if status == 0:
        status = next((code for code in [run_verb(*arguments) for arguments in evaluations] if code), 0)
    return status or untracked


def _untracked(asked: Mapping[str, tuple[argparse.Namespace, Any]], of_bodies: Mapping[str, Progress]) -> int:
    """Exit status where a body was never tracked, which is said; else 0."""
    statuses = []
    for name in asked:
        by_status = {each.name: n for each, n in of_bodies[name].statuses.items()}
        statuses.append(nothing_tracked("pipeline", by_status, "", asked[name][0].initial_state is not None, name))
    if not any(progress.came for progress in of_bodies.values()):
        statuses.append(1)
        if not asked:
            print("pipeline: nobody has come", file=sys.stderr)
    return max(statuses, default=0)


def _evaluations(args: argparse.Namespace, recording: RecordingFile) -> list[list[str]]:
    """A command line of ``evaluate`` for each body that is compared with something."""
    from ...runs.writer import BAG

    found = []
    for name, (own, alone) in by_body(args, recording).items():
        assert alone is not None
        output = args.output or args.bag.parent
        folder = args.bag.parent if name and args.bag.name == BAG else None  # leads to states and clothes
        arguments = evaluation_of(alone, own, {"": folder / name if folder else args.bag}, output / name)
        named = ["--topic", f"/tracker/{name}/state", "--model", str(own.model)] if name and folder is None else []
        found += [[*arguments, *named]] if arguments else []
    return found


def _checked_files(rig, args: argparse.Namespace, recording: RecordingFile | None) -> TrackerConfig:
    """Mistakes in files are said before anything is started; parameters of the tracker."""
    from ...errors import FileFormatError
    from ...loaders.images.source import load_backgrounds
    from ...loaders.keypoints.table import load_keypoint_table
    from ...loaders.model.model_yaml import load_model
    from ...loaders.model.state_yaml import load_state
    from ...model.humans.keypoints import is_person
    from ...runs.config_file import config_for, load_config
    from ...tracking.config import TrackerConfig
    from ...tracking.together.joining import USUAL

    entry = None if recording is None else recording.joining
    if entry is not None:
        load_model(entry.model)
        if entry.config is not None:
            raise FileFormatError(args.recording, "joining.config", "nothing: a graph has one set of parameters", entry.config)
    models = []
    for name, (own, _) in by_body(args, recording).items():
        models.append(model := load_model(own.model))
        own_config = recording.bodies[name].config if recording is not None and name else None
        if own_config is not None:
            expected = "nothing: a graph has one set of parameters"
            raise FileFormatError(args.recording, f"bodies.{name}.config", expected, own_config)
        if own.initial_state:
            load_state(own.initial_state, model)
    if args.occluders:
        load_model(args.occluders)
    load_backgrounds(rig)
    if entry is not None:
        return load_config(args.config, tracker_name(args.ros_args)) if args.config else USUAL
    table = args.keypoints_table
    if table:
        load_keypoint_table(table, models[0])
    if (table or (args.keypoints != "off" and all(map(is_person, models)))) and not _chosen_by_ros(args):
        said = partial(print, "pipeline:", file=sys.stderr, flush=True)
        return config_for(args.config, models[0], table is not None, said, tracker_name(args.ros_args))
    return load_config(args.config, tracker_name(args.ros_args)) if args.config else TrackerConfig()


def _chosen_by_ros(args: argparse.Namespace) -> bool:
    """Whether arguments of ROS may say what is compared: they go before what suits people."""
    return any(word == "--params-file" or "modalities:=" in word for word in args.ros_args)


def _check_points(args: argparse.Namespace, recording: RecordingFile) -> None:
    """A graph has the points of a detector that runs, of whomever cameras look at.

    Raises
    ------
    FileFormatError : the recording names others.
    """
    from ...errors import FileFormatError

    offline = {"keypoints.files": recording.keypoints.files, "person": recording.person, "joint_states": recording.joint_states}
    for name, value in offline.items():
        if value is not None:
            raise FileFormatError(args.recording, name, "nothing: it is for tracker_node track", value)


def _detector_options(
    args: argparse.Namespace, cameras: list[str], named: Sequence[str], joining: Sequence[str], wanted: bool
) -> list[str] | None:
    """Options of the node keypoints; None where it is not started, which is said where points are wanted."""
    from ...errors import TrackerError
    from ...loaders.fetched_files import usable_weights

    if args.keypoints == "off" or (args.keypoints == "auto" and (args.keypoints_table or not wanted)):
        return None
    try:
        usable_weights(args.keypoints_weights)
    except TrackerError as error:
        if args.keypoints == "on":
            raise
        print(f"pipeline: without points of people: {error}", file=sys.stderr, flush=True)
        return None
    listeners = wanted + (args.bag is not None)  # the tracker, if it compares points, and the recorder
    result = ["--rig", str(args.rig), "--cameras", *cameras, "--wait-for-subscribers", str(listeners)]
    if named or joining:
        result += ["--tracker", *(f"tracker/{name}" for name in named)]
    result += ["--joining", *(f"tracker/{name}" for name in joining)] if joining else []
    rate = args.keypoints_rate
    if rate is None and not args.real_time:  # the tracker waits for the points of every set
        rate, result = 0.0, [*result, "--lossless", "--niceness", "0"]
    for option, value in (("config", args.config), ("weights", args.keypoints_weights), ("rate", rate)):
        result += [] if value is None else [f"--{option}", str(value)]
    return result


def _body_options(args: argparse.Namespace, cameras: list[str]) -> list[str]:
    body = ["--bodies", str(args.recording)] if args.model is None else ["--model", str(args.model)]
    result = ["--rig", str(args.rig), *body, "--cameras", *cameras]
    for name in ("config", "initial_state", "occluders", "keypoints_table"):
        if getattr(args, name):
            result += [f"--{name.replace('_', '-')}", str(getattr(args, name))]
    if args.resize or args.shrink > 1:
        result += ["--calibration", "camera_info"]
    return result


def _source_options(args: argparse.Namespace) -> list[str]:
    result = ["--rig", str(args.rig), "--start", str(args.start)]
    if args.end is not None:
        result += ["--end", str(args.end)]
    if args.rate is not None:
        result += ["--rate", str(args.rate)]
    if args.resize:
        result += ["--resize", "{}x{}".format(*args.resize)]
    if args.shrink > 1:
        result += ["--shrink", str(args.shrink)]
    if args.decode_threads is not None:
        result += ["--decode-threads", str(args.decode_threads)]
    if args.cameras:
        result += ["--cameras", *args.cameras]
    if args.capture:
        result += ["--capture", *args.capture]
    return result + [flag for name, flag in (("compressed", "--compressed"), ("loop", "--loop")) if getattr(args, name)]
