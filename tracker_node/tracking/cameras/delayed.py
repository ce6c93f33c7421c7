"""Cameras that run late or early by many image sets: rays to the points of a person meet where cameras saw the same moment.

The pose is not asked, since a camera that is a third of a second late has spoiled it: the rays of one point in two cameras pass
each other at a distance that is least between images of the same moment. How large it is on average, for every lag that may be,
adds up over some seconds. Delays of an image or two are found more sharply by `self_check`.
"""

from __future__ import annotations

import numpy as np

from ...camera.rig import CameraRig
from ...compiled.kernels import compiled
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...observation.image_set import CameraImage, ImageSet
from ...observation.keypoints.people import Person
from ..estimate import DELAYED, CameraFault

_BIN_NS = 33_333_333
_REACH = 36  # bins, of the longest lag either way
_SHORTEST = 3  # bins, of the shortest lag that is named
_MEMORY_NS = 2e9  # time constant of the sums
_EVERY_NS = 60_000_000  # from one set that is taken in to the next
_KEPT = _REACH * _BIN_NS // _EVERY_NS + 1  # of them are kept
_SURE = 0.5  # score of a point that is used
_FAR = 0.09  # distance of the rays of a point, in the extent of the body, that is no farther for being more
_LEAST_SINE = 0.2  # of the angle between two rays that say where a point is
_LEAST_POINTS = 60.0  # pairs of rays, that a mean is made of
_LEAST = 0.13  # mean distance of rays at the same stamp, in the farthest, below which cameras agree
_BETTER = 0.6  # mean distance at another lag, in that at the same stamp, of a camera that is late
_NAMED_SETS = 5  # in a row that find the same camera late by the same lag, from which on it is named


class DelayedCameras:
    """Collects how far the rays of cameras pass each other, lag by lag; deterministic in what it is given.

    Parameters
    ----------
    rig, model : as for the `Tracker`.

    Attributes
    ----------
    faults : cameras whose images are late, or early.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel):
        landmarks = Configuration(model, State.neutral(model)).landmarks_world
        self._rig, self._far_m = rig, _FAR * float(np.ptp(landmarks, axis=0).max(initial=0.0)) if len(landmarks) else 0.0
        self._centers = np.array([camera.center for camera in rig])
        self.reset()

    def reset(self) -> None:
        """Nothing has been seen."""
        n = len(self._rig)
        self._names: tuple[str, ...] = ()
        self._stamps = np.full((n, _KEPT), -1)  # of what is kept of each camera, the oldest overwritten first
        self._rays = np.zeros((n, _KEPT, 0, 3))  # unit, in the world; nan for a point that is not sure
        self._sums, self._counts = np.zeros((2, n, n, 2 * _REACH + 1))  # of the distances, by how much later the first camera is
        self._late: tuple[int, int, int] = -1, 0, 0  # camera that was found late last, lag, sets in a row
        self.faults: tuple[CameraFault, ...] = ()

    @property
    def far_off(self) -> list[int]:
        """Cameras that are left out: their images show another moment, and nobody else may be the cause."""
        return [self._rig.names.index(fault.camera) for fault in self.faults if not fault.rivals]

    def look(self, image_set: ImageSet) -> None:
        """Take in the points of one set, each at the stamp of the image that it was found in; not those of several persons.

        Parameters
        ----------
        image_set : whatever is believed of its cameras.
        """
        found = [_alone(image_set.get(camera.name)) for camera in self._rig]
        newest = self._stamps.max(axis=1)
        fresh = [each is not None and each[1] >= newest[i] + _EVERY_NS for i, each in enumerate(found)]
        names = {each[0].names for each, new in zip(found, fresh, strict=True) if each is not None and new}
        if len(names) != 1:
            return
        if names != {self._names}:
            self.reset()
            self._names, newest = names.pop(), self._stamps.max(axis=1)
            self._rays = np.zeros((*self._stamps.shape, len(self._names), 3))
        at = np.where(fresh, self._stamps.argmin(axis=1), -1)
        for i, (camera, each) in enumerate(zip(self._rig, found, strict=True)):
            if each is not None and fresh[i]:
                person, self._stamps[i, at[i]] = each
                rays, _ = camera.model.rays(person.pixels)
                self._rays[i, at[i]] = np.where((person.scores > _SURE)[:, None], rays @ camera.T_world_cam[:3, :3].T, np.nan)
        stamp_ns, last_ns = int(self._stamps.max()), int(newest.max())
        if last_ns >= 0:
            forgotten = np.exp(-(stamp_ns - last_ns) / _MEMORY_NS)
            self._sums *= forgotten
            self._counts *= forgotten
        _add_distances(self._rays, self._stamps, at, self._centers, self._far_m, self._sums, self._counts)
        self._judge(stamp_ns, max(_BIN_NS, (stamp_ns - last_ns) // 2))

    def _judge(self, stamp_ns: int, sigma_ns: int) -> None:
        """Name the camera whose rays meet those of all others at one other lag; of two cameras nobody knows which."""
        sums, counts = self._sums.sum(axis=1), self._counts.sum(axis=1)
        enough = counts >= _LEAST_POINTS
        means = np.where(enough, sums / np.where(enough, counts, 1.0), np.inf)
        at_once, best = means[:, _REACH], means.argmin(axis=1)
        least = means[np.arange(len(means)), best]
        far = np.isfinite(at_once) & (at_once > _LEAST * self._far_m) & (np.abs(best - _REACH) >= _SHORTEST)
        far &= (best > 0) & (best < 2 * _REACH)  # at the longest lag what is least may lie beyond
        shares = np.where(far, least / np.where(far, at_once, 1.0), np.inf)
        camera = int(shares.argmin())
        if shares[camera] > _BETTER:
            camera = -1
        lag = int(best[camera]) if camera >= 0 else 0
        last_camera, last_lag, in_a_row = self._late
        # Points of somebody else, or of an image that stays, are nearest to others at another lag with each new image.
        in_a_row = in_a_row + 1 if camera == last_camera and abs(lag - last_lag) <= 1 else 1
        self._late = camera, lag, in_a_row
        if in_a_row < _NAMED_SETS:
            return
        if camera < 0:
            self.faults = ()
            return
        name, size_ns = self._rig.names[camera], (lag - _REACH) * _BIN_NS
        since_ns = next((fault.since_ns for fault in self.faults if fault.camera == name), stamp_ns)
        rivals = tuple(other for other in self._rig.names if other != name) if len(self._rig) == 2 else ()
        self.faults = (CameraFault(name, DELAYED, 1e-9 * size_ns, 1e-9 * sigma_ns, since_ns, rivals),)


def _alone(image: CameraImage | None) -> tuple[Person, int] | None:
    """The only person in an image, with the stamp of the image that shows it; None where there is none, or several."""
    if image is None or image.people is None or len(image.people) != 1:
        return None
    return image.people[0], image.stamp_ns if image.people_stamp_ns is None else image.people_stamp_ns


@compiled
def _add_distances(rays, stamps, at, centers, far_m, sums, counts):
    """Add the distances between the rays of cameras at their indices ``at`` (c,) and those of the others, at any of theirs.

    Where ``at`` is -1 nothing is new. ``rays`` (c, n_kept, n_points, 3) and ``stamps`` (c, n_kept) are what is kept; ``sums`` and
    ``counts`` (c, c, n_lags).
    """
    n_cameras, n_kept, n_points = rays.shape[:3]
    for i in range(n_cameras):
        if at[i] < 0:
            continue
        for j in range(n_cameras):
            for k in range(n_kept):
                if j == i or stamps[j, k] < 0 or (k == at[j] and j < i):  # of two that are new, once
                    continue
                lag = int(np.rint((stamps[i, at[i]] - stamps[j, k]) / _BIN_NS))
                if abs(lag) > _REACH:
                    continue
                total, count = 0.0, 0
                for p in range(n_points):
                    a, b = rays[i, at[i], p], rays[j, k, p]
                    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
                    sine = np.sqrt(x * x + y * y + z * z)
                    if sine > _LEAST_SINE:  # not so of nan
                        apart = x * (centers[j, 0] - centers[i, 0]) + y * (centers[j, 1] - centers[i, 1])
                        apart += z * (centers[j, 2] - centers[i, 2])
                        total, count = total + min(abs(apart) / sine, far_m), count + 1
                sums[i, j, _REACH + lag] += total
                sums[j, i, _REACH - lag] += total
                counts[i, j, _REACH + lag] += count
                counts[j, i, _REACH - lag] += count
