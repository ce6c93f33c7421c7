"""``tracker_node new``: descriptions of work, from what has been made for it."""

from __future__ import annotations

import argparse
import sys
from os.path import relpath
from pathlib import Path

from ..arguments.run_images import refuse_to_overwrite
from ..arguments.verbs import Subverb, add_subverbs, run_subverb

SUMMARY = "describe a recording, for track, pipeline and batch: write recording.yaml and parameters for what is there"
EXAMPLE = "tracker_node new recording --rig rig_timed.yaml --model person.yaml"
_POINTS, _CONTOURS = ("region", "keypoints"), ("region",)


def _add_recording_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--rig", required=True, type=Path, metavar="FILE", help="rig.yaml, with the videos or folders of the recording")
    add("--model", required=True, type=Path, metavar="FILE", help="model.yaml or URDF: the body")
    add("--initial-state", type=Path, metavar="FILE", help="state.yaml: the first pose (default: it is searched)")
    add("--modalities", nargs="+", metavar="NAME", help="what the body is compared with (default: region keypoints of a person,"
        " region of other bodies)")  # fmt: skip
    add("--run", type=Path, default=Path("run"), metavar="FOLDER", help="where the results will go (default: %(default)s)")
    add("-o", "--output", type=Path, default=Path("recording.yaml"), metavar="FILE", help="file to write (default: %(default)s)")
    add("--force", action="store_true", help="overwrite what is there")


def _run_recording(args: argparse.Namespace) -> int:
    import numpy as np

    from ...loaders.images.source import assumed_rate, open_camera_source
    from ...loaders.model.model_yaml import load_model
    from ...loaders.model.state_yaml import load_state
    from ...loaders.recording_yaml import PARAMETERS, write_recording
    from ...loaders.rig.rig_yaml import load_rig
    from ...model.humans.keypoints import is_person
    from ...tracking.config import TrackerConfig

    folder = args.output.parent
    refuse_to_overwrite(args, args.output, folder / PARAMETERS)
    rig, model = load_rig(args.rig), load_model(args.model)
    if args.initial_state is not None:
        load_state(args.initial_state, model)
    sources = [open_camera_source(camera) for camera in rig]
    for note in assumed_rate(sources, f"rate_hz below images in {args.output}"):
        print(f"new recording: {note}", file=sys.stderr)
    period_s = float(np.median([1.0 / source.rate_hz for source in sources]))
    modalities = tuple(args.modalities or (_POINTS if is_person(model) else _CONTOURS))
    TrackerConfig(modalities=modalities)
    named = {"rig": args.rig, "model": args.model, "initial_state": args.initial_state, "output": args.run}
    files = {name: relpath(path, folder) for name, path in named.items() if path is not None}
    free = any(camera.time_offset_ns or camera.time_drift_ppm or camera.stamp_file for camera in rig)
    write_recording(args.output, files, modalities, period_s, free, f"{model.name} before {len(rig)} cameras")
    start = f"begins with {args.initial_state}" if args.initial_state else "the body is searched in the first images"
    print(f"{len(rig)} cameras, {1.0 / period_s:.5g} Hz; {start}; wrote {args.output} and {folder / PARAMETERS}")
    return 0


SUBVERBS = (
    Subverb(
        "recording",
        "write recording.yaml and tracker.yaml for a rig, a body and, if there is one, a first pose",
        "tracker_node new recording --rig rig_timed.yaml --model person.yaml -o recording.yaml",
        _add_recording_arguments,
        _run_recording,
    ),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_subverbs(parser, SUBVERBS)


run = run_subverb
