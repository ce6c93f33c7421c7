"""A state of a body as YAML: a first pose to track from (docs/formats.md)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from pydantic import Field, model_validator

from ...errors import FileFormatError, ModelError
from ...geometry import se3, so3
from ...model.articulated import ArticulatedModel
from ...model.configuration import State, refuse_implausible
from ..file_model import STATE, FileModel, Number, numbers, problem, validate
from ..yaml_file import read_mapping, write_mapping
from .model_yaml import transform_of


@dataclass(frozen=True)
class _Kind:
    """How a kind of axis is written; a pose may pass its limits by ``slack``, as other programs' limits are soft."""

    field: str
    prismatic: bool
    verb: str
    what: str
    unit_name: str
    unit: float
    slack: float


_TURNS = _Kind("joints_deg", False, "turns", "an angle", "degrees", np.pi / 180.0, 1.0)
_SLIDES = _Kind("joints_m", True, "slides", "a length", "meters", 1.0, 0.001)


class RootEntry(FileModel):
    """Where the root link is: meters, and a quaternion or roll, pitch, yaw."""

    xyz: numbers(3)  # type: ignore[valid-type]
    quaternion_xyzw: numbers(4) | None = None  # type: ignore[valid-type]
    rpy_deg: numbers(3) | None = None  # type: ignore[valid-type]

    @model_validator(mode="after")
    def _one_rotation(self) -> RootEntry:
        if self.quaternion_xyzw is not None and self.rpy_deg is not None:
            raise problem("either quaternion_xyzw or rpy_deg", "both", "rpy_deg")
        if self.quaternion_xyzw is not None and abs(np.linalg.norm(self.quaternion_xyzw) - 1.0) > 1e-2:
            raise problem("a quaternion of length 1", self.quaternion_xyzw, "quaternion_xyzw")
        return self

    def transform(self) -> np.ndarray:
        """T_world_root (4, 4)."""
        if self.quaternion_xyzw is None:
            return transform_of(self.xyz, self.rpy_deg or (0.0, 0.0, 0.0))
        rotation = so3.matrix_from_xyzw(np.array(self.quaternion_xyzw))
        return se3.from_rotation_translation(rotation, np.array(self.xyz))


class StateFile(FileModel):
    """A whole state file; joints that it does not name are neutral."""

    KIND: ClassVar[str] = STATE

    model: str | None = None
    root: RootEntry
    joints_deg: dict[str, Number] = Field(default_factory=dict)
    joints_m: dict[str, Number] = Field(default_factory=dict)


def load_state(path: str | Path, model: ArticulatedModel) -> State:
    """State of a model from a file.

    Parameters
    ----------
    path, model : YAML file; body.

    Returns
    -------
    State; joints that the file does not name are neutral, or follow their leader.

    Raises
    ------
    FileFormatError : also for a joint axis that the model does not have, and an angle (or length) beyond its limits.
    """
    content = validate(StateFile, read_mapping(path), path)
    positions = State.neutral(model).joint_positions
    for kind, entries in ((_TURNS, content.joints_deg), (_SLIDES, content.joints_m)):
        axes = {axis.name: i for i, axis in enumerate(model.chain.axes) if axis.prismatic == kind.prismatic}
        for name, value in entries.items():
            field = f"{kind.field}.{name}"
            if name not in axes:
                what = f"an axis of model '{model.name}' that {kind.verb}, one of {sorted(axes)}"
                raise FileFormatError(path, field, what, name)
            i = axes[name]
            lower, upper = model.chain.lower[i] / kind.unit, model.chain.upper[i] / kind.unit
            if not lower - kind.slack <= value <= upper + kind.slack:
                raise FileFormatError(path, field, f"{kind.what} in [{lower:.6g}, {upper:.6g}] {kind.unit_name}", value)
            positions[i] = value * kind.unit
    named = {*content.joints_deg, *content.joints_m}
    followed = model.chain.followed(positions)
    for i, axis in enumerate(model.chain.axes):
        if axis.mimic is not None and axis.name not in named:
            positions[i] = followed[i]
    state = State(content.root.transform(), positions)
    try:
        refuse_implausible(model, state.to_values())
    except ModelError as error:
        raise FileFormatError(path, "root", "the state of a body in the room", str(error)) from None
    return state


def dump_state(state: State, model: ArticulatedModel, path: str | Path, comment: str = "") -> None:
    """Write a state; every joint angle is named.

    Parameters
    ----------
    state, model, path : state of ``model``; YAML file.
    comment : lines on top of the file.
    """
    rotation = so3.xyzw_from_matrix(state.T_world_root[:3, :3])
    joints: dict[str, dict[str, float]] = {"joints_deg": {}, "joints_m": {}}
    for axis, value in zip(model.chain.axes, state.joint_positions, strict=True):
        if axis.prismatic:
            joints["joints_m"][axis.name] = float(value)
        else:
            joints["joints_deg"][axis.name] = float(np.rad2deg(value))
    values = {
        "model": model.name,
        "root": {"xyz": state.T_world_root[:3, 3].tolist(), "quaternion_xyzw": rotation.tolist()},
        **{field: values for field, values in joints.items() if values},
    }
    write_mapping(values, path, comment or "State of a body; the format is described in docs/formats.md.")
