"""The loop of fits, on parabolas whose minima are known: stages, new correspondences, repeats, comparison, what may move."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest

from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.objective.constraints.prior import Prior
from tracker_node.objective.normal_equations import CameraEquations, NormalEquations
from tracker_node.optimize.fitter import Fit, Fitter, Stage, at_state
from tracker_node.optimize.levenberg_marquardt import LevenbergMarquardtOptions
from tracker_node.tracking.limbs.tree import stages_of

MODEL = human_model()
CHAIN = MODEL.chain
N = MODEL.n_dof
WEIGHTS = np.linspace(1.0, 3.0, N)
EXACT = LevenbergMarquardtOptions(max_iterations=30, tolerance=1e-12, step_tolerance=1e-12)
START = State.neutral(MODEL)
GOAL = START.retract(np.random.default_rng(4).uniform(0.0, 0.1, N))
ROOT = np.arange(N) < 6


@dataclass(frozen=True, eq=False)
class Parabola:
    """Squared distance from a state, whatever the links."""

    goal: State
    scale: float = 1.0
    links: np.ndarray | None = None

    def linearize(self, state: State) -> NormalEquations:
        H, g = np.zeros((N, N)), np.zeros(N)
        return NormalEquations(H, g, Prior(self.goal, self.scale * WEIGHTS).add_to(H, g, state), N)

    def camera_equations(self, state: State):
        return [CameraEquations(np.full(1, state.T_world_root[0, 3]), np.zeros(1)), None]

    def on_links(self, links: np.ndarray) -> "Parabola":
        """A limb's points are elsewhere."""
        return replace(self, goal=START.retract(np.full(N, 0.02)), links=links)


class Finder:
    """Finds the goal; or, with ``nearer``, what is on the way to it: correspondences of points that are far lead part of it."""

    def __init__(self, goal: State = GOAL, nearer: float = 1.0):
        self.asked, self._goal, self._nearer = [], goal, nearer

    def correspond(self, state: State, detail) -> Parabola:
        self.asked.append((detail, state))
        return Parabola(state.retract(self._nearer * self._goal.difference(state)))

    @property
    def details(self) -> list:
        return [detail for detail, _ in self.asked]


def fit(stages, lead=None, **more) -> Fit:
    return Fitter(MODEL).fit(START, lead or Finder(), stages, **more)


def left(fit: Fit, goal: State = GOAL) -> float:
    return float(np.abs(fit.state.difference(goal)).max())


def test_stages_follow_each_other_from_state_to_state():
    finder = Finder(nearer=0.5)
    found = fit([Stage("coarse", EXACT), Stage("fine", EXACT)], finder)
    assert finder.details == ["coarse", "fine"]
    np.testing.assert_array_equal(finder.asked[0][1].to_values(), START.to_values())
    half = START.retract(0.5 * GOAL.difference(START))
    assert np.abs(finder.asked[1][1].difference(half)).max() < 1e-6  # the second begins where the first has ended
    assert np.abs(found.state.difference(GOAL)[6:]).max() == pytest.approx(0.25 * GOAL.difference(START)[6:].max(), rel=1e-4)


def test_without_renewal_the_correspondences_before_hold():
    finder = Finder(nearer=0.5)
    found = fit([Stage("coarse", EXACT), Stage("unused", EXACT, renew=False)], finder)
    assert finder.details == ["coarse"]
    assert np.abs(found.state.difference(START.retract(0.5 * GOAL.difference(START)))).max() < 1e-6
    only = Finder()
    fit([Stage("first", EXACT, renew=False)], only)
    assert only.details == ["first"]  # where there are none before, they are found


def test_a_gauss_newton_step_is_that_of_the_damped_equations():
    found = fit([Stage(None, damping=0.25)])
    np.testing.assert_allclose(found.state.difference(START)[6:], GOAL.difference(START)[6:] / 1.25, atol=1e-9)
    assert (found.iterations, found.evaluations) == (1, 2)
    np.testing.assert_array_equal(found.equations.g, found.objective.linearize(found.state).g)  # where the step has led
    by_dof = fit([Stage(None, damping=np.where(ROOT, 0.25, 1.0))])
    np.testing.assert_allclose(by_dof.state.difference(START)[6:], GOAL.difference(START)[6:] / 2.0, atol=1e-9)


def test_a_robust_costs_own_curvature_makes_the_step_longer():
    """Of the leading correspondences alone: priors have the curvature that they say."""
    found = fit([Stage(None, damping=1e-12, curvature=0.8)])
    np.testing.assert_allclose(found.state.difference(START)[6:], GOAL.difference(START)[6:] / 0.8, atol=1e-6)
    held = fit([Stage(None, damping=1e-12, curvature=0.8)], priors=[Prior(START, WEIGHTS)])
    np.testing.assert_allclose(held.state.difference(START)[6:], GOAL.difference(START)[6:] / 1.8, atol=1e-6)


def moved_m(a: State, b: State) -> float:
    apart = Configuration(MODEL, a).Ts_world_shape[:, :3, 3] - Configuration(MODEL, b).Ts_world_shape[:, :3, 3]
    return float(np.linalg.norm(apart, axis=1).max())


@pytest.mark.parametrize("repeats", [0, 1, 3])
def test_a_stage_is_repeated_so_often_at_most_while_parts_move(repeats):
    finder = Finder(nearer=0.5)
    found = fit([Stage("fine", repeats=repeats)], finder)
    assert len(finder.asked) == 1 + repeats and found.iterations == 1 + repeats
    states = [state for _, state in finder.asked] + [found.state]
    steps = [moved_m(a, b) for a, b in pairwise(states)]
    assert all(b < a for a, b in pairwise(steps))


def test_a_step_that_moves_no_part_farther_is_the_last():
    finder = Finder(nearer=0.5)
    fit([Stage("fine", repeats=4)], finder)
    states = [state for _, state in finder.asked]
    steps = [moved_m(a, b) for a, b in pairwise(states)]
    settled = Finder(nearer=0.5)
    fit([Stage("fine", repeats=4, settled_m=0.5 * (steps[0] + steps[1]))], settled)
    assert len(settled.asked) == 2  # the second step was short enough


def test_cameras_are_compared_before_the_first_step_that_asks_for_it():
    found = fit([Stage("coarse"), Stage("fine", compares=True, repeats=2), Stage("last", compares=True)])
    assert found.comparison is not None
    np.testing.assert_allclose(
        found.comparison.state.difference(START)[6:], fit([Stage("coarse")]).state.difference(START)[6:], atol=1e-9
    )
    assert found.comparison.cameras[0].normal[0] == found.comparison.state.T_world_root[0, 3]
    assert found.comparison.cameras[1] is None
    assert fit([Stage("coarse"), Stage("fine", EXACT)]).comparison is None


def test_cameras_are_compared_after_a_solver_has_ended():
    found = fit([Stage("coarse", EXACT), Stage("fine", EXACT, compares=True)])
    assert found.comparison.state is found.state
    np.testing.assert_array_equal(found.comparison.equations.H, found.equations.H)


def test_what_others_say_has_no_part_in_the_comparison_of_cameras():
    """It is of the leading correspondences and the priors; in the fit each counts by an equal share."""
    prior, other = Prior(START, WEIGHTS), Parabola(START, 5.0)
    found = fit([Stage(None, damping=1e-12, compares=True)], priors=[prior], others=[other])
    np.testing.assert_allclose(np.diag(found.comparison.equations.H)[6:], 2.0 * WEIGHTS[6:])
    share = 0.5 / (0.5 + 2.5 + 1.0)
    np.testing.assert_allclose(found.state.difference(START)[6:], share * GOAL.difference(START)[6:], atol=1e-6)


def test_what_is_independent_counts_in_full_and_others_share():
    """Leading and other correspondences count half each, and what sees something else wholly."""
    found = fit([Stage(None, EXACT)], others=[Parabola(START, 3.0)], independent=[Parabola(START, 5.0), Parabola(GOAL, 1.0)])
    share = (0.5 + 1.0) / (0.5 + 1.5 + 5.0 + 1.0)
    np.testing.assert_allclose(found.state.difference(START)[6:], share * GOAL.difference(START)[6:], atol=1e-6)
    alone = fit([Stage(None, EXACT)], independent=[Parabola(START, 1.0)])
    np.testing.assert_allclose(alone.state.difference(START)[6:], 0.5 * GOAL.difference(START)[6:], atol=1e-6)
    np.testing.assert_allclose(np.diag(alone.equations.H)[6:], 2.0 * WEIGHTS[6:])
    assert alone.correspondences.goal is not START


def test_what_is_independent_has_no_part_in_the_comparison_of_cameras():
    prior, seen = Prior(START, WEIGHTS), Parabola(START, 5.0)
    found = fit([Stage(None, damping=1e-12, compares=True)], priors=[prior], independent=[seen])
    np.testing.assert_allclose(np.diag(found.comparison.equations.H)[6:], 2.0 * WEIGHTS[6:])
    np.testing.assert_allclose(found.state.difference(START)[6:], GOAL.difference(START)[6:] / 7.0, atol=1e-6)


@pytest.mark.parametrize("solver", [EXACT, None])
@pytest.mark.parametrize("stage", stages_of(CHAIN), ids=lambda stage: stage.name)
def test_a_stage_moves_its_degrees_of_freedom_alone(stage, solver):
    found = fit([Stage(None, solver, damping=1e-12, dofs=stage.dofs)])
    np.testing.assert_allclose(found.state.difference(START)[~stage.dofs], 0.0, atol=1e-12)
    np.testing.assert_allclose(found.state.difference(GOAL)[stage.dofs], 0.0, atol=1e-6 if solver else 1e-3)
    assert found.objective.linearize(START).g[~stage.dofs].any()  # nothing is left out of what has been compared


def test_a_prior_shares_the_way():
    found = fit([Stage(None, EXACT)], priors=[Prior(START, WEIGHTS)])  # as strong as the objective: half the way
    half = 0.5 * GOAL.difference(START)
    np.testing.assert_allclose(found.state.difference(START)[6:], half[6:], atol=1e-6)


def test_constraints_count_wholly_beside_others():
    found = Fitter(MODEL, [Parabola(START, 2.0)]).fit(START, Finder(), [Stage(None, EXACT)], others=[Parabola(GOAL)])
    np.testing.assert_allclose(found.state.difference(START)[6:], GOAL.difference(START)[6:] / 3.0, atol=1e-6)


def test_links_that_are_named_count_alone():
    links = np.arange(len(CHAIN.links)) == 3
    found = fit([Stage(None, EXACT, links=links)])
    assert np.abs(found.state.difference(START)[6:] - 0.02).max() < 1e-6
    assert found.objective.objectives[0].links is links
    assert found.correspondences.links is None  # those of all links


def test_joints_stay_within_their_limits_from_the_start_on():
    outside = State(np.eye(4), CHAIN.upper + 0.3)
    finder = Finder(goal=State(np.eye(4), CHAIN.upper + 1.0))
    found = Fitter(MODEL).fit(outside, finder, [Stage(None), Stage(None, EXACT)])
    for state in (finder.asked[0][1], found.state):
        assert (state.joint_positions <= CHAIN.upper).all()


def test_iterations_and_evaluations_are_those_of_all_stages():
    one, two = fit([Stage(None, EXACT)]), fit([Stage(None, EXACT), Stage(None, EXACT)])
    again = Fitter(MODEL).fit(one.state, Finder(), [Stage(None, EXACT)])
    assert two.iterations == one.iterations + again.iterations
    assert two.evaluations == one.evaluations + again.evaluations


def test_a_fit_at_another_state_has_the_equations_of_there():
    found = fit([Stage(None, EXACT)])
    there = at_state(found, START)
    assert there.state is START and there.correspondences is found.correspondences
    np.testing.assert_array_equal(there.equations.g, found.objective.linearize(START).g)
    assert there.equations.cost > found.equations.cost


def test_without_a_stage_there_is_no_fit():
    with pytest.raises(ValueError, match="at least one stage"):
        fit([])
