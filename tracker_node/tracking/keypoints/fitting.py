"""Fits to detected points alone: from blunt to sharp, Levenberg-Marquardt, with the priors of motion and of the neutral pose."""

from __future__ import annotations

from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...objective.constraints.prior import Prior
from ...optimize.fitter import Fit, Fitter, Stage
from ...optimize.levenberg_marquardt import LevenbergMarquardtOptions
from ..config import TrackerConfig
from ..constraints import constraints_of, resting, staying
from ..engine import Solver
from .modality import KeypointModality

# Factors of what the points say: the first reach bodies that are far off, and what is no outlier is told at the end
_FIRST, _LATER = (0.003, 0.03, 0.3, 1.0), (0.1, 1.0)
_FIRST_ITERATIONS, _ITERATIONS = 30, 8


class KeypointFitting(Solver):
    """How bodies are fitted to the points of a `KeypointModality`.

    Parameters
    ----------
    model, config : as for the `Tracker`.
    modality : has the points.
    """

    def __init__(self, model: ArticulatedModel, config: TrackerConfig, modality: KeypointModality):
        self._config, self.modality = config, modality
        self._fitter, self._rest = Fitter(model, constraints_of(model, config)), resting(model, config.motion)

    def fit(self, start: State, first: bool, prior: Prior | None) -> Fit:
        """Blunt points, then sharp ones."""
        sharpness = _FIRST if first else _LATER
        options = LevenbergMarquardtOptions(_FIRST_ITERATIONS if first else _ITERATIONS)
        stages = [Stage(each, options, compares=each == sharpness[-1]) for each in sharpness]
        return self._fitter.fit(start, self.modality, stages, [prior or staying(start, self._config.motion), self._rest])
