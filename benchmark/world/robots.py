#!/usr/bin/env python3
"""How an arm is tracked by images alone: Panda, by three cameras, from five degrees a joint off.

``panda``: seven joints that swing through a third of their range, two fingers, before cluttered pictures; 90 image sets of
640x480 at 30 Hz, noise of 4 gray levels, blur of 0.6 px, drawn by another renderer than the tracker's. The base does not move
(``motion.base: fixed``), and its place is said 3 mm and 1 degree off. All other parameters are the defaults; no joint states are
used. ``joint_deg``: errors of the seven joints in all sets, median and 95th percentile; ``tcp_mm``: how far the tool center point
is off, median; lost: that more than 100 mm off, or LOST. The description (URDF with COLLADA meshes) is that of the Python
package example-robot-data, which `--urdf` gives the place of.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark._reference import reference_ms
from benchmark.contour._runs import RATE_HZ, WARM_UP
from benchmark.contour.box import displaced, image_sets, rig_around
from benchmark.world._arguments import Figures, add_pictures, parser_of, reported, seeds_of, write_picture
from tracker_node.loaders.model.urdf import load_urdf
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import Status, TrackEstimate
from tracker_node.tracking.tracker import Tracker

SETS = 90
PANDA = "panda_description/urdf/panda.urdf"
HAND, TCP_M = "panda_hand", (0.0, 0.0, 0.1034)  # where the maker has the tool center point, in the frame of the hand
ARM = [f"panda_joint{i}" for i in range(1, 8)]
REST = dict(zip(ARM, np.radians([0.0, -30.0, 0.0, -120.0, 0.0, 100.0, 45.0]), strict=True))
SWING_RAD, PERIODS_S = np.radians(25.0), (2.5, 5.0)
DIRECTIONS_DEG = (20.0, 15.0), (110.0, 25.0), (-70.0, 20.0)
DISTANCE_M, FOCAL_PX, MIDDLE_M = 1.9, 700.0, (0.15, 0.0, 0.5)
START_OFF_RAD, BASE_OFF_M, BASE_OFF_RAD = np.radians(5.0), 0.003, np.radians(1.0)
LOST_M = 0.100


def panda_urdf() -> Path | None:
    """The description of the installed package, if there is one."""
    found = importlib.util.find_spec("cmeel")
    folder = None if found is None or found.origin is None else Path(found.origin).parents[1] / "cmeel.prefix/share"
    path = None if folder is None else folder / "example-robot-data/robots" / PANDA
    return path if path is not None and path.is_file() else None


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


def start_of(model: ArticulatedModel, state: State, seed: int) -> State:
    """Every joint of the arm off to one side or the other, and the base a little."""
    off, rng = displaced(state, [seed, 32], BASE_OFF_M, BASE_OFF_RAD), np.random.default_rng([seed, 33])
    moves = np.array([axis.name in REST for axis in model.chain.axes])
    return State(off.T_world_root, off.joint_positions + START_OFF_RAD * moves * rng.choice([-1.0, 1.0], moves.size))


def judged(model: ArticulatedModel, estimates: list[TrackEstimate], states: list[State]) -> dict[str, np.ndarray]:
    """Errors of the joints (sets, 7) in degrees and of the tool (sets,) in mm; which sets are lost, and which are said to be."""
    arm = [j for j, axis in enumerate(model.chain.axes) if axis.name in REST]
    hand = model.chain.links.index(HAND)

    def tool(state: State) -> np.ndarray:
        T = Configuration(model, state).Ts_world_link[hand]
        return T[:3, :3] @ TCP_M + T[:3, 3]

    joints = [np.abs(e.state.joint_positions[arm] - s.joint_positions[arm]) for e, s in zip(estimates, states, strict=True)]
    off = np.linalg.norm([tool(e.state) - tool(s) for e, s in zip(estimates, states, strict=True)], axis=1)
    said = np.array([e.status is Status.LOST for e in estimates])
    return {"joints_deg": np.degrees(joints), "tcp_mm": 1e3 * off, "lost": said | (off > LOST_M), "said": said}


def run(path: Path, seed: int, config: TrackerConfig, show: Path | None = None) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Errors of one run, and the milliseconds of its sets."""
    model, cameras = load_urdf(path), rig_around(DIRECTIONS_DEG, DISTANCE_M, FOCAL_PX, MIDDLE_M)
    states = states_of(model, seed)
    tracker = Tracker(cameras, model, config, None, start_of(model, states[0], seed))
    estimates, times = [], []
    for number, one in enumerate(image_sets(cameras, model, states, seed + 20)):
        began = time.perf_counter()
        estimates.append(tracker.step(one))
        times.append(1e3 * (time.perf_counter() - began))
        if show is not None and number in (0, SETS // 2):
            write_picture(one, show / f"panda_{seed}_{number:03d}.png")
    return judged(model, estimates, states), np.array(times)


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    path = args.urdf or panda_urdf()
    if path is None:
        print("robots: no Panda: install example-robot-data, or give --urdf FILE", file=sys.stderr)
        return 2

    def measured(config: TrackerConfig) -> Figures:
        runs, times = [], []
        for seed in seeds_of(args):
            found, ms = run(path, seed, config, args.pictures)
            runs.append(found)
            times.append(ms[WARM_UP:])
            summary = {key: float(np.median(value)) for key, value in found.items()}
            print(f"panda, seed {seed}: {summary}, lost {int(found['lost'].sum())}", file=sys.stderr, flush=True)
        return figures(runs, np.concatenate(times))

    return reported("robots", args, measured, motion__base="fixed")


def figures(runs: list[dict[str, np.ndarray]], times_ms: np.ndarray) -> dict[str, float | int]:
    joints = np.concatenate([found["joints_deg"] for found in runs])
    tools = np.concatenate([found["tcp_mm"] for found in runs])
    return {
        "panda.joint_deg": float(np.median(joints)), "panda.joint_p95_deg": float(np.percentile(joints, 95)),
        "panda.tcp_mm": float(np.median(tools)), "panda.tcp_p95_mm": float(np.percentile(tools, 95)),
        "panda.lost_sets": sum(int(found["lost"].sum()) for found in runs), "panda.sets": SETS * len(runs),
        "panda.said_lost": sum(int(found["said"].sum()) for found in runs),
        "panda.set_ms": float(np.median(times_ms)), "panda.set_p95_ms": float(np.percentile(times_ms, 95)),
        "panda.reference_ms": reference_ms(),
    }  # fmt: skip


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = parser_of(__doc__, "robots.py --seeds 3 --pictures out/robots")
    add_pictures(parser)
    parser.add_argument("--urdf", type=Path, metavar="FILE", help="of a Panda (default: that of example-robot-data)")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
