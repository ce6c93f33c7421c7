#!/usr/bin/env python3
"""A rendered recording of two clothed people with exact truth, drawn by a seed: they pass each other closely, embrace, and part.

People, clothes, room and renderer are those of `benchmark/clothed`: skinned bodies and a rasterizer that have nothing of the
tracker's. Five cameras of 640x480, 30 Hz, 150 image sets; `PHASES` says when what happens. Each person's body is the tracker's,
scaled to a T-pose with exact joints, and its start is the state whose landmarks are nearest to the truth, as in the clips of one
person. From seed 101 on people are those of held-out clips: the tracker's tables were fitted to the others.

First step, once: the bodies, in an environment of their own; where they are missing, the program says how.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark.clothed._recording import JOINTS
from benchmark.multi.crossing._motion import N_SETS, PHASES
from benchmark.multi.crossing._stage import PEOPLE, Stage, set_stage, write_recording
from benchmark.multi.crossing._walker import RATE_HZ
from tracker_node.calibration.body import scale_to_trial, targets_of
from tracker_node.calibration.pose import fit_state_to_landmarks
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import SourceError, TrackerError
from tracker_node.loaders.motion.trc import load_trc
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import State
from tracker_node.model.humans.human import human_model
from tracker_node.observation.image_set import CameraImage, ImageSet

DEFAULT_CACHE, DEFAULT_BODIES = Path("out/multi"), Path("out/clothed/bodies")
_LOOK = (0, 22, 40, 56, 72, 84, 96, 108, 126, 149)  # image sets of the sheet
_COLORS = ((0, 255, 255), (255, 255, 0))  # of people's joints there, BGR


@dataclass(frozen=True, eq=False)
class Clip:
    """A recording of two people.

    Attributes
    ----------
    folder : of the recording.
    rig : its cameras.
    models, starts : of each person the body, and its state in the first image set.
    sets : all images.
    joints : names of the joints that are judged.
    truth : of each person, (n_sets, n_joints, 3) meters, world.
    """

    folder: Path
    rig: CameraRig
    models: dict[str, ArticulatedModel]
    starts: dict[str, State]
    sets: list[ImageSet]
    joints: tuple[str, ...]
    truth: dict[str, np.ndarray]


def make_clip(seed: int, cache: Path, bodies: Path = DEFAULT_BODIES) -> Clip:
    """The clip of a seed, drawn if it is not there.

    Parameters
    ----------
    seed : decides people, clothes, room, cameras and ways.
    cache : of the clips' folders.
    bodies : folder of the bodies of `benchmark/clothed`.

    Returns
    -------
    The clip.

    Raises
    ------
    SourceError : no captured walk or no bodies (says how to get them), or an image is missing.
    """
    folder = cache / f"crossing_{seed}"
    if not _is_drawn(folder):
        print(f"{folder}: drawing {N_SETS} image sets", file=sys.stderr, flush=True)
        write_recording(set_stage(seed, bodies), folder, code_of_clips())
    return load_clip(folder)


def _is_drawn(folder: Path) -> bool:
    file = folder / "clip.json"
    return file.is_file() and json.loads(file.read_text(encoding="utf-8"))["code"] == code_of_clips()


def code_of_clips(more: str = "") -> str:
    """Of the programs that say what is drawn, and of what else does."""
    files = sorted((Path(__file__).parent / "crossing").glob("*.py"))
    return hashlib.sha256(b"".join([*(file.read_bytes() for file in files), more.encode()])).hexdigest()[:16]


def load_clip(folder: Path) -> Clip:
    """The clip of a folder.

    Raises
    ------
    SourceError : an image is missing.
    """
    rig, models, starts, truth = load_rig(folder / "rig.yaml"), {}, {}, {}
    for name in PEOPLE:
        model = scale_to_trial(human_model(ankles=True), load_trc(folder / name / "static.trc")).model
        markers = load_trc(folder / name / "truth.trc")
        targets = [targets_of(model, markers, row) for row in range(len(markers))]
        models[name], starts[name] = model, fit_state_to_landmarks(model, targets[0]).state
        truth[name] = np.array([[row[joint] for joint in JOINTS] for row in targets])
    return Clip(folder, rig, models, starts, [_image_set(folder, rig, row) for row in range(N_SETS)], JOINTS, truth)


def _image_set(folder: Path, rig: CameraRig, row: int) -> ImageSet:
    stamp_ns, images = round(row * 1e9 / RATE_HZ), []
    for camera in rig:
        path = folder / camera.name / f"{row:04d}.jpg"
        pixels = cv2.imread(str(path), cv2.IMREAD_COLOR)
        if pixels is None:
            raise SourceError(path, "cannot be read as an image")
        images.append(CameraImage(camera.name, stamp_ns, pixels))
    return ImageSet(stamp_ns, tuple(images))


def draw_sheet(clip: Clip, path: Path) -> None:
    """Write a PNG of some image sets with the true joints; cameras are beside each other."""
    lines = []
    for row in _LOOK:
        images = [image.pixels.copy() for image in clip.sets[row].images]
        for camera, image in zip(clip.rig, images, strict=True):
            cv2.putText(image, f"{camera.name} {row}", (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (255, 255, 255), 1, cv2.LINE_AA)
            for name, color in zip(PEOPLE, _COLORS, strict=True):
                for u, v in camera.project(clip.truth[name][row])[0]:
                    cv2.circle(image, (round(float(u)), round(float(v))), 2, color, -1, cv2.LINE_AA)
        lines.append(np.hstack(images))
    cv2.imwrite(str(path), np.vstack(lines))


def print_gaps(stage: Stage) -> None:
    """Print how far people are from each other, how much of them is within the other, and whether joints are on their people."""
    for name, rows in {"all": (0, N_SETS), **PHASES}.items():
        gaps = [stage.gaps(i) for i in range(*rows, 4)]
        least, within = [1e3 * gap.min() for gap in gaps], 100.0 * np.mean([np.mean(gap < -0.01) for gap in gaps])
        print(
            f"{name}, sets {rows[0]} to {rows[1] - 1}: gap of clothes {np.mean(least):.0f} mm, least {np.min(least):.0f};"
            f" {within:.1f} % of the vertices more than 10 mm within the other"
        )
    on = [stage.on_body(p, i, view) for p in range(len(PEOPLE)) for i in range(0, N_SETS, 10) for view in stage.views]
    print(f"true joints on their own person in the image: {100.0 * np.mean(on):.1f} %")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="default: %(default)s")
    parser.add_argument("--cache", type=Path, default=DEFAULT_CACHE, metavar="FOLDER", help="of clips (default: %(default)s)")
    parser.add_argument("--bodies", type=Path, default=DEFAULT_BODIES, metavar="FOLDER", help="default: %(default)s")
    parser.add_argument("--look", action="store_true", help="write look.png into the clip's folder, and print gaps")
    args = parser.parse_args()
    cv2.setNumThreads(1)
    try:
        began = time.monotonic()
        clip = make_clip(args.seed, args.cache, args.bodies)
        print(f"{clip.folder}: {len(clip.sets)} image sets after {time.monotonic() - began:.0f} s", file=sys.stderr)
        if args.look:
            draw_sheet(clip, clip.folder / "look.png")
            print_gaps(set_stage(args.seed, args.bodies))
    except TrackerError as error:
        print(f"crossing_clip: error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
