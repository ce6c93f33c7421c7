"""Trajectories as CSV, ``states.csv``, ``velocities.csv``, ``covariances.csv``, ``joints.csv``, ``poses.csv``; and poses as TUM.

Numbers have 17 significant digits, so reading gives back the very float64 that was written; covariances have 9. Wall-clock times
are left out: two runs that found the same states write the same bytes. Rows are written through at once, so what was tracked
before a power cut is in the file. TUM is the format of the RGB-D benchmark.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import FileFormatError
from ...geometry import so3
from ...model.kinematic_chain import N_ROOT_DOF
from ..csv_file import CsvTable, CsvWriter, exact
from ..whole_file import write_whole

LEADING_COLUMNS = ("stamp_ns", "status", "reason")
TRAILING_COLUMNS = ("score", "residual", "iterations", "evaluations")
JOINT_COLUMNS = ("stamp_ns", "landmark", "x", "y", "z")
POSE_COLUMNS = ("stamp_ns", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
_N_ROOT_TRANSLATION = 3


@dataclass(frozen=True, eq=False)
class StateRow:
    """One time step of ``states.csv``.

    ``values`` (n_dof,) as `model.configuration.State.to_values`: meters and radians; all NaN where there is no state, which the
    file shows by empty cells. ``status`` is the name of the status, ``score`` the objective's value in its own unit,
    ``residual`` in the unit that ``run.json`` names.
    """

    stamp_ns: int
    status: str
    reason: str
    values: np.ndarray
    score: float = 0.0
    residual: float = 0.0
    iterations: int = 0
    evaluations: int = 0


@dataclass(frozen=True, eq=False)
class StateTrajectory:
    """What ``states.csv`` holds: ``dof_names`` and one row per image set, in the order of the file.

    ``dof_units`` are "m" or "rad"; those of a chain of turns if not given.
    """

    dof_names: tuple[str, ...]
    rows: tuple[StateRow, ...]
    dof_units: tuple[str, ...] = ()

    @property
    def stamps_ns(self) -> np.ndarray:
        """(n,) int64."""
        return np.array([row.stamp_ns for row in self.rows], dtype=np.int64)

    @property
    def values(self) -> np.ndarray:
        """(n, n_dof) meters and radians."""
        return np.array([row.values for row in self.rows], dtype=np.float64).reshape(-1, len(self.dof_names))

    @property
    def status(self) -> tuple[str, ...]:
        return tuple(row.status for row in self.rows)


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Points over time, such as ``joints.csv`` holds.

    Parameters
    ----------
    names : m names.
    stamps_ns : (n,) integer nanoseconds, increasing.
    positions_m : (n, m, 3) meters, world frame.
    valid : (n, m), False where a point was not seen.
    """

    names: tuple[str, ...]
    stamps_ns: np.ndarray
    positions_m: np.ndarray
    valid: np.ndarray

    def __post_init__(self):
        n, m = len(self.stamps_ns), len(self.names)
        if self.positions_m.shape != (n, m, 3) or self.valid.shape != (n, m):
            raise ValueError(
                f"expected positions ({n}, {m}, 3) and validity ({n}, {m}), got {self.positions_m.shape} and {self.valid.shape}"
            )
        if n > 1 and not np.all(np.diff(self.stamps_ns) > 0):
            raise ValueError("expected increasing stamps")

    def select(self, names: Sequence[str]) -> Trajectories:
        """The named points only, in the given order."""
        columns = [self.names.index(name) for name in names]
        return Trajectories(tuple(names), self.stamps_ns, self.positions_m[:, columns], self.valid[:, columns])

    def at(self, stamps_ns: np.ndarray, earlier_ns: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Interpolate linearly. Nothing is extrapolated.

        Parameters
        ----------
        stamps_ns : (k,) integer nanoseconds.
        earlier_ns : is subtracted from them.

        Returns
        -------
        positions : (k, m, 3) meters, zeros where not valid.
        valid : (k, m), False outside the time covered, or next to a point that was not seen.
        """
        before, after, weight, inside = between(self.stamps_ns, stamps_ns, earlier_ns)
        weight = weight[:, None, None]
        positions = (1.0 - weight) * self.positions_m[before] + weight * self.positions_m[after]
        valid = self.valid[before] & self.valid[after] & inside[:, None]
        return np.where(valid[..., None], positions, 0.0), valid

    def shifted(self, shift_ns: int) -> Trajectories:
        """The same points, ``shift_ns`` later."""
        return Trajectories(self.names, self.stamps_ns + shift_ns, self.positions_m, self.valid)


def between(own_ns: np.ndarray, stamps_ns: np.ndarray, earlier_ns: float = 0.0) -> tuple[np.ndarray, ...]:
    """Between which rows some stamps lie.

    Parameters
    ----------
    own_ns : (n,) of the rows, increasing.
    stamps_ns : (k,).
    earlier_ns : is subtracted from ``stamps_ns``.

    Returns
    -------
    before, after : (k,) rows; the same one where it is hit.
    weight : (k,) of the row after.
    inside : (k,) whether the rows cover the stamp.
    """
    query = (stamps_ns - own_ns[0]).astype(np.float64) - earlier_ns
    own = (own_ns - own_ns[0]).astype(np.float64)
    after = np.clip(np.searchsorted(own, query, side="left"), 0, len(own) - 1)
    hit = own[after] == query
    before = np.where(hit, after, np.maximum(after - 1, 0))
    inside = hit | ((query > own[0]) & (query < own[-1]))
    span = np.where(after == before, 1.0, own[after] - own[before])
    return before, after, np.where(hit, 0.0, (query - own[before]) / span), inside


class StatesWriter(CsvWriter):
    """Writes ``states.csv``."""

    def __init__(self, path: str | Path, dof_names: Sequence[str], dof_units: Sequence[str] = ()):
        self.dof_names = tuple(dof_names)
        super().__init__(path, (*LEADING_COLUMNS, *dof_columns(self.dof_names, dof_units), *TRAILING_COLUMNS))

    def append(self, row: StateRow) -> None:
        if len(row.values) != len(self.dof_names):
            raise ValueError(f"expected {len(self.dof_names)} values, got {len(row.values)}")
        numbers = [""] * len(row.values) if np.isnan(row.values).all() else [exact(value) for value in row.values]
        tail = [exact(row.score), exact(row.residual), int(row.iterations), int(row.evaluations)]
        self.write_rows([[int(row.stamp_ns), row.status, row.reason, *numbers, *tail]])


class JointsWriter(CsvWriter):
    """Writes ``joints.csv``."""

    def __init__(self, path: str | Path, landmark_names: Sequence[str]):
        self.landmark_names = tuple(landmark_names)
        super().__init__(path, JOINT_COLUMNS)

    def append(self, stamp_ns: int, positions_m: np.ndarray) -> None:
        """Write one time step.

        Parameters
        ----------
        stamp_ns, positions_m : nanoseconds; (n_landmarks, 3) in the world.
        """
        points = np.asarray(positions_m)
        if points.shape != (len(self.landmark_names), 3):
            raise ValueError(f"expected positions ({len(self.landmark_names)}, 3), got {points.shape}")
        pairs = zip(self.landmark_names, points, strict=True)
        self.write_rows([[int(stamp_ns), name, *map(exact, point)] for name, point in pairs])


class PosesWriter(CsvWriter):
    """Writes ``poses.csv``."""

    def __init__(self, path: str | Path):
        super().__init__(path, POSE_COLUMNS)

    def append(self, stamp_ns: int, T_world_root: np.ndarray) -> None:
        """Write one time step.

        Parameters
        ----------
        stamp_ns, T_world_root : nanoseconds; (4, 4).
        """
        q_xyzw = so3.xyzw_from_matrix(T_world_root[:3, :3])
        self.write_rows([[int(stamp_ns), *map(exact, T_world_root[:3, 3]), *map(exact, q_xyzw)]])


def dof_columns(dof_names: Sequence[str], dof_units: Sequence[str] = ()) -> tuple[str, ...]:
    """Names of columns: the degree of freedom with its unit, ``root_x_m``, ``left_knee_flexion_rad``.

    Parameters
    ----------
    dof_names, dof_units : (n_dof,); "m" or "rad" each, empty for a chain whose joints all turn.

    Returns
    -------
    (n_dof,) names.
    """
    units = dof_units or tuple("m" if i < _N_ROOT_TRANSLATION else "rad" for i in range(len(dof_names)))
    return tuple(f"{name}_{unit}" for name, unit in zip(dof_names, units, strict=True))


def write_states(path: str | Path, trajectory: StateTrajectory) -> None:
    """Write the whole of ``states.csv`` at once.

    Parameters
    ----------
    path, trajectory : file; rows in its order.
    """
    with StatesWriter(path, trajectory.dof_names, trajectory.dof_units) as writer:
        for row in trajectory.rows:
            writer.append(row)


def read_states(path: str | Path) -> StateTrajectory:
    """Inverse of `write_states`.

    Raises
    ------
    FileFormatError : naming line and column.
    """
    table = CsvTable(path, LEADING_COLUMNS)
    if "residual_px" in table.header:
        expected = "columns under their present names (version 0.1 reads its own runs; or track the recording again)"
        raise FileFormatError(path, "header", expected, "those of version 0.1")
    if table.header[-len(TRAILING_COLUMNS) :] != TRAILING_COLUMNS:
        raise FileFormatError(path, "header", f"last columns {', '.join(TRAILING_COLUMNS)}", table.header)
    columns = table.header[len(LEADING_COLUMNS) : -len(TRAILING_COLUMNS)]
    names, units = (tuple(column.rpartition("_")[i] for column in columns) for i in (0, 2))
    if units[:N_ROOT_DOF] != ("m", "m", "m", "rad", "rad", "rad") or not {"m", "rad"}.issuperset(units):
        raise FileFormatError(path, "header", "degrees of freedom named <name>_m (first three) and <name>_rad", columns)
    first, last = len(LEADING_COLUMNS), len(LEADING_COLUMNS) + len(names)
    rows = []
    for cells in table.rows():
        score, residual, iterations, evaluations = range(last, last + len(TRAILING_COLUMNS))
        rows.append(
            StateRow(
                stamp_ns=cells.integer(0),
                status=cells.text[1],
                reason=cells.text[2],
                values=cells.numbers(first, last) if any(cells.text[first:last]) else np.full(last - first, np.nan),
                score=cells.number(score),
                residual=cells.number(residual),
                iterations=cells.integer(iterations),
                evaluations=cells.integer(evaluations),
            )
        )
    return StateTrajectory(names, tuple(rows), units)


def write_joints(path: str | Path, trajectory: Trajectories) -> None:
    """Write the whole of ``joints.csv`` at once; positions that are not valid get no row.

    Parameters
    ----------
    path, trajectory : file; positions over time.
    """
    with CsvWriter(path, JOINT_COLUMNS) as writer:
        for stamp_ns, points, valid in zip(trajectory.stamps_ns, trajectory.positions_m, trajectory.valid, strict=True):
            pairs = zip(trajectory.names, points, valid, strict=True)
            writer.write_rows([[int(stamp_ns), name, *map(exact, point)] for name, point, good in pairs if good])


def read_joints(path: str | Path) -> Trajectories:
    """Inverse of `write_joints`; time steps in order, landmarks in that of their first row; zeros where there is none.

    Raises
    ------
    FileFormatError : naming line and column.
    """
    table = CsvTable(path, JOINT_COLUMNS)
    names: dict[str, int] = {}
    steps: dict[int, dict[str, np.ndarray]] = {}
    for cells in table.rows():
        stamp_ns, name = cells.integer(0), cells.text[1]
        names.setdefault(name, len(names))
        points = steps.setdefault(stamp_ns, {})
        if name in points:
            problem = f"a second one at {stamp_ns}"
            raise FileFormatError(path, f"line {cells.line}", f"one row per time step of '{name}'", problem)
        points[name] = cells.numbers(2, 5)
    positions_m = np.zeros((len(steps), len(names), 3))
    valid = np.zeros((len(steps), len(names)), dtype=np.bool_)
    stamps = sorted(steps)
    for row, stamp_ns in enumerate(stamps):
        for name, point in steps[stamp_ns].items():
            positions_m[row, names[name]] = point
            valid[row, names[name]] = True
    return Trajectories(tuple(names), np.array(stamps, dtype=np.int64), positions_m, valid)


_SECOND_NS = 1_000_000_000


def dump_tum(stamps_ns: np.ndarray, positions_m: np.ndarray, quaternions_xyzw: np.ndarray, path: str | Path) -> None:
    """Write poses in the format of the TUM RGB-D benchmark: lines of ``stamp tx ty tz qx qy qz qw``, seconds and meters.

    Parameters
    ----------
    stamps_ns, positions_m, quaternions_xyzw : (n,), (n, 3) and (n, 4), of the body in the world.
    path : text file.
    """
    lines = ["# timestamp tx ty tz qx qy qz qw"]
    for stamp_ns, p, q in zip(stamps_ns, positions_m, quaternions_xyzw, strict=True):
        seconds, nanoseconds = divmod(int(stamp_ns), _SECOND_NS)
        lines.append(" ".join([f"{seconds}.{nanoseconds:09d}", *(repr(float(value)) for value in (*p, *q))]))
    write_whole(path, "\n".join(lines) + "\n")


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
