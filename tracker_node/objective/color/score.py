"""Generate and test: how far the colors of a body, drawn in a state, are from those of the images (Trewartha, Yeadon & Knight).

The *mask* is every pixel that the drawn body covers, in all cameras together; the score is the rms difference of its colors, one
number over all pixels and channels. Pixels outside an image count neither way. What cannot be scored has the score infinity: no
optimizer takes it for a good one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import cv2
import numpy as np

from ...camera.model import NEAR
from ...camera.rig import CameraRig
from ...geometry import se3
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...parallel import Workers
from ...render.raycast.coefficients import N_COEFFICIENTS
from ..gains import squares_left
from . import drawing as kernel
from .any_shapes import score_with_cast
from .score_kernels import IMAGE_SQUARES, MODEL_SQUARES, N_LIGHT_WORK, N_TOTALS, PRODUCTS, form_of, score_states
from .views import EXCHANGE, ColorConstants, ColorViews, every_nth, is_pinhole, lying


@dataclass(frozen=True)
class ColorOptions:
    """What is compared.

    Attributes
    ----------
    representation : ``raw`` RGB; ``normalized`` by intensity, 255 c / (r + g + b), in which white light and shading cancel;
        ``blend``: the mean square of both, weighted.
    normalized_weight : fraction of the normalized part in a blend, 0..1.
    row_step : score every n-th row of the images only.
    min_pixels : a mask of fewer pixels, over all cameras, cannot be scored.
    gained : raw colors are compared with images in their best gains, see `gains`.
    cap : a pixel differs by no more than this, rms of its channels, gray levels. Where the mask overhangs the body, a lit side
        costs no more than a dark one then, and does not push the body away from the light. Not with gains.
    """

    representation: str = "raw"
    normalized_weight: float = 0.5
    row_step: int = 1
    min_pixels: int = 30
    gained: bool = False
    cap: float = math.inf

    def __post_init__(self) -> None:
        if self.gained and self.cap < math.inf:
            raise ValueError("expected no cap where images have gains: their squares are known of all pixels together only")


class Outcome(IntEnum):
    """Whether a state could be scored, and why not."""

    SCORED = 0
    EMPTY_MASK = 1
    BEHIND_CAMERA = 2


@dataclass(frozen=True, eq=False)
class ColorScore:
    """``rms`` of the color differences in gray levels (0..255), infinite unless ``outcome`` is SCORED; the same for each camera
    of the rig (nan where its mask is empty or it gave no image), and the pixels of its mask."""

    rms: float
    outcome: Outcome
    camera_rms: np.ndarray
    camera_pixels: np.ndarray


class ColorObjective:
    """Scores of a colored body against one image set at a time.

    Parameters
    ----------
    model, rig : body (with colors) and cameras (with lights).
    colors_rgb : (n_cameras, n_shapes, 3) in 0..255 of the shapes as each camera shows them under light of factor one, instead of
        those of the model.
    workers : threads that share states or cameras; None: two.
    """

    def __init__(
        self,
        model: ArticulatedModel,
        rig: CameraRig,
        options: ColorOptions | None = None,
        colors_rgb: np.ndarray | None = None,
        workers: Workers | None = None,
    ):
        self.model, self.options, self._given_colors = model, options or ColorOptions(), colors_rgb
        self.workers = workers or Workers(2)
        self._images: list[np.ndarray | None] = [None] * len(rig)
        self._rows = np.zeros(0, dtype=np.int64)
        self._filled: list[bool] = []
        self._steps: dict[int, ColorObjective] = {}
        self._stale = True
        self._whole_rig, self.rig = rig, every_nth(rig, 1, self.options.row_step)
        self._can_lie = np.array([is_pinhole(camera) for camera in self.rig])
        exchanged = [lying(camera) if can else camera for camera, can in zip(self.rig, self._can_lie, strict=True)]
        self._views = ColorViews([*self.rig, *exchanged])
        self._make_arguments()

    def _make_arguments(self) -> None:
        """Everything that the kernel takes and that no state changes."""
        model, rig, options = self.model, self.rig, self.options
        chain, views = model.chain, self._views
        constants = ColorConstants(model, rig, options.representation, options.normalized_weight, self._given_colors)
        weights = np.array([*constants.weights, 3.0 * options.cap**2], dtype=np.float32)
        self._constants = constants
        self._gained = options.gained and constants.weights[0] > 0.0
        self._form = form_of(
            constants.n_directional, constants.n_spots, constants.bent, constants.weights[0] > 0.0, constants.weights[1] > 0.0,
            self._gained, options.cap < math.inf,
        )  # fmt: skip
        self._chain = (chain.parents, chain.offsets, chain.axis_start, chain.axis_count, chain.directions)
        used = np.ones(len(model.shapes), dtype=np.bool_)
        self._shapes = (constants.kinds, constants.dims, constants.links, model.Ts_link_shape, used)
        self._pixels = (views.views, views.rays, views.planes)
        self._cameras = self._make_cameras()
        self._what = (constants.directed, weights)
        n, height = len(model.shapes), max(max(camera.model.width, camera.model.height) for camera in rig)
        largest = max((c.model.width + 2 * kernel.LANES) * (c.model.height + 2 * kernel.LANES) for c in rig)
        self._work = [
            (
                np.zeros((n, N_COEFFICIENTS), dtype=np.float32), np.zeros((n, kernel.N_SURFACE), dtype=np.float32),
                np.zeros((n, 4), dtype=np.int64), np.zeros((n, height, 2), dtype=np.int32),
                np.zeros(len(constants.directed) * N_LIGHT_WORK, dtype=np.float32),
                np.zeros(largest + kernel.LANES, dtype=np.int32),
            )
            for _ in range(self.workers.threads)
        ]  # fmt: skip

    def _make_cameras(self) -> tuple[np.ndarray, ...]:
        """What the kernel takes of the cameras: all of them, then all again with rows and columns exchanged."""
        views, constants = self._views, self._constants
        twice = [np.concatenate([a, a]) for a in (constants.gain, constants.base, constants.colors_rgb)]
        Ts_cam_world = np.concatenate([constants.Ts_cam_world, EXCHANGE @ constants.Ts_cam_world])
        return (views.params, views.limits, Ts_cam_world, *twice)

    def set_colors(self, colors_rgb: np.ndarray | None) -> None:
        """Other colors of the shapes, (n_cameras, n_shapes, 3); None: those of the model."""
        self._given_colors = colors_rgb
        self._constants.set_colors(self.model, self.rig, colors_rgb)
        self._cameras = self._make_cameras()
        for objective in self._steps.values():
            objective.set_colors(colors_rgb)

    @property
    def colors_rgb(self) -> np.ndarray:
        """(n_cameras, n_shapes, 3) as they are compared with the images."""
        return self._constants.colors_rgb

    def set_images(self, images: Sequence[np.ndarray | None]) -> None:
        """BGR images (h, w, 3) uint8 in the order of the rig; None for a camera that gave none."""
        if len(images) != len(self.rig):
            raise ValueError(f"expected {len(self.rig)} images, one of each camera (or None), got {len(images)}")
        for camera, image in zip(self._whole_rig, images, strict=True):
            shape = (camera.model.height, camera.model.width, 3)
            if image is not None and (image.shape != shape or image.dtype != np.uint8):
                raise ValueError(f"camera '{camera.name}': expected an image {shape} uint8, got {image.shape} {image.dtype}")
        self._images = list(images)
        self._stale = True
        for objective in self._steps.values():
            objective.set_images(images)

    def at_row_step(self, row_step: int) -> ColorObjective:
        """The same, on every n-th row of the images."""
        if row_step == self.options.row_step:
            return self
        if row_step not in self._steps:
            options = replace(self.options, row_step=row_step)
            self._steps[row_step] = ColorObjective(self.model, self._whole_rig, options, self._given_colors, self.workers)
            self._steps[row_step].set_images(self._images)
        return self._steps[row_step]

    def set_cap(self, cap: float) -> None:
        """Another cap, of an objective that has one."""
        self.options = replace(self.options, cap=cap)
        self._what[1][2] = 3.0 * cap**2
        for objective in self._steps.values():
            objective.set_cap(cap)

    def _fill(self, state: State) -> None:
        """Planar pixels are made when they are first asked for, of each camera in the one way that is needed.

        Kernels scan along rows and are quicker on few long ones than on many short ones: where the body stands upright in an
        image, its rows and columns are exchanged (not where rows are left out: then they are few already).
        """
        if not self._stale:
            return
        n, step = len(self.rig), self.options.row_step
        lies = self._stands_in_image(state) & self._can_lie & (self._constants.smooth and step == 1)
        thin = [image if step == 1 or image is None else np.ascontiguousarray(image[::step]) for image in self._images]
        upright = [None if lie else image for image, lie in zip(thin, lies, strict=True)]
        exchanged = [None if image is None or not lie else cv2.transpose(image) for image, lie in zip(thin, lies, strict=True)]
        self._views.fill([*upright, *exchanged])
        self._rows = np.array([i + n * int(lies[i]) for i in range(n) if thin[i] is not None], dtype=np.int64)
        self._filled = [image is not None for image in upright]
        self._stale = False

    def _stands_in_image(self, state: State) -> np.ndarray:
        """Whether the body reaches further down the image than across it, (n_cameras,)."""
        points = Configuration(self.model, state).Ts_world_shape[:, :3, 3]
        result = np.zeros(len(self.rig), dtype=bool)
        for i, camera in enumerate(self.rig):
            x, y, z = se3.apply(camera.T_cam_world, points).T
            z = np.maximum(z, NEAR)
            result[i] = np.ptp(y / z) * camera.model.K[1, 1] > 1.3 * np.ptp(x / z) * camera.model.K[0, 0]
        return result

    def _totals(self, states: Sequence[State]) -> np.ndarray:
        """Squares, pixels and the kernel's status, (n_states, n_cameras, 3)."""
        self._fill(states[0])
        n = len(self.rig)
        totals = np.zeros((len(states), 2 * n, N_TOTALS))
        if self._constants.smooth:
            roots = np.array([state.T_world_root for state in states])
            joints = np.array([state.joint_positions for state in states]).reshape(len(states), -1)
            self._share_out(roots, joints, totals)
        else:
            totals[:, self._rows, 2] = kernel.NOT_SMOOTH
        folded = totals[:, :n] + totals[:, n:]
        if (folded[:, :, 2] == kernel.NOT_SMOOTH).any():
            for k, i in np.argwhere(folded[:, :, 2] == kernel.NOT_SMOOTH):
                folded[k, i] = self._any_shapes(Configuration(self.model, states[k]), int(i))
        if self._gained:
            mm, products, squares = folded[..., MODEL_SQUARES], folded[..., PRODUCTS:IMAGE_SQUARES], folded[..., IMAGE_SQUARES:]
            folded[..., 0] += self._constants.weights[0] * squares_left(mm, products, squares)
        return folded[..., :3]

    def _share_out(self, roots: np.ndarray, joints: np.ndarray, totals: np.ndarray) -> None:
        """Run the kernel for smooth shapes, on several threads where there is enough to do."""

        def run(thread: int, states: slice, cameras: np.ndarray) -> None:
            score_states(
                self._form, self._chain, self._shapes, self._cameras, self._pixels, self._what, roots[states],
                joints[states], cameras, self._work[thread], totals[states],
            )  # fmt: skip

        n = self.workers.threads
        if n < 2 or len(roots) * len(self._rows) < 2:
            return run(0, slice(None), self._rows)
        if len(roots) >= n:
            ends = [len(roots) * k // n for k in range(n + 1)]
            parts = [(slice(ends[k], ends[k + 1]), self._rows) for k in range(n)]
        else:  # copies: rows apart are another type, for which the kernel would be compiled again
            parts = [(slice(None), self._rows[k::n].copy()) for k in range(n)]
        self.workers.map(lambda k: run(k, *parts[k]), range(n))

    def _any_shapes(self, configuration: Configuration, index: int) -> np.ndarray:
        """What one camera's kernel gives (`N_TOTALS`,), whatever the shapes."""
        camera, total = self.rig.cameras[index], np.zeros(N_TOTALS)
        if (se3.apply(camera.T_cam_world, configuration.Ts_world_shape[:, :3, 3])[:, 2] < NEAR).all():
            total[2] = kernel.BEHIND
            return total
        if not self._filled[index]:
            image = self._images[index]
            assert image is not None
            self._views.fill([image[:: self.options.row_step] if i == index else None for i in range(2 * len(self.rig))])
            self._filled[index] = True
        score_with_cast(configuration, camera, self._constants, index, self._views, self._what[1], self._gained, total)
        return total

    def evaluate(self, state: State) -> ColorScore:
        """The score of one state, camera by camera."""
        squares, pixels, outcome = self._totals([state])[0].T
        with np.errstate(divide="ignore", invalid="ignore"):
            camera_rms = np.where(pixels > 0, np.sqrt(squares / (3.0 * pixels)), np.nan)
        total = pixels.sum()
        if (outcome == kernel.BEHIND).any():
            return ColorScore(math.inf, Outcome.BEHIND_CAMERA, camera_rms, pixels.astype(np.int64))
        if total * self.options.row_step < self.options.min_pixels:
            return ColorScore(math.inf, Outcome.EMPTY_MASK, camera_rms, pixels.astype(np.int64))
        return ColorScore(math.sqrt(squares.sum() / (3.0 * total)), Outcome.SCORED, camera_rms, pixels.astype(np.int64))

    def score(self, state: State) -> float:
        """rms over all cameras; infinite where the state cannot be scored."""
        return float(self.scores([state])[0])

    def scores(self, states: Sequence[State]) -> np.ndarray:
        """(n,) of `score`."""
        if not states:
            return np.zeros(0)
        totals = self._totals(states)
        squares, pixels = totals[:, :, 0].sum(axis=1), totals[:, :, 1].sum(axis=1)
        enough = pixels * self.options.row_step >= max(self.options.min_pixels, 1)
        valid = enough & (totals[:, :, 2] != kernel.BEHIND).all(axis=1)
        result = np.full(len(states), math.inf)
        result[valid] = np.sqrt(squares[valid] / (3.0 * pixels[valid]))
        return result


class ColorCoverage:
    """How much of what a body's mask covers is the body (`ScoreObjective`), in gray levels squared, below zero.

    A pixel whose colors differ less than is probable of surroundings counts for the body, any other as much against it at most:
    where a mean over the mask is as good for a body that hides within its own color, this is best where all of that is covered.

    Parameters
    ----------
    objective : with a cap, which is set.
    least : squared difference of a pixel, sum over its channels, that is as probable of either.
    """

    def __init__(self, objective: ColorObjective, least: float):
        objective.set_cap(math.sqrt(2.0 * least / 3.0))
        self._objective, self._least = objective, least

    def score(self, state: State) -> float:
        """Of one state."""
        return float(self.scores([state])[0])

    def scores(self, states: Sequence[State]) -> np.ndarray:
        """(n,) of `score`; a camera that has the body behind itself says nothing, and it is infinite where all have."""
        totals = self._objective._totals(states)
        behind = totals[:, :, 2] == kernel.BEHIND
        squares = np.where(behind, 0.0, totals[:, :, 0] - self._least * totals[:, :, 1])
        return np.where(behind.all(axis=1), math.inf, squares.sum(axis=1) * self._objective.options.row_step)

    def at_row_step(self, row_step: int) -> ColorCoverage:
        """On every n-th row."""
        return ColorCoverage(self._objective.at_row_step(row_step), self._least)
