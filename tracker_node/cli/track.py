"""``tracker_node track``."""

from __future__ import annotations

import argparse
import math
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .arguments.cameras import image_size
from .arguments.recording import add_recording_argument, by_body, evaluate_recording, fill_in, of_those_who_join
from .arguments.run_images import add_person_argument, check, named_options, nothing_tracked, place_of_person
from .nodes.camera_ingest import named_source

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..camera.rig import CameraRig
    from ..loaders.images.source import SourceOptions
    from ..loaders.recording_yaml import RecordingFile
    from ..model.articulated import ArticulatedModel
    from ..runs.joint_states import JointStateFile
    from ..runs.offline import JoiningRun, OfflineRun
    from ..runs.people.detection import DetectionOptions
    from ..runs.people.recorded import PointFiles
    from ..tracking.config import TrackerConfig

SUMMARY = "track recorded images (videos, folders or a bag) without ROS; write a bag, CSV files and run.json"
EXAMPLE = """tracker_node track --rig rig.yaml --model person.yaml --initial-state start.yaml --output out/run1
  tracker_node track recording.yaml --end 20 --output out/try"""
BUILT_IN = {
    "start": 0, "shrink": 1, "source": [], "masks": False, "masked_images": False, "keypoints_first": 0, "keypoints_every": 1,
}  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--rig", type=Path, metavar="FILE", help="rig.yaml: cameras, and the videos or folders they read")
    parser.add_argument("--model", type=Path, metavar="FILE", help="the body: model.yaml, URDF or name (gait_human)")
    parser.add_argument(
        "--config", type=Path, metavar="FILE",
        help="tracker parameters, the same file as for the node (default: built in; of people, region and keypoints)",
    )
    parser.add_argument(
        "--initial-state", type=Path, metavar="FILE",
        help="state.yaml: where the body is in the first images (default: it is searched in them)",
    )  # fmt: skip
    parser.add_argument(
        "--occluders",
        type=Path,
        metavar="FILE",
        help="model.yaml or URDF: fixed things that may hide the body, in the world's frame",
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FOLDER", help="folder for bag, states.csv, joints.csv, poses.csv, run.json"
    )
    parser.add_argument("--cameras", nargs="+", metavar="NAME", help="only these cameras of the rig")
    images = parser.add_argument_group("images")
    bags = images.add_mutually_exclusive_group()
    bags.add_argument("--bag", type=Path, help="take the images from this bag instead of the sources of the rig")
    bags.add_argument(
        "--from-run-bag",
        type=Path,
        metavar="BAG",
        help="track again exactly the image sets of this recorded run, with its images if they are in the bag, else with the"
        " sources of the rig",
    )
    images.add_argument(
        "--source", nargs="+", type=named_source, metavar="CAMERA=SOURCE", help="instead of the rig's: a file, folder or pattern"
    )
    images.add_argument("--start", type=int, default=0, metavar="N", help="first image of each source (default: 0)")
    images.add_argument("--end", type=int, metavar="N", help="image of each source to stop before (default: its end)")
    images.add_argument("--rate", type=float, metavar="HZ", help="image rate of the sources instead of what their files say")
    images.add_argument("--resize", type=image_size, metavar="WxH", help="resample the images; the calibration is scaled along")
    images.add_argument("--shrink", type=int, metavar="N", help="make them N times smaller, by area averages")
    images.add_argument("--base-stamp-ns", type=int, default=0, metavar="NS", help="stamp of image 0 of the sources (default: 0)")
    images.add_argument("--max-sets", type=int, metavar="N", help="stop after this many image sets")
    parser.add_argument(
        "--smooth", nargs="?", type=float, const=math.inf, metavar="LAG",
        help="also write states, velocities and covariances in the light of what came after them, into OUTPUT/smoothed;"
        " LAG: of the next so many seconds (default: of the whole recording)",
    )  # fmt: skip
    points = parser.add_argument_group("points of people, where keypoints is among the modalities")
    points.add_argument(
        "--keypoints", type=Path, metavar="PATH",
        help="those of another detector: file or folder of OpenPose, MMPose, MediaPipe, DeepLabCut, SLEAP, or COCO results",
    )  # fmt: skip
    points.add_argument(
        "--keypoints-table", type=Path, metavar="FILE",
        help="keypoints.yaml: what they are on the body (default: built in, for detectors of people)",
    )  # fmt: skip
    points.add_argument(
        "--keypoints-first", type=int, default=0, metavar="N", help="image of each source that their first image is (default: 0)"
    )
    points.add_argument(
        "--keypoints-weights", type=Path, metavar="FILE",
        help="weights of the network that finds points, such as pose_landmark_heavy.tflite (default: full, which is fetched)",
    )  # fmt: skip
    add_person_argument(points)
    points.add_argument(
        "--keypoints-every", type=int, default=1, metavar="N", help="look for people in every N-th image set (default: 1)"
    )
    robot = parser.add_argument_group("what a robot says of its joints, beside the images")
    robot.add_argument(
        "--joint-states", type=Path, metavar="PATH",
        help="CSV file with stamp_ns and a column a joint (radians, meters), or a bag with sensor_msgs/JointState",
    )  # fmt: skip
    robot.add_argument(
        "--joint-states-topic", metavar="TOPIC", help="of the bag (default: /joint_states, or the only one of that type)"
    )
    parser.add_argument("--masks", action="store_true", help="also record the model's silhouette in every camera")
    parser.add_argument("--masked-images", action="store_true", help="also record the images as seen through that silhouette")
    parser.add_argument("--quiet", action="store_true", help="no progress on stderr")
    add_recording_argument(parser, BUILT_IN)


def run(args: argparse.Namespace) -> int:
    from ..errors import TrackerError
    from ..loaders.rig.rig_yaml import load_rig
    from ..runs.offline import run_together

    recording = fill_in(args, BUILT_IN)
    if args.output is None:
        raise TrackerError("where the results go: give --output FOLDER")
    check(args.max_sets is None or args.max_sets >= 1, "--max-sets", "a number of at least 1", args.max_sets)
    bodies = by_body(args, recording)
    if args.from_run_bag is not None:
        if "" not in bodies:
            raise TrackerError("--from-run-bag: expected a run of one body, got a recording of several")
        _as_that_run(args)
    rig = load_rig(args.rig).with_sources(dict(args.source))
    rig = rig.subset(args.cameras) if args.cameras else rig
    told: list[str] = []

    def tell(sentence: str) -> None:
        told.append(sentence)
        print(f"track: {sentence}", file=sys.stderr, flush=True)

    runs = {name: _offline_run(own, rig, tell) for name, (own, _) in bodies.items()}
    outputs = {name: own.output for name, (own, _) in bodies.items()}
    joining = _joining(args, recording, rig, tell)
    try:
        summaries = run_together(runs, outputs, None if args.quiet else _Progress(), tell, joining)
    except KeyboardInterrupt:
        begun = any((output / "run.json").is_file() for output in outputs.values())
        kept = f"what was tracked until then is in {args.output}" if begun else "nothing was tracked yet"
        print(f"track: ended by Ctrl-C; {kept}", file=sys.stderr)
        raise
    statuses = []
    for name in (name for name in summaries if name not in bodies):
        _report(summaries[name], args.output / name, args.quiet, told, name)
        told += summaries[name]["errors"]
        statuses.append(int(bool(summaries[name]["errors"])))
    if not summaries:
        print("track: nobody has come", file=sys.stderr)
        statuses.append(1)
    for name, (own, alone) in bodies.items():
        summary = summaries[name]
        _report(summary, own.output, args.quiet, told, name)
        told += summary["errors"]
        untracked = nothing_tracked("track", summary["status_counts"], summary["reason"], own.initial_state is not None, name)
        if summary["errors"]:
            statuses.append(1)
        elif alone is None:
            statuses.append(untracked)
        else:
            statuses.append(evaluate_recording(alone, own, own.output, own.output) or untracked)
    return next((status for status in statuses if status), 0)


def _offline_run(args: argparse.Namespace, rig: CameraRig, tell: Callable[[str], None]) -> OfflineRun:
    """What the command line asks of one body."""
    from ..loaders.keypoints.table import load_keypoint_table
    from ..loaders.model.model_yaml import load_model
    from ..loaders.model.state_yaml import load_state
    from ..runs.offline import OfflineRun

    model = load_model(args.model)
    return OfflineRun(
        rig=rig,
        model=model,
        config=_config(args, model, tell),
        initial_state=load_state(args.initial_state, model) if args.initial_state else None,
        occluders=load_model(args.occluders) if args.occluders else None,
        bag=args.from_run_bag or args.bag,
        from_run=args.from_run_bag is not None,
        images=_source_options(args),
        max_sets=args.max_sets,
        smooth_s=_lag(args.smooth),
        detection=_detection(args),
        points=_points(args),
        table=load_keypoint_table(args.keypoints_table, model) if args.keypoints_table and args.from_run_bag else None,
        person=place_of_person(args),
        joint_states=_joint_states(args),
        masks=args.masks,
        masked_images=args.masked_images,
        asked=named_options(args),
    )


def _joining(
    args: argparse.Namespace, recording: RecordingFile | None, rig: CameraRig, tell: Callable[[str], None]
) -> JoiningRun | None:
    """People who may join."""
    from ..api.recording import joining_run
    from ..tracking.together.joining import USUAL

    own = of_those_who_join(args, recording)
    if own is None or recording is None or recording.joining is None:
        return None
    run = _offline_run(own, rig, tell)
    return joining_run(recording.joining, run if own.config else replace(run, config=USUAL), args.output)


def _config(args: argparse.Namespace, model: ArticulatedModel, tell: Callable[[str], None]) -> TrackerConfig:
    """Parameters of the file; without one, of the run that is made again, or what suits the body."""
    from ..runs.config_file import config_for
    from ..runs.images import config_of_run
    from ..runs.load import run_info

    if args.from_run_bag is not None and args.config is None:
        return config_of_run(run_info(args.from_run_bag))
    return config_for(args.config, model, args.keypoints is not None, tell)


def _as_that_run(args: argparse.Namespace) -> None:
    """What the command line leaves out of how images are taken is as in the run that is made again."""
    from ..runs.images import options_of
    from ..runs.load import run_info

    options = options_of(run_info(args.from_run_bag))
    images = ("start", "end", "rate", "resize", "shrink", "base_stamp_ns", "cameras", "source")
    for name in (*images, "joint_states", "joint_states_topic"):
        if getattr(args, name) in (None, BUILT_IN.get(name, 0)) and options.get(name):
            setattr(args, name, options[name])
    args.resize = args.resize and (int(args.resize[0]), int(args.resize[1]))
    args.source = [(camera, source) for camera, source in args.source]
    args.joint_states = args.joint_states and Path(args.joint_states)


def _source_options(args: argparse.Namespace) -> SourceOptions:
    from ..errors import TrackerError
    from ..loaders.images.source import SourceOptions

    try:
        return SourceOptions(
            args.start, args.end, rate_hz=args.rate, size=args.resize, base_stamp_ns=args.base_stamp_ns, shrink=args.shrink
        )
    except ValueError as error:
        raise TrackerError(f"--start, --end, --rate, --resize, --shrink: {error}") from None


def _points(args: argparse.Namespace) -> PointFiles | None:
    from ..errors import FileFormatError
    from ..runs.people.recorded import PointFiles

    if args.keypoints is not None:
        return PointFiles(args.keypoints, args.keypoints_table, args.keypoints_first)
    if args.keypoints_table is not None and args.from_run_bag is None:
        expected = "--keypoints or --from-run-bag beside it (live, a detector may publish the points)"
        raise FileFormatError("command line", "--keypoints-table", expected, "none")
    return None


def _joint_states(args: argparse.Namespace) -> JointStateFile | None:
    from ..errors import FileFormatError
    from ..runs.joint_states import JointStateFile

    if args.joint_states is not None:
        return JointStateFile(args.joint_states, args.joint_states_topic)
    if args.joint_states_topic is not None:
        raise FileFormatError("command line", "--joint-states-topic", "--joint-states beside it", "none")
    return None


def _detection(args: argparse.Namespace) -> DetectionOptions:
    from ..errors import FileFormatError
    from ..runs.people.detection import DetectionOptions

    try:
        return DetectionOptions(args.keypoints_weights, args.keypoints_every)
    except ValueError:
        raise FileFormatError("command line", "--keypoints-every", "a whole number, 1 or more", args.keypoints_every) from None


def _lag(seconds: float | None) -> float | None:
    from ..errors import FileFormatError

    if seconds is not None and not seconds > 0.0:
        raise FileFormatError("command line", "--smooth", "a lag of more than 0 seconds", seconds)
    return seconds


class _Progress:
    """One line on a terminal, a line every few seconds elsewhere."""

    def __init__(self) -> None:
        self._terminal = sys.stderr.isatty()
        self._next = self._began = time.monotonic()

    def __call__(self, done: int, expected: int | None, estimate: Any) -> None:
        now = time.monotonic()
        if now < self._next and done != expected:
            return
        self._next = now + (0.2 if self._terminal else 5.0)
        total = f"/{expected}" if expected else ""
        rate = done / max(now - self._began, 1e-9)
        what = f"{estimate.residual:.1f} {estimate.residual_unit}"
        if estimate.status.name == "INITIALIZING":
            what = estimate.status_reason
        text = f"{done}{total} image sets, {rate:.1f} a second, {estimate.status.name}, {what}"
        end = "\r" if self._terminal and done != expected else "\n"
        print(f"track: {text:<70}", end=end, file=sys.stderr, flush=True)


def _report(summary: dict[str, Any], output: Path, quiet: bool, told: list[str], body: str) -> None:
    from ..tracking.estimate import BUMPED, DELAYED, TURNED

    for error in (error for error in summary["errors"] if error not in told):
        print(f"track: {error}", file=sys.stderr)
    for found in (found for found in summary["contradicted_cameras"] if found["said"] not in told):
        told.append(found["said"])
        more = " (tracker_node rig check RIG)" if found["kind"] in (TURNED, DELAYED) else ""
        by = f"{body}: " if body and found["kind"] != BUMPED else ""  # which the room tells, and no body
        sets = f"{found['sets']} image set{'s' * (found['sets'] != 1)}"
        print(f"track: {by}{found['said']}, in {sets}{more}", file=sys.stderr)
    for note in (note for note in summary["notes"] if note not in told):
        told.append(note)
        print(f"track: {note}", file=sys.stderr)
    if quiet:
        return
    counts = ", ".join(f"{n} {name}" for name, n in summary["status_counts"].items() if n)
    ms = summary["ms_per_set"]
    time_text = f"; {ms['p50']:.1f} ms a set (95 %: {ms['p95']:.1f})" if ms["p50"] is not None else ""
    print(f"{body and f'{body}: '}{summary['image_sets']} image sets: {counts or 'none'}{time_text}")
    print(f"results in {output}")
