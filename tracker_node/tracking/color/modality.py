"""Colors of the body's parts: those of the model or learned, compared at points of the surface on a pyramid of images.

The colors of a body's parts as each camera shows them: those of the model, or learned from images.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

import cv2
import numpy as np

from ...camera.rig import CameraRig
from ...errors import ModelError
from ...model.articulated import ArticulatedModel, Shape
from ...model.configuration import Configuration, State
from ...model.shapes.primitives import Box, Mesh
from ...objective.normal_equations import LeastSquaresObjective
from ...objective.points.photometry import Offsets, PhotometryOptions, SurfaceCorrespondences, SurfacePhotometry
from ...render.raycast.raycaster import render_color, render_labels
from ..config import ColorOverBackgroundConfig
from ..modality import Images, Modality, Persons
from ..motion.model import ExposureDelays
from .agreement import ColorAgreement, agreement_of


class ColorScores(Protocol):
    """What else compares the parts' colors with the images."""

    def set_colors(self, learned: np.ndarray | None, rgb: np.ndarray) -> None:
        """Take the parts' colors.

        Parameters
        ----------
        learned : (n_cameras, n_shapes, 3) in 0..255; None: those of the model, whose faces may have colors of their own.
        rgb : the same with those of the model as plain colors.
        """
        ...

    def set_images(self, images: Images, expected: State | None) -> None:
        """Take the images of a set.

        Parameters
        ----------
        images : by camera.
        expected : where the body is expected; None: nobody knows.
        """
        ...


class ColorModality(Modality):
    """The `Modality` of colored parts.

    Parameters
    ----------
    rig, model : as for the `Tracker`.
    config : parameters.
    options : what of a color is compared, and on how many levels of the image pyramid.
    parallel : maps a function over cameras.
    scores : what else compares the parts' colors with the images; None: nothing does.
    fit_gain : find in the first image set what brings each camera's images into the light of the model, where colors are not
        learned: those are in the light of the images.

    Attributes
    ----------
    leads : whether most links have a color that tells them from the links next to them. Where one cloth covers both sides of a
        joint, folds and shades pass for borders.

    Raises
    ------
    ModelError : a model without colors, when none are to be learned.
    """

    def __init__(
        self,
        rig: CameraRig,
        model: ArticulatedModel,
        config: ColorOverBackgroundConfig,
        options: PhotometryOptions,
        parallel: Callable[[Callable, list], list],
        scores: ColorScores | None = None,
        fit_gain: bool = False,
    ):
        self._rig, self._model, self._config, self._scores = rig, model, config, scores
        self._fits_gain = fit_gain and not config.learn_colors
        if not config.learn_colors:
            check_colors(model)
        self._options, self._photometry = options, SurfacePhotometry(model, rig, options, parallel)
        self.reset()

    def reset(self) -> None:
        """The colors are those of the model."""
        self._colors = PartColors(self._model, self._rig)
        self._use_colors()
        self._learned = False
        self._gains = np.ones((len(self._rig), 3))
        self._images: Images = [None] * len(self._rig)
        self._delays: ExposureDelays | None = None
        self._agreement: tuple[State, ColorAgreement] | None = None
        self.leads = self._are_distinct(0.0)

    def _use_colors(self) -> None:
        """Those of the model are left to the model, whose faces may have colors of their own."""
        colors = self._colors.rgb if self._colors.learned else None
        self._photometry.set_colors(colors)
        if self._scores is not None:
            self._scores.set_colors(colors, self._colors.rgb)
        self._agreement = None

    def lessons(self, known: bool) -> Sequence[float]:
        """Colors are learned whole, or gains found, once."""
        if not (self._config.learn_colors or self._fits_gain) or self._learned:
            return ()
        return (1.0,) if known else (1.0, 1.0)

    def learn_first(self, images: Images, state: State, lesson: float) -> None:
        """Learn the colors of all parts, or the gains of the cameras."""
        self._learned = True
        if self._fits_gain:
            self._gains = self._photometry.gains(images, state)
        else:
            self._learn(images, state, lesson)
            self.leads = self._are_distinct(agreement_of(self._photometry.painted, self._rig, images, state, self._options).rms)

    def set_images(
        self, images: Images, expected: State | None, delays: ExposureDelays | None = None, persons: Persons = ()
    ) -> None:
        """Blur and halve the images around the expected body."""
        self._delays = delays
        self._show([None] * len(self._rig) if expected is None else list(map(_lit, images, self._gains)), expected)

    def relight(self, state: State) -> None:
        """Find the gains of a first image set anew, where the body is in ``state`` rather than where it was said to be."""
        if self._fits_gain:
            gains = self._photometry.gains(self._images, state)
            self._gains = self._gains * gains
            self._show(list(map(_lit, self._images, gains)), state)

    def _show(self, images: Images, expected: State | None) -> None:
        self._images, self._agreement = images, None
        around = State.neutral(self._model) if expected is None else expected
        self._photometry.set_images(self._images, around, self._config.reach_px, self._offsets(around))
        if self._scores is not None:
            self._scores.set_images(self._images, expected)

    def correspond(self, state: State, detail: int) -> SurfaceCorrespondences:
        """Points of the surface that is seen in a state."""
        return self._photometry.correspond(state, detail, self._offsets(state))

    def agreement(self, state: State) -> ColorAgreement:
        """How far the colors agree in the present images; that of the last state is kept."""
        if self._agreement is None or self._agreement[0] is not state:
            self._agreement = state, self.agreement_by(self._options.representation, state)
        return self._agreement[1]

    def agreement_by(self, representation: str, state: State) -> ColorAgreement:
        """How far the colors agree in the present images by another representation.

        Parameters
        ----------
        representation, state : of `ColorConfig`, and of the body.

        Returns
        -------
        In gray levels of that.
        """
        painted, parallel, offsets = self._photometry.painted, self._photometry.parallel, self._offsets(state)
        options = replace(self._options, representation=representation)
        return agreement_of(painted, self._rig, self._images, state, options, parallel, offsets)

    def _offsets(self, state: State) -> Offsets | None:
        return None if self._delays is None else self._delays.offsets(state)

    def variance(self, state: State) -> float:
        """Gray levels squared of one color channel, times how many neighboring pixels share one error."""
        return float(max(self.agreement(state).rms, self._config.residual_sigma) ** 2 * self._config.correlation)

    def information_at(self, state: State) -> tuple[LeastSquaresObjective, float]:
        """Colors of the surface seen in ``state``, on the finest level, and their unit in units of information."""
        return self.correspond(state, 0), 1.0 / self.variance(state)

    def _are_distinct(self, rms: float) -> bool:
        """Whether most links are told apart, where colors leave ``rms`` gray levels a channel."""
        least = min(_CONTRAST * max(rms, self._config.residual_sigma), _CLEAR)
        return bool(self._colors.distinct_links(least).mean() > 0.5)

    def learn(self, images: Images, state: State, weights: np.ndarray | None) -> None:
        """Colors follow slowly, where ``color_rate`` is positive."""
        if self._config.color_rate > 0.0:
            images = list(map(_lit, images, self._gains))
            self._learn(images, state, self._config.color_rate)

    def _learn(self, images: Images, state: State, share: float) -> None:
        self._colors.learn(images, state, share)
        self._use_colors()


def _lit(image: np.ndarray | None, gains: np.ndarray) -> np.ndarray | None:
    """A BGR image with gains (3,) of red, green and blue; what is too bright is white."""
    if image is None or (gains == 1.0).all():
        return image
    levels = np.arange(256)[:, None] * gains[::-1]
    return cv2.LUT(image, np.clip(np.rint(levels), 0, 255).astype(np.uint8)[None])


_GREY = 128.0  # a body of this color shows how much light reaches it, up to twice what would be full
_LEAST_PIXELS = 12
_CONTRAST = 2.0  # of links next to each other, in rms residuals: most of a suit's have 2 to 3, most of clothes' 0.1 to 1.8
_CLEAR = 55.0  # gray levels a channel, that do in any case: most of a suit's have 75 to 107, most of clothes' 2 to 48
_RIM = np.ones((5, 5), dtype=np.uint8)  # what is so near a part's border is not learned


def check_colors(model: ArticulatedModel) -> None:
    """Whether there is anything to compare.

    Raises
    ------
    ModelError : when all shapes have the color that files get which state none.
    """
    default = Shape.__dataclass_fields__["color_rgb"].default
    if all(shape.color_rgb == default and not is_pictured(shape) for shape in model.shapes):
        raise ModelError(
            f"model '{model.name}' has no colors: expected color_rgb of its shapes, or the parameter color.learn_colors, for an"
            " engine that goes by colors"
        )


def is_pictured(shape: Shape) -> bool:
    """Whether the shape has more colors than one."""
    primitive = shape.primitive
    if isinstance(primitive, Box):
        return primitive.face_colors_rgb is not None or primitive.textures is not None
    if isinstance(primitive, Mesh):
        return any(c is not None for c in (primitive.texture, primitive.vertex_colors_rgb, primitive.face_colors_rgb))
    return False


class PartColors:
    """Colors of parts by camera.

    Attributes
    ----------
    rgb : (n_cameras, n_shapes, 3) in 0..255, under light of factor one.
    learned : whether any of them comes from an image.
    """

    def __init__(self, model: ArticulatedModel, rig: CameraRig):
        self._model, self._rig = model, rig
        self.learned = False
        self._grey = replace(model, shapes=tuple(replace(s, color_rgb=(int(_GREY),) * 3) for s in model.shapes))
        self.rgb = np.tile(np.array([shape.color_rgb for shape in model.shapes], dtype=np.float64), (len(rig), 1, 1))

    def distinct_links(self, least: float) -> np.ndarray:
        """(n_links,) mask of those whose color is that of no link next to them, by ``least`` gray levels a channel."""
        chain, shape_links = self._model.chain, self._model.shape_links
        colored = np.bincount(shape_links, minlength=len(chain.links)) > 0
        rgb = np.array([self.rgb[:, shape_links == i].mean(axis=(0, 1)) if has else np.zeros(3) for i, has in enumerate(colored)])
        distinct = np.ones(len(chain.links), dtype=np.bool_)
        for joint in chain.joints:
            pair = [chain.link_index(joint.parent), chain.link_index(joint.child)]
            if colored[pair].all() and np.sqrt(np.mean((rgb[pair[0]] - rgb[pair[1]]) ** 2)) < least:
                distinct[pair] = False
        return distinct

    def learn(self, images: Images, state: State, share: float) -> None:
        """Mix in the colors that the parts of a body have in the images.

        A part's color is the median over what a camera shows of it.

        Parameters
        ----------
        images, state : of all cameras, and the body's in them.
        share : weight of the new colors, 0..1; with one, a part that a camera does not show gets the mean of the other
            cameras, if one of them does.
        """
        found = np.full(self.rgb.shape, np.nan)
        for i, image in enumerate(images):
            if image is not None:
                self._look(i, image, state, found[i])
        seen = np.isfinite(found)
        self.learned |= bool(seen.any())
        if share == 1.0:
            with np.errstate(invalid="ignore"):
                elsewhere = np.where(seen, found, 0.0).sum(axis=0) / seen.sum(axis=0)
            found = np.where(seen, found, elsewhere[None])
            seen = np.isfinite(found)
        self.rgb = np.where(seen, (1.0 - share) * self.rgb + share * np.where(seen, found, 0.0), self.rgb)

    def _look(self, index: int, image: np.ndarray, state: State, out: np.ndarray) -> None:
        """Medians of a camera's image over the light, into ``out`` (n_shapes, 3)."""
        camera = self._rig.cameras[index]
        configuration = Configuration(self._grey, state)
        sight = render_labels(configuration, camera)
        if sight is None:
            return
        (u0, v0, u1, v1), labels = sight
        light = render_color(configuration, camera, self._rig.lights, (u0, v0, u1, v1)).rgb / _GREY
        rgb = image[v0:v1, u0:u1, ::-1]
        for s in range(len(self._model.shapes)):
            part = cv2.erode((labels == s + 1).view(np.uint8), _RIM) > 0
            part &= light.min(axis=2) > 0.05
            if part.sum() >= _LEAST_PIXELS:
                out[s] = np.minimum(np.median(rgb[part] / light[part], axis=0), 255.0)
