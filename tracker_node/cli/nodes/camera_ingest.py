"""``tracker_node camera_ingest``: publish cameras of all kinds."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ..arguments.cameras import add_topics_argument, image_size, with_topics

if TYPE_CHECKING:
    from ...camera.rig import CameraRig
    from ...ros.ingest.cameras import OpenedCameras
    from ...ros.ingest.node import IngestOptions
    from ...ros.ingest.outlet import CameraCounts

SUMMARY = "publish videos, image folders, bags, devices, network streams or topics as the ROS cameras of a rig"
EXAMPLE = """tracker_node camera_ingest --rig rig.yaml --loop --shrink 2
  tracker_node camera_ingest --rig rig.yaml --source left=rtsp://10.0.0.2/a right=v4l2:/dev/video0 --capture right.gain=4
  tracker_node camera_ingest --source left=http://10.0.0.3/video --record out/board"""


def named_source(text: str) -> tuple[str, str]:
    """``left=videos/left.mp4`` -> (``left``, ``videos/left.mp4``)."""
    name, equals, source = text.partition("=")
    if not equals or not name.isidentifier() or not source:
        raise argparse.ArgumentTypeError(f"expected CAMERA=SOURCE, got '{text}'")
    if not name.isascii():
        raise argparse.ArgumentTypeError(f"camera '{name}': expected a-z, A-Z, 0-9 and _, as its topics have this name")
    return name, source


def add_source_arguments(parser: argparse.ArgumentParser) -> None:
    """What part of the sources, and how; shared with ``pipeline``."""
    parser.add_argument("--cameras", nargs="+", metavar="NAME", help="only these cameras of the rig")
    parser.add_argument(
        "--source",
        nargs="+",
        default=[],
        type=named_source,
        metavar="CAMERA=SOURCE",
        help="instead of the rig's: a file, folder or pattern, bag:PATH[#TOPIC], v4l2:DEVICE, rtsp://, http://, topic:NAME",
    )
    parser.add_argument(
        "--capture",
        nargs="+",
        default=[],
        metavar="[CAMERA.]FIELD=VALUE",
        help="pixel_format, rate_hz, exposure_us, gain, controls.NAME, bayer, publish=color|mono|native|jpeg, camera_info_url",
    )
    parser.add_argument("--rate", type=float, metavar="HZ", help="images per second, instead of what the files say")
    parser.add_argument("--start", type=int, default=0, metavar="N", help="first image (default 0)")
    parser.add_argument("--end", type=int, metavar="N", help="image to stop before (default: the last)")
    parser.add_argument("--resize", type=image_size, metavar="WxH", help="resample the images; the calibration is scaled along")
    parser.add_argument("--shrink", type=int, default=1, metavar="N", help="make them N times smaller, by area averages")
    parser.add_argument("--decode-threads", type=int, metavar="N", help="of each camera's decoder (default: OpenCV's choice)")
    parser.add_argument("--compressed", action="store_true", help="offer JPEG images too, on <cam>/image_raw/compressed")


def add_pace_arguments(parser: argparse.ArgumentParser) -> None:
    """When images go out; shared with ``compose``."""
    parser.add_argument("--loop", action="store_true", help="begin again at the end, for ever")
    parser.add_argument("--stamps", choices=("live", "file"), help="of the clock, or of the files (default: live when paced)")
    parser.add_argument("--no-frame-skip", action="store_true", help="publish images after their time instead of skipping them")
    parser.add_argument("--preload", action="store_true", help="decode all images first (short clips at high rates)")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--rig", metavar="FILE", help="rig.yaml with cameras and their sources; without it, --source names them")
    add_source_arguments(parser)
    add_topics_argument(parser)
    add_pace_arguments(parser)
    parser.add_argument(
        "--as-fast-as-consumed",
        action="store_true",
        help="send the next images when the tracker has answered; loses nothing, keeps the stamps of the files",
    )
    parser.add_argument("--consumer", default="tracker", metavar="NODE", help="node that answers (default: tracker)")
    parser.add_argument("--wait-for-subscribers", type=int, default=0, metavar="N", help="wait for N subscribers to the images")
    parser.add_argument("--wait-for-info-subscribers", type=int, default=0, metavar="N", help="and to the calibrations")
    parser.add_argument("--record", type=Path, metavar="FOLDER", help="write the images as they come to this bag too")


def source_options(args: argparse.Namespace, **more):
    """`SourceOptions` of the command line.

    Parameters
    ----------
    args : of the command line.
    **more : further fields of `SourceOptions`.

    Returns
    -------
    options : which images of the sources.

    Raises
    ------
    TrackerError : numbers that contradict each other.
    """
    from ...errors import TrackerError
    from ...loaders.images.source import SourceOptions

    try:
        return SourceOptions(
            args.start, args.end, args.loop, args.rate, args.resize, shrink=args.shrink, threads=args.decode_threads, **more
        )
    except ValueError as error:
        raise TrackerError(f"--start, --end, --rate, --resize, --shrink, --decode-threads: {error}") from None


def cameras_of(rig, args: argparse.Namespace):
    """Cameras that the command line selects.

    Parameters
    ----------
    rig : None where there is none.
    args : of the command line.

    Returns
    -------
    cameras : with their sources.

    Raises
    ------
    TrackerError : names or fields that are not known, or nothing to publish.
    """
    from ...errors import TrackerError
    from ...loaders.rig.capture_yaml import split_change
    from ...ros.ingest.cameras import chosen_cameras

    sources = dict(args.source)
    if rig is None and not sources:
        raise TrackerError("nothing to publish: give --rig, or --source CAMERA=SOURCE")
    names = sources if rig is None else rig.names
    changes = [split_change(text, names) for text in args.capture]
    return chosen_cameras(rig, args.cameras or (), sources, changes)


def opened_cameras(verb: str, rig: CameraRig | None, args: argparse.Namespace, options: IngestOptions) -> OpenedCameras:
    """The cameras that the command line selects, opened; what cannot be used is told.

    Parameters
    ----------
    verb : that tells it.
    rig : None where there is none.
    args : of the command line.
    options : of the node.

    Returns
    -------
    opened : the cameras that can be used.

    Raises
    ------
    TrackerError : there are none, or live ones are to wait for their consumer.
    """
    from ...loaders.source_address import sources_from_parent
    from ...ros.ingest.cameras import open_cameras
    from ...ros.ingest.node import check_consumable

    args.source = args.source or sources_from_parent()
    opened = open_cameras(cameras_of(rig, args), options.source, args.preload)
    check_consumable(opened, options)  # before a bag is begun
    for name, problem in opened.problems.items():
        print(f"tracker_node {verb}: {name}: {problem}", file=sys.stderr, flush=True)
    for name, source in opened.recorded.items():
        if source.note:
            print(f"tracker_node {verb}: note: {name}: {source.note}", file=sys.stderr, flush=True)
    return opened


def run(args: argparse.Namespace) -> int:
    from ...loaders.rig.rig_yaml import load_rig
    from ...ros.executor import finished_bag, ros_process, spin
    from ...ros.ingest.node import CameraIngestNode, IngestOptions
    from ...ros.ingest.outlet import InputRecorder
    from ...ros.parameter_overrides import refuse_undeclared

    rig = load_rig(args.rig) if args.rig else None
    options = IngestOptions(
        source=source_options(args, keep=args.record is not None),
        live_stamps=args.stamps == "live" if args.stamps else not args.as_fast_as_consumed,
        as_fast_as_consumed=args.as_fast_as_consumed,
        consumer=args.consumer,
        frame_skip=not args.no_frame_skip,
        wait_for_subscribers=args.wait_for_subscribers,
        wait_for_info_subscribers=args.wait_for_info_subscribers,
        compressed=args.compressed,
    )
    opened = opened_cameras("camera_ingest", rig, args, options)
    recorder = InputRecorder(args.record) if args.record is not None else None
    with finished_bag(recorder):
        try:
            with ros_process(with_topics(args.ros_args, rig, dict(args.topics))) as stop:
                node = CameraIngestNode(opened, options, recorder)
                refuse_undeclared(node, args.ros_args)
                node.start()
                try:
                    spin(node, stop, node.finished.is_set)
                finally:
                    node.close()
                    counts, problems = node.counts, node.problems
                    node.destroy_node()
        finally:
            bag_problem = _close(recorder)
    print(summary(counts))
    if recorder is not None:
        print(f"recorded: {recorder.written} messages in {args.record}, {recorder.dropped} dropped")
    if bag_problem:
        problems = problems | {"bag": bag_problem}
    tell_problems("camera_ingest", opened, problems)
    return 1 if problems else 0


def tell_problems(verb: str, opened: OpenedCameras, problems: dict[str, str]) -> None:
    """Print at the end what was not printed at the beginning.

    Parameters
    ----------
    verb : that tells it.
    opened : the cameras, with the problems of the beginning.
    problems : name -> what is wrong.
    """
    for name, problem in problems.items():
        if opened.problems.get(name) != problem:
            print(f"tracker_node {verb}: {name}: {problem}", file=sys.stderr)


def _close(recorder) -> str:
    """Finish the bag; returns what went wrong."""
    from ...errors import TrackerError

    try:
        if recorder is not None:
            recorder.close()
    except TrackerError as error:
        return str(error)
    return ""


def summary(counts: dict[str, CameraCounts]) -> str:
    """One line per camera."""
    return "\n".join(
        f"{name}: " + ", ".join(f"{value} {key}" for key, value in count.values().items() if value or key == "published")
        for name, count in counts.items()
    )
