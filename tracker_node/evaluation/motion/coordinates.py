"""Motions as named numbers over time: those of the body model, or those of OpenSim's models of a person."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ...errors import FileFormatError, ModelError
from ...geometry import so3
from ...loaders.images.stamps import stamps_of_times_ns
from ...loaders.motion.bvh import AXES_Y_UP
from ...loaders.motion.trc import load_table
from ...model.articulated import ArticulatedModel
from ...model.configuration import ROOT_NAMES, angles_of, variable_names
from ...model.kinematic_chain import N_ROOT_DOF
from ...runs.motion import RunMotion
from .isb_angles import LINK_FROM_ISB, cardan_angles

PELVIS = ("pelvis_tilt", "pelvis_list", "pelvis_rotation", "pelvis_tx", "pelvis_ty", "pelvis_tz")
_GAP = 1.5  # median steps from one row to the next: further apart, some are left out between them
_OURS_IN_Y_UP = {"x": "y", "y": "z", "z": "x"}  # axis of such a file -> the world's, as `loaders.motion.bvh.AXES_Y_UP`
_SIDE_LETTERS = (("right", "r"), ("left", "l"))
# Coordinates of Rajagopal et al. (IEEE Trans. Biomed. Eng. 63 (2016) 2068-2079) -> angle of `cardan_angles`, sign
_TRUNK = {
    "lumbar_extension": ("spine_flexion", -1.0),
    "lumbar_bending": ("spine_bend_right", 1.0),
    "lumbar_rotation": ("spine_turn_left", 1.0),
}
_LIMBS = {
    "hip_flexion": "hip_flexion", "hip_adduction": "hip_adduction", "hip_rotation": "hip_internal_rotation",
    "knee_angle": "knee_flexion", "ankle_angle": "ankle_dorsiflexion",
    "arm_flex": "shoulder_flexion", "arm_add": "shoulder_adduction", "arm_rot": "shoulder_internal_rotation",
    "elbow_flex": "elbow_flexion",
}  # fmt: skip
# Of them those that are single axes of the human: theirs, ours, sign
_SINGLE_AXES = (
    ("hip_flexion", "hip_flexion", 1.0), ("hip_adduction", "hip_abduction", -1.0), ("hip_rotation", "hip_internal_rotation", 1.0),
    ("knee_angle", "knee_flexion", 1.0), ("elbow_flex", "elbow_flexion", 1.0),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Coordinates:
    """``values`` (n, k) in meters and radians, by ``units`` "m" and "rad"; zeros where the motion is not valid."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray

    def scaled(self, degrees: bool) -> np.ndarray:
        """(n, k) with angles in degrees, if so."""
        return self.values * [180.0 / math.pi if degrees and unit == "rad" else 1.0 for unit in self.units]


def model_coordinates(motion: RunMotion, y_up: bool) -> Coordinates:
    """Coordinates of the body model: position, somersault, tilt and twist of the root, and the joints' positions.

    Parameters
    ----------
    motion : states over time.
    y_up : the position is along the axes of a file with y up; no choice of axes changes the angles.

    Returns
    -------
    (n, 6 + axes).
    """
    values = np.zeros((len(motion), len(ROOT_NAMES) + motion.model.chain.n_axes))
    places = motion.values[:, :3] @ AXES_Y_UP.T if y_up else motion.values[:, :3]
    near = None
    for i in np.flatnonzero(motion.valid):
        near = angles_of(so3.exp(motion.values[i, 3:6]), near)
        values[i] = np.concatenate([places[i], near, motion.values[i, N_ROOT_DOF:]])
    names = (*(f"root_{name}" for name in ROOT_NAMES), *(axis.name for axis in motion.model.chain.axes))
    return Coordinates(names, ("m",) * 3 + ("rad",) * 3 + tuple(axis.unit for axis in motion.model.chain.axes), values)


def opensim_coordinates(motion: RunMotion) -> Coordinates:
    """Coordinates with names, axes and signs of Rajagopal's model, as far as the body has them; ground with y up.

    The pelvis is turned by tilt, list and rotation about its Z, X, Y in turn. Its place is that of our root's origin.

    Raises
    ------
    ModelError : a body whose root is no pelvis.
    """
    root = motion.model.chain.links[0]
    if root != "pelvis":
        raise ModelError(f"coordinates of OpenSim: expected a body whose root is 'pelvis', got '{root}'")
    pelvis = np.zeros((len(motion), 6))
    good = motion.valid
    turned = AXES_Y_UP @ Rotation.from_rotvec(motion.values[good, 3:6]).as_matrix() @ LINK_FROM_ISB
    pelvis[good, :3] = np.unwrap(Rotation.from_matrix(turned).as_euler("ZXY"), axis=0)
    pelvis[:, 3:] = motion.values[:, :3] @ AXES_Y_UP.T
    angles = cardan_angles(motion)
    column = {name: angles.radians[:, j, k] for j, triple in enumerate(angles.names) for k, name in enumerate(triple)}
    wanted = {name: (source, sign) for name, (source, sign) in _TRUNK.items()}
    wanted |= {f"{name}_{letter}": (f"{side}_{source}", 1.0) for side, letter in _SIDE_LETTERS for name, source in _LIMBS.items()}
    found = {name: sign * column[source] for name, (source, sign) in wanted.items() if source in column}
    values = np.concatenate([pelvis, np.stack(list(found.values()), axis=1)], axis=1)
    return Coordinates((*PELVIS, *found), ("rad",) * 3 + ("m",) * 3 + ("rad",) * len(found), values)


def load_coordinates(
    path: str | Path, model: ArticulatedModel, y_up: bool = True
) -> tuple[tuple[str, ...], np.ndarray, np.ndarray, np.ndarray]:
    """Variables of poses from a ``.mot`` or ``.sto`` file, as far as it has them.

    The file's columns may be those of `model_coordinates`, or those of OpenSim's models that are single axes of the human: hips,
    knees and elbows. Others are left out. Where rows are missing, an invalid one marks the gap.

    Parameters
    ----------
    path : of the file.
    model : whose variables are read.
    y_up : axes of the root's position.

    Returns
    -------
    names : (k,) of `model.configuration.variable_names`, in that order.
    stamps_ns : (n,) integer nanoseconds.
    values : (n, k) meters and radians.
    valid : (n, k).

    Raises
    ------
    FileFormatError : what is wrong in the file, or no column of the model in it.
    """
    table = load_table(path)
    units = dict(zip(variable_names(model), ("m",) * 3 + ("rad",) * 3 + model.chain.dof_units[N_ROOT_DOF:], strict=True))
    found: dict[str, tuple[int, float]] = {}  # column and factor of each variable
    for column, label in enumerate(table.names):
        name, sign = _variable(label)
        name = _OURS_IN_Y_UP.get(name, name) if y_up else name
        if name in units:
            found.setdefault(name, (column, sign * (math.pi / 180.0 if table.in_degrees and units[name] == "rad" else 1.0)))
    if not found:
        raise FileFormatError(path, "column names", f"variables of '{model.name}' ({list(units)[-1]}...)", list(table.names[:4]))
    found = {name: found[name] for name in units if name in found}
    columns, factors = [column for column, _ in found.values()], [factor for _, factor in found.values()]
    values, valid = table.values[:, columns] * factors, table.valid[:, columns]
    stamps = stamps_of_times_ns(path, table.times_s)
    return tuple(found), *_with_gaps(stamps, values, valid)


def _with_gaps(stamps_ns: np.ndarray, values: np.ndarray, valid: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """With a row that is not valid amid every gap, so that nobody interpolates across."""
    steps = np.diff(stamps_ns)
    after = np.flatnonzero(steps > _GAP * np.median(steps)) + 1 if len(steps) else np.zeros(0, dtype=int)
    amid = stamps_ns[after] - steps[after - 1] // 2
    return np.insert(stamps_ns, after, amid), np.insert(values, after, 0.0, axis=0), np.insert(valid, after, False, axis=0)


def _variable(label: str) -> tuple[str, float]:
    """A pose variable, and with which sign, for a column of a table."""
    for theirs, ours, sign in _SINGLE_AXES:
        for side, letter in _SIDE_LETTERS:
            if label == f"{theirs}_{letter}":
                return f"{side}_{ours}", sign
    root = label.removeprefix("root_")
    return (root if root in ROOT_NAMES else label), 1.0
