"""Eliminated normal equations against the whole system, solved as it stands."""

import numpy as np
import pytest

from tracker_node.calibration.board.adjustment import CLOCK, N_PLACE, BoardEquations, CameraRows

N_LENS, N_TIME_STEPS = 4, 3
P = N_PLACE + N_LENS  # of a camera
PRIOR = 2.5


def rows(camera, rng, m=40):
    return CameraRows(
        camera, np.arange(m) % N_TIME_STEPS, rng.uniform(0.5, 2.0, m), rng.standard_normal((m, 2)),
        rng.standard_normal((m, 2, P)), rng.standard_normal((m, 2, 6)), rng.standard_normal((m, 2)),
    )  # fmt: skip


@pytest.fixture(scope="module")
def seen():
    rng = np.random.default_rng(1)
    return [rows(0, rng), rows(1, rng)]


LATE_S = np.random.default_rng(2).standard_normal((N_TIME_STEPS, 2))


def equations(seen, stamps=False):
    result = BoardEquations(np.array([0, P, 2 * P]), N_TIME_STEPS)
    for one in seen:
        result.add(one)
        if stamps:
            result.eliminate_stamps(one, LATE_S[:, one.camera], PRIOR)
    return result


def whole(seen, stamps=False):
    """H and g of all cameras, poses and, at the end, stamps (time step by time step, camera by camera)."""
    d, n = 2 * P, N_TIME_STEPS
    size = d + 6 * n + (2 * n if stamps else 0)
    H, g = np.zeros((size, size)), np.zeros(size)
    for one in seen:
        for k, time_step in enumerate(one.time_step):
            J = np.zeros((2, size))
            J[:, one.camera * P : (one.camera + 1) * P] = one.by_camera[k]
            J[:, d + 6 * time_step : d + 6 * time_step + 6] = one.by_pose[k]
            if stamps:
                J[:, d + 6 * n + 2 * time_step + one.camera] = one.by_stamp[k]
            H += one.weights[k] * J.T @ J
            g += one.weights[k] * J.T @ one.residuals[k]
    if stamps:
        own = np.arange(d + 6 * n, size)
        H[own, own] += PRIOR
        g[own] += PRIOR * LATE_S.ravel()
    return H, g


def free_of(result, size):
    return np.concatenate([result.free, np.ones(size - len(result.free), dtype=bool)])


@pytest.mark.parametrize("stamps", [False, True])
def test_a_step_is_that_of_the_whole_system(seen, stamps):
    result, (H, g) = equations(seen, stamps), whole(seen, stamps)
    result.hold(True, True, True)
    free, step = free_of(result, len(g)), np.zeros(len(g))
    step[free] = -np.linalg.solve(H[np.ix_(free, free)], g[free])
    cameras, poses, late_s = result.step(0.0)
    assert np.allclose(np.concatenate(cameras), step[: 2 * P], atol=1e-8)
    assert np.allclose(poses.ravel(), step[2 * P : 2 * P + 6 * N_TIME_STEPS], atol=1e-8)
    if stamps:
        assert np.allclose(late_s.ravel(), step[2 * P + 6 * N_TIME_STEPS :], atol=1e-8)
    else:
        assert late_s.shape == (N_TIME_STEPS, 2)
        assert not late_s.any()


@pytest.mark.parametrize("stamps", [False, True])
def test_the_covariance_is_that_of_the_whole_system(seen, stamps):
    result, (H, g) = equations(seen, stamps), whole(seen, stamps)
    result.hold(True, False, True)
    free = free_of(result, len(g))
    inside = np.linalg.inv(H[np.ix_(free, free)])[: result.free.sum(), : result.free.sum()]
    found = result.covariance()
    assert np.allclose(found[np.ix_(result.free, result.free)], inside, rtol=1e-6)
    assert not found[~result.free].any()
    assert not found[:, ~result.free].any()


def test_damping_makes_diagonals_larger(seen):
    damping, (H, g) = 0.3, whole(seen)
    result = equations(seen)
    result.hold(True, True, True)
    free = free_of(result, len(g))
    H = H + damping * np.diag(np.diag(H))
    step = -np.linalg.solve(H[np.ix_(free, free)], g[free])
    cameras, poses, _ = result.step(damping)
    assert np.allclose(np.concatenate(cameras)[result.free], step[: result.free.sum()], atol=1e-8)
    assert np.allclose(poses.ravel(), step[result.free.sum() :], atol=1e-8)


@pytest.mark.parametrize("cameras", [False, True])
@pytest.mark.parametrize("clocks", [False, True])
@pytest.mark.parametrize("lenses", [False, True])
def test_what_is_held(seen, cameras, clocks, lenses):
    result = equations(seen)
    result.hold(cameras, clocks, lenses)
    first, second = result.free[:P], result.free[P:]
    assert not first[:N_PLACE].any()  # the world is where the first camera is
    assert first[N_PLACE:].tolist() == second[N_PLACE:].tolist() == [lenses] * N_LENS
    assert second[:CLOCK].tolist() == [cameras] * 6
    assert second[CLOCK] == clocks
    moves = np.concatenate(result.step(1e-3)[0])
    assert np.array_equal(moves != 0.0, result.free)


def test_nothing_free_leaves_the_poses(seen):
    result, (H, g) = equations(seen), whole(seen)
    result.hold(False, False, False)
    cameras, poses, _ = result.step(0.0)
    own = slice(2 * P, None)
    assert not np.concatenate(cameras).any()
    assert np.allclose(poses.ravel(), -np.linalg.solve(H[own, own], g[own]), atol=1e-8)
    assert not result.covariance().any()


def test_a_lens_prior_is_of_that_lens_alone(seen):
    result, before = equations(seen), equations(seen)
    gradient, precision = np.arange(1.0, 5.0), np.arange(5.0, 9.0)
    result.add_lens_prior(1, gradient, precision)
    lens = slice(P + N_PLACE, 2 * P)
    assert np.allclose(np.diag(result.shared - before.shared)[lens], precision)
    assert np.allclose((result.gradient_shared - before.gradient_shared)[lens], gradient)
    assert np.count_nonzero(result.shared - before.shared) == N_LENS
    assert np.count_nonzero(result.gradient_shared - before.gradient_shared) == N_LENS
