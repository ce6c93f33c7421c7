"""Clips in which a body, or one limb, cannot be where a tracker takes it to be, and clips in which all is well.

What goes wrong, of the whole body: it is *occluded* by a crate, it *exits* from all images, it *teleports* (a cut), or the
tracker has a *wrong start*. Of one limb: it is *hidden* in a crate, or the tracker is handed a state in which it is *swapped*
with its partner on the other side, or *mirrored*. The tracker is told nothing but, where it says so, the state.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.synthesis.scenes.rasterizer import ColoredMesh
from tracker_node.synthesis.subjects.cones import ModelSubject
from tracker_node.tracking.limbs.tree import Limb

BODY_KINDS = ("occluded", "exit", "teleport", "wrong_start")
LIMB_KINDS = ("hidden", "swapped", "mirrored")
_CRATE_MARGIN_M = 0.05
_CRATE_CELLS = 6  # along each edge of a crate
_EXIT_M_PER_SET = 0.25
_LEAST_MOVE_M = 0.2  # of a limb's end, in a state that is handed over


@dataclass(frozen=True, eq=False)
class EventClip:
    """States of a body, image set by image set, and what is wrong in the sets ``begins`` <= i < ``ends``.

    ``limb`` is empty where the whole body is concerned. ``handed`` is the state that the tracker is given before set ``begins``.
    ``crate`` stands in the picture from ``begins`` to ``ends``.
    """

    name: str
    kind: str
    states: Sequence[State]
    begins: int = 0
    ends: int = 0
    limb: str = ""
    handed: State | None = None
    crate: ColoredMesh | None = None

    def meshes(self, subject: ModelSubject) -> Iterator[ColoredMesh]:
        """What is in the picture, image set by image set."""
        for i, state in enumerate(self.states):
            mesh = subject.mesh(Configuration(subject.model, state))
            yield joined(mesh, self.crate) if self.crate is not None and self.begins <= i < self.ends else mesh


def placed(states: Sequence[State], rng: np.random.Generator, reach_m: float = 0.35) -> list[State]:
    """A motion carried to another place on the floor, and turned."""
    turn = so3.exp([0.0, 0.0, rng.uniform(-np.pi, np.pi)])
    T = se3.from_rotation_translation(turn, np.array([*rng.uniform(-reach_m, reach_m, 2), 0.0]))
    return [State(T @ state.T_world_root, state.joint_positions) for state in states]


def occluded(name: str, subject: ModelSubject, states: Sequence[State], begins: int, ends: int, rng) -> EventClip:
    """A crate around the whole body, as far as it moves."""
    everything = np.ones(len(subject.model.shapes), dtype=np.bool_)
    around = crate(*_extent(subject, states[begins:ends], everything), rng)
    return EventClip(name, "occluded", states, begins, ends, crate=around)


def exits(name: str, states: Sequence[State], begins: int, ends: int) -> EventClip:
    """The body is lifted out of all images, faster and faster, and is back at once at the end."""
    moved = list(states)
    for i in range(begins, ends):
        T = states[i].T_world_root.copy()
        T[2, 3] += _EXIT_M_PER_SET * 0.5 * (i - begins + 1) * (i - begins + 2)
        moved[i] = State(T, states[i].joint_positions)
    return EventClip(name, "exit", moved, begins, ends)


def teleports(name: str, states: Sequence[State], others: Sequence[State], begins: int) -> EventClip:
    """A cut to another motion in another place."""
    return EventClip(name, "teleport", [*states[:begins], *others[begins:]], begins, len(states))


def wrong_start(name: str, model: ArticulatedModel, states: Sequence[State], rng) -> EventClip:
    """A first state far off: by 0.4 to 0.8 m, up to half a turn, and joints anywhere near their limits' middle."""
    heading = rng.uniform(-np.pi, np.pi)
    away = rng.uniform(0.4, 0.8) * np.array([np.cos(heading), np.sin(heading), 0.0])
    T = states[0].T_world_root.copy()
    T[:3, :3] = so3.exp([0.0, 0.0, rng.uniform(-np.pi, np.pi)]) @ T[:3, :3]
    T[:3, 3] += away
    neutral = State.neutral(model).joint_positions
    joints = np.clip(neutral + rng.normal(0.0, 0.4, len(neutral)), model.chain.lower, model.chain.upper)
    return EventClip(name, "wrong_start", states, 0, len(states), handed=State(T, joints))


def hidden(name: str, subject: ModelSubject, states: Sequence[State], limb: Limb, begins: int, ends: int, rng) -> EventClip:
    """The limb's last part reaches into a crate as large as its movement; what else comes there is hidden too."""
    last = np.zeros(len(limb.shapes), dtype=np.bool_)
    links = subject.model.shape_links
    depth = subject.model.chain.link_moved_by.sum(axis=1)[links]
    last[limb.shapes] = depth[limb.shapes] == depth[limb.shapes].max()
    around = crate(*_extent(subject, states[begins:ends], last), rng)
    return EventClip(name, "hidden", states, begins, ends, limb.name, crate=around)


def swapped(
    name: str, model: ArticulatedModel, states: Sequence[State], limb: Limb, partner: Limb, begins: int
) -> EventClip | None:
    """The tracker is handed a state in which both limbs reach for each other's joints; None where that hardly differs."""
    truth = states[begins]
    points = Configuration(model, truth).landmarks_world
    own, other = (np.flatnonzero(b.links[model.landmark_links]) for b in (limb, partner))
    wrong = reach(model, truth, limb.dofs | partner.dofs, np.concatenate([own, other]), points[np.concatenate([other, own])])
    return _handed(name, "swapped", model, states, limb, begins, wrong)


def mirrored(name: str, model: ArticulatedModel, states: Sequence[State], limb: Limb, begins: int) -> EventClip | None:
    """The tracker is handed a state in which the limb is reflected in a plane of the trunk through its first joint, that plane of
    the three which moves its end the most; None where that is little."""
    truth = states[begins]
    body = Configuration(model, truth)
    own = np.flatnonzero(limb.links[model.landmark_links])
    first = int(np.flatnonzero(limb.links)[0])
    center, R = body.Ts_world_link[first, :3, 3], truth.T_world_root[:3, :3]
    local = (body.landmarks_world[own] - center) @ R
    wrongs = [reach(model, truth, limb.dofs, own, (local * flip) @ R.T + center) for flip in np.ones((3, 3)) - 2.0 * np.eye(3)]
    wrong = max(wrongs, key=lambda state: _moved(model, truth, state, limb))
    return _handed(name, "mirrored", model, states, limb, begins, wrong)


def _handed(name, kind, model, states, limb: Limb, begins: int, wrong: State) -> EventClip | None:
    if _moved(model, states[begins], wrong, limb) < _LEAST_MOVE_M:
        return None
    return EventClip(name, kind, states, begins, len(states), limb.name, handed=wrong)


def _moved(model: ArticulatedModel, a: State, b: State, limb: Limb) -> float:
    """How far the landmarks of a limb are apart at most, meters."""
    own = limb.links[model.landmark_links]
    apart = Configuration(model, a).landmarks_world - Configuration(model, b).landmarks_world
    return float(np.linalg.norm(apart[own], axis=1).max())


def reach(model: ArticulatedModel, state: State, dofs: np.ndarray, landmarks: np.ndarray, targets: np.ndarray) -> State:
    """The state within the limits in which ``landmarks`` (k,) come nearest to ``targets`` (k, 3), meters, by ``dofs`` alone."""
    lower, upper = model.chain.lower, model.chain.upper
    for _ in range(40):
        body = Configuration(model, state)
        J = body.landmark_jacobian()[landmarks][:, :, dofs].reshape(-1, int(dofs.sum()))
        step = np.zeros(model.n_dof)
        residual = (targets - body.landmarks_world[landmarks]).ravel()
        step[dofs] = np.linalg.solve(J.T @ J + 1e-3 * np.eye(J.shape[1]), J.T @ residual)
        moved = state.retract(step)
        state = State(moved.T_world_root, np.clip(moved.joint_positions, lower, upper))
    return state


def crate(low: np.ndarray, high: np.ndarray, rng: np.random.Generator) -> ColoredMesh:
    """A box between two corners (3,), meters, its faces checkered in random colors."""
    n = _CRATE_CELLS
    grid = np.stack(np.meshgrid(np.arange(n), np.arange(n), indexing="ij"), axis=-1).reshape(-1, 1, 2)
    cells = (grid + np.array([(0, 0), (1, 0), (1, 1), (0, 1)])) / n  # (n * n, 4, 2)
    vertices, normals = [], []
    for axis in range(3):
        for side in (0.0, 1.0):
            corners = np.insert(cells, axis, side, axis=-1)
            outward = (side == 1.0) != (axis == 1)  # (e0, e1) of the face turn about +e_axis, but for y
            vertices.append((corners if outward else corners[:, ::-1]).reshape(-1, 3))
            normals.append(np.tile((2.0 * side - 1.0) * np.eye(3)[axis], (4 * n * n, 1)))
    points = np.concatenate(vertices)
    quads = np.arange(len(points)).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    colors = np.repeat(rng.integers(20, 235, (len(quads), 3)), 4, axis=0).astype(np.uint8)
    return ColoredMesh(low + points * (high - low), faces, colors, np.concatenate(normals))


def joined(a: ColoredMesh, b: ColoredMesh) -> ColoredMesh:
    """Both meshes as one; they have normals."""
    assert a.normals is not None and b.normals is not None
    return ColoredMesh(
        np.concatenate([a.vertices, b.vertices]),
        np.concatenate([a.faces, b.faces + len(a.vertices)]),
        np.concatenate([a.colors_rgb, b.colors_rgb]),
        np.concatenate([a.normals, b.normals]),
    )


def _extent(subject: ModelSubject, states: Sequence[State], shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the box in which the shapes move, with a margin."""
    points = [subject.points(Configuration(subject.model, state), shapes) for state in states]
    low, high = np.min([p.min(axis=0) for p in points], axis=0), np.max([p.max(axis=0) for p in points], axis=0)
    return low - _CRATE_MARGIN_M, high + _CRATE_MARGIN_M
