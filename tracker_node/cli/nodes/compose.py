"""``tracker_node compose``: ingest and tracker in one process, images handed over as they are."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace

from ..arguments.cameras import with_topics
from .camera_ingest import add_pace_arguments, add_source_arguments, opened_cameras, source_options, summary, tell_problems
from .tracker import add_body_arguments, add_tracking_arguments, start_by_itself, tracker_options

SUMMARY = "run camera_ingest and tracker in one process: images pass from one to the other without being sent"
EXAMPLE = "tracker_node compose --rig rig.yaml --model person.yaml --initial-state start.yaml --loop"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_body_arguments(parser)
    add_source_arguments(parser)
    add_pace_arguments(parser)
    add_tracking_arguments(parser)


def run(args: argparse.Namespace) -> int:
    from ...ros.tracker.heap import kept_for_ever

    with kept_for_ever():
        from ...loaders.rig.rig_yaml import load_rig
        from ...ros.direct_images import DirectImages
        from ...ros.executor import attach, ros_process, spin
        from ...ros.ingest.node import CameraIngestNode, IngestOptions
        from ...ros.tracker.image_inbox import InboxOptions
        from ...ros.tracker.node import TrackerNode

        rig = load_rig(args.rig)
        ingest = IngestOptions(
            source=source_options(args),
            live_stamps=args.stamps == "live" if args.stamps else not args.lossless,
            as_fast_as_consumed=args.lossless,
            frame_skip=not args.no_frame_skip,
            wait_for_subscribers=1,
            wait_for_info_subscribers=1,
            compressed=args.compressed,
        )
        opened = opened_cameras("compose", rig, args, ingest)
        opened.check_trackable(real_time=not args.lossless)
        direct = DirectImages(opened.cameras)
        options = tracker_options(args, rig, InboxOptions(lossless=args.lossless, direct=direct))
    with ros_process(with_topics(args.ros_args, rig, dict(args.topics))) as stop:
        tracker, cameras = TrackerNode(options), CameraIngestNode(opened, replace(ingest, direct=direct))
        attach(tracker)
        attach(cameras, beside=tracker)
        try:
            start_by_itself(tracker, dict(args.wait_for), stop)
            failure: object = tracker.failure
            if not failure:
                cameras.start()
                spin(tracker, stop, lambda: tracker.has_ended or (cameras.finished.is_set() and tracker.at_rest))
        finally:
            cameras.close()
            tracker.close()
            if args.output is not None:
                tracker.write_bodies(args.output)
            failure, counts, problems = tracker.failure or tracker.fatal, cameras.counts, cameras.problems
            cameras.destroy_node()
            tracker.destroy_node()
    print(summary(counts))
    tell_problems("compose", opened, problems)
    if failure:
        print(f"tracker_node compose: error: {failure}", file=sys.stderr)
    return 2 if failure else 1 if problems else 0
