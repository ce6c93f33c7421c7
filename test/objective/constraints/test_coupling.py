"""Axes that others drive: derivatives against differences, and a pull on a follower that moves its leader."""

import numpy as np
import pytest

from helpers.numeric.finite_difference import assert_jacobian
from tracker_node.errors import UnknownNameError
from tracker_node.model.configuration import State
from tracker_node.model.kinematic_chain import Axis, Following, Joint, KinematicChain
from tracker_node.objective.constraints.prior import CouplingObjective, Prior, SumObjective
from tracker_node.optimize.levenberg_marquardt import LevenbergMarquardtOptions, minimize

X = (1.0, 0.0, 0.0)


def gears(leader: str = "crank") -> KinematicChain:
    axes = (
        Axis("crank", X, -2.0, 2.0),
        Axis("rack", X, -0.1, 0.3, prismatic=True, mimic=Following(leader, 0.2, 0.1)),
        Axis("free", X),
        Axis("hand", X, mimic=Following("rack", -3.0)),
    )
    return KinematicChain(("a", "b"), (Joint("gear", "a", "b", np.eye(4), axes),))


def test_derivatives():
    chain = gears()
    objective = CouplingObjective(chain, 0.5)
    state = State(np.eye(4), np.array([0.3, -0.2, 0.7, 0.1]))
    equations = objective.linearize(state)
    residuals = np.array([-0.2 - 0.2 * 0.3 - 0.1, 0.1 + 3.0 * -0.2]) / 0.5
    assert (equations.cost, equations.count) == (pytest.approx(residuals @ residuals), 2)
    assert_jacobian(2.0 * equations.g[None], lambda d: np.array([objective.linearize(state.retract(d)).cost]), step=1e-3)
    assert_jacobian(equations.H, lambda d: objective.linearize(state.retract(d)).g, step=1e-3)


def test_a_pull_on_the_last_axis_moves_the_first_and_stops_at_its_limit():
    chain = gears()
    information = np.full(10, 1e-3)
    information[8], information[9] = 10.0, 10.0
    wanted = State(np.eye(4), np.array([0.0, 0.0, 0.4, -0.6]))
    objective = SumObjective([CouplingObjective(chain)], priors=[Prior(wanted, information)])
    options = LevenbergMarquardtOptions(max_iterations=40, tolerance=0.0, step_tolerance=1e-9)
    crank, rack, free, hand = minimize(objective, State(np.eye(4), np.zeros(4)), chain, options).state.joint_positions
    assert (crank, rack, hand) == (pytest.approx(0.5, abs=2e-3), pytest.approx(0.2, abs=1e-3), pytest.approx(-0.6, abs=1e-3))
    assert free == pytest.approx(0.4, abs=1e-4)
    further = SumObjective([CouplingObjective(chain)], priors=[Prior(State(np.eye(4), np.full(4, -5.0)), information)])
    crank, rack, _, hand = minimize(further, State(np.eye(4), np.zeros(4)), chain, options).state.joint_positions
    assert (rack, hand) == (0.3, pytest.approx(-0.9, abs=1e-3))  # the rack is at its stop, and so are those that mesh with it
    assert crank == pytest.approx(1.0, abs=2e-3)


def test_a_leader_that_is_not_there_is_named():
    with pytest.raises(UnknownNameError, match="axis that 'rack' follows 'crnk'; valid: crank, free, hand"):
        gears("crnk")
