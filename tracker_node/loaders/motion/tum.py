"""Poses over time in the format of the TUM RGB-D benchmark: lines of ``stamp tx ty tz qx qy qz qw``, seconds and meters."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..whole_file import write_whole

_SECOND_NS = 1_000_000_000


def dump_tum(stamps_ns: np.ndarray, positions_m: np.ndarray, quaternions_xyzw: np.ndarray, path: str | Path) -> None:
    """Write poses; stamps keep their nanoseconds.

    Parameters
    ----------
    stamps_ns, positions_m, quaternions_xyzw : (n,), (n, 3) and (n, 4).
    """
    lines = ["# timestamp tx ty tz qx qy qz qw"]
    for stamp_ns, p, q in zip(stamps_ns, positions_m, quaternions_xyzw, strict=True):
        seconds, nanoseconds = divmod(int(stamp_ns), _SECOND_NS)
        lines.append(" ".join([f"{seconds}.{nanoseconds:09d}", *(repr(float(value)) for value in (*p, *q))]))
    write_whole(path, "\n".join(lines) + "\n")
