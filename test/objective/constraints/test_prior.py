"""The Gaussian pull against finite differences of its cost, diagonal and correlated; sums of objectives."""

import numpy as np
import pytest

from tracker_node.geometry import se3, so3
from tracker_node.model.configuration import State
from tracker_node.objective.constraints.prior import Prior, SumObjective
from tracker_node.objective.normal_equations import NormalEquations

N = 8


def random_state(rng, spread=1.0):
    pose = se3.from_rotation_translation(so3.exp(spread * rng.normal(size=3)), rng.normal(size=3))
    return State(pose, rng.normal(size=N - 6))


def information_of(kind, rng):
    if kind == "diagonal":
        return rng.uniform(0.1, 5.0, N)
    A = rng.normal(size=(N, N))
    return A @ A.T


@pytest.mark.parametrize("kind", ["diagonal", "full"])
@pytest.mark.parametrize("seed", range(3))
def test_gradient_is_that_of_the_cost(kind, seed):
    rng = np.random.default_rng(seed)
    prior = Prior(random_state(rng, 0.5), information_of(kind, rng))
    state = random_state(rng, 0.5)

    def cost(tangent):
        return prior.add_to(np.zeros((N, N)), np.zeros(N), state.retract(tangent))

    g = np.zeros(N)
    prior.add_to(np.zeros((N, N)), g, state)
    step = 1e-6
    numeric = [(cost(step * e) - cost(-step * e)) / (4.0 * step) for e in np.eye(N)]
    np.testing.assert_allclose(g, numeric, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("kind", ["diagonal", "full"])
def test_one_newton_step_reaches_a_mean_that_is_turned_about_one_axis(kind):
    rng = np.random.default_rng(5)
    mean = random_state(rng)
    prior = Prior(mean, information_of(kind, rng))
    offset = rng.normal(size=N)
    offset[3:6] = 0.0, 0.0, 0.4
    state = mean.retract(offset)
    H, g = np.zeros((N, N)), np.zeros(N)
    prior.add_to(H, g, state)
    np.testing.assert_allclose(H, H.T, atol=1e-12)
    np.testing.assert_allclose(state.retract(-np.linalg.solve(H, g)).difference(mean), np.zeros(N), atol=1e-9)


class Fixed:
    def __init__(self, equations):
        self.equations = equations

    def linearize(self, state):
        return self.equations


def test_a_sum_adds_what_its_parts_say_times_their_factors():
    rng = np.random.default_rng(2)
    parts = [NormalEquations(information_of("full", rng), rng.normal(size=N), float(i + 1), 10 * (i + 1)) for i in range(2)]
    prior = Prior(random_state(rng), information_of("full", rng))
    state = random_state(rng)
    found = SumObjective([Fixed(p) for p in parts], [1.0, 0.5], [prior]).linearize(state)
    H, g = parts[0].H + 0.5 * parts[1].H, parts[0].g + 0.5 * parts[1].g
    cost = 2.0 + prior.add_to(H, g, state)
    np.testing.assert_allclose(found.H, H)
    np.testing.assert_allclose(found.g, g)
    assert found.cost == pytest.approx(cost)
    assert found.count == 30
    assert parts[0].H is not found.H  # the parts are left as they are
