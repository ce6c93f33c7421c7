"""A body by the pictures on its faces: aligned in each camera's own brightness, and looked for where it is lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...objective.constraints.prior import Prior
from ...objective.normal_equations import Comparison, NormalEquations
from ...objective.points.texture import TextureObjective, TextureScore
from ...observation.image_set import ImageSet
from ...optimize.alignment import AlignmentOptions, align
from ...optimize.reacquire import ReacquireOptions, reacquire
from ...optimize.result import OptimizerResult
from ...optimize.robust_start import RobustStartOptions
from ..config import TrackerConfig
from ..engine import Images, Report, Verdict
from ..estimate import CameraReport, Status
from ..motion.model import Passage

_TRIED, _ALIGNED = 3, 40  # times the states of a round, all in one round; so many of them are aligned
_WIDEN, _WIDEST = 0.5, 2.0  # the search grows by this share with every set that it fails in, up to so many times


class TextureEngine:
    """The `Engine` of pictured boxes; the parameters are those of ``config.texture``."""

    in_information_units = False

    def __init__(self, rig: CameraRig, model: ArticulatedModel, config: TrackerConfig):
        self._rig, self._model, self._config = rig, model, config.texture
        self._objective = TextureObjective(model, rig, threads=config.threads)
        self._alignment = AlignmentOptions(self._objective.n_levels - 1, tolerance=1e-4)
        self.reset()

    def reset(self) -> None:
        """There is nothing learnt; only the width of the search begins anew."""
        self._lost, self._found_again = 0, False
        self._score: TextureScore | None = None

    def begin(self, images: Images, start: State, *, known: bool = False) -> State:
        """Pictures are known beforehand: the start stays."""
        return start

    def observe(self, images: Images, expected: State | None, passage: Passage | None = None) -> None:
        """Halve the images again and again; where nobody knows where the body is, none is looked at."""
        self._objective.set_images([None] * len(self._rig) if expected is None else images)

    def fit(self, start: State, first: bool, prior: Prior | None = None) -> OptimizerResult:
        """Alignment from coarse to fine, and a search where that has not led to the body."""
        chain = self._model.chain
        result = align(self._objective, start, chain, self._alignment)
        self._score, self._found_again = self._objective.evaluate(result.state), False
        searches = self._config.search_states > 0 and self._objective.sees
        if _agreement(self._score) >= self._config.degraded_agreement or not searches:
            return result
        wider = min(1.0 + _WIDEN * max(self._lost - 1, 0), _WIDEST)
        radius, angle = wider * self._config.search_radius, wider * np.deg2rad(self._config.search_angle_deg)
        around = RobustStartOptions(
            radius, angle, _TRIED * self._config.search_states, rounds=1,
            keep=_ALIGNED, row_step=1 << (self._objective.n_levels - 1), seed=self._config.seed,
        )  # fmt: skip
        found = reacquire(self._objective, start, chain, ReacquireOptions(around, self._alignment))
        if found is None:
            return result
        score = self._objective.evaluate(found.state)
        if not score.score < self._score.score:
            return replace(result, evaluations=result.evaluations + found.evaluations)
        self._score, self._found_again = score, True
        return replace(found, evaluations=result.evaluations + found.evaluations)

    def judge(self, result: OptimizerResult, image_set: ImageSet) -> Verdict:
        """By the share of the pictures' contrast that the images show, in the middle camera."""
        verdict = self._judge(image_set)
        self._lost = self._lost + 1 if verdict.status is Status.LOST else 0
        return verdict

    def _judge(self, image_set: ImageSet) -> Verdict:
        score, config = self._score, self._config
        if score is None or not np.isfinite(score.score):
            return Verdict(Status.LOST, "no camera sees a picture of the body where it is expected", noise=True)
        agreement = _agreement(score)
        figures = f"images show {100 * agreement:.0f} % of the pictures' contrast"
        if agreement < config.lost_agreement:
            return Verdict(Status.LOST, figures, noise=True)
        if self._found_again:
            return Verdict(Status.DEGRADED, f"found again by a search; {figures}", jumped=True)
        if agreement < config.degraded_agreement:
            return Verdict(Status.DEGRADED, figures)
        shares = dict(zip(self._rig.names, 1.0 - score.camera_scores, strict=True))
        against = [f"{name} ({100 * share:.0f} %)" for name, share in shares.items() if share < config.lost_agreement]
        if against:
            return Verdict(Status.DEGRADED, f"pictures do not agree in {', '.join(against)}")
        if len(image_set.cameras) < len(self._rig):
            return Verdict(Status.DEGRADED, f"{len(image_set.cameras)} of {len(self._rig)} cameras")
        if np.isfinite(score.camera_scores).sum() < min(2, len(self._rig)):
            return Verdict(Status.DEGRADED, "only one camera sees a picture of the body")
        return Verdict(Status.TRACKING, "")

    def linearize(self, state: State) -> NormalEquations:
        """On the finest level."""
        self._score = self._objective.evaluate(state)
        return self._objective.at_level(0).linearize(state)

    def comparison(self) -> Comparison | None:
        """Cameras are not compared: the units are grey levels."""
        return None

    def report(self, result: OptimizerResult, image_set: ImageSet) -> Report:
        """Residuals are in grey levels of the pictures, where those of contours are in pixels."""
        equations, config, reports = result.equations, self._config, []
        score = self._score
        for i, camera in enumerate(self._rig):
            image = image_set.get(camera.name)
            points = 0 if score is None else int(score.camera_points[i])
            rms = 0.0 if score is None else float(score.camera_rms[i])
            reports.append(CameraReport(camera.name, 0 if image is None else image.stamp_ns, rms if points else 0.0, points))
        rms = float(np.sqrt(equations.cost / equations.count)) if equations.count else 0.0
        H = equations.H.copy()
        H[np.diag_indices_from(H)] += 1e-6 * max(float(np.diag(H).max()), 1.0)
        covariance = max(rms, config.residual_sigma) ** 2 * config.correlation * np.linalg.inv(H)
        return Report(tuple(reports), rms, 0.5 * (covariance + covariance.T))

    def learn(self, images: Images, state: State) -> None:
        """Nothing: the pictures do not change, and brightness is found anew in every image."""


def _agreement(score: TextureScore) -> float:
    """Share of the pictures' contrast that the middle camera shows, of an even number the better; 0 where none sees one."""
    seen = np.sort(1.0 - score.camera_scores[np.isfinite(score.camera_scores)])
    return float(seen[len(seen) // 2]) if len(seen) else 0.0
