#!/usr/bin/env python3
"""How robots are tracked: two arms and a humanoid, by images alone, with a base that is not known, and beside joint states.

Joints swing through some 50 degrees before cluttered pictures; 90 image sets of 640x480 at 30 Hz, noise of 4 gray levels, blur of
0.6 px, drawn by another renderer than the tracker's. The start is five degrees a joint off, to one side or the other. All
parameters but `motion.base` are the defaults.

``panda``, ``ur5``: three cameras, `base: fixed` where it is, images alone. ``panda_base``: its place is said 3 mm and 1 degree
off. ``panda_prior``: with joint states, each joint of which is 0.3 degrees (standard deviation) off for the whole run; the base
as in ``panda_base``. ``g1``: a humanoid of 29 joints whose root sways, seen by four cameras.

``joint_deg``: errors of the joints that swing in all sets, median and 95th percentile; ``tcp_mm``: how far the tool center point
(of the humanoid, the farther wrist) is off, median; lost: that more than 100 mm off, or LOST. The descriptions (URDF with COLLADA
and STL meshes) are those of the Python package example-robot-data, whose folder of robots `--robots` names.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark._reference import reference_ms
from benchmark.contour._runs import RATE_HZ, WARM_UP
from benchmark.contour.box import displaced, image_sets, rig_around
from benchmark.world._arguments import Figures, add_pictures, reported, runs_of, seeded_parser, write_picture
from tracker_node.camera.rig import CameraRig
from tracker_node.geometry import so3
from tracker_node.loaders.model.urdf import load_urdf
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.observation.image_set import ImageSet
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import Status, TrackEstimate
from tracker_node.tracking.tracker import Tracker

SETS = 90
SWING_RAD, PERIODS_S = np.radians(25.0), (2.5, 5.0)
SWAY_M, SWAY_RAD = 0.05, np.radians(10.0)
START_OFF_RAD, BASE_OFF_M, BASE_OFF_RAD = np.radians(5.0), 0.003, np.radians(1.0)
SAID_OFF_RAD = np.radians(0.3)
LOST_M = 0.100


@dataclass(frozen=True)
class Robot:
    """What moves, from where, and who looks at it.

    Parameters
    ----------
    urdf : below the folder of robots.
    rest_deg : middle of the swing, by the names of joints.
    tools : links, and the points on them that are compared.
    directions_deg, distance_m, focal_px, middle_m : cameras, see `rig_around`.
    sways : the root moves too.
    """

    urdf: str
    rest_deg: Mapping[str, float]
    tools: tuple[tuple[str, tuple[float, float, float]], ...]
    directions_deg: tuple[tuple[float, float], ...]
    distance_m: float
    middle_m: tuple[float, float, float]
    focal_px: float = 700.0
    sways: bool = False

    @cached_property
    def rig(self) -> CameraRig:
        return rig_around(self.directions_deg, self.distance_m, self.focal_px, self.middle_m)

    def swinging(self, model: ArticulatedModel) -> list[int]:
        return [j for j, axis in enumerate(model.chain.axes) if axis.name in self.rest_deg]


ASIDE = (20.0, 15.0), (110.0, 25.0), (-70.0, 20.0)
PANDA = Robot(
    "panda_description/urdf/panda.urdf",
    dict(zip([f"panda_joint{i}" for i in range(1, 8)], (0.0, -30.0, 0.0, -120.0, 0.0, 100.0, 45.0), strict=True)),
    (("panda_hand", (0.0, 0.0, 0.1034)),),  # where the maker has the tool center point
    ASIDE, 1.9, (0.15, 0.0, 0.5),
)  # fmt: skip
UR5 = Robot(
    "ur_description/urdf/ur5_robot.urdf",
    {"shoulder_pan_joint": 0.0, "shoulder_lift_joint": -100.0, "elbow_joint": 100.0, "wrist_1_joint": -90.0,
     "wrist_2_joint": -90.0, "wrist_3_joint": 0.0},
    (("tool0", (0.0, 0.0, 0.0)),),
    ASIDE, 1.9, (0.15, 0.0, 0.4),
)  # fmt: skip
_SIDES = {"shoulder_pitch": 0.0, "shoulder_yaw": 0.0, "elbow": 30.0, "hip_pitch": -10.0, "hip_yaw": 0.0, "knee": 30.0}
G1 = Robot(
    "g1_description/urdf/g1_29dof_rev_1_0.urdf",
    {"waist_yaw_joint": 0.0, "left_shoulder_roll_joint": 35.0, "right_shoulder_roll_joint": -35.0}
    | {f"{side}_{name}_joint": angle for side in ("left", "right") for name, angle in _SIDES.items()},
    (("left_wrist_yaw_link", (0.0, 0.0, 0.0)), ("right_wrist_yaw_link", (0.0, 0.0, 0.0))),
    ((20.0, 15.0), (110.0, 20.0), (-70.0, 20.0), (200.0, 10.0)), 2.6, (0.0, 0.0, -0.15), sways=True,
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A robot; whether the place of its base is said wrongly, and whether joint states come beside the images."""

    robot: Robot
    base_off: bool = False
    says: bool = False


CASES = {
    "panda": Case(PANDA), "panda_base": Case(PANDA, base_off=True), "panda_prior": Case(PANDA, base_off=True, says=True),
    "ur5": Case(UR5), "g1": Case(G1),
}  # fmt: skip


def folder_of_robots() -> Path | None:
    """That of the installed package example-robot-data, if there is one."""
    found = importlib.util.find_spec("cmeel")
    folder = None if found is None or found.origin is None else Path(found.origin).parents[1] / "cmeel.prefix/share"
    path = None if folder is None else folder / "example-robot-data/robots"
    return path if path is not None and path.is_dir() else None


def states_of(robot: Robot, model: ArticulatedModel, seed: int) -> list[State]:
    """Every joint swings at a rate and from a phase of its own."""
    rng = np.random.default_rng([seed, 31])
    axes = model.chain.axes
    rates, phases = 2.0 * np.pi / rng.uniform(*PERIODS_S, len(axes)), rng.uniform(0.0, 2.0 * np.pi, len(axes))
    sway = rng.normal(size=(2, 3))
    states = []
    for k in range(SETS):
        angles, T = State.neutral(model).joint_positions.copy(), np.eye(4)
        for j, axis in enumerate(axes):
            if axis.name in robot.rest_deg:
                angle = np.radians(robot.rest_deg[axis.name]) + SWING_RAD * np.sin(rates[j] * k / RATE_HZ + phases[j])
                angles[j] = np.clip(angle, axis.lower, axis.upper)
        if robot.sways:
            way, turn = np.sin(2.0 * np.pi * k / (RATE_HZ * PERIODS_S[0])), np.sin(2.0 * np.pi * k / (RATE_HZ * PERIODS_S[1]))
            T[:3, 3] = SWAY_M * way * sway[0] / np.linalg.norm(sway[0])
            T[:3, :3] = so3.exp(SWAY_RAD * turn * sway[1] / np.linalg.norm(sway[1]))
        states.append(State(T, angles))
    return states


def start_of(case: Case, model: ArticulatedModel, state: State, seed: int) -> State:
    """Every joint that swings off to one side or the other; the base, where it is said wrongly, a little."""
    off = displaced(state, [seed, 32], BASE_OFF_M, BASE_OFF_RAD) if case.base_off else state
    angles = off.joint_positions.copy()
    angles[case.robot.swinging(model)] += START_OFF_RAD * np.random.default_rng([seed, 33]).choice(
        [-1.0, 1.0], len(case.robot.swinging(model))
    )
    return State(off.T_world_root, angles)


def with_joint_states(
    case: Case, model: ArticulatedModel, states: list[State], sets: Iterable[ImageSet], seed: int
) -> Iterable[ImageSet]:
    """Image sets beside what the robot says of its joints: of all of them, each off by a constant of its own."""
    axes = model.chain.axes
    off = SAID_OFF_RAD * np.random.default_rng([seed, 34]).normal(size=len(axes))
    off[[j for j in range(len(axes)) if j not in case.robot.swinging(model)]] = 0.0
    for one, state in zip(sets, states, strict=True):
        said = {axis.name: value for axis, value in zip(axes, state.joint_positions + off, strict=True)}
        yield replace(one, joint_positions=said) if case.says else one


@dataclass(frozen=True, eq=False)
class Run:
    """Errors of the joints (sets, n) in degrees and of the tool (sets,) in mm; which sets are lost, and which are said to be."""

    joints_deg: np.ndarray
    tcp_mm: np.ndarray
    lost: np.ndarray
    said: np.ndarray
    times_ms: np.ndarray

    def __str__(self) -> str:
        p95 = np.percentile(self.joints_deg, 95)
        return (
            f"{np.median(self.joints_deg):.3f} deg (95 %: {p95:.2f}), {np.median(self.tcp_mm):.2f} mm,"
            f" {int(self.lost.sum())} lost, {np.median(self.times_ms):.1f} ms"
        )


def judged(
    robot: Robot, model: ArticulatedModel, estimates: list[TrackEstimate], states: list[State], times_ms: list[float]
) -> Run:
    links = [(model.chain.links.index(link), np.array(point)) for link, point in robot.tools]

    def tools(state: State) -> np.ndarray:
        Ts = Configuration(model, state).Ts_world_link
        return np.array([Ts[link, :3, :3] @ point + Ts[link, :3, 3] for link, point in links])

    swinging, pairs = robot.swinging(model), list(zip(estimates, states, strict=True))
    joints = [np.abs(e.state.joint_positions[swinging] - s.joint_positions[swinging]) for e, s in pairs]
    off = np.array([np.linalg.norm(tools(e.state) - tools(s), axis=1).max() for e, s in pairs])
    said = np.array([e.status is Status.LOST for e in estimates])
    return Run(np.degrees(joints), 1e3 * off, said | (off > LOST_M), said, np.array(times_ms[WARM_UP:]))


def run(case: Case, folder: Path, seed: int, config: TrackerConfig, show: Path | None = None) -> Run:
    """One clip, tracked; ``show``: how the names of pictures begin."""
    robot = case.robot
    model, rig = load_urdf(folder / robot.urdf), robot.rig
    states = states_of(robot, model, seed)
    if not robot.sways:
        config = replace(config, motion=replace(config.motion, base="fixed"))
    tracker = Tracker(rig, model, config, None, start_of(case, model, states[0], seed))
    estimates, times = [], []
    sets = with_joint_states(case, model, states, image_sets(rig, model, states, seed + 20), seed)
    for number, one in enumerate(sets):
        began = time.perf_counter()
        estimates.append(tracker.step(one))
        times.append(1e3 * (time.perf_counter() - began))
        if show is not None and number in (0, SETS // 2):
            write_picture(one, show.with_name(f"{show.name}_{number:03d}.png"))
    return judged(robot, model, estimates, states, times)


def figures(name: str, runs: list[Run]) -> Figures:
    joints, tools = np.concatenate([run.joints_deg for run in runs]), np.concatenate([run.tcp_mm for run in runs])
    times = np.concatenate([run.times_ms for run in runs])
    values: dict[str, float | int] = {
        "joint_deg": float(np.median(joints)), "joint_p95_deg": float(np.percentile(joints, 95)),
        "tcp_mm": float(np.median(tools)), "tcp_p95_mm": float(np.percentile(tools, 95)),
        "lost_sets": sum(int(run.lost.sum()) for run in runs), "sets": SETS * len(runs),
        "said_lost": sum(int(run.said.sum()) for run in runs),
        "set_ms": float(np.median(times)), "set_p95_ms": float(np.percentile(times, 95)), "reference_ms": reference_ms(),
    }  # fmt: skip
    return {f"{name}.{key}": value for key, value in values.items()}


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    folder = args.robots or folder_of_robots()
    if folder is None:
        print("robots: no robots: install example-robot-data, or give --robots FOLDER", file=sys.stderr)
        return 2

    def measured(config: TrackerConfig) -> Figures:
        def runs(name: str, seed: int, show: Path | None) -> Iterator[Run]:
            yield run(CASES[name], folder, seed, config, show)

        found = runs_of(args, args.only or CASES, runs)
        return {key: value for name, clips in found for key, value in figures(name, clips).items()}

    return reported("robots", args, measured)


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = seeded_parser(__doc__, "robots.py --only panda ur5 --seeds 3 --pictures out/robots", list(CASES))
    add_pictures(parser)
    parser.add_argument("--robots", type=Path, metavar="FOLDER", help="with panda_description and others beside each other")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
