"""Parts of one color over the background: what the body explains of the difference between images and background.

The color of a part alone does not tell an arm in front of the chest from one beside it, since both are skin. Where images show
the background, whatever differs from it has to be covered by the body.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import cv2
import numpy as np

from ...camera.rig import CameraRig
from ...errors import ModelError
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...objective.area.background_score import BackgroundObjective
from ...objective.constraints.prior import Prior
from ...observation.image_set import ImageSet
from ...optimize.fitter import Fit
from ...optimize.levenberg_marquardt import clip_to_limits
from ...optimize.score_objective import PartialObjective, ScoreObjective
from ...optimize.stepping import SteppingOptions, schedule, step_downhill
from ...parallel import Workers
from ...render.raycast.raycaster import render_labels
from ..assessment import Assessment
from ..config import ColorOverBackgroundConfig
from ..estimate import Status
from ..limbs.tree import Limb, stages_of
from ..modality import Images
from ..poses import Poses, PoseSearch
from .judge import ColorJudge
from .modality import ColorModality, ColorScores
from .search import ColorSearch, walked

_LONGEST_PX = 480  # images are shrunk to this, which is enough for parts of one color
_MARGIN_PX = 15  # around the expected body, of those images
_STAGE = SteppingOptions(schedule((20, 8), (5, 2), (2, 2)))
_FIRST_STAGE = SteppingOptions(schedule((50, 20, 8), (10, 5, 2), (2, 2, 2)))
_POLISH = SteppingOptions(schedule((6, 3), (1.5, 0.7)))
_LOST_SHARE, _DEGRADED_SHARE = 0.2, 0.3  # of what is to be explained around the body
_SQUARED_LEVELS = 3e7  # of the other color scores, that a fraction of one is worth to the priors


class BackgroundScores(ColorScores):
    """Shrunk cameras, backgrounds and images, and the score on them (`ColorScores`).

    Parameters
    ----------
    rig, model, backgrounds : as for the `Tracker`. A camera without a background says only what suits the parts' colors.
    workers : threads that share states or cameras.

    Raises
    ------
    ModelError : a part that is neither ellipsoid nor cone; no backgrounds at all.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel, backgrounds: Mapping[str, np.ndarray | list], workers: Workers):
        if not backgrounds:
            raise ModelError("the modality color_over_background needs images of the background: give cameras of the rig one")
        self._model = model
        self._sizes = []
        for camera in rig:
            shrink = min(1.0, _LONGEST_PX / max(camera.model.width, camera.model.height))
            self._sizes.append((round(shrink * camera.model.width), round(shrink * camera.model.height)))
        cameras = [replace(c, model=c.model.resized(*size)) for c, size in zip(rig, self._sizes, strict=True)]
        self._rig = replace(rig, cameras=tuple(cameras))
        shown: list[np.ndarray | None] = []
        for camera in rig:
            image = backgrounds.get(camera.name)
            shown.append(np.median(image, axis=0).astype(np.uint8) if isinstance(image, list) else image)
        colors = np.zeros((len(rig), len(model.shapes), 3))
        self.objective = BackgroundObjective(model, self._rig, colors, self._shrunk(shown), workers=workers)

    def _shrunk(self, images: Sequence[np.ndarray | None]) -> list[np.ndarray | None]:
        return [
            None if image is None else cv2.resize(image, size, interpolation=cv2.INTER_AREA)
            for image, size in zip(images, self._sizes, strict=True)
        ]

    def set_colors(self, learned: np.ndarray | None, rgb: np.ndarray) -> None:
        """Take the colors of all parts."""
        self.objective.set_colors(rgb)

    def set_images(self, images: Images, expected: State | None) -> None:
        """Take the images of a set, and what there is to explain: the surroundings of the expected body."""
        self.objective.set_images(self._shrunk(images))
        if expected is not None:
            configuration = Configuration(self._model, expected)
            sights = [render_labels(configuration, camera, _MARGIN_PX) for camera in self._rig]
            self.objective.restrict([None if sight is None else sight[0] for sight in sights])


class BackgroundJudge(ColorJudge):
    """By colors, and by how much the body explains in the median camera: colors learned in a wrong place agree there, too."""

    def __init__(
        self, rig: CameraRig, model: ArticulatedModel, config: ColorOverBackgroundConfig, modality: ColorModality,
        scores: BackgroundScores,
    ):  # fmt: skip
        super().__init__(rig, model, config, modality)
        self._scores = scores

    def assess(self, fit: Fit, image_set: ImageSet) -> Assessment:
        """Status by colors, and by how much of the difference to the backgrounds the body explains."""
        shares = 1.0 - self._scores.objective.evaluate(fit.state).camera_scores
        seen = shares[np.isfinite(shares)]
        median = float(np.median(seen)) if len(seen) else 0.0
        assessment = super().assess(fit, image_set)
        if assessment.status is Status.LOST or median >= _DEGRADED_SHARE:
            return assessment
        reason = f"the body explains {100.0 * max(median, 0.0):.0f} % of what is not the background"
        return Assessment(Status.LOST if median < _LOST_SHARE else Status.DEGRADED, reason)


class _WithPriors:
    """The score with priors (`ScoreObjective`)."""

    def __init__(self, objective: ScoreObjective, priors: Sequence[Prior]):
        self._objective, self._priors = objective, priors

    def _prior(self, state: State) -> float:
        offsets = [(state.difference(prior.mean), prior.information) for prior in self._priors]
        return float(sum(information @ offset**2 for offset, information in offsets)) / _SQUARED_LEVELS

    def score(self, state: State) -> float:
        return self._objective.score(state) + self._prior(state)

    def scores(self, states: Sequence[State]) -> np.ndarray:
        return self._objective.scores(states) + np.array([self._prior(state) for state in states])

    def at_row_step(self, row_step: int) -> _WithPriors:
        return _WithPriors(self._objective.at_row_step(row_step), self._priors)

    def beside(self, state: State, variables: Sequence[int]) -> _WithPriors:
        assert isinstance(self._objective, PartialObjective)
        return _WithPriors(self._objective.beside(state, variables), self._priors)


class BackgroundSearch(ColorSearch):
    """Downhill stepping on the score, part by part and then all together (`ColorSearch`)."""

    def __init__(
        self, model: ArticulatedModel, config: ColorOverBackgroundConfig, modality: ColorModality, scores: BackgroundScores
    ):
        self._model, self._config, self._modality, self._objective = model, config, modality, scores.objective
        self._parts = stages_of(model.chain)

    def run(self, start: State, priors: Sequence[Prior], first: bool) -> Fit:
        """Where no camera shows the body, it stays."""
        score, chain, state, evaluations, converged = _WithPriors(self._objective, priors), self._model.chain, start, 0, False
        walks = [(part.variables, _FIRST_STAGE if first else _STAGE) for part in self._parts]
        for variables, options in [*walks, (None, _POLISH)]:
            found = step_downhill(score, state, chain, options, variables)
            state, evaluations, converged = found.state, evaluations + found.evaluations, found.converged
        return walked(self._modality, state, priors, len(walks) + 1, evaluations, converged)

    def find_limb(self, limb: Limb, around: State, rng: np.random.Generator) -> State:
        """The best of many random places of a limb, walked downhill from."""
        chain, spread = self._model.chain, np.deg2rad(self._config.search_angle_deg)
        turns = rng.uniform(-2.0 * spread, 2.0 * spread, (self._config.search_states // 4, int(limb.dofs.sum())))
        tangents = np.zeros((1 + len(turns), chain.n_dof))
        tangents[1:, limb.dofs] = turns
        coarse = self._objective.at_row_step(2)
        search = PoseSearch(chain, lambda poses: -coarse.scores([poses.state(i) for i in range(len(poses))]), limb.dofs, rng)
        poses, _ = search.run(Poses.of([clip_to_limits(around, chain)] * len(tangents)).retracted(tangents), [], 1)
        variables = np.flatnonzero(limb.dofs).tolist()
        return step_downhill(self._objective, poses.state(0), chain, _FIRST_STAGE, variables).state
