"""Truth to hold a run against: joint positions over time from TRC, C3D or CSV files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from ...loaders.images.stamps import stamps_from_first_ns
from ...loaders.motion.c3d_file import load_c3d
from ...loaders.motion.trajectory_file import read_joints
from ...loaders.motion.trc import load_trc
from ...model.humans.landmark_names import landmark_of_marker
from .association import Trajectories

OWN_TIME = (".trc", ".c3d", ".mot", ".sto")  # suffixes of files whose stamps count from their first row


def load_truth(path: str | Path, y_up: bool | None = None) -> Trajectories:
    """Positions from a ``.trc`` or ``.c3d`` (stamps count from its first row), or a ``.csv`` in the format of ``joints.csv``.

    Names like ``RShoulder`` become ``right_shoulder``.

    Parameters
    ----------
    y_up : of TRC and C3D files; None: a TRC file has y up, a C3D file what it says itself.

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
