"""``tracker_node camera_ingest``: publish recorded cameras."""

from __future__ import annotations

import argparse
import sys

SUMMARY = "publish the videos or image folders of a rig as ROS cameras"
EXAMPLE = "tracker_node camera_ingest --rig rig.yaml --loop --resize 640x480"


def image_size(text: str) -> tuple[int, int]:
    """``640x480`` -> (640, 480)."""
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit() and int(width) and int(height)):
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT, got '{text}'")
    return int(width), int(height)


def add_source_arguments(parser: argparse.ArgumentParser) -> None:
    """What part of the sources, and how; shared with ``pipeline``."""
    parser.add_argument("--cameras", nargs="+", metavar="NAME", help="only these cameras of the rig")
    parser.add_argument("--rate", type=float, metavar="HZ", help="images per second, instead of what the files say")
    parser.add_argument("--start", type=int, default=0, metavar="N", help="first image (default 0)")
    parser.add_argument("--end", type=int, metavar="N", help="image to stop before (default: the last)")
    parser.add_argument("--resize", type=image_size, metavar="WxH", help="resample the images; the calibration is scaled along")
    parser.add_argument("--compressed", action="store_true", help="offer JPEG images too, on <cam>/image_raw/compressed")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--rig", required=True, metavar="FILE", help="rig.yaml with cameras and their sources")
    add_source_arguments(parser)
    parser.add_argument("--loop", action="store_true", help="begin again at the end, for ever")
    parser.add_argument(
        "--as-fast-as-consumed",
        action="store_true",
        help="send the next images when the tracker has answered; loses nothing, keeps the stamps of the files",
    )
    parser.add_argument("--consumer", default="tracker", metavar="NODE", help="node whose state topic answers (default tracker)")
    parser.add_argument("--stamps", choices=("live", "file"), help="of the clock, or of the files (default: live when paced)")
    parser.add_argument("--no-frame-skip", action="store_true", help="publish late images instead of skipping them")
    parser.add_argument("--wait-for-subscribers", type=int, default=0, metavar="N", help="wait for N subscribers to the images")
    parser.add_argument("--wait-for-info-subscribers", type=int, default=0, metavar="N", help="and to the calibrations")
    parser.add_argument("--preload", action="store_true", help="decode all images first (short clips at high rates)")


def run(args: argparse.Namespace) -> int:
    from ..errors import TrackerError
    from ..loaders.image_source import SourceOptions
    from ..loaders.rig_yaml import load_rig
    from ..ros.camera_ingest_node import CameraIngestNode, IngestOptions, open_sources
    from ..ros.executor import ros_process, spin

    rig = load_rig(args.rig)
    try:
        source_options = SourceOptions(args.start, args.end, args.loop, args.rate, args.resize)
    except ValueError as error:
        raise TrackerError(f"--start, --end, --rate, --resize: {error}") from None
    options = IngestOptions(
        source=source_options,
        live_stamps=args.stamps == "live" if args.stamps else not args.as_fast_as_consumed,
        as_fast_as_consumed=args.as_fast_as_consumed,
        consumer=args.consumer,
        frame_skip=not args.no_frame_skip,
        wait_for_subscribers=args.wait_for_subscribers,
        wait_for_info_subscribers=args.wait_for_info_subscribers,
        compressed=args.compressed,
        preload=args.preload,
    )
    sources, problems = open_sources(rig, options, args.cameras)
    with ros_process(args.ros_args) as stop:
        node = CameraIngestNode(rig, sources, problems, options)
        node.start()
        try:
            spin(node, stop, node.finished.is_set)
        finally:
            node.close()
            summary = summarize(node.counts)
            node.destroy_node()
    print(summary)
    for name, problem in node.problems.items():
        print(f"tracker_node camera_ingest: {name}: {problem}", file=sys.stderr)
    return 1 if node.problems else 0


def summarize(counts) -> str:
    """One line per camera."""
    return "\n".join(
        f"{name}: " + ", ".join(f"{value} {key}" for key, value in count.values().items() if value or key == "published")
        for name, count in counts.items()
    )
