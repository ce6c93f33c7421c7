"""Reads a C3D file with ezc3d in a process of its own, which a damaged file can crash, hold up or fill without harm to others.

``python -m tracker_node.loaders.motion.c3d_reader FILE`` writes the points as an ``.npz`` archive to standard output;
`read_c3d` starts it.
"""

from __future__ import annotations

import io
import resource
import subprocess
import sys
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import FileFormatError

_TIMEOUT_S = 120.0
_MEMORY_BYTES = 8 << 30
_NOT_MARKERS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS")  # lists of the points that are something else


def read_c3d(path: str | Path) -> Mapping[str, np.ndarray]:
    """Content of a C3D file.

    Returns
    -------
    ``points`` (n, m, 3) in the file's unit, ``residuals`` (n, m), ``rate`` (), and texts: ``labels`` (m), ``not_markers``,
    ``units``, ``y_screen``; ``actual_frames`` (), how many ``TRIAL`` states, 0 where it does not.

    Raises
    ------
    FileFormatError : what ezc3d says of a file that it cannot read, or how its process ended.
    """
    command = [sys.executable, "-m", "tracker_node.loaders.motion.c3d_reader", str(path)]
    try:
        child = subprocess.run(command, capture_output=True, timeout=_TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired:
        raise FileFormatError(path, "(content)", f"a C3D file that is read within {_TIMEOUT_S:.0f} s", "none") from None
    if child.returncode != 0:
        said = child.stderr.decode(errors="replace").strip().splitlines()
        problem = said[-1] if said else f"one that ends the reader with status {child.returncode}"
        raise FileFormatError(path, "(content)", "an undamaged C3D file", problem)
    try:
        with np.load(io.BytesIO(child.stdout), allow_pickle=False) as archive:
            return dict(archive)
    except (ValueError, OSError, zipfile.BadZipFile) as error:
        raise FileFormatError(path, "(content)", "an undamaged C3D file", str(error)) from None


def main(path: str) -> None:
    """Read ``path`` and write what `read_c3d` returns."""
    import ezc3d

    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    file = ezc3d.c3d(path)
    point = file["parameters"]["POINT"]

    def texts(name: str) -> list[str]:
        return [str(value).strip() for value in point[name]["value"]] if name in point else []

    np.savez(
        sys.stdout.buffer,
        points=np.asarray(file["data"]["points"], dtype=np.float64)[:3].transpose(2, 1, 0),
        residuals=np.asarray(file["data"]["meta_points"]["residuals"], dtype=np.float64)[0].T,
        rate=np.float64(file["header"]["points"]["frame_rate"]),
        labels=np.array([label for i in ("", *range(2, 99)) for label in texts(f"LABELS{i}")], dtype=np.str_),
        not_markers=np.array([label for kind in _NOT_MARKERS for label in texts(kind)], dtype=np.str_),
        units=np.array(texts("UNITS"), dtype=np.str_),
        y_screen=np.array(texts("Y_SCREEN"), dtype=np.str_),
        actual_frames=_actual_frames(file["parameters"].get("TRIAL", {})),
    )


def _actual_frames(trial: Mapping[str, Any]) -> int:
    """From the numbers of the first and last frame, each two words of 16 bits, the lower one first."""
    numbers = []
    for name in ("ACTUAL_START_FIELD", "ACTUAL_END_FIELD"):
        words = [int(word) & 0xFFFF for word in np.ravel(trial[name]["value"])] if name in trial else []
        numbers.append(words[0] + (words[1] << 16) if len(words) == 2 else 0)
    return numbers[1] - numbers[0] + 1 if 0 < numbers[0] <= numbers[1] else 0


if __name__ == "__main__":
    try:
        main(sys.argv[1])
    except Exception as error:  # whatever the library throws becomes the last line that the other process reads
        sys.exit(f"{type(error).__name__}: {error}".replace("\n", " "))
