"""Assessment of fits to detected points alone: the whole body, by the share of points that are no outliers."""

from __future__ import annotations

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...objective.keypoints.correspondences import KeypointCorrespondences, PointsAt
from ...observation.image_set import ImageSet
from ...optimize.fitter import Fit
from ..assessment import Assessment, Report, assess_cameras, camera_reports, inverse_covariance
from ..engine import Judge
from ..estimate import Status
from ..limbs.judge import known_m
from .modality import KeypointModality

_LEAST_POINTS = 6  # of all cameras, for a body to be seen at all
_LOST, _DEGRADED = 0.3, 0.6  # shares of the points that are no outliers
_BRIDGED_SETS = 15  # at which no detector has looked, after which a body is lost: detectors are slower than cameras


class KeypointJudge(Judge):
    """Assesses fits of one body.

    Parameters
    ----------
    rig, model, modality : cameras, body, and what compares points.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel, modality: KeypointModality):
        self._rig, self._modality, self._known_m = rig, modality, known_m(model)
        self._known: tuple[Fit, np.ndarray] | None = None
        self.reset()

    def reset(self) -> None:
        """No points have been seen."""
        self._without = _BRIDGED_SETS

    def restart(self) -> None:
        """A state has been handed over, which points have not confirmed."""
        self.reset()

    def assess(self, fit: Fit, image_set: ImageSet) -> Assessment:
        """By the share of points that are where the fit has them."""
        points = _points(fit)
        seen = points.weights >= 0.0
        if not self._modality.looked and self._without < _BRIDGED_SETS:
            self._without += 1
            return Assessment(Status.DEGRADED, "no detector has looked: the body is where it is expected")
        if seen.sum() < _LEAST_POINTS:
            return Assessment(Status.LOST, f"{int(seen.sum())} points of the body are found", noise=True)
        self._without = 0
        inliers = np.where(seen, points.weights, 0.0)
        share = float(inliers.sum() / seen.sum())
        if share < _DEGRADED:
            status = Status.LOST if share < _LOST else Status.DEGRADED
            return Assessment(status, f"{100.0 * share:.0f} % of its points are where it is", noise=status is Status.LOST)
        shares = {
            camera.name: float(inliers[:, i].sum() / seen[:, i].sum()) for i, camera in enumerate(self._rig) if seen[:, i].any()
        }
        sees, elsewhere = "the body", "the body's points are elsewhere"
        status, reason = assess_cameras(shares, _LOST, image_set.cameras, len(self._rig), elsewhere, sees)
        sigma_m = float(np.sqrt(np.linalg.eigvalsh(self._covariance(fit)[:3, :3])[-1]))  # one camera leaves the depth open
        if status is Status.TRACKING and sigma_m > self._known_m:
            status, reason = Status.DEGRADED, f"its place is known to {1e3 * sigma_m:.0f} mm"
        return Assessment(status, reason, log_ratio=-fit.equations.cost)

    def _covariance(self, fit: Fit) -> np.ndarray:
        """(n_dof, n_dof); that of the last fit is kept."""
        if self._known is None or self._known[0] is not fit:
            self._known = fit, inverse_covariance(fit.equations.H, 1.0)
        return self._known[1]

    def report(self, fit: Fit, image_set: ImageSet) -> Report:
        """Distances of points, pixels, and the covariance."""
        correspondences, points = fit.correspondences, _points(fit)
        assert isinstance(correspondences, KeypointCorrespondences)
        squares, weights = correspondences.squares_px(fit.state), np.maximum(points.weights, 0.0)
        of_cameras = [_rms(weights[:, i], squares[:, i]) for i in range(len(self._rig))]
        cameras = camera_reports(self._rig, image_set, of_cameras, (weights > 0.5).sum(axis=0))
        return Report(cameras, _rms(weights, squares), self._covariance(fit))


def _rms(weights: np.ndarray, squares: np.ndarray) -> float:
    return float(np.sqrt((weights * squares).sum() / max(float(weights.sum()), 1e-9)))


def _points(fit: Fit) -> PointsAt:
    correspondences = fit.correspondences
    assert isinstance(correspondences, KeypointCorrespondences)
    return correspondences.at(fit.state)
