"""Cameras that have been bumped: all that stood still in their picture stands elsewhere, turned by as much.

Corners of what is not the body are followed from a first image of each camera. Those that have stood still for some looks are
the room's. As long as some of them still do, the camera does; where most of them, all over the picture, have made the same turn,
the camera has made it. What the body says of a camera (`self_check`) takes seconds, and clothes say less than they seem to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from ...camera.rig import Camera, CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State, configured
from ...observation.image_set import CameraImage, ImageSet
from ...observation.keypoints.people import moved_in_image
from ...render.contour.generators import world_spheres
from ...render.shape_arrays import bounding_spheres
from ..estimate import BUMPED, CameraFault

_WIDTH = 240  # pixels, to which images are reduced: a third of a degree is one of them
_BROAD_PX, _COARSE, _DARK = 6.0, 4, 8.0  # of what a pixel is compared with, by coarser ones; gray levels that say nothing
_EVEN = 128.0  # gray level of a pixel that is as its surroundings
_CORNERS, _APART_PX = 80, 8.0
_WINDOW, _HALVED = (15, 15), 1  # pixels about a corner; how often they are, at the first
_STILL_PX, _SAME_PX = 0.35, 0.5  # of the reduced image: a corner has not moved; it has moved as others have
_PROVED = 3  # looks in which a corner has stood still, from which on it is of the room
_LEAST, _MOST_STILL, _AGREE, _SPREAD = 12, 0.15, 0.5, 0.25  # corners; shares of them; share of the picture that they span
_FARTHEST = np.radians(3.0)  # beyond which too much of an image would be missing
_ZOOMED = 0.03  # a lens that zooms by more is not one that was turned
_BODY = 1.3  # times as large a body's parts may be
_NAMED_LOOKS = 2  # in a row, in which a camera stays turned: who walks off, with nothing but a plain wall behind, does not stay
_SPACING_NS = 30_000_000  # from one look to the next, whichever camera's turn it is: fast cameras are not shaken faster
_RENEWED_NS, _RENEWED_LOOKS = 10_000_000_000, 10  # after which, where daylight has gone on, another image is the first...
_STANDS = 0.2  # ...of a camera that has turned by less than so much of the least turn that is named


@dataclass(eq=False)
class _View:
    """What one camera has shown.

    ``first``: reduced image, with ``corners`` (n, 2), of ``since_ns``. ``proved``: (n,) how often each has stood still. ``turn``
    of the last of all ``looked``, and its standard deviation ``sigma``, radians, as an ``affine`` (2, 3) of pixels of the whole
    image; in how many ``looks`` it was one, since when.
    """

    first: np.ndarray
    corners: np.ndarray
    since_ns: int
    proved: np.ndarray = field(init=False)
    turn: float = 0.0
    sigma: float = 0.0
    affine: np.ndarray = field(default_factory=lambda: np.eye(2, 3))
    looks: int = 0
    turned_ns: int = 0
    looked: int = 0

    def __post_init__(self) -> None:
        self.proved = np.zeros(len(self.corners), dtype=np.int64)

    @property
    def is_named(self) -> bool:
        return self.looks >= _NAMED_LOOKS

    def is_worth_a_look(self, stamp_ns: int) -> bool:
        """A plain picture is looked at now and then."""
        return len(self.corners) > 0 or stamp_ns - self.since_ns > _RENEWED_NS


class BumpedCameras:
    """Follows what stands still in each camera's picture; deterministic in what it is given.

    Parameters
    ----------
    rig, model : as for the `Tracker`.
    angle_rad : a camera that is turned by more is named.

    Attributes
    ----------
    faults : after the last set.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel, angle_rad: float):
        self._rig, self._model, self._angle = rig, model, angle_rad
        self._spheres = bounding_spheres(model)
        self.reset()

    def reset(self) -> None:
        """Nothing has been shown."""
        self._views: list[_View | None] = [None] * len(self._rig)
        self._turn, self._looked_ns = 0, -(2**62)
        self.faults: tuple[CameraFault, ...] = ()

    @property
    def far_off(self) -> list[int]:
        """Indices of the cameras that are turned by so much that their images cannot be turned back."""
        return [i for i, view in enumerate(self._views) if view is not None and view.is_named and view.turn > _FARTHEST]

    def turned_back(self, image_set: ImageSet) -> ImageSet:
        """Image sets as the cameras would show them, had none been bumped.

        Parameters
        ----------
        image_set : as they show them.

        Returns
        -------
        Of cameras that are not too far off.
        """
        bumped = {name: view.affine for name, view in zip(self._rig.names, self._views, strict=True)
                  if view is not None and view.is_named and view.turn <= _FARTHEST}  # fmt: skip
        if not bumped:
            return image_set
        images = (_moved(image, bumped[image.camera]) if image.camera in bumped else image for image in image_set.images)
        return replace(image_set, images=tuple(images))

    def look(self, stamp_ns: int, images: Sequence[np.ndarray | None], state: State) -> None:
        """Take in one set: one camera, in turn, and those that may have been turned.

        Parameters
        ----------
        stamp_ns : of the set.
        images : pixels per camera of the rig, None where the set has none.
        state : of the body.
        """
        turn = -1
        if stamp_ns - self._looked_ns >= _SPACING_NS:
            turn = self._turn = (self._turn + 1) % len(images)
            self._looked_ns = stamp_ns
        for i, (image, view) in enumerate(zip(images, self._views, strict=True)):
            if image is not None and (view is None or view.looks == 1 or (i == turn and view.is_worth_a_look(stamp_ns))):
                self._look_at(i, stamp_ns, image, state)
        names = self._rig.names
        self.faults = tuple(
            CameraFault(name, BUMPED, view.turn, view.sigma, view.turned_ns)
            for name, view in zip(names, self._views, strict=True) if view is not None and view.is_named
        )  # fmt: skip

    def _look_at(self, i: int, stamp_ns: int, image: np.ndarray, state: State) -> None:
        camera, view, (now, scale) = self._rig.cameras[i], self._views[i], _reduced(image)
        if view is None or not len(view.corners):
            self._views[i] = self._begun(camera, stamp_ns, now, scale, state)
            return
        view.looked += 1
        found, still, room = self._followed(camera, view, now, scale, state, view.corners)
        n_room, n_still = int(room.sum()), int((room & still).sum())
        if found is None and n_still <= _MOST_STILL * n_room and view.proved.max() >= _PROVED:  # farther than flow reaches
            shift, _ = cv2.phaseCorrelate(view.first.astype(np.float32), now.astype(np.float32))
            found, *_ = self._followed(camera, view, now, scale, state, view.corners + np.array(shift, np.float32))
        if found is not None and found[0] > self._angle and n_still <= _MOST_STILL * n_room:
            view.turned_ns = view.turned_ns if view.looks else stamp_ns
            by = scale * (found[2] - view.affine) @ (*camera.model.K[:2, 2], 1.0)
            stays = view.is_named or np.abs(by).max() < _SAME_PX
            view.looks, (view.turn, view.sigma, view.affine) = view.looks + 1 if stays else 1, found
            return
        if view.is_named and n_still < _AGREE * max(n_room, _LEAST):
            return  # something is in the way
        view.looks = 0
        view.proved[still] += 1
        n, past = len(view.corners), stamp_ns - view.since_ns > _RENEWED_NS and view.looked >= _RENEWED_LOOKS
        if past and (n < _LEAST or still.sum() < _AGREE * n) and (found is None or found[0] < _STANDS * self._angle):
            self._views[i] = self._begun(camera, stamp_ns, now, scale, state)

    def _followed(
        self, camera: Camera, view: _View, now: np.ndarray, scale: float, state: State, expected: np.ndarray
    ) -> tuple[tuple[float, float, np.ndarray] | None, np.ndarray, np.ndarray]:
        """The turn of `_turn_of`, and masks (n,) of the corners that stand still, and of those that are of the room."""
        moved, ok, _ = cv2.calcOpticalFlowPyrLK(
            view.first, now, view.corners[:, None], expected[:, None].copy(), winSize=_WINDOW, maxLevel=_HALVED,
            flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        )  # fmt: skip
        moved = moved[:, 0]
        hidden = self._on_body(camera, scale, np.concatenate([view.corners, moved]), state).reshape(2, -1).any(axis=0)
        usable = (ok[:, 0] > 0) & ~hidden
        still, room = usable & (np.linalg.norm(moved - view.corners, axis=1) < _STILL_PX), usable & (view.proved >= _PROVED)
        found = _turn_of(camera, scale, view.corners[room], moved[room], now.shape) if room.sum() >= _LEAST else None
        return found, still, room

    def _begun(self, camera: Camera, stamp_ns: int, now: np.ndarray, scale: float, state: State) -> _View:
        corners = cv2.goodFeaturesToTrack(now, _CORNERS, 0.02, _APART_PX)
        corners = np.zeros((0, 2), np.float32) if corners is None else corners[:, 0]
        return _View(now, corners[~self._on_body(camera, scale, corners, state)], stamp_ns)

    def _on_body(self, camera: Camera, scale: float, pixels: np.ndarray, state: State) -> np.ndarray:
        """(n,) mask of pixels (n, 2) of the reduced image that may show the body."""
        spheres = np.empty_like(self._spheres)
        world_spheres(configured(self._model, state).Ts_world_shape, self._spheres, spheres)
        middles, seen = camera.project(spheres[:, :3])
        depths = np.maximum((spheres[:, :3] - camera.center) @ camera.T_world_cam[:3, 2], 1e-3)
        radii = _BODY * scale * float(camera.model.K[0, 0]) * spheres[:, 3] / depths
        apart = np.linalg.norm(pixels[:, None] - scale * middles[None], axis=2)
        return ((apart < radii) & seen).any(axis=1)


def _moved(image: CameraImage, affine: np.ndarray) -> CameraImage:
    """The image that has the pixel that was at ``affine`` (2, 3) of a place at that place, and people with it."""
    flags, size = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, (image.pixels.shape[1], image.pixels.shape[0])
    pixels = cv2.warpAffine(image.pixels, affine, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    back = cv2.invertAffineTransform(affine)
    people = None if image.people is None else tuple(moved_in_image(person, back, size) for person in image.people)
    return replace(image, pixels=pixels, people=people)


def _reduced(image: np.ndarray) -> tuple[np.ndarray, float]:
    """An (h, w, 3) or (h, w) image small, gray, and whatever the light: in shares of what is about each pixel, uint8; and by how
    much smaller. Whole factors are far faster, and of a large image some pixels do."""
    factor = max(round(image.shape[1] / _WIDTH), 1)
    step = max(factor // 4, 1)
    per_pixel = factor // step
    height, width = (max(n // (per_pixel * step), 1) for n in image.shape[:2])
    thinned = image[: height * per_pixel * step, : width * per_pixel * step]
    if step > 1:
        thinned = cv2.resize(thinned, (width * per_pixel, height * per_pixel), interpolation=cv2.INTER_NEAREST)
    gray = thinned if thinned.ndim == 2 else cv2.cvtColor(thinned, cv2.COLOR_BGR2GRAY)
    small = cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA)
    coarse = cv2.resize(small, (max(width // _COARSE, 1), max(height // _COARSE, 1)), interpolation=cv2.INTER_AREA)
    about = cv2.resize(cv2.GaussianBlur(coarse, (0, 0), _BROAD_PX / _COARSE), (width, height)).astype(np.float32) + _DARK
    return cv2.divide(small.astype(np.float32), about, scale=_EVEN, dtype=cv2.CV_8U), 1.0 / (per_pixel * step)


def _turn_of(
    camera: Camera, scale: float, before: np.ndarray, now: np.ndarray, shape: tuple[int, ...]
) -> tuple[float, float, np.ndarray] | None:
    """The turn, radians, that most of the corners (n, 2) have made, all over a picture of (h, w), and its standard deviation; the
    same as affine (2, 3) of pixels of the whole image.

    None where they do not agree on one.
    """
    affine, inliers = cv2.estimateAffinePartial2D(before, now, ransacReprojThreshold=_SAME_PX)
    agree = inliers[:, 0] > 0 if affine is not None else np.zeros(len(before), dtype=np.bool_)
    if agree.sum() < max(_LEAST, _AGREE * len(before)):
        return None
    spread = cv2.contourArea(cv2.convexHull(before[agree]))
    if spread < _SPREAD * shape[0] * shape[1] or abs(np.hypot(affine[0, 0], affine[1, 0]) - 1.0) > _ZOOMED:
        return None
    A, K = affine[:, :2], camera.model.K
    half = 0.5 * (scale - 1.0)  # from a pixel's middle to that of its first part
    whole = np.column_stack([A, (A @ (half, half) + affine[:, 2] - half) / scale])
    shift = A @ K[:2, 2] + whole[:, 2] - K[:2, 2]
    off = now[agree] - before[agree] @ A.T - affine[:, 2]
    sigma = np.sqrt((off**2).sum(axis=1).mean() / agree.sum()) / (scale * K[0, 0])
    return float(np.hypot(np.linalg.norm(shift) / K[0, 0], np.arctan2(A[1, 0], A[0, 0]))), float(sigma), whole
