"""Generate and test: how far the colors of a body, drawn in a state, are from those of the images (Trewartha, Yeadon & Knight).

The *mask* is every pixel that the drawn body covers, in all cameras together; the score is the rms difference of its colors, one
number over all pixels and channels. Pixels outside an image count neither way. What cannot be scored has the score infinity: no
optimizer takes it for a good one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ..camera.camera_rig import CameraRig
from ..model.articulated_model import ArticulatedModel
from ..model.configuration import Configuration, State
from ..render import raycaster

REPRESENTATIONS = ("raw", "normalized", "blend")


@dataclass(frozen=True)
class ColorOptions:
    """What is compared.

    Attributes
    ----------
    representation : ``raw`` RGB; ``normalized`` by intensity, 255 c / (r + g + b), in which white light and shading cancel;
        ``blend``: the mean square of both, weighted.
    normalized_weight : share of the normalized part in a blend, 0..1.
    column_step : score every n-th column of the images only.
    min_pixels : a mask of fewer pixels, over all cameras, cannot be scored.
    """

    representation: str = "raw"
    normalized_weight: float = 0.5
    column_step: int = 1
    min_pixels: int = 30


class Verdict(IntEnum):
    """Whether a state could be scored, and why not."""

    SCORED = 0
    EMPTY_MASK = 1
    BEHIND_CAMERA = 2


@dataclass(frozen=True, eq=False)
class ColorScore:
    """``rms`` of the color differences in grey levels (0..255), infinite unless ``verdict`` is SCORED; the same for each camera
    of the rig (nan where its mask is empty or it gave no image), and the pixels of its mask."""

    rms: float
    verdict: Verdict
    camera_rms: np.ndarray
    camera_pixels: np.ndarray


class ColorObjective:
    """Scores of a colored body against one image set at a time.

    Parameters
    ----------
    model, rig : body (with colors) and cameras (with lights).
    colors_rgb : (n_cameras, n_shapes, 3) in 0..255 of the shapes as each camera shows them, instead of those of the model.
    threads : `scores` shares out its states over so many.
    """

    def __init__(
        self,
        model: ArticulatedModel,
        rig: CameraRig,
        options: ColorOptions | None = None,
        colors_rgb: np.ndarray | None = None,
        threads: int = 2,
    ):
        self.model, self.rig, self.options = model, rig, options or ColorOptions()
        self._images: list[np.ndarray | None] = [None] * len(rig)

    def set_images(self, images: Sequence[np.ndarray | None]) -> None:
        """BGR images (h, w, 3) uint8 in the order of the rig; None for a camera that gave none."""
        self._images = list(images)

    def evaluate(self, state: State) -> ColorScore:
        """The score of one state, camera by camera."""
        configuration = Configuration(self.model, state)
        squares, pixels = np.zeros(len(self.rig)), np.zeros(len(self.rig), dtype=np.int64)
        for i, (camera, image) in enumerate(zip(self.rig, self._images, strict=True)):
            if image is None:
                continue
            view = raycaster.render_color(configuration, camera, self.rig.lights)
            inside = view.labels > 0
            difference = view.rgb[inside] - image[:, :, ::-1][inside]
            squares[i], pixels[i] = float((difference**2).sum()), len(difference)
        camera_rms = np.sqrt(squares / np.where(pixels, 3 * pixels, np.nan))
        if pixels.sum() < self.options.min_pixels:
            return ColorScore(math.inf, Verdict.EMPTY_MASK, camera_rms, pixels)
        return ColorScore(math.sqrt(squares.sum() / (3 * pixels.sum())), Verdict.SCORED, camera_rms, pixels)

    def score(self, state: State) -> float:
        """rms over all cameras; infinite where the state cannot be scored."""
        return self.evaluate(state).rms

    def scores(self, states: Sequence[State]) -> np.ndarray:
        """(n,) of `score`."""
        return np.array([self.score(state) for state in states])
