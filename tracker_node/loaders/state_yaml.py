"""A state of a body as YAML: a first pose to track from (docs/formats.md)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pydantic import Field, model_validator

from ..errors import FileFormatError
from ..geometry import quaternion, se3
from ..model.articulated_model import ArticulatedModel
from ..model.configuration import State
from .model_yaml import transform_of
from .yaml_file import FileModel, Number, numbers, problem, read_mapping, validate, write_mapping

_SLACK_DEG = 1.0  # an optimizer's soft limit may be passed by a little


class RootEntry(FileModel):
    """Where the root link is: metres, and a quaternion or roll, pitch, yaw."""

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
        rotation = quaternion.matrix_from_xyzw(np.array(self.quaternion_xyzw))
        return se3.from_rotation_translation(rotation, np.array(self.xyz))


class StateFile(FileModel):
    """A whole state file; joint angles that it does not name are neutral."""

    model: str | None = None
    root: RootEntry
    joints_deg: dict[str, Number] = Field(default_factory=dict)


def load_state(path: str | Path, model: ArticulatedModel) -> State:
    """State of ``model`` from a file.

    Raises
    ------
    FileFormatError : also for a joint axis that the model does not have, and an angle beyond its limits.
    """
    content = validate(StateFile, read_mapping(path), path)
    names = [axis.name for axis in model.chain.axes]
    positions = State.neutral(model).joint_positions
    for name, angle_deg in content.joints_deg.items():
        field = f"joints_deg.{name}"
        if name not in names:
            raise FileFormatError(path, field, f"a joint axis of model '{model.name}', one of {sorted(names)}", name)
        i = names.index(name)
        lower, upper = np.rad2deg(model.chain.lower[i]), np.rad2deg(model.chain.upper[i])
        if not lower - _SLACK_DEG <= angle_deg <= upper + _SLACK_DEG:
            raise FileFormatError(path, field, f"an angle in [{lower:.6g}, {upper:.6g}] degrees", angle_deg)
        positions[i] = np.deg2rad(angle_deg)
    return State(content.root.transform(), positions)


def dump_state(state: State, model: ArticulatedModel, path: str | Path, comment: str = "") -> None:
    """Write a state of ``model``; every joint angle is named."""
    rotation = quaternion.xyzw_from_matrix(state.T_world_root[:3, :3])
    angles = np.rad2deg(state.joint_positions)
    values = {
        "model": model.name,
        "root": {"xyz": state.T_world_root[:3, 3].tolist(), "quaternion_xyzw": rotation.tolist()},
        "joints_deg": {axis.name: float(angle) for axis, angle in zip(model.chain.axes, angles, strict=True)},
    }
    write_mapping(values, path, comment or "State of a body; the format is described in docs/formats.md.")
