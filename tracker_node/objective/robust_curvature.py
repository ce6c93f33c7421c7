"""How steeply the pull of robust residuals grows: less than their weights say.

A Gauss-Newton step takes the weights for fixed. Yet those of residuals that it makes larger fall: the pull r w(r) of the
Geman-McClure kernel, w = (1 + x)^-2 with x = (r / (c sigma))^2, has the slope w (1 - 3 x) / (1 + x). Steps by the weights alone
fall short, by a quarter for residuals as wide as they are taken for and c = 3; the sum of the slopes makes them Newton's.
"""

from __future__ import annotations

import numpy as np

_USUAL = 0.7  # spread of residuals beside what they are taken for, on rendered clips and on recorded ones
_LEAST = 0.5  # what is left for kernels so narrow that most residuals are outliers


def curvature_share(robust_sigmas: float, spread: float = _USUAL) -> float:
    """Sum of the slopes over the sum of the weights, of normal residuals.

    ``robust_sigmas``: c, the kernel's scale in standard deviations that residuals are taken to have; ``spread``: their own, in
    the same unit. 1 for a kernel that is wide.
    """
    r = np.linspace(-5.0, 5.0, 201)
    density, x = np.exp(-0.5 * r * r), (spread * r / robust_sigmas) ** 2
    weights = density / (1.0 + x) ** 2
    return max(float((weights * (1.0 - 3.0 * x) / (1.0 + x)).sum() / weights.sum()), _LEAST)
