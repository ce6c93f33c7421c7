"""Poses over time in the format of the TUM RGB-D benchmark: lines of ``stamp tx ty tz qx qy qz qw``, seconds and metres."""

from __future__ import annotations

from pathlib import Path

from ..whole_file import write_whole
from .trajectory_file import PoseTrajectory

_SECOND_NS = 1_000_000_000


def dump_tum(poses: PoseTrajectory, path: str | Path) -> None:
    """Write poses; stamps keep their nanoseconds."""
    lines = ["# timestamp tx ty tz qx qy qz qw"]
    for stamp_ns, p, q in zip(poses.stamps_ns, poses.positions_m, poses.quaternions_xyzw, strict=True):
        seconds, nanoseconds = divmod(int(stamp_ns), _SECOND_NS)
        lines.append(" ".join([f"{seconds}.{nanoseconds:09d}", *(repr(float(value)) for value in (*p, *q))]))
    write_whole(path, "\n".join(lines) + "\n")
