"""The colors of a body's parts as each camera shows them: those of the model, or learned from images."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from ...camera.rig import CameraRig
from ...errors import ModelError
from ...model.articulated import ArticulatedModel, Shape
from ...model.configuration import Configuration, State
from ...model.shapes.primitives import Box, Mesh
from ...render.raycast.raycaster import render_color, render_labels
from ..engine import Images

_GREY = 128.0  # a body of this color shows how much light reaches it, up to twice what would be full
_LEAST_PIXELS = 12
_RIM = np.ones((5, 5), dtype=np.uint8)  # what is so near a part's border is not learned


def check_colors(model: ArticulatedModel) -> None:
    """Whether there is anything to compare.

    Raises
    ------
    ModelError : when all shapes have the color that files get which state none.
    """
    default = Shape.__dataclass_fields__["color_rgb"].default
    if all(shape.color_rgb == default and not _is_pictured(shape) for shape in model.shapes):
        raise ModelError(
            f"model '{model.name}' has no colors: expected color_rgb of its shapes, or the parameter color.learn_colors, for an"
            " engine that goes by colors"
        )


def _is_pictured(shape: Shape) -> bool:
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
