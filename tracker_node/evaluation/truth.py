"""Truth to hold a run against: joint positions over time from TRC or CSV files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import FileFormatError
from ..loaders.trajectory_file import read_joints
from ..loaders.trc import load_trc
from ..model.landmark_names import landmark_of_marker
from .association import Trajectories


def load_truth(path: str | Path, y_up: bool = True) -> Trajectories:
    """Positions from a ``.trc`` (stamps count from its first row) or a ``.csv`` in the format of ``joints.csv``.

    ``y_up`` is for TRC files. Names like ``RShoulder`` become ``right_shoulder``.

    Raises
    ------
    FileFormatError : another kind of file, or whatever is wrong in it.
    """
    path = Path(path)
    if path.suffix.lower() == ".trc":
        markers = load_trc(path, y_up=y_up)
        stamps = np.round((markers.times_s - markers.times_s[0]) * 1e9).astype(np.int64)
        names, positions, valid = markers.names, markers.positions_m, markers.valid
    elif path.suffix.lower() == ".csv":
        joints = read_joints(path)
        order = np.argsort(joints.stamps_ns)
        names, stamps = joints.names, joints.stamps_ns[order]
        positions, valid = joints.positions_m[order], joints.valid[order]
    else:
        raise FileFormatError(path, "(name)", "a .trc or a .csv file", path.suffix or path.name)
    if not len(stamps):
        raise FileFormatError(path, "(content)", "at least one row", "none")
    return Trajectories(tuple(landmark_of_marker(name) for name in names), stamps, positions, valid)
