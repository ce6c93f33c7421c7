"""What speaks for a body in the first images: differences from the empty scene or, where nobody has seen that, what moves; then
the colors of what is found there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
import scipy  # imports its modules when they are first used

from ...camera.rig import Camera
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...observation.appearance import ColorModel, SceneModel, body_log_odds
from ...render.raycast.raycaster import render_mask

_SIGMA = 4.0  # gray levels that a pixel of the small empty scene varies by
_MOVED_SIGMA = 5.0  # the same between two images of one scene
_SHADOW = 0.65  # darkest; a wider range would take bare legs for the shadow that they cast
_REACH = 3.0  # log-odds are clipped there
_DENIED = 1.2  # nor those of the scene beyond this: a body may have the colors of what is behind it
_MOST_IMAGES = 9  # that are kept to see what moves
_RECENT = 2  # of them, the latest, in which a body is about where it is now
_BINS = 16  # a channel
_RARE = 2e-4  # density, of bins, of colors that have not been seen
_MOVED = 1.0  # log-odds of a pixel that has changed, besides what its color says
_EDGE = np.ones((3, 3), np.uint8)  # the model is not the body to the pixel
_NEAR = np.ones((25, 25), np.uint8)  # what is farther from the body, of some eighty pixels, may be another's
_FAR, _NEAR_PX = 1.5, 14.0  # what a pixel far from all that has changed loses, and from where on


class StartEvidence:
    """Maps of log-odds, one a camera.

    Parameters
    ----------
    cameras : the small cameras. backgrounds : camera name -> small background images.

    Attributes
    ----------
    colors : log-odds of every bin of colors for each camera, None where nothing has been learned.
    support : what is added to the log-odds by color (h, w), None for nothing.
    """

    def __init__(self, cameras: Sequence[Camera], backgrounds: Mapping[str, list[np.ndarray]]):
        self._cameras = tuple(cameras)
        self._scenes = [SceneModel.from_images(backgrounds[c.name], _SIGMA) if c.name in backgrounds else None for c in cameras]
        self.reset()

    def reset(self) -> None:
        """Forget all images."""
        self._past: list[Sequence[np.ndarray | None]] = []
        self._moves: dict[int, np.ndarray | None] = {}
        self.forget_colors()
        self.watched = 0

    @property
    def images(self) -> Sequence[np.ndarray | None]:
        """The latest small images."""
        return self._past[-1]

    @property
    def scene_known(self) -> bool:
        """Whether every camera that has an image has a background image as well."""
        return all(scene is not None or image is None for scene, image in zip(self._scenes, self.images, strict=True))

    def watch(self, images: Sequence[np.ndarray | None]) -> None:
        """Take in the small images of a set. The past is kept in steps that become longer with time."""
        self._past.append(list(images))
        self._moves = {}
        self.watched += 1
        if len(self._past) > _MOST_IMAGES:
            del self._past[1:-1:2]

    def forget_colors(self) -> None:
        """As before anything was learned."""
        self.colors: list[np.ndarray | None] = [None] * len(self._cameras)
        self.support: list[np.ndarray | None] = [None] * len(self._cameras)

    def maps(self) -> list[np.ndarray | None]:
        """Log-odds (h, w) float32 of the latest images; None for a camera that has none, or nothing to hold it against."""
        result: list[np.ndarray | None] = []
        for i, (image, scene) in enumerate(zip(self.images, self._scenes, strict=True)):
            if image is None:
                result.append(None)
            elif scene is not None:
                result.append(np.maximum(_against(image, scene), -_DENIED, dtype=np.float32))
            else:
                result.append(self._by_color(i, image))
        return result

    def sure(self) -> list[np.ndarray | None]:
        """Masks (h, w) bool of the latest images: what differs from the background or, where nobody has seen that, shows what
        no older image shows, in a color of the body's. The place that a body has left is new as well, but not in its colors."""
        return [self._surely(i, image) for i, image in enumerate(self.images)]

    def _surely(self, i: int, image: np.ndarray | None) -> np.ndarray | None:
        scene, ratios, past = self._scenes[i], self.colors[i], self._before(i, 1 + _RECENT)
        if image is None:
            return None
        if scene is not None:
            return _against(image, scene) > 0.0
        if ratios is None or not past:
            return None
        new = np.min([_changed(image, old) for old in past], axis=0) > 0.0
        return new & (_looked_up(ratios, color_bins(image)) > 0.0)

    def _before(self, i: int, latest: int) -> list[np.ndarray]:
        """The small images of camera ``i`` but for those of the ``latest`` sets."""
        return [old for images in self._past[:-latest] if (old := images[i]) is not None]

    def _by_color(self, i: int, image: np.ndarray) -> np.ndarray | None:
        if i not in self._moves:
            self._moves[i] = self._moved(i, image)
        moved, ratios = self._moves[i], self.colors[i]
        if ratios is None:
            return moved
        odds = _looked_up(ratios, color_bins(image)) + self._by_motion(i)
        support = self.support[i]
        return np.clip(odds if support is None else odds + support, -_REACH, _REACH, dtype=np.float32)

    def _by_motion(self, i: int) -> np.ndarray | float:
        """Log-odds (h, w) besides what colors say: of what has changed, and far from all that has."""
        moved = self._moves.get(i)
        if moved is None:
            return 0.0
        return _MOVED * (moved > 0.0) - _FAR * np.clip(_distance_to(moved > 0.0) / _NEAR_PX - 1.0, 0.0, 1.0)

    def maps_of_parts(self, parts: np.ndarray, scenes: Sequence[np.ndarray | None]) -> list[np.ndarray | None]:
        """Log-odds of parts against the scenes.

        Parameters
        ----------
        parts : (n, bins) densities of colors.
        scenes : (bins,) of each camera; None where it is not known.

        Returns
        -------
        (n, h, w) float32 of each camera, None without; where a background image is known, all parts have the same.
        """
        result: list[np.ndarray | None] = []
        for i, (odds, image, density) in enumerate(zip(self.maps(), self.images, scenes, strict=True)):
            if odds is None or image is None or density is None:
                result.append(None)
            elif self._scenes[i] is not None:
                result.append(np.repeat(odds[None], len(parts), axis=0))
            else:
                bins, besides = color_bins(image), self._by_motion(i)
                ratios = np.log((parts + _RARE) / (density + _RARE)).clip(-_REACH, _REACH).astype(np.float32)
                by_part = [_looked_up(ratio, bins) + besides for ratio in ratios]
                result.append(np.clip(by_part, -_REACH, _REACH, dtype=np.float32))
        return result

    def _moved(self, i: int, image: np.ndarray) -> np.ndarray | None:
        """Log-odds that a pixel shows what it did not show in all of the past; a shadow does not count."""
        past = self._before(i, 1)
        if not past:
            return None
        return np.max([_changed(image, old) for old in past], axis=0)

    def learn(self, inside: Sequence[np.ndarray], around: Sequence[np.ndarray]) -> None:
        """Learn colors from the latest images.

        The body is much the same from all sides, what is behind it does not.

        Parameters
        ----------
        inside, around : (h, w) weights of pixels on the body, and near it, of each camera.
        """
        own = {
            i: color_density(image, weights)
            for i, (image, weights) in enumerate(zip(self.images, inside, strict=True))
            if image is not None and weights.sum() > 1.0
        }
        pooled = sum(own.values(), np.zeros(_BINS**3)) / max(len(own), 1)
        self.colors = list(self.colors)
        for i, image in enumerate(self.images):
            if image is None or i not in own:
                continue
            ratio = np.log((0.6 * pooled + 0.4 * own[i] + _RARE) / (scene_density(image, around[i]) + _RARE))
            self.colors[i] = np.clip(ratio, -_REACH, _REACH).astype(np.float32)


class StartCoverage:
    """What a start leaves unexplained: pixels that are surely of the body, and lie beside it.

    The engine asks whether contours are found where a state has them. An arm that lies on the contour of the trunk has some, and
    nobody asks for the true arm beside it.

    Parameters
    ----------
    model, cameras : the body, and the small cameras.
    sure : (h, w) of each camera, what is surely of the body; None for a camera that says nothing.
    """

    def __init__(self, model: ArticulatedModel, cameras: Sequence[Camera], sure: Sequence[np.ndarray | None]):
        self._model, self._cameras, self._sure = model, tuple(cameras), list(sure)

    def uncovered(self, state: State) -> float:
        """What is surely of the body but beside ``state``, as a fraction of the pixels that this covers in the same images."""
        body, beside, covered = Configuration(self._model, state), 0, 0
        for camera, sure in zip(self._cameras, self._sure, strict=True):
            if sure is None:
                continue
            mask = (render_mask(body, camera) > 0).astype(np.uint8)
            near = (cv2.dilate(mask, _NEAR) > 0) & (cv2.dilate(mask, _EDGE) == 0)
            beside, covered = beside + int((sure & near).sum()), covered + int(mask.sum())
        return beside / max(covered, 1)


def _against(image: np.ndarray, scene: SceneModel) -> np.ndarray:
    return body_log_odds(image, (0, 0, image.shape[1], image.shape[0]), scene, ColorModel(), _SHADOW, _REACH)


def _changed(image: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Log-odds (h, w) that a pixel shows something else than ``before``."""
    scene = SceneModel.from_images([cv2.GaussianBlur(before, (3, 3), 0.7)], _MOVED_SIGMA)
    return _against(cv2.GaussianBlur(image, (3, 3), 0.7), scene)


def _looked_up(ratios: np.ndarray, bins: np.ndarray) -> np.ndarray:
    """Log-odds (h, w) of pixels by their ``bins`` of colors (h, w), smoothed; ``ratios`` are those of every bin."""
    return cv2.blur(ratios[bins], (3, 3))


def _distance_to(mask: np.ndarray) -> np.ndarray:
    """(h, w) pixels to the nearest one of ``mask`` that is more than a speck."""
    solid = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))
    return cv2.distanceTransform(1 - solid, cv2.DIST_L2, 3) if solid.any() else np.zeros(mask.shape, np.float32)


def color_bins(image: np.ndarray) -> np.ndarray:
    """(h, w) number of each pixel's bin of colors."""
    b, g, r = (image[..., c].astype(np.int64) * _BINS // 256 for c in range(3))
    return (b * _BINS + g) * _BINS + r


def scene_density(image: np.ndarray, around: np.ndarray) -> np.ndarray:
    """Density of the colors beside a body, mostly of those near it.

    Parameters
    ----------
    image, around : (h, w, 3) BGR uint8, and (h, w) weights of pixels near the body.

    Returns
    -------
    (bins^3,).
    """
    whole = color_density(image, np.ones(image.shape[:2]))
    return 0.75 * color_density(image, around) + 0.25 * whole if around.sum() > 1.0 else whole


def color_density(image: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Smoothed fraction of each bin of colors.

    Parameters
    ----------
    image, weights : (h, w, 3) BGR uint8, and (h, w) of its pixels.

    Returns
    -------
    (bins^3,).
    """
    counts = np.bincount(color_bins(image).ravel(), weights.ravel().astype(np.float64), _BINS**3)
    smooth = scipy.ndimage.gaussian_filter(counts.reshape(_BINS, _BINS, _BINS), 0.7, mode="constant").ravel()
    return smooth / max(float(smooth.sum()), 1e-9)
