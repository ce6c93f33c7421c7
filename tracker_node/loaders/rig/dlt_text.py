"""DLT coefficients as text: eleven lines, a column per camera, commas or blanks between (as Argus and DLTdv write them).

``u = (L1 x + L2 y + L3 z + L4) / (L9 x + L10 y + L11 z + 1)`` and so on, with ``v`` downward as everywhere here.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ...errors import FileFormatError
from ..whole_file import read_text, write_whole

N_COEFFICIENTS = 11


def load_dlt(path: str | Path) -> np.ndarray:
    """L1..L11 of each camera, (n_cameras, 11).

    Raises
    ------
    FileFormatError : naming the line.
    """
    rows = [line.replace(",", " ").replace(";", " ").split() for line in read_text(path).splitlines() if line.strip()]
    if len(rows) != N_COEFFICIENTS:
        expected = f"{N_COEFFICIENTS} lines, one per coefficient, a column per camera"
        raise FileFormatError(path, "(file)", expected, f"{len(rows)} lines")
    columns = len(rows[0])
    values = np.empty((columns, N_COEFFICIENTS))
    for i, row in enumerate(rows):
        try:
            numbers = np.array(row, dtype=np.float64)
        except ValueError as error:
            raise FileFormatError(path, f"line {i + 1}", "numbers", " ".join(row)) from error
        if len(numbers) != columns or not np.isfinite(numbers).all():
            raise FileFormatError(path, f"line {i + 1}", f"{columns} numbers, one per camera", " ".join(row))
        values[:, i] = numbers
    return values


def dump_dlt(coefficients: ArrayLike, path: str | Path) -> None:
    """Write DLT coefficients, in place of what was there.

    Parameters
    ----------
    coefficients, path : L1..L11 (n_cameras, 11); text file.
    """
    lines = [",".join(repr(float(value)) for value in row) for row in np.asarray(coefficients).T]
    write_whole(path, "\n".join(lines) + "\n")
