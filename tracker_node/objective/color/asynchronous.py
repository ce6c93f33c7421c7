"""One score, and one photometric alignment, of cameras that do not expose at one time.

A camera that exposes dt later sees the body where it has moved on to: it is scored at ``state.retract(dt * velocity)``. The
velocity is given, from the prediction or from the images before and after; it is not estimated here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ..normal_equations import LeastSquaresObjective, NormalEquations
from .alignment import PhotometricObjective, PhotometricOptions
from .score import ColorObjective, ColorOptions, ColorScore, Outcome

T = TypeVar("T", ColorObjective, PhotometricObjective)


class _Delayed(Generic[T]):
    """Objectives of the cameras that expose equally late, seconds, with their indices in the rig.

    ``velocity`` (n_dof,), in the state's tangent per second, may be set at any time; None: the body rests.
    """

    def __init__(self, rig: CameraRig, late_s: Sequence[float], make: Callable[[CameraRig, list[int]], T]):
        if len(late_s) != len(rig):
            raise ValueError(f"expected {len(rig)} delays, one of each camera, got {len(late_s)}")
        self.velocity: np.ndarray | None = None
        self._parts: list[tuple[float, list[int], T]] = []
        for late in sorted(set(late_s)):
            cameras = [i for i, value in enumerate(late_s) if value == late]
            self._parts.append((late, cameras, make(rig.subset([rig.names[i] for i in cameras]), cameras)))

    def set_images(self, images: Sequence[np.ndarray | None]) -> None:
        """BGR images (h, w, 3) uint8 in the order of the rig; None for a camera that gave none."""
        for _, cameras, objective in self._parts:
            objective.set_images([images[i] for i in cameras])


def _seen(state: State, late_s: float, velocity: np.ndarray | None) -> State:
    """Where the body is ``late_s`` after ``state``."""
    return state if velocity is None else state.retract(late_s * velocity)


def _of(colors_rgb: np.ndarray | None, cameras: list[int]) -> np.ndarray | None:
    return None if colors_rgb is None else np.asarray(colors_rgb)[cameras]


class AsynchronousObjective(_Delayed[ColorObjective]):
    """The `ColorObjective` of a rig whose cameras expose ``late_s`` (n_cameras,) seconds after the state that is scored."""

    def __init__(
        self, model: ArticulatedModel, rig: CameraRig, late_s: Sequence[float], options: ColorOptions | None = None,
        colors_rgb: np.ndarray | None = None,
    ):  # fmt: skip
        self.rig, self.options = rig, options or ColorOptions()
        each = replace(self.options, min_pixels=1)  # how many are too few is a matter of all cameras together
        super().__init__(rig, late_s, lambda some, cameras: ColorObjective(model, some, each, _of(colors_rgb, cameras)))

    def evaluate(self, state: State) -> ColorScore:
        """The score of one state, camera by camera."""
        return self._evaluate(state, self.options.row_step)

    def _evaluate(self, state: State, row_step: int) -> ColorScore:
        camera_rms, pixels = np.full(len(self.rig), np.nan), np.zeros(len(self.rig), dtype=np.int64)
        outcome = Outcome.SCORED
        for late_s, cameras, objective in self._parts:
            score = objective.at_row_step(row_step).evaluate(_seen(state, late_s, self.velocity))
            camera_rms[cameras], pixels[cameras] = score.camera_rms, score.camera_pixels
            if score.outcome == Outcome.BEHIND_CAMERA:
                outcome = score.outcome
        total = int(pixels.sum())
        if outcome == Outcome.SCORED and total * row_step < max(self.options.min_pixels, 1):
            outcome = Outcome.EMPTY_MASK
        if outcome != Outcome.SCORED:
            return ColorScore(math.inf, outcome, camera_rms, pixels)
        squares = float((np.where(pixels > 0, camera_rms, 0.0) ** 2 * pixels).sum())
        return ColorScore(math.sqrt(squares / total), outcome, camera_rms, pixels)

    def score(self, state: State) -> float:
        """rms over all cameras; infinite where the state cannot be scored."""
        return self.evaluate(state).rms

    def scores(self, states: Sequence[State]) -> np.ndarray:
        """(n,) of `score`."""
        return np.array([self.score(state) for state in states])

    def at_row_step(self, row_step: int) -> AsynchronousObjective | _Decimated:
        """The same images and velocity, every n-th image row only."""
        return self if row_step == self.options.row_step else _Decimated(self, row_step)


@dataclass(frozen=True)
class _Decimated:
    """A `AsynchronousObjective` on every n-th row."""

    whole: AsynchronousObjective
    row_step: int

    def score(self, state: State) -> float:
        return self.whole._evaluate(state, self.row_step).rms

    def scores(self, states: Sequence[State]) -> np.ndarray:
        return np.array([self.score(state) for state in states])

    def at_row_step(self, row_step: int) -> AsynchronousObjective | _Decimated:
        return self.whole.at_row_step(row_step)


class AsynchronousPhotometricObjective(_Delayed[PhotometricObjective]):
    """The `PhotometricObjective` of a rig whose cameras expose ``late_s`` (n_cameras,) seconds after the state.

    How the velocity's own direction turns with the state is left out of the derivatives: in a few milliseconds that is nothing.
    """

    def __init__(
        self, model: ArticulatedModel, rig: CameraRig, late_s: Sequence[float], options: PhotometricOptions | None = None,
        colors_rgb: np.ndarray | None = None,
    ):  # fmt: skip
        options = options or PhotometricOptions()
        self._min_pixels, self._n_dof = options.min_pixels, model.n_dof
        each = replace(options, min_pixels=1)  # how many are too few is a matter of all cameras together
        super().__init__(rig, late_s, lambda some, cameras: PhotometricObjective(model, some, each, _of(colors_rgb, cameras)))

    @property
    def n_levels(self) -> int:
        return self._parts[0][2].n_levels

    def at_level(self, level: int) -> _Level:
        """The least-squares problem on one level; 0 is the finest."""
        parts = [(late, objective.at_level(level)) for late, _, objective in self._parts]
        return _Level(self._n_dof, self.velocity, parts, max(self._min_pixels / 4.0**level, 1.0))


class _Level:
    """One level with the velocity of its making.

    Each part's cost is its mean times the residuals that it had at first; here it is the mean over all parts times the residuals
    of all, so that a body does not gain by leaving the images of one part.
    """

    def __init__(
        self, n_dof: int, velocity: np.ndarray | None, parts: Sequence[tuple[float, LeastSquaresObjective]], min_pixels: float
    ):
        self._n_dof = n_dof
        self._velocity, self._parts, self._min_pixels = velocity, parts, min_pixels
        self._first = [0] * len(parts)
        self._first_of_all = 0

    def linearize(self, state: State) -> NormalEquations:
        """Sums over the parts that show the body; too little of it in all of them costs infinity."""
        H, g, cost, count = np.zeros((self._n_dof, self._n_dof)), np.zeros(self._n_dof), 0.0, 0
        for i, (late, objective) in enumerate(self._parts):
            part = objective.linearize(_seen(state, late, self._velocity))
            if part.count == 0:
                continue
            self._first[i] = self._first[i] or part.count
            unscaled = part.count / self._first[i]
            H, g, cost, count = H + unscaled * part.H, g + unscaled * part.g, cost + unscaled * part.cost, count + part.count
        if count < 3 * self._min_pixels:
            return NormalEquations(H, g, math.inf, 0)
        self._first_of_all = self._first_of_all or count
        scale = self._first_of_all / count
        return NormalEquations(scale * H, scale * g, scale * cost, count)
