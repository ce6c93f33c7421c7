"""A lens as a vector: fx, fy, cx, cy, then the coefficients of its distortion; and what pixels do when it changes."""

from __future__ import annotations

import numpy as np

from ...camera.model import CameraModel

# Coefficients that are sought, in the orders of `camera.distortion`, and how large each may be expected to be (a weak prior, so
# that few or central views do not blow up what they do not tell)
COEFFICIENTS = {
    "none": (),
    "plumb_bob": ("k1", "k2", "p1", "p2", "k3"),
    "rational_polynomial": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "equidistant": ("k1", "k2", "k3", "k4"),
}
COEFFICIENT_SIGMA = {"k1": 1.0, "k2": 1.0, "p1": 0.02, "p2": 0.02, "k3": 1.0, "k4": 0.5, "k5": 0.5, "k6": 0.5}
N_PINHOLE = 4


def lens_vector(model: CameraModel) -> np.ndarray:
    """(4 + n,) of a lens without skew; n as in `COEFFICIENTS`, whatever the model has."""
    coefficients = np.zeros(len(COEFFICIENTS[model.distortion_model]))
    coefficients[: model.distortion.size] = model.distortion
    return np.concatenate([[model.K[0, 0], model.K[1, 1], model.K[0, 2], model.K[1, 2]], coefficients])


def lens_of_vector(vector: np.ndarray, like: CameraModel) -> CameraModel:
    """The lens of a vector.

    Parameters
    ----------
    vector : (4 + n,) see `lens_vector`.
    like : lens with the image size and the kind of distortion.

    Returns
    -------
    A lens without skew.

    Raises
    ------
    ValueError : a focal length that is not positive.
    """
    fx, fy, cx, cy = vector[:N_PINHOLE]
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return CameraModel(like.width, like.height, K, like.distortion_model, vector[N_PINHOLE:])


def lens_prior(model: CameraModel) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation (4 + n,) of what a lens may be: the principal point near the middle, little distortion.

    Focal lengths are left alone: their deviation is infinite.
    """
    width, height = model.width, model.height
    names = COEFFICIENTS[model.distortion_model]
    mean = np.concatenate([np.zeros(2), [(width - 1) / 2.0, (height - 1) / 2.0], np.zeros(len(names))])
    near = 0.1 * max(width, height)
    return mean, np.concatenate([[np.inf, np.inf, near, near], [COEFFICIENT_SIGMA[name] for name in names]])


def lens_jacobian(model: CameraModel, points_cam: np.ndarray) -> np.ndarray:
    """Derivative of pixels by the lens vector.

    Parameters
    ----------
    model : the lens.
    points_cam : (m, 3) in the camera's frame, in front of it.

    Returns
    -------
    (m, 2, 4 + n).
    """
    x, y = points_cam[:, 0] / points_cam[:, 2], points_cam[:, 1] / points_cam[:, 2]
    by_distortion = _distortion_jacobian(model, x, y)
    fx, fy, cx, cy = lens_vector(model)[:N_PINHOLE]
    pixels, _ = model.project(points_cam)
    result = np.zeros((len(points_cam), 2, N_PINHOLE + by_distortion.shape[2]))
    result[:, 0, 0], result[:, 1, 1] = (pixels[:, 0] - cx) / fx, (pixels[:, 1] - cy) / fy
    result[:, 0, 2] = result[:, 1, 3] = 1.0
    result[:, 0, N_PINHOLE:], result[:, 1, N_PINHOLE:] = fx * by_distortion[:, 0], fy * by_distortion[:, 1]
    return result


def _distortion_jacobian(model: CameraModel, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(m, 2, n): change of the distorted normalized coordinates with the coefficients."""
    r2 = x * x + y * y
    if model.distortion_model == "none":
        return np.zeros((len(x), 2, 0))
    if model.distortion_model == "equidistant":
        r = np.sqrt(r2)
        theta = np.arctan(r)
        over_r = np.where(r > 1e-8, 1.0 / np.maximum(r, 1e-8), 0.0)
        radial = [theta ** (2 * i + 3) * over_r for i in range(4)]
        return np.stack([np.stack([x * f, y * f], axis=1) for f in radial], axis=2)
    k = np.zeros(8)
    k[: model.distortion.size] = model.distortion
    top = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))
    bottom = 1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]))
    numerator, denominator = [r2**i / bottom for i in (1, 2, 3)], [-top * r2**i / bottom**2 for i in (1, 2, 3)]
    columns = [np.stack([x * f, y * f], axis=1) for f in (*numerator[:2], numerator[2], *denominator)]
    tangential = [np.stack([2 * x * y, r2 + 2 * y * y], axis=1), np.stack([r2 + 2 * x * x, 2 * x * y], axis=1)]
    n = len(COEFFICIENTS[model.distortion_model])
    return np.stack([*columns[:2], *tangential, *columns[2:]], axis=2)[:, :, :n]
