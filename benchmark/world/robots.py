#!/usr/bin/env python3
"""How an arm is tracked by images alone: Panda, by three cameras, from five degrees a joint off.

``panda``: seven joints that swing through a third of their range, two fingers, before cluttered pictures; 90 image sets of
640x480 at 30 Hz, noise of 4 gray levels, blur of 0.6 px, drawn by another renderer than the tracker's. The base does not move
(``motion.base: fixed``), and its place is said 3 mm and 1 degree off. All other parameters are the defaults; no joint states are
used. ``joint_deg``: errors of the seven joints in the sets from the fifth on, median and 95th percentile; ``tcp_mm``: how far the
hand is off, median; lost: a hand more than 100 mm off, or LOST. The description (URDF with COLLADA meshes) is that of the Python
package example-robot-data, which `--urdf` gives the place of.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark._reference import reference_ms
from benchmark.contour._runs import RATE_HZ, WARM_UP, configured, image_set, print_circumstances
from benchmark.world.things import LIGHTS, sensed
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import TrackerError
from tracker_node.experiments.target_images import TargetStudio
from tracker_node.loaders.model.urdf import load_urdf
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import N_ROOT_DOF
from tracker_node.observation.image_set import ImageSet
from tracker_node.report.metrics_file import report_metrics
from tracker_node.synthesis.scenes.room import cluttered_background
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import Status, TrackEstimate
from tracker_node.tracking.tracker import Tracker

SETS = 90
PANDA = "panda_description/urdf/panda.urdf"
HAND = "panda_hand_joint"  # whose origin is the tool's
ARM = [f"panda_joint{i}" for i in range(1, 8)]
REST = dict(zip(ARM, np.radians([0.0, -30.0, 0.0, -120.0, 0.0, 100.0, 45.0]), strict=True))
SWING_RAD, PERIODS_S = np.radians(25.0), (2.5, 5.0)
DISTANCE_M, HEIGHT_M, FOCAL_PX = 1.9, 0.5, 700.0
START_OFF_RAD, BASE_OFF_M, BASE_OFF_RAD = np.radians(5.0), 0.003, np.radians(1.0)
LOST_M, SETTLED = 0.100, 5


def panda_urdf() -> Path | None:
    """The description of the installed package, if there is one."""
    found = importlib.util.find_spec("cmeel")
    folder = None if found is None or found.origin is None else Path(found.origin).parents[1] / "cmeel.prefix/share"
    path = None if folder is None else folder / "example-robot-data/robots" / PANDA
    return path if path is not None and path.is_file() else None


def rig() -> CameraRig:
    """Three cameras around the arm, that look at its middle."""
    K = np.array([[FOCAL_PX, 0.0, 319.5], [0.0, FOCAL_PX, 239.5], [0.0, 0.0, 1.0]])
    cameras = []
    for i, (azimuth, elevation) in enumerate(np.radians([(20.0, 15.0), (110.0, 25.0), (-70.0, 20.0)])):
        back = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        T = np.eye(4)
        T[:3, :3] = np.column_stack([right, np.cross(-back, right), -back])
        T[:3, 3] = DISTANCE_M * back + [0.15, 0.0, HEIGHT_M]
        cameras.append(Camera(f"cam{i + 1:02d}", CameraModel(640, 480, K), T))
    return CameraRig(tuple(cameras), lights=LIGHTS)


def states_of(model: ArticulatedModel, seed: int) -> list[State]:
    """Every joint swings at a rate and from a phase of its own."""
    rng = np.random.default_rng([seed, 31])
    names = [axis.name for axis in model.chain.axes]
    rates, phases = 2.0 * np.pi / rng.uniform(*PERIODS_S, len(names)), rng.uniform(0.0, 2.0 * np.pi, len(names))
    states = []
    for k in range(SETS):
        angles = State.neutral(model).joint_positions.copy()
        for j, axis in enumerate(model.chain.axes):
            if axis.name in REST:
                angle = REST[axis.name] + SWING_RAD * np.sin(rates[j] * k / RATE_HZ + phases[j])
                angles[j] = np.clip(angle, axis.lower, axis.upper)
        states.append(State(np.eye(4), angles))
    return states


def image_sets(cameras: CameraRig, model: ArticulatedModel, states: list[State], seed: int) -> Iterator[ImageSet]:
    """What the cameras see; drawn as they are asked for."""
    backgrounds = [cluttered_background(camera, seed + 20) for camera in cameras]
    with TargetStudio(cameras) as studio:
        for number, state in enumerate(states):
            images = studio.images(Configuration(model, state), backgrounds)
            yield image_set(cameras, [sensed(im, i, number) for i, im in enumerate(images)], round(number * 1e9 / RATE_HZ))


def displaced(model: ArticulatedModel, state: State, seed: int) -> State:
    """Every joint of the arm off to one side or the other, and the base a little."""
    rng = np.random.default_rng([seed, 32])
    tangent = np.zeros(model.n_dof)
    move, turn = rng.normal(size=3), rng.normal(size=3)
    tangent[:3], tangent[3:6] = BASE_OFF_M * move / np.linalg.norm(move), BASE_OFF_RAD * turn / np.linalg.norm(turn)
    for j, axis in enumerate(model.chain.axes):
        if axis.name in REST:
            tangent[N_ROOT_DOF + j] = START_OFF_RAD * rng.choice([-1.0, 1.0])
    return state.retract(tangent)


def judged(model: ArticulatedModel, estimates: list[TrackEstimate], states: list[State]) -> dict[str, np.ndarray]:
    """Errors of the joints (sets, 7) in degrees and of the hand (sets,) in mm; which sets are lost, and which are said to be."""
    arm = [j for j, axis in enumerate(model.chain.axes) if axis.name in REST]
    hand = model.landmark_index(HAND)
    joints = [np.abs(e.state.joint_positions[arm] - s.joint_positions[arm]) for e, s in zip(estimates, states, strict=True)]
    places = [
        Configuration(model, e.state).landmarks_world[hand] - Configuration(model, s).landmarks_world[hand]
        for e, s in zip(estimates, states, strict=True)
    ]
    off = np.linalg.norm(places, axis=1)
    said = np.array([e.status is Status.LOST for e in estimates])
    return {"joints_deg": np.degrees(joints), "hand_mm": 1e3 * off, "lost": said | (off > LOST_M), "said": said}


def run(path: Path, seed: int, config: TrackerConfig, show: Path | None = None) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Errors of one run, and the milliseconds of its sets."""
    model, cameras = load_urdf(path), rig()
    states = states_of(model, seed)
    tracker = Tracker(cameras, model, config, None, displaced(model, states[0], seed))
    estimates, times = [], []
    for number, one in enumerate(image_sets(cameras, model, states, seed)):
        began = time.perf_counter()
        estimates.append(tracker.step(one))
        times.append(1e3 * (time.perf_counter() - began))
        if show is not None and number in (0, SETS // 2):
            show.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(show / f"panda_{seed}_{number:03d}.png"), np.hstack([image.pixels for image in one.images]))
    return judged(model, estimates, states), np.array(times)


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    cv2.setNumThreads(1)
    path = args.urdf or panda_urdf()
    if path is None:
        print("robots: no Panda: install example-robot-data, or give --urdf FILE", file=sys.stderr)
        return 2
    runs, times = [], []
    try:
        config = configured(args.changes, motion__base="fixed")
        for seed in args.seeds or range(1, 2 if args.quick else 6):
            found, ms = run(path, seed, config, args.pictures)
            runs.append(found)
            times.append(ms[WARM_UP:])
            summary = {key: float(np.median(value[SETTLED:])) for key, value in found.items()}
            print(f"panda, seed {seed}: {summary}, lost {int(found['lost'].sum())}", file=sys.stderr, flush=True)
    except TrackerError as error:
        print(f"robots: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(figures(runs, np.concatenate(times)), args.json)
    return 0


def figures(runs: list[dict[str, np.ndarray]], times_ms: np.ndarray) -> dict[str, float | int]:
    joints = np.concatenate([found["joints_deg"][SETTLED:] for found in runs])
    hands = np.concatenate([found["hand_mm"][SETTLED:] for found in runs])
    return {
        "panda.joint_deg": float(np.median(joints)), "panda.joint_p95_deg": float(np.percentile(joints, 95)),
        "panda.tcp_mm": float(np.median(hands)), "panda.tcp_p95_mm": float(np.percentile(hands, 95)),
        "panda.lost_sets": sum(int(found["lost"].sum()) for found in runs), "panda.sets": SETS * len(runs),
        "panda.said_lost": sum(int(found["said"].sum()) for found in runs),
        "panda.set_ms": float(np.median(times_ms)), "panda.set_p95_ms": float(np.percentile(times_ms, 95)),
        "panda.reference_ms": reference_ms(),
    }  # fmt: skip


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0],
        epilog="example:\n  python benchmark/world/robots.py --seeds 3 --pictures out/robots",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--quick", action="store_true", help="one seed")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    parser.add_argument("--urdf", type=Path, metavar="FILE", help="of a Panda (default: that of example-robot-data)")
    parser.add_argument("--seeds", nargs="+", type=int, metavar="N", help="of the motions (default: 1 to 5)")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="write two image sets of each run there")
    parser.add_argument(
        "--set", nargs="+", default=[], metavar="KEY=VALUE", dest="changes", help="parameters of the tracker, e.g. threads=1"
    )
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
