"""Parts of one color over the empty scene: the engine of colors, searching by how much of an image the body explains.

The color of a part alone does not tell an arm in front of the chest from one beside it, since both are skin. Where plates show
the empty scene, whatever is not the scene has to be covered by the body.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import cv2
import numpy as np

from ...camera.rig import CameraRig
from ...errors import ModelError
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...objective.color.scene import SceneObjective
from ...objective.constraints.prior import Prior
from ...objective.points.photometry import SurfacePhotometry
from ...observation.image_set import ImageSet
from ...optimize.levenberg_marquardt import clip_to_limits
from ...optimize.result import OptimizerResult
from ...optimize.stepping import SteppingOptions, schedule, step_downhill
from ...render.raycast.raycaster import render_labels
from ..config import ColorConfig, TrackerConfig
from ..engine import Images, Verdict
from ..estimate import Status
from ..motion.model import Passage
from .engine import ColorEngine
from .hierarchy import Pulled, Stage
from .search import ColorSearch

_LONGEST_PX = 480  # images are shrunk to this, which is enough for parts of one color
_MARGIN_PX = 15  # around the expected body, of those images
_STAGE = SteppingOptions(schedule((20, 8), (5, 2), (2, 2)))
_FIRST_STAGE = SteppingOptions(schedule((50, 20, 8), (10, 5, 2), (2, 2, 2)))
_POLISH = SteppingOptions(schedule((6, 3), (1.5, 0.7)))
_LOST_SHARE, _DEGRADED_SHARE = 0.2, 0.3  # of what is to be explained around the body
_SQUARED_LEVELS = 3e7  # of the other color scores, that a share of one is worth to the priors


class SceneEngine(ColorEngine):
    """The `Engine` of colored parts before plates; status and covariance are those of `ColorEngine`.

    Parameters
    ----------
    rig, model, config, plates : as for the `Tracker`. A camera without a plate says only what suits the parts' colors.

    Raises
    ------
    ModelError : a model without colors, when none are to be learnt; a part that is neither ellipsoid nor cone; no plates at all.
    """

    def __init__(
        self,
        rig: CameraRig,
        model: ArticulatedModel,
        config: TrackerConfig,
        plates: Mapping[str, np.ndarray | list],
        parallel: Callable[[Callable, list], list],
    ):
        if not plates:
            raise ModelError("the modality color_over_background needs images of the background: give cameras of the rig one")
        self._scene = _Scene(rig, model, plates, config.threads)
        super().__init__(rig, model, ColorConfig(**vars(config.color_over_background)), config.threads, parallel)
        self._search = SceneSearch(model, self._config, self._photometry, self._scene)

    def _take_colors(self) -> None:
        super()._take_colors()
        self._scene.objective.set_colors(self._colors.rgb)

    def observe(self, images: Images, expected: State | None, passage: Passage | None = None) -> None:
        """Shrink the images, too."""
        super().observe(images, expected, passage)
        self._scene.observe(self._images, expected)

    def judge(self, result: OptimizerResult, image_set: ImageSet) -> Verdict:
        """By colors, and by how much the body explains in the middle camera: colors learnt in a wrong place agree there, too."""
        shares = 1.0 - self._scene.objective.evaluate(result.state).camera_scores
        seen = shares[np.isfinite(shares)]
        middle = float(np.median(seen)) if len(seen) else 0.0
        verdict = super().judge(result, image_set)
        if verdict.status is Status.LOST or middle >= _DEGRADED_SHARE:
            return verdict
        reason = f"the body explains {100.0 * max(middle, 0.0):.0f} % of what is not the empty scene"
        return Verdict(Status.LOST if middle < _LOST_SHARE else Status.DEGRADED, reason)


class _Scene:
    """Shrunk cameras, plates and images, and the score on them."""

    def __init__(self, rig: CameraRig, model: ArticulatedModel, plates: Mapping[str, np.ndarray | list], threads: int):
        self._model = model
        self._sizes = []
        for camera in rig:
            shrink = min(1.0, _LONGEST_PX / max(camera.model.width, camera.model.height))
            self._sizes.append((round(shrink * camera.model.width), round(shrink * camera.model.height)))
        cameras = [replace(c, model=c.model.resized(*size)) for c, size in zip(rig, self._sizes, strict=True)]
        self._rig = replace(rig, cameras=tuple(cameras))
        shown: list[np.ndarray | None] = []
        for camera in rig:
            plate = plates.get(camera.name)
            shown.append(np.median(plate, axis=0).astype(np.uint8) if isinstance(plate, list) else plate)
        colors = np.zeros((len(rig), len(model.shapes), 3))
        self.objective = SceneObjective(model, self._rig, colors, self._shrunk(shown), threads=threads)

    def _shrunk(self, images: Sequence[np.ndarray | None]) -> list[np.ndarray | None]:
        return [
            None if image is None else cv2.resize(image, size, interpolation=cv2.INTER_AREA)
            for image, size in zip(images, self._sizes, strict=True)
        ]

    def observe(self, images: Images, expected: State | None) -> None:
        self.objective.set_images(self._shrunk(images))
        if expected is not None:
            configuration = Configuration(self._model, expected)
            sights = [render_labels(configuration, camera, _MARGIN_PX) for camera in self._rig]
            self.objective.look_at([None if sight is None else sight[0] for sight in sights])


class _Pulled:
    """The scene's score with priors (`ScoreObjective`)."""

    def __init__(self, objective: SceneObjective, priors: Sequence[Prior]):
        self._objective, self._priors = objective, priors

    def _pull(self, state: State) -> float:
        offsets = [(state.difference(prior.mean), prior.information) for prior in self._priors]
        return float(sum(information @ offset**2 for offset, information in offsets)) / _SQUARED_LEVELS

    def score(self, state: State) -> float:
        return self._objective.score(state) + self._pull(state)

    def scores(self, states: Sequence[State]) -> np.ndarray:
        return self._objective.scores(states) + np.array([self._pull(state) for state in states])

    def at_row_step(self, row_step: int) -> _Pulled:
        return _Pulled(self._objective.at_row_step(row_step), self._priors)


class SceneSearch(ColorSearch):
    """Downhill stepping on the scene's score, part by part and then all together; equations are those of the photometry."""

    def __init__(self, model: ArticulatedModel, config: ColorConfig, photometry: SurfacePhotometry, scene: _Scene):
        super().__init__(model, config, photometry, None)
        self._objective = scene.objective

    def run(self, start: State, priors: Sequence[Prior], first: bool) -> OptimizerResult:
        """Where no camera shows the body, it stays."""
        score, chain, state, evaluations, converged = _Pulled(self._objective, priors), self._model.chain, start, 0, False
        walks = [(stage.variables, _FIRST_STAGE if first else _STAGE) for stage in self._stages]
        for variables, options in [*walks, (None, _POLISH)]:
            found = step_downhill(score, state, chain, options, variables)
            state, evaluations, converged = found.state, evaluations + found.evaluations, found.converged
        equations = Pulled(self._photometry.at_level(0), priors).linearize(state)
        return OptimizerResult(state, equations, len(walks) + 1, evaluations, converged)

    def find_limb(self, limb: Stage, around: State, rng: np.random.Generator) -> State:
        """The best of many random places of ``limb``, walked downhill from."""
        chain, spread = self._model.chain, np.deg2rad(self._config.search_angle_deg)
        candidates = [around]
        for turn in rng.uniform(-2.0 * spread, 2.0 * spread, (self._config.search_states // 4, int(limb.dofs.sum()))):
            tangent = np.zeros(chain.n_dof)
            tangent[limb.dofs] = turn
            candidates.append(clip_to_limits(around.retract(tangent), chain))
        best = candidates[int(np.argmin(self._objective.at_row_step(2).scores(candidates)))]
        return step_downhill(self._objective, best, chain, _FIRST_STAGE, limb.variables).state
