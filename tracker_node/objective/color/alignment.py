"""Direct photometric alignment: the color score as a least-squares problem with analytic derivatives, on an image pyramid.

The same residuals as `score`, summed over the mask; see `alignment_kernels` for how they change with the state. On coarse
levels colors reach further, so that a body a few pixels of that level off is found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...parallel import Workers
from ...render.raycast.coefficients import N_COEFFICIENTS
from ..contour_residual import assemble
from ..gains import gains_of, squares_left
from ..normal_equations import NormalEquations
from . import alignment_kernels as sums
from . import drawing as kernel
from .any_shapes import linearize_with_cast
from .score_kernels import form_of
from .views import ColorConstants, ColorViews, every_nth

_WORTH_THREADS = 8000  # pixels: with fewer, handing work to a thread takes longer than the work


@dataclass(frozen=True)
class PhotometricOptions:
    """What is compared, and how.

    Attributes
    ----------
    representation, normalized_weight, min_pixels, gained : as in `score.ColorOptions`.
    levels : of the pyramid; level 0 is the image, each next one has half its width and height.
    """

    representation: str = "raw"
    normalized_weight: float = 0.5
    min_pixels: int = 30
    levels: int = 4
    gained: bool = False


class PhotometricObjective:
    """Color residuals of a body against one image set at a time, level by level.

    Parameters
    ----------
    model, rig, colors_rgb, workers : as of `score.ColorObjective`.
    """

    def __init__(
        self,
        model: ArticulatedModel,
        rig: CameraRig,
        options: PhotometricOptions | None = None,
        colors_rgb: np.ndarray | None = None,
        workers: Workers | None = None,
    ):
        self.model, self.rig, self.options = model, rig, options or PhotometricOptions()
        self.colors_rgb = colors_rgb
        self.n_levels = self.options.levels
        self.workers = workers or Workers(2)
        self._levels: list[_Level] = [_Level(self, every_nth(rig, 2**k, 2**k)) for k in range(self.n_levels)]
        self._pyramid: list[list[np.ndarray | None]] = [[None] * len(rig)]

    def set_images(self, images: Sequence[np.ndarray | None]) -> None:
        """BGR images (h, w, 3) uint8 in the order of the rig; None for a camera that gave none."""
        self._pyramid = [list(images)]
        for level in self._levels:
            level.stale = True

    def set_colors(self, colors_rgb: np.ndarray | None) -> None:
        """Other colors of the shapes, (n_cameras, n_shapes, 3); None: those of the model."""
        self.colors_rgb = colors_rgb
        for level in self._levels:
            level.constants.set_colors(self.model, self.rig, colors_rgb)

    def _images(self, level: int) -> list[np.ndarray | None]:
        while len(self._pyramid) <= level:
            finer = self._pyramid[-1]
            self._pyramid.append(self.workers.map(lambda image: None if image is None else cv2.pyrDown(image), finer))
        return self._pyramid[level]

    def at_level(self, level: int) -> LevelObjective:
        """The least-squares problem on one level; 0 is the finest."""
        here = self._levels[level]
        if here.stale:
            here.fill(self._images(level))
        return LevelObjective(here)


class _Level:
    """Everything of one level that no state changes, and work space."""

    def __init__(self, owner: PhotometricObjective, rig: CameraRig):
        self.owner, self.rig, self.stale = owner, rig, True
        self.views = ColorViews(rig.cameras)
        options, model = owner.options, owner.model
        self.constants = ColorConstants(model, rig, options.representation, options.normalized_weight, owner.colors_rgb)
        constants = self.constants
        self.weights = np.array(constants.weights, dtype=np.float32)
        self.gained = options.gained and constants.weights[0] > 0.0
        self.form = form_of(
            constants.n_directional, constants.n_spots, False, constants.weights[0] > 0, constants.weights[1] > 0, self.gained
        )
        n = len(model.shapes)
        self.used = np.ones(n, dtype=np.bool_)
        self.work = [
            (
                np.zeros((n, N_COEFFICIENTS), dtype=np.float32), np.zeros((n, kernel.N_SURFACE), dtype=np.float32),
                np.zeros((n, 4), dtype=np.int64), np.zeros((n, camera.model.height, 2), dtype=np.int32),
                np.zeros(constants.directed.size, dtype=np.float32),
                np.zeros((camera.model.width + 2 * kernel.LANES) * camera.model.height + kernel.LANES, dtype=np.int32),
                np.zeros(sums.N_SUMS * kernel.LANES, dtype=np.float32),
            )
            for camera in rig
        ]  # fmt: skip
        self.sums = np.zeros((len(rig), n, sums.N_SUMS))
        self.seen: list[int] = []

    def fill(self, images: Sequence[np.ndarray | None]) -> None:
        self.views.fill(images)
        self.seen = [i for i, image in enumerate(images) if image is not None]
        self.stale = False

    def camera_sums(self, index: int, configuration: Configuration, Ts_world_shape: np.ndarray, gains: np.ndarray) -> None:
        """Fill the sums of one camera; ``gains`` (n_cameras, 3) float32 of the images."""
        constants, views = self.constants, self.views
        outcome = kernel.NOT_SMOOTH
        if constants.vectorized:
            outcome = sums.linearize_camera(
                self.form,
                (constants.kinds, constants.dims, self.used, constants.colors_rgb[index]),
                (
                    views.params[index], views.limits[index], constants.Ts_cam_world[index], constants.gain[index],
                    constants.base[index],
                ),
                (views.views[index], views.rays, views.planes),
                constants.directed, self.weights, gains[index], Ts_world_shape, self.work[index], self.sums[index],
            )  # fmt: skip
        if outcome == kernel.NOT_SMOOTH:
            linearize_with_cast(
                configuration, self.rig.cameras[index], constants, index, views, self.weights, gains[index], self.gained,
                self.sums[index],
            )  # fmt: skip


class LevelObjective:
    """One level of a `PhotometricObjective` against its present images.

    The mask changes with the state. A cost that is a plain sum would reward a body for hiding, so it is the mean over the mask
    times the number of pixels that the mask had at first.
    """

    def __init__(self, level: _Level):
        self._level = level
        self._pixels = 0.0
        self._gains = np.ones((len(level.rig), 3), dtype=np.float32)  # as of the state before: near the best there is

    def _sum(self, configuration: Configuration) -> float:
        """Fill the sums of all cameras; the squares that remain when images have their best gains."""
        level, workers = self._level, self._level.owner.workers
        Ts_world_shape, gains = np.ascontiguousarray(configuration.Ts_world_shape), self._gains
        if self._pixels > _WORTH_THREADS:
            workers.map(lambda i: level.camera_sums(i, configuration, Ts_world_shape, gains), level.seen)
        else:
            for i in level.seen:
                level.camera_sums(i, configuration, Ts_world_shape, gains)
        squares = sum(float(level.sums[i, :, sums.SQUARES].sum()) for i in level.seen)
        if not level.gained:
            return squares
        found = level.sums[level.seen].sum(axis=1)
        mm, products = found[:, sums.SUM_MODEL_SQUARES], found[:, sums.SUM_PRODUCTS : sums.SUM_IMAGE_SQUARES]
        of_image, used = found[:, sums.SUM_IMAGE_SQUARES : sums.N_SUMS], self._gains[level.seen].astype(np.float64)
        self._gains[level.seen] = gains_of(products, of_image)
        before = float((mm + np.sum(used * (used * of_image - 2.0 * products), axis=1)).sum())
        return squares + level.constants.weights[0] * (float(squares_left(mm, products, of_image).sum()) - before)

    def linearize(self, state: State) -> NormalEquations:
        """Normal equations in gray levels squared; ``count`` is the number of residuals. No mask costs infinity."""
        level, owner = self._level, self._level.owner
        configuration, chain = Configuration(owner.model, state), owner.model.chain
        first = not self._pixels
        squares = self._sum(configuration)
        if first and level.gained:
            squares = self._sum(configuration)
        normal, gradient = np.zeros((len(chain.links), 6, 6)), np.zeros((len(chain.links), 6))
        pixels = 0.0
        for i in level.seen:
            sums.add_to_links(level.sums[i], owner.model.shape_links, level.constants.Ts_cam_world[i], normal, gradient)
            pixels += float(level.sums[i, :, sums.PIXELS].sum())
        H, g = np.zeros((chain.n_dof, chain.n_dof)), np.zeros(chain.n_dof)
        assemble(normal, gradient, chain.link_moved_by, configuration.twists, H, g)
        if pixels < max(owner.options.min_pixels / 4.0**self.number, 1.0):
            return NormalEquations(H, g, math.inf, 0)
        self._pixels = self._pixels or pixels
        scale = self._pixels / pixels
        return NormalEquations(scale * H, scale * g, scale * squares, int(3 * pixels))

    def camera_equations(self, state: State) -> list[None]:
        """Gray levels of cameras are not compared."""
        return [None] * len(self._level.rig)

    @property
    def number(self) -> int:
        """Of this level, 0 being the finest."""
        return self._level.owner._levels.index(self._level)
