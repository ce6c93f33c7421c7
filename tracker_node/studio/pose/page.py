"""The page on which a body is posed by hand, as the papers' authors set their first pose: sliders, mouse, and a score.

The degrees of freedom as people read and set them: meters, degrees, roll, pitch and yaw, grouped by joint.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from starlette.routing import BaseRoute

from ...errors import FileFormatError, UnknownNameError
from ...geometry import se3, so3
from ...loaders.file_model import FileModel, Number, numbers
from ...loaders.json_values import finite
from ...loaders.model.model_yaml import transform_of
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF, Axis
from ...optimize.levenberg_marquardt import clip_to_limits
from ..endpoints import get, post
from ..images import OutlineDrawer
from ..session import ExistsError, PoseFiles, StudioSession, made_once
from .bench import PoseBench
from .drag import MODES, Grip, drag


class Pose(FileModel):
    """Values of all degrees of freedom, as `values` orders them."""

    values: list[Number]


class PoseInSet(Pose):
    """A pose in the images of one set."""

    set: int


class Drag(Pose):
    """A handle taken from a pose and dragged to a pixel of a camera."""

    handle: int
    camera: str
    pixel: numbers(2)  # type: ignore[valid-type]
    mode: str = "limb"


class Saved(PoseInSet):
    """A pose to be written."""

    name: str
    overwrite: bool = False


class Nothing(FileModel):
    """No more than that it is asked for."""


class Loaded(FileModel):
    """A file to be read."""

    name: str


class PosePage:
    """What the page asks for, each answer as plain values."""

    def __init__(self, session: StudioSession):
        self._session = session
        self._files = PoseFiles(session.files.folder)
        self._kept: PoseInSet | None = None

    @made_once
    def _drawer(self) -> OutlineDrawer:
        return OutlineDrawer(self._session.needed_rig(), self._session.needed_model())

    @made_once
    def _bench(self) -> PoseBench:
        return PoseBench(self._session)

    def body(self) -> dict[str, Any]:
        """All that does not change while a pose is set, and the first pose."""
        model, handles = self._session.needed_model(), self._drawer.handles
        self._session.needed_images()
        first = self._session.initial_state or State.neutral(model)
        values = values_of(first, model)
        links = model.chain.links
        return {
            "values": values,
            "groups": dof_groups(model, values),
            "handles": [{"name": name, "link": links[link]} for name, link in zip(handles.names, handles.links, strict=True)],
            "bones": handles.bones,
            "parts": [{"name": s.name, "color": c} for s, c in zip(model.shapes, self._drawer.colors(), strict=True)],
            "score": {"name": self._bench.scorer.name, "meaning": self._bench.scorer.meaning, "shrunk": self._bench.factor},
            "folder": str(self._session.files.folder),
            "kept": None if self._kept is None else {"values": self._kept.values, "set": self._kept.set},
        }

    def keep(self, asked: PoseInSet) -> dict[str, Any]:
        """Keep the pose for a page that is loaded again, as long as the studio runs."""
        state_of(asked.values, self._session.needed_model())  # refuses what is no pose of the body
        self._kept = asked
        return {}

    def discard(self) -> dict[str, Any]:
        """Forget the kept pose: the next page begins with the first one."""
        self._kept = None
        return {}

    def show(self, asked: Pose) -> dict[str, Any]:
        """The pose within its limits, and drawn."""
        return self._shown(state_of(asked.values, self._session.needed_model()))

    def _shown(self, state: State) -> dict[str, Any]:
        return {"values": values_of(state, self._session.needed_model()), "cameras": self._drawer.drawn(state)}

    def drag(self, asked: Drag) -> dict[str, Any]:
        """The pose with the handle where the mouse is, drawn."""
        model, handles = self._session.needed_model(), self._drawer.handles
        if not 0 <= asked.handle < len(handles.names):
            raise FileFormatError("request", "handle", f"a number below {len(handles.names)}", asked.handle)
        if asked.mode not in MODES:
            raise UnknownNameError("mode", asked.mode, MODES)
        grip = Grip(int(handles.links[asked.handle]), handles.points[asked.handle], self._session.needed_rig()[asked.camera])
        return self._shown(drag(model, state_of(asked.values, model), grip, np.array(asked.pixel), asked.mode))

    def score(self, asked: PoseInSet) -> dict[str, Any]:
        """What the engine would say of the pose."""
        found = self._bench.score(state_of(asked.values, self._session.needed_model()), asked.set)
        cameras = {c.camera: {"value": c.value, "samples": c.samples} for c in found.cameras}
        return {"total": found.total, "cameras": cameras, "parts": found.parts}

    def fit(self, asked: PoseInSet) -> dict[str, Any]:
        """The pose that the engine finds from here."""
        began = time.perf_counter()
        found = self._bench.fit(state_of(asked.values, self._session.needed_model()), asked.set)
        limbs = [{"name": limb.name, "status": limb.status.name, "reason": limb.reason} for limb in found.limbs]
        result = {"status": found.status.name, "reason": found.status_reason}
        result |= {"residual": finite(found.residual), "unit": found.residual_unit}
        return {**self._shown(found.state), **result, "limbs": limbs, "seconds": time.perf_counter() - began}

    def names(self) -> dict[str, Any]:
        """Files that may be loaded."""
        return {"names": self._files.names()}

    def load(self, asked: Loaded) -> dict[str, Any]:
        """The pose of a file, drawn."""
        return self._shown(self._files.load(asked.name, self._session.needed_model()))

    def save(self, asked: Saved) -> dict[str, Any]:
        """Write the pose: ``path``; ``exists`` where a file of that name is there, and nobody has said to replace it."""
        model = self._session.needed_model()
        comment = f"Set by hand in image set {asked.set}; the format is described in docs/formats.md."
        try:
            path = self._files.save(asked.name, state_of(asked.values, model), model, comment, asked.overwrite)
        except ExistsError as error:
            return {"exists": str(error)}
        return {"path": str(path)}


def routes(session: StudioSession) -> Sequence[BaseRoute]:
    """Below ``/api/pose/``: questions by GET, poses by POST."""
    page = PosePage(session)
    return [
        get("/api/pose/body", page.body),
        get("/api/pose/names", page.names),
        post("/api/pose/keep", PoseInSet, page.keep),
        post("/api/pose/discard", Nothing, lambda asked: page.discard()),
        post("/api/pose/show", Pose, page.show),
        post("/api/pose/drag", Drag, page.drag),
        post("/api/pose/score", PoseInSet, page.score),
        post("/api/pose/fit", PoseInSet, page.fit),
        post("/api/pose/load", Loaded, page.load),
        post("/api/pose/save", Saved, page.save),
    ]


ROOT_NAMES = ("x", "y", "z", "roll", "pitch", "yaw")
_REACH_M = 1.5  # of the sliders of the root, about where it is at first


def values_of(state: State, model: ArticulatedModel) -> list[float]:
    """The degrees of freedom as people read them.

    Parameters
    ----------
    state : of the body.
    model : the body.

    Returns
    -------
    (n_dof,): position in meters, fixed-axis roll, pitch, yaw in degrees, then the axes in degrees or meters.
    """
    joints = state.joint_positions * _per_unit(model)
    rpy_deg = np.rad2deg(so3.to_roll_pitch_yaw(state.T_world_root[:3, :3])) + 0.0
    return [*state.T_world_root[:3, 3].tolist(), *rpy_deg.tolist(), *joints.tolist()]


def state_of(values: Sequence[float], model: ArticulatedModel) -> State:
    """Inverse of `values_of`; joints are put within their limits, and driven ones where their leaders put them.

    Parameters
    ----------
    values : (n_dof,), as of `values_of`.
    model : the body.

    Returns
    -------
    The state.

    Raises
    ------
    FileFormatError : another number of values than the model has degrees of freedom.
    """
    if len(values) != model.n_dof:
        raise FileFormatError("request", "values", f"{model.n_dof} numbers, for model '{model.name}'", len(values))
    root = transform_of((0.0, 0.0, 0.0), tuple(values[3:N_ROOT_DOF]))
    T = se3.from_rotation_translation(root[:3, :3], np.array(values[:3]))
    joints = np.array(values[N_ROOT_DOF:], dtype=np.float64) / _per_unit(model)
    return clip_to_limits(State(T, model.chain.followed(joints)), model.chain)


def dof_groups(model: ArticulatedModel, values: Sequence[float]) -> list[dict[str, Any]]:
    """The root, then every joint that moves.

    Parameters
    ----------
    model : the body.
    values : (n_dof,), the pose about which the sliders of the root reach.

    Returns
    -------
    ``name``, ``link`` (what it moves), and ``dofs`` with name, unit, limits, neutral of each.
    """
    around = [(x - _REACH_M, x + _REACH_M) for x in values[:3]] + 3 * [(-180.0, 180.0)]
    units = 3 * ["m"] + 3 * ["deg"]
    root = [_dof(name, i, units[i], around[i], None, False) for i, name in enumerate(ROOT_NAMES)]
    groups = [{"name": "root", "link": model.chain.links[0], "dofs": root}]
    joint_of = {joint.child: joint for joint in model.chain.joints}
    chain = model.chain
    for link, name in enumerate(chain.links):
        first = int(chain.axis_start[link])
        axes = chain.axes[first : first + int(chain.axis_count[link])]
        if axes:
            dofs = [_axis_dof(axis, N_ROOT_DOF + first + i) for i, axis in enumerate(axes)]
            groups.append({"name": joint_of[name].name, "link": name, "dofs": dofs})
    return groups


def _axis_dof(axis: Axis, index: int) -> dict[str, Any]:
    per = 1.0 if axis.prismatic else 180.0 / np.pi
    limits = (-180.0, 180.0) if axis.endless else (axis.lower * per, axis.upper * per)
    return _dof(axis.name, index, "m" if axis.prismatic else "deg", limits, axis.neutral * per, axis.mimic is not None)


def _dof(name: str, index: int, unit: str, limits: tuple[float, float], neutral: float | None, driven: bool) -> dict[str, Any]:
    lower, upper = limits
    return {"name": name, "index": index, "unit": unit, "lower": lower, "upper": upper, "neutral": neutral, "driven": driven}


def _per_unit(model: ArticulatedModel) -> np.ndarray:
    """(n_axes,) what to multiply radians and meters by for degrees and meters."""
    return np.array([1.0 if axis.prismatic else 180.0 / np.pi for axis in model.chain.axes])
