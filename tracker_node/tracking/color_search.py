"""From a start to the state whose colors suit the images best: by alignment part by part, by stepping or by simplex."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..model.articulated_model import ArticulatedModel
from ..model.configuration import State
from ..model.kinematic_chain import KinematicChain
from ..objective.color_score import ColorObjective
from ..objective.contour_objective import Prior
from ..objective.surface_photometry import SurfacePhotometry
from ..optimize.levenberg_marquardt import LevenbergMarquardtOptions, clip_to_limits, minimize
from ..optimize.result import OptimizerResult
from ..optimize.score_objective import SearchResult
from ..optimize.simplex import SimplexOptions, SimplexStage, search_simplex
from ..optimize.stepping import SCHEDULES, SteppingOptions, schedule, step_downhill
from .config import ColorConfig
from .hierarchy import Pulled, Stage, limbs_of, stages_of

_TOLERANCE = 1e-3
_TRACKING = schedule((20, 10, 5), (4, 2, 1))
_STEPPING_POLISH = SteppingOptions(schedule((5,), (1,)))
_SIMPLEX_POLISH = SimplexOptions((SimplexStage(0.01, np.deg2rad(1.0), 0.2, max_evaluations=20),))
_BEST = 3  # candidates of a lost limb that are aligned


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
        n = config.first_iterations if first else config.iterations
        options = LevenbergMarquardtOptions(max_iterations=n, tolerance=_TOLERANCE)
        coarsest, state, iterations, evaluations = config.levels - 1, start, 0, 0
        steps: list[tuple[int, Stage | None]] = [(coarsest, stage) for stage in self._stages]
        steps += [(level, None) for level in range(coarsest, -1, -1)]
        for level, stage in steps:
            result = minimize(Pulled(self._photometry.at_level(level), priors, stage), state, chain, options)
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
        """The state in which ``limb`` suits the images best of many random ones around, the rest of the body as it is.

        Only the limb's own points are scored; the best few candidates are aligned.
        """
        config, chain, level = self._config, self._model.chain, min(2, self._config.levels - 1)
        coarse = self._photometry.at_level(level)
        coarse.freeze(around)
        spread = np.deg2rad(config.search_angle_deg)
        candidates = [around]
        for turn in rng.uniform(-2.0 * spread, 2.0 * spread, (config.search_states // 4, int(limb.dofs.sum()))):
            tangent = np.zeros(chain.n_dof)
            tangent[limb.dofs] = turn
            candidates.append(clip_to_limits(around.retract(tangent), chain))
        costs = np.array([coarse.cost(state, limb.links) for state in candidates])
        best: tuple[float, State] | None = None
        options = LevenbergMarquardtOptions(max_iterations=config.first_iterations, tolerance=_TOLERANCE)
        for index in np.argsort(costs, kind="stable")[:_BEST]:
            aligned = minimize(Pulled(coarse, (), limb), candidates[index], chain, options)
            if best is None or aligned.equations.cost < best[0]:
                best = (aligned.equations.cost, aligned.state)
        assert best is not None
        return best[1]
