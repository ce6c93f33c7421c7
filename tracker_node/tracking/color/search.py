"""From a start to the state whose colors suit the images best: by alignment part by part, by stepping or by simplex."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF, KinematicChain
from ...objective.color.score import ColorObjective
from ...objective.constraints.prior import Prior
from ...objective.points.photometry import PhotometryLevel, SurfacePhotometry
from ...optimize.levenberg_marquardt import LevenbergMarquardtOptions, clip_to_limits, minimize
from ...optimize.result import OptimizerResult
from ...optimize.score_objective import SearchResult
from ...optimize.simplex import SimplexOptions, SimplexStage, search_simplex
from ...optimize.stepping import SCHEDULES, SteppingOptions, schedule, step_downhill
from ..config import ColorConfig
from .hierarchy import Pulled, Stage, limbs_of, stages_of

_TOLERANCE = 1e-3
_TRACKING = schedule((20, 10, 5), (4, 2, 1))
_STEPPING_POLISH = SteppingOptions(schedule((5,), (1,)))
_SIMPLEX_POLISH = SimplexOptions((SimplexStage(0.01, np.deg2rad(1.0), 0.2, max_evaluations=20),))
_BEAM = 6  # places of a lost limb that are followed
_LIMB_ITERATIONS = 15
_SEARCH_LEVEL = 2  # of the pyramid


class ColorSearch:
    """Optimizers of the color engine, with joint limits and priors.

    Parameters
    ----------
    photometry : for the alignment, and the normal equations of every result.
    score : of the mask, for stepping and simplex.
    """

    def __init__(self, model: ArticulatedModel, config: ColorConfig, photometry: SurfacePhotometry, score: ColorObjective | None):
        self._model, self._config, self._photometry, self._score = model, config, photometry, score
        chain = model.chain
        self._stages = stages_of(chain) if config.hierarchical else ()
        self.limbs = limbs_of(chain)

    def run(self, start: State, priors: Sequence[Prior], first: bool) -> OptimizerResult:
        """Part by part, where that is asked for, then all variables together."""
        if self._config.optimizer == "alignment":
            return self._align(start, priors, first)
        return self._by_scores(start, priors, first)

    def _align(self, start: State, priors: Sequence[Prior], first: bool) -> OptimizerResult:
        config, chain = self._config, self._model.chain
        passes = config.first_passes if first else config.passes
        options = LevenbergMarquardtOptions(max_iterations=config.iterations, tolerance=_TOLERANCE)
        coarsest, state, iterations, evaluations = config.levels - 1, start, 0, 0
        steps: list[tuple[PhotometryLevel, Stage | None]]
        coarse = self._photometry.at_level(coarsest)  # all stages share its points
        steps = [(coarse, stage) for stage in self._stages]
        steps += [(self._photometry.at_level(level), None) for level in range(coarsest, -1, -1) for _ in range(passes)]
        for objective, stage in steps:
            result = minimize(Pulled(objective, priors, stage), state, chain, options)
            state, iterations, evaluations = result.state, iterations + result.iterations, evaluations + result.evaluations
        return OptimizerResult(state, result.equations, iterations, evaluations, result.converged)

    def _by_scores(self, start: State, priors: Sequence[Prior], first: bool) -> OptimizerResult:
        """The hierarchy needs no polish of its own for the root's variables: the last walk moves them all."""
        chain, state, evaluations, converged = self._model.chain, start, 0, False
        rounds: list[list[int] | None] = [stage.variables for stage in self._stages] or [None]
        for variables in rounds:
            found = self._walk(state, chain, variables)
            state, evaluations, converged = found.state, evaluations + found.evaluations, found.converged
        if self._stages:
            found = self._walk(state, chain, None, polish=True)
            state, evaluations, converged = found.state, evaluations + found.evaluations, found.converged
        equations = Pulled(self._photometry.at_level(0), priors).linearize(state)
        return OptimizerResult(state, equations, len(rounds) + bool(self._stages), evaluations, converged)

    def _walk(self, state: State, chain: KinematicChain, variables: list[int] | None, polish: bool = False) -> SearchResult:
        config, score = self._config, self._score
        assert score is not None
        if config.optimizer == "stepping":
            loops = _TRACKING if config.schedule == "tracking" else SCHEDULES[config.schedule]
            return step_downhill(score, state, chain, _STEPPING_POLISH if polish else SteppingOptions(loops), variables)
        return search_simplex(score, state, chain, _SIMPLEX_POLISH if polish else SimplexOptions(), variables)

    def find_limb(self, limb: Stage, around: State, rng: np.random.Generator) -> State:
        """The state in which ``limb`` suits the images best of many tried, the rest of the body as it is.

        Generate and test, from proximal to distal: for each link in turn random angles, from the few best places of what carries
        it; only the links placed so far are scored. The best of the whole limb are aligned.
        """
        config, chain = self._config, self._model.chain
        level = self._photometry.at_level(min(_SEARCH_LEVEL, config.levels - 1))
        level.freeze(around)
        spread, beam = np.deg2rad(config.search_angle_deg), [around]
        links = [link for link in np.flatnonzero(limb.links).tolist() if chain.axis_count[link]]
        for link in links:
            own = _own_links(chain, limb, link, links)
            tried = list(beam)
            for state in beam:
                tried += self._turned(state, link, spread, config.search_states // (len(links) * len(beam)), rng)
            costs = np.array([level.cost(state, own) for state in tried])
            beam = [tried[i] for i in np.argsort(costs, kind="stable")[:_BEAM]]
        options = LevenbergMarquardtOptions(max_iterations=_LIMB_ITERATIONS, tolerance=_TOLERANCE)
        aligned = [minimize(Pulled(level, (), limb), state, chain, options) for state in beam]
        return min(aligned, key=lambda result: result.equations.cost).state

    def _turned(self, state: State, link: int, spread: float, n: int, rng: np.random.Generator) -> list[State]:
        """``n`` states with other angles of a link's joint, normally distributed around its present ones."""
        chain = self._model.chain
        first, count = int(chain.axis_start[link]), int(chain.axis_count[link])
        result = []
        for turn in rng.normal(0.0, spread, (n, count)):
            angles = state.joint_positions.copy()
            angles[first : first + count] += turn
            result.append(clip_to_limits(State(state.T_world_root, angles), chain))
        return result


def _own_links(chain: KinematicChain, limb: Stage, link: int, links: list[int]) -> np.ndarray:
    """Mask (n_links,) of a limb's links that are in place once ``link`` is: without those that a later joint moves."""
    placed = limb.links.copy()
    for later in links[links.index(link) + 1 :]:
        first = N_ROOT_DOF + int(chain.axis_start[later])
        placed &= ~chain.link_moved_by[:, first]
    return placed
