import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers.numeric.finite_difference import assert_jacobian
from tracker_node.camera import distortion
from tracker_node.camera.distortion import MODEL_IDS

PACKED = {
    "none": [0.0] * 8,
    "plumb_bob": [-0.25, 0.08, 0.001, -0.002, -0.01, 0.0, 0.0, 0.0],
    "rational_polynomial": [0.4, 0.1, 0.0005, -0.0007, 0.01, 0.7, 0.2, 0.03],
    "equidistant": [-0.02, 0.01, -0.003, 0.0005, 0.0, 0.0, 0.0, 0.0],
}
coordinates = st.one_of(st.floats(-0.7, 0.7), st.integers(-10, -1).map(lambda e: 10.0**e), st.just(0.0))


@pytest.mark.parametrize("model", PACKED)
@given(x=coordinates, y=coordinates)
def test_derivative_matches_finite_differences(model, x, y):
    k = np.array(PACKED[model])
    jacobian = np.array(distortion.distort(MODEL_IDS[model], k, x, y)[2:]).reshape(2, 2)
    assert_jacobian(jacobian, lambda d: distortion.distort(MODEL_IDS[model], k, x + d[0], y + d[1])[:2], step=1e-4)


@pytest.mark.parametrize("model", PACKED)
@given(x=coordinates, y=coordinates)
def test_undistort_inverts(model, x, y):
    k = np.array(PACKED[model])
    xd, yd = distortion.distort(MODEL_IDS[model], k, x, y)[:2]
    back_x, back_y, converged = distortion.undistort(MODEL_IDS[model], k, xd, yd)
    assert converged
    assert np.allclose((back_x, back_y), (x, y), atol=1e-9)


def test_equidistant_reaches_far_to_the_side():
    k = np.zeros(8)
    for degrees in (10.0, 60.0, 80.0):
        r = np.tan(np.radians(degrees))
        xd, yd = distortion.distort(2, k, 0.6 * r, 0.8 * r)[:2]
        assert np.isclose(np.hypot(xd, yd), np.radians(degrees))
        x, y, converged = distortion.undistort(2, k, xd, yd)
        assert converged
        assert np.allclose((x, y), (0.6 * r, 0.8 * r), rtol=1e-8)


def test_monotonic_radius_is_where_the_polynomial_folds():
    assert distortion.monotonic_radius(0, np.zeros(8)) == np.inf
    k1 = np.array([-0.5, 0, 0, 0, 0, 0, 0, 0])
    assert np.isclose(distortion.monotonic_radius(1, k1), np.sqrt(0.98 / 1.5), atol=0.003)  # slope 0.02 is the limit
