"""velocities.csv and covariances.csv: there and back, and errors that name the place."""

from pathlib import Path

import numpy as np
import pytest

from helpers.sources.tables import read_numbers
from tracker_node.errors import FileFormatError
from tracker_node.loaders.motion.trajectory_file import CovariancesWriter, VelocitiesWriter, read_covariances
from tracker_node.model.kinematic_chain import ROOT_DOF_NAMES

NAMES = (*ROOT_DOF_NAMES, "knee_flexion", "slide")
UNITS = ("m",) * 3 + ("rad",) * 4 + ("m",)


def spreads(rng: np.random.Generator, count: int) -> np.ndarray:
    roots = rng.normal(size=(count, 8, 8))
    return roots @ np.swapaxes(roots, 1, 2)


def written(path: Path, count: int = 3) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    states, velocities = spreads(rng, count), spreads(rng, count) * 1e-7
    with CovariancesWriter(path, NAMES) as writer:
        for i in range(count):
            writer.append(10**18 + i, states[i], velocities[i])
    return states, velocities


def test_velocities_come_back_bit_for_bit(tmp_path):
    values = np.random.default_rng(1).normal(size=(4, 8)) * 1e3
    with VelocitiesWriter(tmp_path / "velocities.csv", NAMES, UNITS) as writer:
        for i, row in enumerate(values):
            writer.append(10**18 + i, row)
    stamps_ns, read = read_numbers(tmp_path / "velocities.csv")
    assert read.tobytes() == values.tobytes()
    assert stamps_ns.tolist() == [10**18 + i for i in range(4)]
    header = (tmp_path / "velocities.csv").read_text().splitlines()[0].split(",")
    assert header[1:] == [f"{name}_{unit}_per_s" for name, unit in zip(NAMES, UNITS, strict=True)]


def test_covariances_come_back(tmp_path):
    states, velocities = written(tmp_path / "covariances.csv")
    read = read_covariances(tmp_path / "covariances.csv")
    assert read.dof_names == NAMES
    assert read.stamps_ns.tolist() == [10**18, 10**18 + 1, 10**18 + 2]
    np.testing.assert_allclose(read.state, states, rtol=1e-8)
    np.testing.assert_allclose(read.velocity, velocities, rtol=1e-8)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda lines: lines[:-1], "16 rows for each time step"),
        (lambda lines: lines[:5] + lines[6:], "line 6"),
        (lambda lines: [*lines[:4], lines[4].replace("state", "root"), *lines[5:]], "line 5"),
        (lambda lines: [lines[0], lines[1].rsplit(",", 1)[0] + ",wide", *lines[2:]], "column 'slide'"),
        (lambda lines: ["a,b,c", *lines[1:]], "header"),
    ],
)
def test_a_damaged_file_is_refused_with_the_place(tmp_path, change, problem):
    path = tmp_path / "covariances.csv"
    written(path)
    path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")
    with pytest.raises(FileFormatError, match=problem):
        read_covariances(path)


def test_other_shapes_are_refused(tmp_path):
    with CovariancesWriter(tmp_path / "c.csv", NAMES) as writer, pytest.raises(ValueError, match="velocity"):
        writer.append(0, np.eye(8), np.eye(7))
    with VelocitiesWriter(tmp_path / "v.csv", NAMES) as writer, pytest.raises(ValueError, match="velocity"):
        writer.append(0, np.zeros(7))
