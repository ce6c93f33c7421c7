"""From information to a covariance that errors bear out."""

from __future__ import annotations

import numpy as np

from ..model.kinematic_chain import N_ROOT_DOF

_LEAST = 1e-9  # of the largest entry of the information's diagonal: what nothing is known of keeps a variance that can be written


def calibrated_covariance(information: np.ndarray, scale: float, curvature: float) -> np.ndarray:
    """Covariance (n_dof, n_dof) of a state in its tangent, from the information (n_dof, n_dof) of images and priors.

    ``scale`` multiplies the inverse: how many lines share an error is not known from them. ``curvature`` times the squared
    variance of a joint, but no more than that variance, is added to it: an angle d that is hardly known leads along an arc, and
    off its tangent by the order of d^2, where other angles seem to be known exactly. Both were fitted to synthetic errors.
    """
    H = information.copy()
    H[np.diag_indices_from(H)] += _LEAST * max(float(np.diag(H).max()), 1.0)
    covariance = scale * np.linalg.inv(H)
    covariance = 0.5 * (covariance + covariance.T)
    joints = np.arange(N_ROOT_DOF, len(H))
    variance = covariance[joints, joints]
    covariance[joints, joints] += variance * (curvature * variance) / (1.0 + curvature * variance)
    return covariance
