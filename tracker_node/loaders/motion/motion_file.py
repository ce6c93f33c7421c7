"""Velocities and covariances of states as CSV: ``velocities.csv`` and ``covariances.csv``.

Velocities have 17 significant digits, covariances 9.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from ..csv_file import CsvTable, CsvWriter, exact
from .trajectory_file import dof_columns

STATE, VELOCITY = "state", "velocity"
COVARIANCE_COLUMNS = ("stamp_ns", "of", "dof")


@dataclass(frozen=True, eq=False)
class CovarianceTrajectory:
    """What ``covariances.csv`` holds: (n, n_dof, n_dof) each, in tangents (m, rad) and in tangents per second."""

    dof_names: tuple[str, ...]
    stamps_ns: np.ndarray
    state: np.ndarray
    velocity: np.ndarray


class VelocitiesWriter(CsvWriter):
    """Writes ``velocities.csv``: a column per degree of freedom, ``root_x_m_per_s``."""

    def __init__(self, path: str | Path, dof_names: Sequence[str], dof_units: Sequence[str] = ()):
        self._n = len(dof_names)
        super().__init__(path, ("stamp_ns", *(f"{column}_per_s" for column in dof_columns(dof_names, dof_units))))

    def append(self, stamp_ns: int, velocity: np.ndarray) -> None:
        """Write one time step.

        Parameters
        ----------
        stamp_ns, velocity : nanoseconds; (n_dof,) in the state's tangent per second.
        """
        if np.shape(velocity) != (self._n,):
            raise ValueError(f"expected a velocity ({self._n},), got {np.shape(velocity)}")
        self.write_rows([[int(stamp_ns), *map(exact, velocity)]])


class CovariancesWriter(CsvWriter):
    """Writes ``covariances.csv``: a row of a matrix in each line."""

    def __init__(self, path: str | Path, dof_names: Sequence[str]):
        self._names = tuple(dof_names)
        super().__init__(path, (*COVARIANCE_COLUMNS, *self._names))

    def append(self, stamp_ns: int, state: np.ndarray, velocity: np.ndarray) -> None:
        """Write one time step.

        Parameters
        ----------
        stamp_ns : nanoseconds.
        state, velocity : covariances (n_dof, n_dof) of the state in its tangent, and of the velocity.
        """
        n = len(self._names)
        for of, matrix in ((STATE, state), (VELOCITY, velocity)):
            if matrix.shape != (n, n):
                raise ValueError(f"expected a covariance ({n}, {n}) of the {of}, got {matrix.shape}")
            rows = zip(self._names, matrix, strict=True)
            self.write_rows([[int(stamp_ns), of, name, *(f"{value:.9g}" for value in row)] for name, row in rows])


def read_covariances(path: str | Path) -> CovarianceTrajectory:
    """What `CovariancesWriter` wrote.

    Raises
    ------
    FileFormatError : naming line and column.
    """
    table = CsvTable(path, COVARIANCE_COLUMNS)
    names = table.header[len(COVARIANCE_COLUMNS) :]
    n, due = len(names), [(of, name) for of in (STATE, VELOCITY) for name in names]
    stamps_ns: list[int] = []
    values: list[np.ndarray] = []
    for i, cells in enumerate(table.rows()):
        of, name = due[i % len(due)]
        stamp_ns = cells.integer(0)
        if i % len(due) == 0:
            stamps_ns.append(stamp_ns)
        if (stamp_ns, *cells.text[1:3]) != (stamps_ns[-1], of, name):
            raise FileFormatError(path, f"line {cells.line}", f"{stamps_ns[-1]}, {of}, {name}", ", ".join(cells.text[:3]))
        values.append(cells.numbers(len(COVARIANCE_COLUMNS), len(COVARIANCE_COLUMNS) + n))
    if len(values) != len(stamps_ns) * len(due):
        raise FileFormatError(path, "(end)", f"{len(due)} rows for each time step", f"{len(values) % len(due)} for the last")
    matrices = np.array(values).reshape(-1, 2, n, n)
    return CovarianceTrajectory(names, np.array(stamps_ns, dtype=np.int64), matrices[:, 0], matrices[:, 1])
