"""How steep the pull of robust residuals is, against sampled ones."""

import numpy as np
import pytest

from tracker_node.tracking.region.fitting import curvature_share


@pytest.mark.parametrize("robust_sigmas, spread", [(3.0, 0.7), (3.0, 1.0), (5.0, 1.0)])
def test_it_is_the_slope_of_the_mean_pull_over_the_mean_weight(robust_sigmas, spread):
    residuals, h = spread * np.random.default_rng(1).normal(size=400_000), 0.05

    def weights(r):
        return (1.0 + (r / robust_sigmas) ** 2) ** -2

    pulls = [((residuals + step) * weights(residuals + step)).mean() for step in (-h, h)]
    slope = (pulls[1] - pulls[0]) / (2.0 * h)
    assert curvature_share(robust_sigmas, spread) == pytest.approx(slope / weights(residuals).mean(), abs=0.01)


def test_a_wide_kernel_is_none_and_a_narrow_one_leaves_something():
    assert curvature_share(1000.0) == pytest.approx(1.0, abs=1e-4)
    assert 0.0 < curvature_share(0.1) == curvature_share(0.2) < curvature_share(3.0) < 1.0
