#!/usr/bin/env python3
"""Whether the doctor names what is wrong with a rig, and is silent where nothing is.

Twelve faults (`_planted_faults.py`) are planted, each alone, into a real recording (the Balancing sample, its refined rig)
and into rendered ones (a mannequin dancing, four cameras; drawn by OpenGL, not by the tracker's own renderer). A fault is
named where the doctor tells it, of the right cameras; ``doctor.named`` is of the clip on which the fewest are,
``doctor.false_alarms`` counts whatever else it tells, of clean and of faulty clips of all kinds.

``doctor.turned_*``: clips of clothed people, whose cameras are turned by half a degree and by one, each alone, about an axis
drawn by seed; ``named`` is the share of turns that are told of the right camera, ``wrong`` counts what else is told, of the
clips as they are, too.
"""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np

from tracker_node.camera.rig import CameraRig
from tracker_node.cli.sample import prepare
from tracker_node.doctor.diagnosis import examine
from tracker_node.doctor.recording import CameraRecording
from tracker_node.doctor.setup import Finding
from tracker_node.geometry import se3, so3
from tracker_node.loaders.images.source import open_camera_source
from tracker_node.loaders.rig.calibration_toml import load_pose2sim
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.report.metrics_file import report_metrics
from tracker_node.runs.people.detection import DetectionOptions, Detector, detectors_of
from tracker_node.synthesis.recording import Request, default_motions, produce
from tracker_node.synthesis.scenes.scene import SceneConfig

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark.calibration._planted_faults import PLANTED, Clip
from benchmark.clothed._recording import default_folders
from benchmark.clothed._recording import load_clip as load_people

OUTPUT = Path("out/doctor")
FAULTY = ("balancing", "dance_b")  # the clips that faults are planted in
CLEAN = ("balancing", "dance_b", "walk", "spinkick", "swing")
IF_THERE = ("caliscope",)  # a real recording of four webcams, of a board waved by hand
RATE_HZ, TURNS_DEG = 30.0, (0.5, 1.0)  # of clips of clothed people, and what their cameras are turned by
N_REAL, N_RENDERED = 100, 60  # images of each camera: 1.7 s at 60 Hz, 2 s at 30 Hz


def load_clip(name: str) -> Clip:
    """A clip by name: ``balancing``, ``caliscope`` (below TRACKER_SHARED_DATA), or a motion that is rendered, the spinkick by six
    cameras."""
    if name == "caliscope":
        calibration = Path(os.environ["TRACKER_SHARED_DATA"]) / "caliscope_board" / "post_optimization" / "camera_array.toml"
        sources = [replace(c, source=str(calibration.with_name(f"{c.name}.mp4"))) for c in load_pose2sim(calibration)]
        rig, n_images = CameraRig(tuple(sources)), N_RENDERED
    elif name == "balancing":
        folder, n_images = OUTPUT / "sample", N_REAL
        prepare(folder)
        rig = load_rig(folder / "rig_refined.yaml")
    else:
        folder, n_images = OUTPUT / name, N_RENDERED
        scene = SceneConfig(n_cameras=6 if name == "spinkick" else 4, seed=3 if name == "spinkick" else 1)
        produce(Request(motion=name, n_images=n_images, scene=scene, motions=default_motions()), folder)
        rig = load_rig(folder / "rig.yaml")
    sources = {camera.name: open_camera_source(camera) for camera in rig}
    images = {camera: [image for _, image in islice(source, n_images)] for camera, source in sources.items()}
    return Clip(rig, images, {camera: source.rate_hz for camera, source in sources.items()})


@cache
def detector() -> Detector:
    return detectors_of(DetectionOptions())[0]


def findings(clip: Clip) -> tuple[Finding, ...]:
    """What the doctor says of a clip, with people looked for."""
    recordings = {}
    for name in clip.rig.names:
        rate_hz = clip.rates_hz[name]
        recordings[name] = CameraRecording(name, len(clip.images[name]), rate_hz, detector=detector())
        for i, image in enumerate(clip.images[name]):
            recordings[name].add(round(i * 1e9 / rate_hz), image)
    return examine(clip.rig, recordings).findings


def turned(rig: CameraRig, index: int, degrees: float, rng: np.random.Generator) -> CameraRig:
    """The rig with a camera that looks elsewhere, about an axis across its line of sight."""
    axis = np.append(rng.normal(size=2), 0.0)
    camera = rig.cameras[index]
    T = se3.from_rotation_translation(so3.exp(np.radians(degrees) * axis / np.linalg.norm(axis)), np.zeros(3))
    cameras = (*rig.cameras[:index], replace(camera, T_world_cam=camera.T_world_cam @ T), *rig.cameras[index + 1 :])
    return replace(rig, cameras=cameras)


def turned_cameras(folders: list[Path], quick: bool) -> dict[str, float]:
    """What the doctor says of turned cameras, by the motion and the joints of people."""
    rng = np.random.default_rng(7)
    named: dict[float, list[bool]] = {size: [] for size in TURNS_DEG}
    wrong = 0
    for folder in folders[:1] if quick else folders:
        clip = load_people(folder)
        recordings = {name: CameraRecording(name, len(clip), RATE_HZ, detector=detector()) for name in clip.rig.names}
        for image_set in clip.sets():
            for image in image_set.images:
                recordings[image.camera].add(image.stamp_ns, image.bgr)
        told = examine(clip.rig, recordings).findings
        wrong += len(told)
        print(f"{clip.name}, clean", flush=True)
        _say(told, [])
        for size, own in named.items():
            for i, name in enumerate(clip.rig.names[:1] if quick else clip.rig.names):
                told = examine(turned(clip.rig, i, size, rng), recordings).findings
                right = [finding for finding in told if finding.cameras == (name,) and finding.fault == "place"]
                print(f"{clip.name}, {name} turned by {size:g} degrees", flush=True)
                _say(told, right)
                own.append(bool(right))
                wrong += len(told) - len(right)
    shares = {f"doctor.turned_{size:g}deg_named": float(np.mean(own)) for size, own in named.items() if own}
    return {**shares, "doctor.turned_wrong": wrong}


def judged(fault: str, clip: Clip) -> tuple[bool, int]:
    """Whether a planted fault is named, and how much else is told."""
    planted = PLANTED[fault]
    told = findings(planted.plant(clip))
    wanted = (planted.fault, tuple(clip.rig.names[i] for i in planted.cameras))
    right = [finding for finding in told if (finding.fault, finding.cameras) == wanted]
    _say(told, right)
    return bool(right), len(told) - len(right)


def _say(told: tuple[Finding, ...], right: list[Finding]) -> None:
    for finding in told:
        print(f"    {'' if finding in right else 'FALSE: '}{finding.sentence}", flush=True)


def main(arguments: list[str] | None = None) -> int:
    parser = parser_of(
        __doc__,
        "python benchmark/calibration/doctor.py --json out/doctor.json",
        "one rendered clip and three faults: shows that it runs",
    )
    every = [*dict.fromkeys((*FAULTY, *CLEAN, *(IF_THERE if "TRACKER_SHARED_DATA" in os.environ else ())))]
    parser.add_argument("--clips", nargs="*", default=every, metavar="NAME", help="only these")
    parser.add_argument("--faults", nargs="+", default=list(PLANTED), choices=list(PLANTED), metavar="FAULT", help="only these")
    people = default_folders(Path("out/clothed"))
    parser.add_argument("--people", nargs="*", type=Path, default=people, metavar="FOLDER", help="clips of clothed people")
    args = parser.parse_args(arguments)
    quick = ["swing"], ["wrong_resolution", "swapped_cameras", "clock_offset"]
    clips, faults = quick if args.quick else (args.clips, args.faults)

    metrics: dict[str, float] = {}
    if args.people:
        metrics |= turned_cameras(args.people, args.quick)
    named: list[int] = []
    false_alarms = 0
    for name in clips:
        clip = load_clip(name)
        print(f"{name}, clean", flush=True)
        told = findings(clip)
        _say(told, [])
        metrics[f"doctor.{name}.clean_false_alarms"] = len(told)
        false_alarms += len(told)
        if name not in FAULTY and not args.quick:
            continue
        count = 0
        for fault in faults:
            print(f"{name}, {fault}", flush=True)
            right, others = judged(fault, clip)
            count += right
            false_alarms += others
        metrics[f"doctor.{name}.named"] = count
        named.append(count)
    if named:
        metrics["doctor.named"] = min(named)
    metrics["doctor.false_alarms"] = false_alarms
    report_metrics(metrics, args.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
