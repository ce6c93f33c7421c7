"""An articulated body part by part: what each stage moves, and what it leaves alone."""

import numpy as np
import pytest

from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.objective.constraints.prior import Prior
from tracker_node.objective.normal_equations import NormalEquations
from tracker_node.optimize.levenberg_marquardt import LevenbergMarquardtOptions, minimize
from tracker_node.tracking.color.hierarchy import Pulled, limbs_of, stages_of

MODEL = human_model()
CHAIN = MODEL.chain


def test_stages_cover_every_degree_of_freedom_once_and_go_outward():
    stages = stages_of(CHAIN)
    np.testing.assert_array_equal(sum(stage.dofs.astype(int) for stage in stages), 1)
    assert stages[0].variables == [0, 1, 2, 3, 4, 5] and stages[0].links.all()
    order = [next(i for i, stage in enumerate(stages) if name in stage.name.split(", ")) for name in
             ("abdomen", "torso", "left_clavicle", "left_upper_arm", "left_forearm")]  # fmt: skip
    assert order == sorted(set(order))
    assert {name for stage in stages for name in stage.name.split(", ")} >= {"left_thigh", "right_shank", "head"}


@pytest.mark.parametrize("stage", [*stages_of(CHAIN), *limbs_of(CHAIN)], ids=lambda stage: stage.name)
def test_a_stage_moves_its_links_and_no_others(stage):
    """By forward kinematics on random motions of its degrees of freedom."""
    rng = np.random.default_rng(2)
    state = State.neutral(MODEL).retract(rng.normal(0.0, 0.2, CHAIN.n_dof))
    moved = state.retract(np.where(stage.dofs, rng.normal(0.0, 0.3, CHAIN.n_dof), 0.0))
    before, after = (Configuration(MODEL, s).Ts_world_link for s in (state, moved))
    np.testing.assert_array_equal(np.abs(after - before).max(axis=(1, 2)) > 1e-9, stage.links)


def test_limbs_are_the_branches_of_the_tree():
    limbs = {stage.name: [CHAIN.links[i] for i in np.flatnonzero(stage.links)] for stage in limbs_of(CHAIN)}
    assert set(limbs) == {"head", "left_clavicle", "right_clavicle", "left_thigh", "right_thigh"}
    assert set(limbs["left_clavicle"]) == {"left_clavicle", "left_upper_arm", "left_forearm", "left_hand"}
    assert set(limbs["right_thigh"]) == {"right_thigh", "right_shank", "right_foot"}


class Parabola:
    """Squared distance from a state, whatever the links."""

    def __init__(self, goal: State):
        self._prior = Prior(goal, np.linspace(1.0, 3.0, CHAIN.n_dof))

    def linearize(self, state: State, links: np.ndarray | None = None) -> NormalEquations:
        H, g = np.zeros((CHAIN.n_dof, CHAIN.n_dof)), np.zeros(CHAIN.n_dof)
        return NormalEquations(H, g, self._prior.add_to(H, g, state), CHAIN.n_dof)


def test_a_stage_is_minimized_alone_and_a_pull_shares_the_way():
    rng = np.random.default_rng(4)
    start = State.neutral(MODEL)
    goal = start.retract(rng.uniform(0.0, 0.1, CHAIN.n_dof))
    options = LevenbergMarquardtOptions(max_iterations=30, tolerance=1e-12, step_tolerance=1e-12)
    stage = stages_of(CHAIN)[1]
    found = minimize(Pulled(Parabola(goal), (), stage), start, CHAIN, options)
    np.testing.assert_allclose(found.state.difference(start)[~stage.dofs], 0.0, atol=1e-12)
    np.testing.assert_allclose(found.state.difference(goal)[stage.dofs], 0.0, atol=1e-6)
    pull = Prior(start, np.linspace(1.0, 3.0, CHAIN.n_dof))  # as strong as the objective: half the way
    found = minimize(Pulled(Parabola(goal), (pull,)), start, CHAIN, options)
    half = 0.5 * goal.difference(start)
    np.testing.assert_allclose(found.state.difference(start)[6:], half[6:], atol=1e-6)
