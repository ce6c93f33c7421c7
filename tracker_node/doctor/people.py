"""Whether a camera looks where the rig has it, by the joints of people.

Where anything moves is known by cells of a few pixels (`motion`), in which a turn of half a degree is lost. The joints that a
network finds of one person in all cameras are known to a few pixels each, and there are hundreds of them. Each camera is turned
until it sees them where the others do; that which makes all cameras agree best by its turn is the one that is wrong, if that
makes much of a difference. A turn about the line of sight is hardly seen where the person fills little of the image.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..calibration.points.rig_refinement import collect_joints, people_table
from ..calibration.points.triangulation import reproject, triangulate
from ..camera.rig import Camera, CameraRig
from ..errors import CalibrationError
from ..geometry import se3, so3
from .recording import CameraRecording

LEAST_CAMERAS = 3  # two see a joint somewhere whatever their turn
_SURE = 0.5  # score of a joint, below which it is a guess
_ERROR = 1.0 / 60.0  # of a network's joints, in sizes of the person
_MOST_APART = 0.5  # of the time from look to look: images that are farther apart show another moment
_LEAST_SHARE = 0.09  # of the misfit that a turn takes away, from which on it is told; of twelve sound rigs it takes 0.07 at most
_LEAST_NEARER = 0.3  # by which a camera's joints come nearer, in errors that joints have
_SOUND = 1.2  # median distance in each camera, in errors that joints have: such cameras agree
_AS_GOOD = 0.85  # of that share: another camera's turn explains the misfit as well
_ROUNDS = 8
_FAR = 1.5  # in median distances: of a joint that counts half
_TURN_RAD = 0.05  # standard deviation of turns before anything is seen
_CAMERAS_SHARE = 0.2  # of what joints say: errors of one joint are alike from image to image


@dataclass(frozen=True)
class Turn:
    """A camera that should be turned, with ``rivals`` that may be it as well.

    ``share`` of the misfit that the turn takes away; ``before_px``, ``after_px``: median distance of the camera's joints.
    """

    camera: str
    rivals: tuple[str, ...]
    turned_deg: float
    share: float
    before_px: float
    after_px: float


@dataclass(frozen=True, eq=False)
class Comparison:
    """What people's joints say of cameras.

    Attributes
    ----------
    rig : the cameras, turned where a turn is told.
    turn : None: no camera is.
    sound : all cameras of ``rig`` have the joints where the others have them.
    apart_px : median distance from there, in the camera of ``rig`` in which it is largest.
    """

    rig: CameraRig
    turn: Turn | None
    sound: bool
    apart_px: float


def common_joints(cameras: Sequence[Camera], recordings: Mapping[str, CameraRecording]) -> tuple[CameraRig, np.ndarray] | None:
    """The joints of one person in the cameras that show one.

    Parameters
    ----------
    cameras : for the pixels of their images.
    recordings : camera -> what a detector has found in some of its images.

    Returns
    -------
    Rig of these cameras, and (n_images, n_joints, n_cameras, 3) u, v, score; None of fewer than `LEAST_CAMERAS`.
    """
    seeing = [camera for camera in cameras if any(look.people for look in recordings[camera.name].looks)]
    if len(seeing) < LEAST_CAMERAS:
        return None
    looks = [recordings[camera.name].looks for camera in seeing]
    moments = min(looks, key=len)
    if len(moments) < 2:
        return None
    apart = _MOST_APART * float(np.median(np.diff([look.stamp_ns for look in moments])))
    people: list[list[np.ndarray]] = [[] for _ in seeing]
    for moment in moments:
        for own, found in zip(looks, people, strict=True):
            nearest = min(own, key=lambda look: abs(look.stamp_ns - moment.stamp_ns))
            there = nearest.people if abs(nearest.stamp_ns - moment.stamp_ns) < apart else ()
            found.append(people_table(there))
    rig = CameraRig(tuple(seeing))
    try:
        return rig, collect_joints(rig, people)
    except CalibrationError:  # somebody else is seen by a camera, or a rig is so wrong that nobody is the same
        return None


def compared(rig: CameraRig, joints: np.ndarray) -> Comparison:
    """Whether cameras agree on joints, and which of them a turn would make agree with the others.

    Parameters
    ----------
    rig, joints : of `common_joints`.

    Returns
    -------
    What was found.
    """
    misfit = _Misfit(joints)
    before = misfit.distances(rig)
    turned = [_with_turn(rig, i, misfit.turn(rig, i)) for i in range(len(rig))]
    after, total = [misfit.distances(own) for own in turned], _misfit_of(before)
    shares = [1.0 - _misfit_of(own) / total if total > 0.0 else 0.0 for own in after]
    best = int(np.argmax(shares))
    was, becomes = _medians(before), _medians(after[best])
    told = shares[best] > _LEAST_SHARE and was[best] - becomes[best] > _LEAST_NEARER and becomes[best] < _SOUND
    if not told:
        return Comparison(rig, None, bool(was.max() < _SOUND), misfit.error_px * float(was.max()))
    name, camera = rig.names[best], rig.cameras[best]
    rivals = tuple(other for other, own in zip(rig.names, shares, strict=True) if own > _AS_GOOD * shares[best] and other != name)
    angle = so3.log(camera.T_world_cam[:3, :3].T @ turned[best].cameras[best].T_world_cam[:3, :3])
    px = misfit.error_px * np.array([was[best], becomes[best]])
    turn = Turn(name, rivals, math.degrees(float(np.linalg.norm(angle))), shares[best], *px)
    return Comparison(turned[best], turn, bool(becomes.max() < _SOUND), misfit.error_px * float(becomes.max()))


def _with_turn(rig: CameraRig, index: int, turn: np.ndarray) -> CameraRig:
    """``turn`` (3,) radians, in the camera's frame, of what it sees."""
    camera = rig.cameras[index]
    T = se3.from_rotation_translation(so3.exp(turn).T, np.zeros(3))
    cameras = (*rig.cameras[:index], replace(camera, T_world_cam=camera.T_world_cam @ T), *rig.cameras[index + 1 :])
    return replace(rig, cameras=cameras)


def _misfit_of(distances: np.ndarray) -> float:
    """Mean logarithm of squared distances: what is far off says little."""
    known = distances[np.isfinite(distances)]
    return float(np.log1p(known**2).mean()) if len(known) else 0.0


def _medians(distances: np.ndarray) -> np.ndarray:
    """(n_cameras,)."""
    known = (own[np.isfinite(own)] for own in distances.T)
    return np.array([float(np.median(own)) if len(own) else np.inf for own in known])


class _Misfit:
    """How little cameras agree on joints, (n_images, n_joints, n_cameras, 3)."""

    def __init__(self, joints: np.ndarray):
        self._pixels = joints[..., :2].reshape(-1, joints.shape[2], 2)
        self._sure = joints[..., 2].reshape(-1, joints.shape[2]) >= _SURE
        seen = joints[..., 2] >= _SURE
        sizes = [np.ptp(joints[k, seen[k, :, i], i, :2], axis=0).max() for k, i in np.argwhere(seen.any(axis=1))]
        self.error_px = _ERROR * float(np.median(sizes)) if sizes else 1.0

    def distances(self, rig: CameraRig) -> np.ndarray:
        """(n, n_cameras) of the joints in each camera from where all cameras have them, in errors that joints have; nan where a
        joint is not known."""
        _, valid, pixels = self._seen_by(rig, self._sure)
        return np.where(self._sure & valid[:, None], np.linalg.norm(pixels - self._pixels, axis=2), np.nan) / self.error_px

    def _seen_by(self, rig: CameraRig, sure: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points, which of them are known, and their pixels in all cameras, by the joints that are ``sure``."""
        models, Ts = [camera.model for camera in rig], np.array([camera.T_world_cam for camera in rig])
        points, valid = triangulate(models, Ts, self._pixels, sure.astype(np.float64))
        return points, valid, reproject(models, Ts, points)[0]

    def turn(self, rig: CameraRig, index: int) -> np.ndarray:
        """(3,) radians, by which what a camera sees of the others' joints is to be turned (Gauss-Newton, Cauchy weights)."""
        camera, others = rig.cameras[index], self._sure.copy()
        others[:, index] = False
        points, valid, _ = self._seen_by(rig, others)
        used = valid & self._sure[:, index]
        before, pixels, turn = se3.apply(camera.T_cam_world, points[used]), self._pixels[used, index], np.zeros(3)
        if not used.any():
            return turn
        for _ in range(_ROUNDS):
            at = before @ so3.exp(turn).T
            projected, D_point, _ = camera.model.project_with_jacobian(at)
            residuals = pixels - projected
            distances = np.linalg.norm(residuals, axis=1)
            sigma = max(1.2 * float(np.median(distances)), 0.5 * self.error_px)
            weights = _CAMERAS_SHARE / sigma**2 / (1.0 + (distances / (_FAR * sigma)) ** 2)
            jacobian = D_point @ -np.array([so3.hat(point) for point in at])
            H = np.einsum("nij,n,nik->jk", jacobian, weights, jacobian) + np.eye(3) / _TURN_RAD**2
            g = np.einsum("nij,n,ni->j", jacobian, weights, residuals) - turn / _TURN_RAD**2
            turn = so3.log(so3.exp(np.linalg.solve(H, g)) @ so3.exp(turn))
        return turn
