"""Points and covariances from heat maps whose moments are known."""

import numpy as np
import pytest

from tracker_node.observation.keypoints.blazepose import read_heat_maps


def logits(probabilities: np.ndarray) -> np.ndarray:
    """(height, width, n) float32."""
    p = np.clip(probabilities, 1e-12, 1.0 - 1e-6)
    return np.log(p / (1.0 - p)).astype(np.float32)


def read(probabilities: np.ndarray, *points: tuple[float, float]):
    n = len(points)
    means, covariances, peaks = np.empty((n, 2)), np.empty((n, 2, 2)), np.empty(n)
    read_heat_maps(logits(probabilities), np.array(points), means, covariances, peaks)
    return means, covariances, peaks


def empty(n: int = 1, height: int = 20, width: int = 30) -> np.ndarray:
    return np.zeros((height, width, n))


def test_mean_and_second_moments_are_those_of_the_squared_cells_around_the_peak():
    p, rng = empty(), np.random.default_rng(1)
    p[5:12, 15:22, 0] = rng.uniform(0.0, 0.8, (7, 7))
    p[8, 18] = 0.9
    (mean,), (covariance,), (peak,) = read(p, (16.0, 9.0))
    v, u = np.mgrid[5:12, 15:22]
    weights, cells = p[5:12, 15:22, 0].ravel() ** 2, np.stack([u.ravel(), v.ravel()])
    np.testing.assert_allclose(mean, np.average(cells, axis=1, weights=weights), atol=1e-5)
    np.testing.assert_allclose(covariance, np.cov(cells, aweights=weights, bias=True) + 0.05 * np.eye(2), atol=1e-5)
    assert peak == pytest.approx(0.9, abs=1e-6)


def test_cells_farther_than_three_from_the_peak_have_no_say():
    for du, dv in ((3, 0), (-3, 0), (0, 3), (0, -3), (4, 0), (-4, 0), (0, 4), (0, -4)):
        p = empty()
        p[9, 16], p[9 + dv, 16 + du] = 0.8, 0.8
        ((u, v),), _, _ = read(p, (16.0, 9.0))
        near = max(abs(du), abs(dv)) <= 3
        assert (u, v) == pytest.approx((16.0 + 0.5 * du * near, 9.0 + 0.5 * dv * near), abs=1e-4), (du, dv)


@pytest.mark.parametrize(("guess", "column"), [(15.49, 15), (15.5, 16), (16.49, 16)])
@pytest.mark.parametrize("side", [-1, 1])
def test_the_peak_is_searched_within_three_cells_of_the_one_nearest_to_the_guess(guess, column, side):
    p = empty()
    p[9, [column + 3 * side, column + 4 * side]] = [[0.5], [0.9]]
    _, _, (peak,) = read(p, (guess, 9.2))
    assert peak == pytest.approx(0.5, abs=1e-6)
    p[9, column + 3 * side - side] = 0.6
    _, _, (peak,) = read(p, (guess, 9.2))
    assert peak == pytest.approx(0.6, abs=1e-6)
    q = empty()
    q[[column + 3 * side - 5, column + 4 * side - 5], 5] = [[0.5], [0.9]]
    _, _, (peak,) = read(q, (5.3, guess - 5.0))
    assert peak == pytest.approx(0.5, abs=1e-6)


def test_one_cell_is_known_as_finely_as_a_map_can_tell():
    p = empty()
    p[9, 16] = 0.9
    _, (covariance,), (peak,) = read(p, (16.3, 8.8))
    np.testing.assert_allclose(covariance, 0.05 * np.eye(2), atol=1e-4)
    assert peak == pytest.approx(0.9)


def test_each_point_has_a_map_of_its_own_and_those_at_the_border_the_cells_that_there_are():
    p = empty(2)
    p[0, 0, 0], p[2, 1, 0], p[19, 29, 1], p[18, 29, 1] = 0.6, 0.3, 0.4, 0.4
    means, covariances, peaks = read(p, (0.0, 0.0), (29.0, 19.0))
    np.testing.assert_allclose(means, [[0.2, 0.4], [29.0, 18.5]], atol=1e-4)
    np.testing.assert_allclose(peaks, [0.6, 0.4], atol=1e-5)
    assert covariances[1, 1, 1] == pytest.approx(0.25 + 0.05, abs=1e-3) and covariances[1, 0, 0] == pytest.approx(0.05, abs=1e-3)


@pytest.mark.parametrize("guess", [(-10.0, 5.0), (5.0, -10.0), (40.0, 5.0), (5.0, 30.0)])
def test_a_guess_off_the_map_stays_and_is_known_to_three_cells(guess):
    (mean,), (covariance,), (peak,) = read(np.full((20, 30, 1), 0.5), guess)
    assert tuple(mean) == guess and peak == 0.0
    np.testing.assert_array_equal(covariance, 9.0 * np.eye(2))
