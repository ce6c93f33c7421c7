"""A run's motion as tables for spreadsheets and pandas: one row per time step, empty cells in gaps."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...loaders.csv_file import CsvWriter, exact
from ...loaders.motion.trc import METERS_PER_UNIT
from ...loaders.whole_file import whole_file
from ...runs.motion import RunMotion
from .coordinates import model_coordinates, opensim_coordinates
from .export import ExportOptions
from .isb_angles import isb_angles
from .kinematics import StateKinematics, derivatives

_DERIVATIVES = ("velocities", "accelerations")
TABLES = (  # every name that a table can have
    "landmarks", *(f"landmark_{name}" for name in _DERIVATIVES), "coordinates", *(f"state_{name}" for name in _DERIVATIVES),
    "isb_angles", *(f"isb_angle_{name}" for name in _DERIVATIVES),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class MotionTable:
    """Columns (n, k) of one file, with their validity (n, k); their names end in their units."""

    name: str
    columns: tuple[str, ...]
    values: np.ndarray
    valid: np.ndarray


def write_tables(motion: RunMotion, folder: Path, tables: list[MotionTable]) -> None:
    """Write ``<name>.csv`` of each table: ``stamp_ns``, ``time_s`` since the first row, and the columns.

    Those of `TABLES` that are not among them are deleted: they would be of another export, maybe in other axes and units.

    Parameters
    ----------
    motion : its stamps and times.
    folder : is made.
    tables : with a row for each state of the motion.

    Raises
    ------
    OSError : not all of them can be written. Unless they could and only taking the places of the earlier ones failed, the
        folder is as it was.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:  # each takes the place of an earlier one when all are written, and on the disk
        for table in tables:
            _write_table(motion, table, stack.enter_context(whole_file(folder / f"{table.name}.csv")))
    for name in set(TABLES) - {table.name for table in tables}:
        (folder / f"{name}.csv").unlink(missing_ok=True)


def _write_table(motion: RunMotion, table: MotionTable, path: Path) -> None:
    with CsvWriter(path, ("stamp_ns", "time_s", *table.columns)) as writer:
        for stamp, time_s, values, good in zip(motion.stamps_ns, motion.times_s, table.values, table.valid, strict=True):
            cells = [exact(value) if ok else "" for value, ok in zip(values, good, strict=True)]
            writer.write_rows([[int(stamp), exact(time_s), *cells]])


def tables(motion: RunMotion, options: ExportOptions, kinematics: StateKinematics | None = None) -> list[MotionTable]:
    """Landmarks, coordinates, and on request angles after the ISB, with their derivatives.

    Velocities of the state are those of its tangent: angular velocity of the root about the file's axes.

    Parameters
    ----------
    motion : states over time; that of ``kinematics``, where there are any.
    options : axes, units, and what is written.
    kinematics : the filtered motion, whose derivatives are written too; None: no derivatives.

    Returns
    -------
    Of `TABLES`, those that are asked for.
    """
    return list(_tables(motion, options, kinematics))


def _tables(motion: RunMotion, options: ExportOptions, kinematics: StateKinematics | None) -> Iterator[MotionTable]:
    length, angle = 1.0 / METERS_PER_UNIT[options.unit], 180.0 / np.pi if options.degrees else 1.0
    points = (length * motion.landmarks_m()[:, options.columns(motion.model)] @ options.axes.T).reshape(len(motion), -1)
    names = [f"{label}_{axis}" for label in options.labels(motion.model) for axis in "xyz"]
    valid = np.repeat(motion.landmarks_valid()[:, options.columns(motion.model)], 3, axis=1)
    yield from _with_derivatives(motion, "landmark", "landmarks", names, [options.unit] * len(names), points, valid, kinematics)
    found = opensim_coordinates(motion) if options.opensim else model_coordinates(motion, options.y_up)
    scale = {"m": (options.unit, length), "rad": (options.angle_unit, angle)}
    columns = tuple(f"{name}_{scale[unit][0]}" for name, unit in zip(found.names, found.units, strict=True))
    whole = np.repeat(motion.valid[:, None], len(columns), axis=1)
    yield MotionTable("coordinates", columns, found.values * [scale[unit][1] for unit in found.units], whole)
    if kinematics is not None:
        yield from _state_derivatives(motion, options, kinematics, scale)
    if options.isb_angles:
        angles = isb_angles(motion)
        names, values = [name for triple in angles.names for name in triple], angle * angles.radians.reshape(len(motion), -1)
        units = [options.angle_unit] * len(names)
        valid = np.repeat(angles.valid, 3, axis=1)
        yield from _with_derivatives(motion, "isb_angle", "isb_angles", names, units, values, valid, kinematics)


def _state_derivatives(
    motion: RunMotion, options: ExportOptions, kinematics: StateKinematics, scale: dict[str, tuple[str, float]]
) -> Iterator[MotionTable]:
    chain = motion.model.chain
    units = [scale[unit] for unit in chain.dof_units]
    for name, values, per in (("velocities", kinematics.velocity, "s"), ("accelerations", kinematics.acceleration, "s2")):
        turned = values.copy()
        turned[:, :3], turned[:, 3:6] = values[:, :3] @ options.axes.T, values[:, 3:6] @ options.axes.T
        columns = tuple(f"{dof}_{unit}_per_{per}" for dof, (unit, _) in zip(chain.dof_names, units, strict=True))
        valid = np.repeat(motion.valid[:, None], len(columns), axis=1)
        yield MotionTable(f"state_{name}", columns, turned * [factor for _, factor in units], valid)


def _with_derivatives(
    motion: RunMotion,
    one: str,
    name: str,
    names: list[str],
    units: list[str],
    values: np.ndarray,
    valid: np.ndarray,
    kinematics: StateKinematics | None,
) -> Iterator[MotionTable]:
    pairs = list(zip(names, units, strict=True))
    yield MotionTable(name, tuple(f"{column}_{unit}" for column, unit in pairs), values, valid)
    if kinematics is None:
        return
    first, second, good = derivatives(values, motion.valid, motion.rate_hz)
    good = valid & good[:, None]
    yield MotionTable(f"{one}_velocities", tuple(f"{column}_{unit}_per_s" for column, unit in pairs), first, good)
    yield MotionTable(f"{one}_accelerations", tuple(f"{column}_{unit}_per_s2" for column, unit in pairs), second, good)
