"""Fits to contours: Levenberg-Marquardt, first with boundaries that attract from afar, then without (Knossow et al., 2008)."""

from __future__ import annotations

from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...objective.constraints.prior import Prior
from ...optimize.fitter import Fit, Fitter, Stage
from ...optimize.levenberg_marquardt import LevenbergMarquardtOptions
from ..config import TrackerConfig
from ..constraints import constraints_of, resting, staying
from ..engine import MemorylessSolver
from .modality import COARSE, FINE, ChamferModality


class ChamferFitting(MemorylessSolver):
    """How bodies are fitted to the contours of a `ChamferModality`.

    Parameters
    ----------
    model, config : as for the `Tracker`.
    modality : of the contours.
    """

    def __init__(self, model: ArticulatedModel, config: TrackerConfig, modality: ChamferModality):
        self._config, self._modality = config, modality
        self._fitter, self._rest = Fitter(model, constraints_of(model, config)), resting(model, config.motion)

    def fit(self, start: State, first: bool, prior: Prior | None) -> Fit:
        """Coarse iterations, then fine ones.

        Parameters
        ----------
        start : state to begin at.
        first : of a first image set, with more iterations.
        prior : in information units; None: the start, as `motion.stay_position` and `motion.stay_angle` say.

        Returns
        -------
        The fit.
        """
        chamfer, motion = self._config.chamfer, self._config.motion
        total = chamfer.first_iterations if first else chamfer.max_iterations
        n_coarse = min(total // 2 if first else chamfer.coarse_iterations, total - 1)
        stages = [Stage(COARSE, LevenbergMarquardtOptions(n_coarse, tolerance=chamfer.tolerance))] if n_coarse > 0 else []
        # In coarse ones boundaries attract from wherever they are, which says nothing of cameras
        stages.append(Stage(FINE, LevenbergMarquardtOptions(total - n_coarse, tolerance=chamfer.tolerance), compares=True))
        return self._fitter.fit(start, self._modality, stages, [prior or staying(start, motion), self._rest])
