"""Files with truth: positions of joints over time from TRC, C3D or CSV, degrees of freedom from `truth.states`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import FileFormatError, TrackerError
from ...loaders.images.stamps import stamps_from_first_ns
from ...loaders.motion.c3d_file import load_c3d
from ...loaders.motion.trajectory_file import read_joints
from ...loaders.motion.trc import load_trc
from ...model.articulated import ArticulatedModel
from ...model.humans.measures import landmark_of_marker
from .association import Trajectories
from .states import TrueStates, holds_states, load_true_states

OWN_TIME = (".trc", ".c3d", ".mot", ".sto")  # suffixes of files whose stamps count from their first row


@dataclass(frozen=True, eq=False)
class Truth:
    """Truth of a run; ``..._own_time``: stamps count from the file's own first row."""

    joints: Trajectories | None = None
    states: TrueStates | None = None
    joints_own_time: bool = False
    states_own_time: bool = False


def load_truth(path: str | Path, y_up: bool | None = None) -> Trajectories:
    """Positions from a ``.trc`` or ``.c3d`` (stamps count from its first row), or a ``.csv`` in the format of ``joints.csv``.

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
        markers = load_c3d(path, y_up) if kind == ".c3d" else load_trc(path, y_up is not False)
        stamps = stamps_from_first_ns(path, markers.times_s)
        names, positions, valid = markers.names, markers.positions_m, markers.valid
    elif kind == ".csv":
        joints = read_joints(path)
        order = np.argsort(joints.stamps_ns)
        names, stamps = joints.names, joints.stamps_ns[order]
        positions, valid = joints.positions_m[order], joints.valid[order]
    else:
        raise FileFormatError(path, "(name)", "a .trc, .c3d or .csv file", path.suffix or path.name)
    if not len(stamps):
        raise FileFormatError(path, "(content)", "at least one row", "none")
    landmarks = tuple(landmark_of_marker(name) for name in names)
    twice = sorted({name for name in landmarks if landmarks.count(name) > 1})
    if twice:
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
