"""How far colors agree, compared with a body that lies on its surroundings by chance.

Agreement is 1 - d / e, with d the mean squared difference of colors over a mask, and e the one to be expected if the mask's
colors met those of the surroundings at random. On a body of plain parts it is the share of the mask that lies where it should:
nearly 1 when all is right, nearly 0 on something else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ...camera.rig import Camera, CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...objective.per_camera import moved_state
from ...objective.points.photometry import Offsets, PhotometryOptions, features_of
from ...parallel import serial
from ...render.raycast.raycaster import render_color, render_labels
from ..modality import Images

_RING_PX = 24  # width of what is taken for the surroundings
_STEP = 2  # every second pixel is enough
_LEAST_PART = 200  # pixels of a part, over all cameras, below which nothing is said of it
_PLAIN = 0.5  # a part whose difference from the surroundings is below this fraction of the whole body's is not distinct from them
LEAST_CAMERA = 50


@dataclass(frozen=True, eq=False)
class ColorAgreement:
    """Squared differences, what they would be by chance, and pixels, each (n_cameras, n_shapes)."""

    squares: np.ndarray
    chance: np.ndarray
    pixels: np.ndarray

    @property
    def cameras(self) -> np.ndarray:
        """(n_cameras,), nan where a camera shows too little."""
        return _share(self.squares.sum(axis=1), self.chance.sum(axis=1), self.pixels.sum(axis=1) >= LEAST_CAMERA)

    @property
    def parts(self) -> np.ndarray:
        """(n_shapes,), nan where too little is seen, or where the surroundings have much the same color."""
        chance, pixels = self.chance.sum(axis=0), self.pixels.sum(axis=0)
        telling = chance / np.maximum(pixels, 1.0) >= _PLAIN * chance.sum() / max(pixels.sum(), 1.0)
        return _share(self.squares.sum(axis=0), chance, telling & (pixels >= _LEAST_PART))

    def of(self, shapes: np.ndarray) -> float:
        """Of some shapes (mask (n_shapes,)) together; infinite where too little of them is seen."""
        squares, chance = self.squares[:, shapes].sum(), self.chance[:, shapes].sum()
        return float(1.0 - squares / max(chance, 1e-6)) if self.pixels[:, shapes].sum() >= _LEAST_PART else float("inf")

    @property
    def median(self) -> float:
        """Of the median camera: some may be covered, and one may agree by chance."""
        seen = self.cameras[np.isfinite(self.cameras)]
        return float(np.median(seen)) if len(seen) else 0.0

    @property
    def camera_rms(self) -> np.ndarray:
        """(n_cameras,) gray levels, rms over pixels and channels; 0 where nothing is seen."""
        return np.sqrt(self.squares.sum(axis=1) / (3.0 * np.maximum(self.pixels.sum(axis=1), 1.0)))

    @property
    def rms(self) -> float:
        """Over all cameras."""
        return float(np.sqrt(self.squares.sum() / (3.0 * max(self.pixels.sum(), 1.0))))


def _share(squares: np.ndarray, chance: np.ndarray, seen: np.ndarray) -> np.ndarray:
    result = np.full(squares.shape, np.nan)
    result[seen] = 1.0 - squares[seen] / np.maximum(chance[seen], 1e-6)
    return result


def agreement_of(
    painted: Sequence[ArticulatedModel], rig: CameraRig, images: Images, state: State, options: PhotometryOptions,
    parallel: Callable[[Callable, list], list] = serial, offsets: Offsets | None = None,
) -> ColorAgreement:  # fmt: skip
    """Agreement of a body with the images.

    Parameters
    ----------
    painted : the model in the colors of each camera.
    rig : the cameras, with their lights.
    images : by camera.
    state : of the body.
    options : what of a color is compared.
    parallel : maps a function over cameras.
    offsets : of each camera the tangent (n_dof,) from ``state`` to where the body is when it exposes; None: where it says.

    Returns
    -------
    By camera and part.
    """
    offsets = offsets or [None] * len(rig)
    sums = np.zeros((3, len(rig), len(painted[0].shapes)))

    def look(i: int) -> None:
        image = images[i]
        if image is not None:
            _look(painted[i], rig.cameras[i], rig, image, moved_state(state, offsets[i]), options, sums[:, i])

    parallel(look, list(range(len(rig))))
    return ColorAgreement(*sums)


def _look(
    model: ArticulatedModel, camera: Camera, rig: CameraRig, image: np.ndarray, state: State, options: PhotometryOptions,
    sums: np.ndarray,
) -> None:  # fmt: skip
    configuration = Configuration(model, state)
    sight = render_labels(configuration, camera, _RING_PX)
    if sight is None:
        return
    (u0, v0, u1, v1), labels = sight
    view = render_color(configuration, camera, rig.lights, (u0, v0, u1, v1))
    near = cv2.dilate((labels > 0).view(np.uint8), np.ones((2 * _RING_PX + 1,) * 2, dtype=np.uint8)) > 0
    thin = np.s_[::_STEP, ::_STEP]
    labels, ring = labels[thin], (near & (labels == 0))[thin]
    target = features_of(image[v0:v1, u0:u1, ::-1][thin], options)
    around = target[ring].astype(np.float64)
    if not len(around) or not labels.any():
        return
    inside = labels > 0
    drawn, seen, which = features_of(view.rgb[thin][inside], options), target[inside], labels[inside].astype(np.int64) - 1
    mean, variance = around.mean(axis=0), around.var(axis=0).sum()
    weight, n = float(_STEP**2), sums.shape[1]
    sums[0] = weight * np.bincount(which, ((drawn - seen) ** 2).sum(axis=1), n)
    sums[1] = weight * np.bincount(which, ((drawn - mean) ** 2).sum(axis=1) + variance, n)
    sums[2] = weight * np.bincount(which, minlength=n)
