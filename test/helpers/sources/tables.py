"""Tables of numbers over time as runs leave them, read by numpy alone."""

from pathlib import Path

import numpy as np


def read_numbers(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Stamps (n,) int64 and the other columns (n, k) of ``poses.csv`` or ``velocities.csv``."""
    lines = [line.split(",") for line in path.read_text().splitlines()[1:]]
    return np.array([int(line[0]) for line in lines]), np.array([[float(cell) for cell in line[1:]] for line in lines])
