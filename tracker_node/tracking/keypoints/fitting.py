"""Fits to detected points alone: from blunt to sharp, Levenberg-Marquardt, with the priors of motion and of the neutral pose."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.constraints.prior import Prior
from ...optimize.fitter import Fit, Fitter, Stage
from ...optimize.levenberg_marquardt import LevenbergMarquardtOptions
from ..config import TrackerConfig
from ..constraints import constraints_of, resting, staying
from ..engine import Solver
from .modality import KeypointModality

# Factors of what the points say: the first reach bodies that are far off, and what is no outlier is told at the end
_FIRST, _LATER = (0.003, 0.03, 0.3, 1.0), (0.1, 1.0)
_FIRST_SHARP, _SHARP, _SHORT = (LevenbergMarquardtOptions(iterations) for iterations in (30, 8, 2))
_HELD = 1e6  # information of what may not move
_CLEARLY = 4.0  # cost by which a limb has to be better elsewhere, and sides exchanged
# Cost that sides exchanged in one camera alone add at most, for them to be exchanged in others as well, and in how many cameras
_HOPELESS, _MOST_EXCHANGED = 20.0, 3


class KeypointFitting(Solver):
    """How bodies are fitted to the points of a `KeypointModality`.

    Parameters
    ----------
    model, config : as for the `Tracker`.
    modality : has the points.
    """

    def __init__(self, model: ArticulatedModel, config: TrackerConfig, modality: KeypointModality):
        self._config, self.modality, self._chain = config, modality, model.chain
        self._fitter, self._rest = Fitter(model, constraints_of(model, config)), resting(model, config.motion)

    def fit(self, start: State, first: bool, prior: Prior | None) -> Fit:
        """Blunt points, then sharp ones; then left and right of hips and shoulders as they suit everything else."""
        prior = prior or staying(start, self._config.motion)
        fit = self._staged(start, first, prior)
        return fit if first else self._with_sides(fit, start, prior)

    def _with_sides(self, fit: Fit, start: State, prior: Prior) -> Fit:
        """The same with hips or shoulders exchanged in cameras that see one behind the other.

        A detector that has followed a trunk until it is seen end on can have its far side for its near one afterwards, in two
        cameras at once: the fit follows, until arms and legs do not reach any more.
        """
        best = fit
        for pair, cameras in self.modality.end_on(fit.state):
            tried = [(self._exchanged(start, prior, pair, [i]), [i]) for i in cameras]
            tried.sort(key=_cost_of)
            several = [i for each, (i,) in tried[:_MOST_EXCHANGED] if each.equations.cost < best.equations.cost + _HOPELESS]
            for n in range(2, len(several) + 1):
                tried += [(self._exchanged(start, prior, pair, chosen), list(chosen)) for chosen in combinations(several, n)]
            other, chosen = min(tried, key=_cost_of)
            if other.equations.cost < best.equations.cost - _CLEARLY:
                self.modality.exchange(pair, chosen)
                best = other
        return best if best is fit else self._fitted(best.state, [Stage(1.0, _SHARP, compares=True)], prior)

    def _exchanged(self, state: State, prior: Prior, pair: tuple[int, int], cameras: Sequence[int]) -> Fit:
        """A short fit, as if a detector had taken these points for each other."""
        with self.modality.exchanged(pair, cameras):
            return self._fitted(state, [Stage(1.0, _SHORT)], prior)

    def _staged(self, start: State, first: bool, prior: Prior) -> Fit:
        sharpness, options = (_FIRST, _FIRST_SHARP) if first else (_LATER, _SHARP)
        return self._fitted(start, [Stage(each, options, compares=each == sharpness[-1]) for each in sharpness], prior)

    def _fitted(self, start: State, stages: Sequence[Stage], prior: Prior) -> Fit:
        return self._fitter.fit(start, self.modality, stages, [prior, self._rest])

    def limb_elsewhere(self, state: State, dofs: np.ndarray) -> State | None:
        """A limb where its points are, from wherever it is.

        Parameters
        ----------
        state : of the body, which is held but for the limb.
        dofs : (n_dof,) mask of the limb's own.

        Returns
        -------
        The state with the limb elsewhere; None where the points do not clearly speak for that.
        """
        joints = dofs[N_ROOT_DOF:]
        held = Prior(state, np.where(dofs, 0.0, _HELD))
        here, rest = state.joint_positions, np.array([axis.neutral for axis in self._chain.axes])
        lower, upper = self._chain.lower, self._chain.upper
        limited = np.isfinite(lower) & np.isfinite(upper)
        middle = np.where(limited, 0.5 * (np.where(limited, lower, 0.0) + np.where(limited, upper, 0.0)), rest)
        tried = [np.where(joints, angles, here) for angles in (here, middle, rest)]
        best = min((self._staged(State(state.T_world_root, angles), True, held).state for angles in tried), key=self._cost)
        return best if self._cost(best) < self._cost(state) - _CLEARLY else None

    def _cost(self, state: State) -> float:
        cost = self.modality.correspond(state, 1.0).at(state).equations.cost
        return cost if np.isfinite(cost) else np.inf


def _cost_of(tried: tuple[Fit, list[int]]) -> float:
    cost = tried[0].equations.cost
    return cost if np.isfinite(cost) else np.inf
