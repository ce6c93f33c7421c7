"""Assessment of fits to correspondence lines: limb by limb, by their outlines; with residuals and covariance."""

from __future__ import annotations

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration
from ...objective.lines import correspondence as kernel
from ...objective.lines.correspondences import PartEvidence
from ...observation.image_set import ImageSet
from ..assessment import Assessment, Report, assess_cameras
from ..config import TrackerConfig
from ..engine import Judge
from ..estimate import CameraReport, Status
from ..keypoints.evidence import lost_odds
from ..limbs.judge import LimbJudge, body_status, is_noise
from ..uncertainty.covariance import ImageEvidence, fit_covariance
from .fitting import LineFit, RegionFitting
from .line_errors import LineErrors

_LEAST_OUTLINE = 10  # samples of the outline that a camera should see, to be asked
_UNSEEN = -1e6  # log-likelihood ratio of a body that no camera sees: worse than any that is seen
_CHANCE = 3.0  # log-likelihood ratio of a contour against none, a sample, that a body has wherever it is put
_FOUND_LESS = 0.5  # times what is usual of the cameras: one that finds less of the outline does not agree


class RegionJudge(Judge):
    """Assesses fits of one body.

    Parameters
    ----------
    rig, model, config : as for the `Tracker`.
    fitting : that has made the fits.

    Attributes
    ----------
    limbs : judges limb by limb.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel, config: TrackerConfig, fitting: RegionFitting, limbs: LimbJudge):
        self._rig, self._model, self._fitting, self.limbs = rig, model, fitting, limbs
        self._inlier_px = config.region.inlier_px
        self._errors = LineErrors(rig, model, config.region)
        self._known: tuple[LineFit, ImageEvidence, tuple[np.ndarray, np.ndarray]] | None = None

    def reset(self) -> None:
        """Forget the evidence of limbs."""
        self.limbs.reset()
        self._known = None

    def restart(self) -> None:
        """Forget which limbs are lost."""
        self.limbs.restart()

    def assess(self, fit: LineFit, image_set: ImageSet) -> Assessment:
        """Limb by limb, then by cameras."""
        evidence = self._fitting.region.part_evidence(fit.correspondences, fit.state, self._inlier_px)
        if not evidence.expected.any():
            reason = "no camera sees the body where it is expected"
            return Assessment(Status.LOST, reason, noise=True, limbs=self.limbs.nothing_seen(), log_ratio=_UNSEEN)
        by_points = self._by_points(fit)
        reports = self.limbs.update(evidence, fit.state, self._of(fit)[1][0], by_points)
        status, reason = body_status(reports)
        if status is Status.TRACKING:
            status, reason = self._status_of_cameras(evidence, image_set, fit.correspondences.active)
        return Assessment(
            status, reason, noise=is_noise(evidence) and by_points is None, jumped=fit.jumped, limbs=reports,
            dof_weights=self.limbs.dof_weights(reports), part_weights=self.limbs.part_weights(reports),
            log_ratio=_log_ratio(evidence),
        )  # fmt: skip

    def _by_points(self, fit: LineFit) -> np.ndarray | None:
        """Log odds of each limb being lost, by the points of a detector, where there are any."""
        points = self._fitting.points_at(fit.state)
        if not points:
            return None
        return lost_odds(points[0], fit.state, self.limbs.limbs, self._fitting.region.size_px(fit.state))

    def _status_of_cameras(self, evidence: PartEvidence, image_set: ImageSet, active: list[int]) -> tuple[Status, str]:
        expected, close = evidence.expected.sum(axis=1), evidence.close.sum(axis=1)
        shares = {self._rig.cameras[i].name: close[i] / expected[i] for i in active if expected[i] >= _LEAST_OUTLINE}
        usual = float(np.median(list(shares.values()))) if shares else 0.0
        return assess_cameras(
            shares, _FOUND_LESS * usual, image_set.cameras, len(self._rig), "the body's outline is not found",
            "where the body is",
        )  # fmt: skip

    def _of(self, fit: LineFit) -> tuple[ImageEvidence, tuple[np.ndarray, np.ndarray]]:
        """What the lines say of a fit, and its `fit_covariance`."""
        if self._known is None or self._known[0] is not fit:
            images = self._errors.evidence(fit.correspondences, fit.state, self._fitting.share)
            body = Configuration(self._model, fit.state)
            self._known = fit, images, fit_covariance(fit.equations.H, images, body)
        return self._known[1:]

    def report(self, fit: LineFit, image_set: ImageSet) -> Report:
        """Residuals of the lines, pixels, and the covariance."""
        reports, squares, weight, lines = [], 0.0, 0.0, fit.correspondences.at(fit.state)
        for i, camera in enumerate(self._rig):
            image, stats = image_set.get(camera.name), lines.stats(i)
            squares, weight = squares + stats[kernel.SQUARES], weight + stats[kernel.WEIGHT]
            rms = float(np.sqrt(stats[kernel.SQUARES] / max(stats[kernel.WEIGHT], 1e-12)))
            reports.append(CameraReport(camera.name, 0 if image is None else image.stamp_ns, rms, int(stats[kernel.COUNT])))
        images, (covariance, second_order) = self._of(fit)
        return Report(tuple(reports), float(np.sqrt(squares / max(weight, 1e-12))), covariance, images, second_order)


def _log_ratio(evidence: PartEvidence) -> float:
    """Log-likelihood of the body's outline against chance; what hides behind the rest wins nothing."""
    return float((evidence.log_ratio - _CHANCE * evidence.expected).sum())
