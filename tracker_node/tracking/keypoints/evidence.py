"""Whether a limb is where a fit has it, by the points that a detector has found on it; and how much of a body cameras show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...camera.rig import Camera, CameraRig
from ...model.configuration import State
from ...objective.keypoints.correspondences import KeypointCorrespondences
from ...objective.keypoints.kernels import OUTLIER, S_UU, S_UV, S_VV, SCORE
from ...observation.image_set import ImageSet
from ..limbs.tree import Limb

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
