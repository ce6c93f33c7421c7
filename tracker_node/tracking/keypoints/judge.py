"""Assessment by the points that a detector has found.

Of fits to points alone, the whole body, by the share of points that are no outliers. Beside lines, whether each limb is where a
fit has it, and how much of a body cameras show.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...camera.rig import Camera, CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...objective.keypoints.correspondences import KeypointCorrespondences, PointsAt
from ...objective.keypoints.kernels import OUTLIER, S_UU, S_UV, S_VV, SCORE
from ...observation.image_set import ImageSet
from ...optimize.fitter import Fit
from ..assessment import Assessment, Report, assess_cameras, camera_reports, inverse_covariance
from ..engine import Judge
from ..estimate import Status
from ..limbs.judge import known_m
from ..limbs.tree import Limb
from .modality import KeypointModality

_ELSEWHERE_PX2 = 55.0**2  # mean square of how far a point of a lost limb is off, in pixels, on a body of `_BODY_PX`
_BODY_PX = 200.0
_CORRELATION = 1.5  # how many cameras share one error
_LEAST_SCORE, _LEAST_OF_ONE = 1.0, 0.5  # of a point that says anything: over all cameras, or of a camera alone
_SURE = 0.6  # score of a point in a camera that sees it, and does not guess where it is behind something
_LIMIT = 6.0  # log odds of one point
_MOST = 0.8  # of a body's points, which are in an image that should show it
_OF_ONE_CAMERA = -1.5  # the least that points of one camera say: not lost in its image, but too little to confirm a depth


def lost_odds(points: KeypointCorrespondences, state: State, limbs: Sequence[Limb], body_px: float) -> np.ndarray:
    """Log odds of each limb being lost, by its worst point that is seen by two cameras.

    A point of a limb that is elsewhere is somewhere around; one that is in place has the residual that its covariance says, or is
    an outlier in either case. Where one camera alone is sure of the end of a limb that says little for it: its depth may be
    mirrored.

    Parameters
    ----------
    points : of the present set.
    state : of the body.
    limbs : of the body.
    body_px : size of the body in the images, pixels.

    Returns
    -------
    (n_limbs,) natural logarithms; 0 for one that is guessed everywhere, nan for one without points.
    """
    at, observed = points.at(state), points.observed
    seen = at.weights >= 0.0
    odds = np.where(seen, observed[:, :, OUTLIER], 1.0)
    near = np.exp(-0.5 * np.minimum(at.squares, 200.0))
    det = observed[:, :, S_UU] * observed[:, :, S_VV] - observed[:, :, S_UV] ** 2
    spread = _ELSEWHERE_PX2 * (body_px / _BODY_PX) ** 2
    away = np.where(seen, 1.0 / (1.0 + spread * np.sqrt(np.maximum(det, 0.0))), 1.0)
    ratio = np.where(seen, np.log((away + odds) / (near + odds)), 0.0)
    scores = np.where(seen, observed[:, :, SCORE], 0.0)
    by_point = np.clip((scores * ratio).sum(axis=1) / _CORRELATION, -_LIMIT, _LIMIT)
    guessed = scores.sum(axis=1) < np.where(seen.sum(axis=1) == 1, _LEAST_OF_ONE, _LEAST_SCORE)
    by_point[guessed] = 0.0  # guessed everywhere: that guesses agree with each other says nothing
    by_two = (scores >= _SURE).sum(axis=1) >= 2  # cameras: what the others guess says little of the depth
    result = np.full(len(limbs), np.nan)
    for i, limb in enumerate(limbs):
        own = limb.links[points.body.links] & seen.any(axis=1)
        if own.any():
            several = own & (seen.sum(axis=1) >= 2)
            result[i] = by_point[several if several.any() else own].max()
            at_end = limb.links[points.body.links] & (points.body.links == limb.end)
            if not (by_two & (at_end if at_end.any() else own)).any():
                result[i] = max(result[i], _OF_ONE_CAMERA)
    return result


def shares_found(points: KeypointCorrespondences, state: State, rig: CameraRig, image_set: ImageSet) -> np.ndarray:
    """How much of a body a detector surely finds where it is, in each camera.

    Parameters
    ----------
    points : of the present set.
    state : of the body.
    rig : cameras.
    image_set : whose people say where the detector has looked.

    Returns
    -------
    (n_cameras,) shares of the body's points, by their scores; nan where it finds none and has not looked, where many of them are
    out of the image, or where others may hide the body.
    """
    agree = np.maximum(points.at(state).weights, 0.0) * points.observed[:, :, SCORE]
    shares = agree.mean(axis=0)
    for i in np.flatnonzero(shares == 0.0):
        camera = rig.cameras[i]
        image = image_set.get(camera.name)
        looked = image is not None and image.people is not None and not image_set.neighbors
        if not looked or not _is_in_image(camera, points, state):
            shares[i] = np.nan
    return shares


def _is_in_image(camera: Camera, points: KeypointCorrespondences, state: State) -> bool:
    """Whether most of a body's points are in the image of a camera, whatever is before them."""
    pixels, before = camera.project(points.body.places(state))
    return bool((before & camera.model.in_image(pixels)).mean() > _MOST)


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
