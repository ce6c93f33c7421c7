"""Files with truth: positions of joints over time from TRC, C3D or CSV, degrees of freedom from ``states.csv`` or OpenSim.

The joints that a person's motion is judged by, and the bones between them.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import FileFormatError, TrackerError, repeated
from ...geometry import se3, so3
from ...loaders.csv_file import CsvTable
from ...loaders.images.stamps import stamps_of_times_ns
from ...loaders.motion.c3d_file import load_markers
from ...loaders.motion.trajectory_file import (
    JOINT_COLUMNS,
    LEADING_COLUMNS,
    POSE_COLUMNS,
    StateRow,
    StateTrajectory,
    Trajectories,
    between,
    dof_columns,
    read_joints,
    read_states,
)
from ...model.articulated import ArticulatedModel
from ...model.configuration import (
    ROOT_NAMES,
    ROTATION_NAMES,
    Configuration,
    State,
    angles_of,
    from_variables,
    to_variables,
    variable_names,
)
from ...model.humans.measures import landmark_of_marker
from ...model.kinematic_chain import N_ROOT_DOF, ROOT_DOF_NAMES
from ..motion.coordinates import load_coordinates

COORDINATES = (".mot", ".sto")
_NO_TRUTH, _GIVEN = ("LOST", "INITIALIZING"), "TRACKING"
_FIRST = dof_columns(ROOT_DOF_NAMES)[0]


@dataclass(frozen=True, eq=False)
class TrueStates:
    """Variables of a pose over time (see `model.configuration`), full turns counted on.

    Parameters
    ----------
    names : k names: x, y, z, somersault, tilt, twist of the root, and axes of joints; any of them may be missing.
    stamps_ns : (n,) increasing.
    values : (n, k) meters and radians.
    valid : (n, k).
    """

    names: tuple[str, ...]
    stamps_ns: np.ndarray
    values: np.ndarray
    valid: np.ndarray

    def at(self, stamps_ns: np.ndarray, earlier_ns: float = 0.0) -> TrueStates:
        """Interpolate linearly, the root's orientation along the shortest rotation, as of runs; beyond the rows nothing is valid.

        Parameters
        ----------
        stamps_ns : (m,) integer nanoseconds.
        earlier_ns : is subtracted from them.

        Returns
        -------
        A row for each stamp.
        """
        before, after, weight, inside = between(self.stamps_ns, stamps_ns, earlier_ns)
        values = (1.0 - weight[:, None]) * self.values[before] + weight[:, None] * self.values[after]
        valid = self.valid[before] & self.valid[after] & inside[:, None]
        if set(ROTATION_NAMES) <= set(self.names):  # somersault and twist make leaps where the tilt comes near 90 degrees
            columns = [self.names.index(name) for name in ROTATION_NAMES]
            for i in np.flatnonzero(valid[:, columns].all(axis=1) & (before < after)):
                one, other = (so3.from_somersault_tilt_twist(*self.values[row[i], columns]) for row in (before, after))
                values[i, columns] = angles_of(so3.exp(weight[i] * so3.log(other @ one.T)) @ one, values[i, columns])
        return TrueStates(self.names, stamps_ns, np.where(valid, values, 0.0), valid)

    def shifted(self, shift_ns: int) -> TrueStates:
        """The same states, ``shift_ns`` later."""
        return TrueStates(self.names, self.stamps_ns + shift_ns, self.values, self.valid)

    def states(self, model: ArticulatedModel) -> tuple[State | None, ...]:
        """A state of ``model`` for every row; None where a variable of it is missing."""
        wanted = variable_names(model)
        if not set(wanted) <= set(self.names):
            return (None,) * len(self.stamps_ns)
        columns = [self.names.index(name) for name in wanted]
        whole = np.all(self.valid[:, columns], axis=1)
        return tuple(from_variables(row[columns]) if ok else None for row, ok in zip(self.values, whole, strict=True))

    def joints(self, model: ArticulatedModel) -> Trajectories:
        """The landmarks of ``model`` in these states; they are not valid where a variable is missing."""
        positions = np.zeros((len(self.stamps_ns), len(model.landmark_names), 3))
        valid = np.zeros(positions.shape[:2], dtype=bool)
        for i, state in enumerate(self.states(model)):
            if state is not None:
                positions[i], valid[i] = Configuration(model, state).landmarks_world, True
        return Trajectories(model.landmark_names, self.stamps_ns, positions, valid)


def holds_states(path: str | Path) -> bool:
    """Whether a file is a CSV of states or poses, by its header, or of coordinates, by its name."""
    if Path(path).suffix.lower() in COORDINATES:
        return True
    if Path(path).suffix.lower() != ".csv":
        return False
    header = CsvTable(path).header
    return header[: len(LEADING_COLUMNS)] == LEADING_COLUMNS or header == POSE_COLUMNS or _FIRST in header


def load_true_states(path: str | Path, model: ArticulatedModel | None = None, y_up: bool | None = None) -> TrueStates:
    """States from a file in the format of ``states.csv`` or ``poses.csv``, or a ``.mot`` or ``.sto``.

    Of ``states.csv`` the stamp and the degrees of freedom are enough. Rows without a state, or with status LOST, do not count.

    Parameters
    ----------
    path : of the file.
    model : whose variables a file of coordinates has; needed for these.
    y_up : of a file of coordinates, True if None.

    Returns
    -------
    Angles counted on over full turns.

    Raises
    ------
    FileFormatError : whatever is wrong in it, or no row.
    """
    if model is not None and Path(path).suffix.lower() in COORDINATES:
        return TrueStates(*load_coordinates(path, model, y_up is not False))
    table = CsvTable(path)
    whole = table.header[: len(LEADING_COLUMNS)] == LEADING_COLUMNS
    trajectory = read_states(path) if whole else _poses(table) if table.header == POSE_COLUMNS else _plain_states(table)
    if not trajectory.rows:
        raise FileFormatError(path, "(content)", "at least one row", "none")
    latest = {int(stamp): i for i, stamp in enumerate(trajectory.stamps_ns)}
    rows = [latest[stamp] for stamp in sorted(latest)]
    variables = unwrapped(trajectory.values[rows])
    known = np.array([trajectory.status[i] not in _NO_TRUTH for i in rows]) & np.isfinite(variables).all(axis=1)
    variables = np.where(known[:, None], variables, 0.0)
    names = (*ROOT_NAMES, *trajectory.dof_names[N_ROOT_DOF:])
    return TrueStates(names, trajectory.stamps_ns[rows], variables, np.repeat(known[:, None], len(names), axis=1))


def _poses(table: CsvTable) -> StateTrajectory:
    """Poses of the root as states of a body without joints."""
    rows = []
    for cells in table.rows():
        numbers = cells.numbers(1, len(POSE_COLUMNS))
        T = se3.from_rotation_translation(so3.matrix_from_xyzw(numbers[3:]), numbers[:3])
        rows.append(StateRow(cells.integer(0), _GIVEN, "", State(T, np.zeros(0)).to_values()))
    return StateTrajectory(ROOT_DOF_NAMES, tuple(rows))


def _plain_states(table: CsvTable) -> StateTrajectory:
    """States by a stamp and degrees of freedom alone, whatever else there is."""
    columns = [i for i, name in enumerate(table.header) if name.endswith(("_m", "_rad"))]
    names = tuple(table.header[i].rpartition("_")[0] for i in columns)
    if "stamp_ns" not in table.header[:1] or names[:N_ROOT_DOF] != ROOT_DOF_NAMES:
        expected = f"stamp_ns, then {', '.join(dof_columns(ROOT_DOF_NAMES))}, then joints as in states.csv"
        raise FileFormatError(table.path, "header", expected, table.header)
    rows = [StateRow(c.integer(0), _GIVEN, "", np.array([c.number(i) for i in columns])) for c in table.rows()]
    return StateTrajectory(names, tuple(rows))


def unwrapped(values: np.ndarray, near: Sequence[np.ndarray | None] | None = None) -> np.ndarray:
    """Pose variables of states, angles counted on over full turns.

    Parameters
    ----------
    values : (n, k) of states.
    near : (n,) variables that a row's angles are to be near, or None: the last row before that is finite.

    Returns
    -------
    (n, k), NaN where ``values`` are not finite.
    """
    variables, before = np.full(values.shape, np.nan), None
    for i in np.flatnonzero(np.isfinite(values).all(axis=1)):
        beside = near[int(i)] if near is not None else None
        variables[i] = before = to_variables(State.from_values(values[i]), before if beside is None else beside)
    return variables


SIDES = ("left", "right")
PAIRED = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
EVALUATED_JOINTS = ("neck", "head", *(f"{side}_{joint}" for side in SIDES for joint in PAIRED))

BONES = (
    *((f"{side}_{a}", f"{side}_{b}") for side in SIDES for a, b in (("shoulder", "elbow"), ("elbow", "wrist"))),
    *((f"{side}_{a}", f"{side}_{b}") for side in SIDES for a, b in (("hip", "knee"), ("knee", "ankle"))),
    ("left_shoulder", "right_shoulder"),
    ("left_hip", "right_hip"),
    ("neck", "head"),
)
LIMBS = {  # limb -> its end joint
    **{f"{side} arm": f"{side}_wrist" for side in SIDES},
    **{f"{side} leg": f"{side}_ankle" for side in SIDES},
}


def common_joints(model_names: Collection[str], truth_names: Sequence[str]) -> tuple[str, ...]:
    """Joints to judge: those of `EVALUATED_JOINTS` that both have; for another body every name that both have.

    Parameters
    ----------
    model_names : landmarks of the model.
    truth_names : points of the truth.

    Returns
    -------
    Their names.
    """
    both = [name for name in truth_names if name in model_names]
    human = tuple(name for name in EVALUATED_JOINTS if name in both)
    return human or tuple(both)


def common_bones(names: Collection[str]) -> tuple[tuple[str, str], ...]:
    """`BONES` whose both ends are in ``names``."""
    return tuple(bone for bone in BONES if bone[0] in names and bone[1] in names)


def offset_links(model: ArticulatedModel, names: Sequence[str]) -> np.ndarray:
    """Links in whose frames the constant offsets of landmarks are estimated.

    It is the landmark's own link, but the parent's for one on a last link (hand, foot, head): how that turns is hardly
    observed.

    Parameters
    ----------
    model : the body.
    names : m landmarks.

    Returns
    -------
    (m,) indices of links.
    """
    chain = model.chain
    links = np.array([model.landmark_links[model.landmark_index(name)] for name in names], dtype=int)
    has_child = np.isin(np.arange(len(chain.links)), chain.parents)
    return np.where(has_child[links] | (chain.parents[links] < 0), links, chain.parents[links])


OWN_TIME = (".trc", ".c3d", ".mot", ".sto")  # suffixes of files whose times are seconds from a start of their own


@dataclass(frozen=True, eq=False)
class Truth:
    """Truth of a run; ``..._own_time``: stamps count from a start of the file's own."""

    joints: Trajectories | None = None
    states: TrueStates | None = None
    joints_own_time: bool = False
    states_own_time: bool = False


def load_truth(path: str | Path, y_up: bool | None = None) -> Trajectories:
    """Positions from a ``.trc`` or ``.c3d``, or a ``.csv`` in the format of ``joints.csv``.

    Parameters
    ----------
    path : of the file.
    y_up : of TRC and C3D files; None: a TRC file has y up, a C3D file what it says itself.

    Returns
    -------
    Names like ``RShoulder`` have become ``right_shoulder``.

    Raises
    ------
    FileFormatError : another kind of file, or whatever is wrong in it.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind in (".trc", ".c3d"):
        markers = load_markers(path, y_up)
        stamps = stamps_of_times_ns(path, markers.times_s)
        names, positions, valid = markers.names, markers.positions_m, markers.valid
    elif kind == ".csv":
        header = CsvTable(path).header
        if "stamp_ns" in header[:1] and "landmark" not in header:
            expected = f"columns of joints.csv ({', '.join(JOINT_COLUMNS)}), poses.csv ({', '.join(POSE_COLUMNS)}) or states.csv"
            raise FileFormatError(path, "header", f"{expected} (stamp_ns, {_FIRST}, …)", header)
        joints = read_joints(path)
        names, stamps, positions, valid = joints.names, joints.stamps_ns, joints.positions_m, joints.valid
    else:
        raise FileFormatError(path, "(name)", "a .trc, .c3d or .csv file", path.suffix or path.name)
    if not len(stamps):
        raise FileFormatError(path, "(content)", "at least one row", "none")
    landmarks = tuple(landmark_of_marker(name) for name in names)
    if twice := repeated(landmarks):
        raise FileFormatError(path, "(markers)", "each landmark under one name", twice)
    return Trajectories(landmarks, stamps, positions, valid)


def truth_of(paths: Sequence[str], y_up: bool | None, model: ArticulatedModel | None) -> Truth:
    """The truth in some files: joints, states, both or nothing.

    Parameters
    ----------
    paths : at most one file with positions (TRC, C3D, CSV) and one with degrees of freedom (MOT, STO, CSV).
    y_up : whether the files have y up; None: as `load_truth` and `load_true_states` take it.
    model : body that the degrees of freedom are of; None where no file has any.

    Returns
    -------
    Truth, with None for what no file holds.

    Raises
    ------
    TrackerError : two files of one kind, or one that cannot be read.
    """
    states = [path for path in paths if holds_states(path)]
    joints = [path for path in paths if path not in states]
    for of, what in ((states, "states"), (joints, "joints")):
        if len(of) > 1:
            raise TrackerError(f"truth: expected one file with {what}, got {', '.join(of)}")
    return Truth(
        load_truth(joints[0], y_up) if joints else None,
        load_true_states(states[0], model, y_up) if states else None,
        *(bool(of) and Path(of[0]).suffix.lower() in OWN_TIME for of in (joints, states)),
    )
