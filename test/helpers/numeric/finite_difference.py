"""The one check of analytic derivatives against finite differences."""

from collections.abc import Callable

import numpy as np


def numerical_jacobian(function: Callable[[np.ndarray], np.ndarray], n: int, step: float = 1e-5) -> np.ndarray:
    """value_D_tangent (..., n) at zero of a function of a tangent vector (n,), by fourth-order central differences.

    For a function on a manifold let it retract: ``lambda d: residual(state.retract(d))``.
    """
    columns = []
    for direction in np.eye(n) * step:
        near = np.asarray(function(direction), dtype=float) - np.asarray(function(-direction), dtype=float)
        far = np.asarray(function(2.0 * direction), dtype=float) - np.asarray(function(-2.0 * direction), dtype=float)
        columns.append((8.0 * near - far) / (12.0 * step))
    return np.stack(columns, axis=-1)


def assert_jacobian(
    analytic: np.ndarray,
    function: Callable[[np.ndarray], np.ndarray],
    step: float = 1e-5,
    tolerance: float = 1e-7,
) -> None:
    """Fail unless ``analytic`` (..., n) is the derivative of ``function`` at zero, within ``tolerance`` of its largest entry."""
    numeric = numerical_jacobian(function, analytic.shape[-1], step)
    assert analytic.shape == numeric.shape, f"expected a Jacobian of shape {numeric.shape}, got {analytic.shape}"
    scale = max(1.0, float(np.abs(numeric).max(initial=0.0)))
    worst = float(np.abs(analytic - numeric).max(initial=0.0)) / scale
    assert worst <= tolerance, f"largest difference {worst:.3g} of the largest entry {scale:.3g}\n{analytic - numeric}"
