"""How long people's segments are where a detector marks their joints, and how these lengths go together.

A detector's joints are those of people who clicked in pictures, or of skeletons of rendered bodies: an upper arm between them is
a seventh shorter than between the centers of rotation that anatomists tabulate, hips are a third farther apart. The default body
has the latter; one that is made from points alone is expected to have the former.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from .shape_parameters import ShapeSpace

# Over 300 people of anny 0.6.2 (Brégier et al., Human Mesh Modeling for Anny Body, ECCV 2026): logarithms of lengths over those
# of the default body of the same size (trunk, thigh and shank together). Each is MEANS + SLOPES * (logarithm of the size), with
# covariance COVARIANCE. `benchmark/clothed/person/_write_bodies.py --lengths 300` draws them, `benchmark.clothed._fit --lengths`
# prints this. The Balancing clip's person, by OpenPose's joints, lies within but for a trunk that is longer by 7 % (3.4 sigma).
_ROWS = (
    ("length upper_arm",), ("length forearm",), ("length thigh",), ("length shank",),
    ("length pelvis", "length abdomen", "length torso"), ("length clavicle",), ("breadth pelvis y",),
)  # fmt: skip
_MEANS = np.array([-0.162, -0.024, 0.016, 0.035, -0.047, 0.006, 0.309])
_SLOPES = np.array([-0.083, 0.002, 0.230, -0.154, -0.058, -0.097, -0.140])
_COVARIANCE = 1e-4 * np.array([
    [2.68, -0.82, 4.36, -3.33, -0.66, -4.09, -6.11],
    [-0.82, 26.08, -2.40, 5.88, -3.28, 19.50, 21.33],
    [4.36, -2.40, 22.71, -14.86, -6.03, -19.27, -19.97],
    [-3.33, 5.88, -14.86, 11.44, 2.44, 16.43, 16.45],
    [-0.66, -3.28, -6.03, 2.44, 3.02, 1.70, 2.16],
    [-4.09, 19.50, -19.27, 16.43, 1.70, 33.22, 28.20],
    [-6.11, 21.33, -19.97, 16.45, 2.16, 28.20, 42.03],
])  # fmt: skip
_SIZE_SIGMA = 0.15  # children, too
_OWN_SIGMA = 0.01  # of a length that the drawn bodies do not vary by themselves
_WITHIN_TRUNK_SIGMA = 0.05  # of the ratio of two of its parts


def expected_lengths(space: ShapeSpace) -> tuple[np.ndarray, np.ndarray]:
    """What is expected of the shape parameters of a person whose joints a detector has found.

    Parameters
    ----------
    space : bodies like the default human, or like another model.

    Returns
    -------
    Mean (n,) and information (n, n) of the parameters; those of `ShapeSpace.sigmas` for a body that has not these lengths.
    """
    names, mean, information = space.names, np.zeros(len(space)), np.diag(space.sigmas**-2.0)
    if not {"size", *(name for row in _ROWS for name in row)} <= set(names):
        return mean, information
    columns = [[names.index(name) for name in row] for row in _ROWS]
    size, described = names.index("size"), [names.index("size"), *(column for row in columns for column in row)]
    information[described, described] = 0.0
    to_rows = np.zeros((len(_ROWS), len(space)))
    for k, row in enumerate(columns):
        to_rows[k, row] = 1.0 / len(row)
        mean[row] = _MEANS[k]
        for one, other in pairwise(row):
            information[np.ix_([one, other], [one, other])] += np.array([[1.0, -1.0], [-1.0, 1.0]]) / _WITHIN_TRUNK_SIGMA**2
    to_rows[:, size] -= _SLOPES
    information += to_rows.T @ np.linalg.inv(_COVARIANCE + _OWN_SIGMA**2 * np.eye(len(_ROWS))) @ to_rows
    information[size, size] += _SIZE_SIGMA**-2.0
    return mean, information
