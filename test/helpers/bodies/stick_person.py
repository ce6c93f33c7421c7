"""A person of sticks with the joints that people are judged by, and runs of it, for tests of evaluation."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tracker_node.geometry import se3, so3
from tracker_node.loaders.bag.message_types import STATE_COVARIANCE, TRACKED_STATE, message_of
from tracker_node.loaders.bag.writer import BagWriter
from tracker_node.loaders.motion.trajectory_file import (
    StateRow,
    StateTrajectory,
    Trajectories,
    write_joints,
    write_states,
)
from tracker_node.model.articulated import ArticulatedModel, Landmark, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain
from tracker_node.model.shapes.primitives import Ellipsoid, TruncatedCone
from tracker_node.runs.messages import state_covariance, tracked_state
from tracker_node.tracking.estimate import CameraReport, Status, Timings, TrackEstimate

PERIOD_NS = 16_666_667
ALL_AXES = (("x", (1.0, 0.0, 0.0)), ("y", (0.0, 1.0, 0.0)), ("z", (0.0, 0.0, 1.0)))


def person() -> ArticulatedModel:
    """Trunk, head, and four limbs of two segments and an end (hand or foot)."""
    links, joints, shapes = ["trunk", "head"], [_ball("neck", "trunk", "head", (0.0, 0.0, 0.5))], []
    landmarks = [Landmark("neck", "head", (0.0, 0.0, 0.0)), Landmark("head", "head", (0.0, 0.0, 0.2))]
    shapes.append(Shape("trunk", "trunk", TruncatedCone(0.15, 0.10, 0.3, 0.0, 0.5)))
    shapes.append(Shape("head", "head", Ellipsoid((0.09, 0.08, 0.12)), _at((0.0, 0.0, 0.12))))
    for side, y in (("left", 1.0), ("right", -1.0)):
        for names, parts, origin, length in (
            (("shoulder", "elbow", "wrist"), ("upper_arm", "forearm", "hand"), (0.0, 0.2 * y, 0.45), 0.28),
            (("hip", "knee", "ankle"), ("thigh", "shank", "foot"), (0.0, 0.1 * y, 0.0), 0.42),
        ):
            parent, offset = "trunk", origin
            for name, part in zip(names, parts, strict=True):
                link = f"{side}_{part}"
                links.append(link)
                joints.append(_ball(f"{side}_{name}", parent, link, offset))
                landmarks.append(Landmark(f"{side}_{name}", link, (0.0, 0.0, 0.0)))
                shapes.append(Shape(link, link, TruncatedCone(0.05, 0.05, 0.5, -length, 0.0)))
                parent, offset = link, (0.0, 0.0, -length)
    return ArticulatedModel("stick_person", KinematicChain(tuple(links), tuple(joints)), tuple(shapes), tuple(landmarks))


def _ball(name: str, parent: str, child: str, offset: tuple[float, float, float]) -> Joint:
    return Joint(name, parent, child, _at(offset), tuple(Axis(f"{name}_{letter}", axis) for letter, axis in ALL_AXES))


def _at(position: tuple[float, float, float]) -> np.ndarray:
    return se3.from_rotation_translation(np.eye(3), np.array(position))


@dataclass(frozen=True, eq=False)
class Motion:
    """States at every stamp."""

    model: ArticulatedModel
    stamps_ns: np.ndarray
    states: tuple[State, ...]

    @property
    def configurations(self) -> list[Configuration]:
        return [Configuration(self.model, state) for state in self.states]

    @property
    def landmarks_m(self) -> np.ndarray:
        """(n, n_landmarks, 3)."""
        return np.array([c.landmarks_world for c in self.configurations])


def motion(n: int = 40, seed: int = 3) -> Motion:
    """Everything turns smoothly, every joint at its own pace."""
    model, rng = person(), np.random.default_rng(seed)
    pace, phase = rng.uniform(1.0, 4.0, model.chain.n_axes), rng.uniform(0.0, 6.0, model.chain.n_axes)
    stamps = np.arange(n, dtype=np.int64) * PERIOD_NS
    states = []
    for t in stamps * 1e-9:
        root = se3.from_rotation_translation(so3.exp(np.array([0.1, 0.2, 0.5 * t])), np.array([0.3 * t, 0.0, 0.9]))
        states.append(State(root, 0.4 * np.sin(pace * t + phase)))
    return Motion(model, stamps, tuple(states))


def write_run(folder: Path, tracked: Motion, status: list[str] | None = None) -> Path:
    """``states.csv`` of a run that found exactly these states."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for i, (stamp, state) in enumerate(zip(tracked.stamps_ns, tracked.states, strict=True)):
        said = status[i] if status else "TRACKING"
        rows.append(StateRow(int(stamp), said, "", state.to_values(), 1.0, 2.0 + i % 2, 3 + i % 3, 4))
    write_states(folder / "states.csv", StateTrajectory(tracked.model.chain.dof_names, tuple(rows)))
    return folder


def write_state_bag(
    path: Path, tracked: Motion, cameras: tuple[str, ...] = ("cam01", "cam02"), others: tuple[str, ...] = ()
) -> Path:
    """A bag of tracked states as the live recorder leaves it, stamps in another order than recorded.

    Parameters
    ----------
    path : of the bag.
    tracked : the states, on ``/person/state``.
    cameras : names.
    others : bodies with the same states, on ``/<name>/state``.

    Returns
    -------
    ``path``.
    """
    with BagWriter(path) as writer:
        for i in np.random.default_rng(1).permutation(len(tracked.states)):
            stamp = int(tracked.stamps_ns[i])
            reports = tuple(CameraReport(name, stamp, 2.0 + k + i % 2, 25) for k, name in enumerate(cameras))
            zeros = np.zeros(tracked.model.chain.n_dof)
            estimate = TrackEstimate(
                stamp, Status.TRACKING, "", tracked.states[i], zeros, np.diag(zeros), 1.0, 2.5, reports, 4, 5,
                Timings(1.0, 2.0, 3.0),
            )  # fmt: skip
            for body in ("person", *others):
                for topic, kind, content_of in (
                    (f"/{body}/state", TRACKED_STATE, tracked_state),
                    (f"/{body}/state_covariance", STATE_COVARIANCE, state_covariance),
                ):
                    writer.write_message(topic, stamp, message_of(kind, content_of(estimate, tracked.model, "world")))
    return path


def write_truth(path: Path, tracked: Motion, moved_m: float = 0.0) -> Path:
    """Truth as CSV, every landmark moved along x."""
    positions = tracked.landmarks_m + np.array([moved_m, 0.0, 0.0])
    valid = np.ones(positions.shape[:2], dtype=bool)
    write_joints(path, Trajectories(tracked.model.landmark_names, tracked.stamps_ns, positions, valid))
    return path
