"""The intensity-normalized score of bodies whose shapes have one color each, without shading a pixel.

Under white light shading cancels in normalized colors. What a pixel adds to the score then depends on the image and on which
shape is in front, so it is computed once for every image, and a score only sums what the drawn labels cover. It is the same
number as `ColorObjective` gives, for boxes and meshes in a fraction of the time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..camera.camera_model import NEAR
from ..camera.camera_rig import Camera, CameraRig
from ..geometry import se3
from ..model.articulated_model import ArticulatedModel
from ..model.configuration import Configuration, State
from ..model.primitives import Box, Mesh
from ..render import raycaster
from ..render.extent import body_extent
from .color_score import ColorOptions, ColorScore, Verdict


class FlatColorObjective:
    """Scores of a body against one image set at a time; parameters as for `ColorObjective`.

    The representation must be normalized. Colors are those before an image clips them at 255.
    """

    def __init__(
        self,
        model: ArticulatedModel,
        rig: CameraRig,
        options: ColorOptions | None = None,
        colors_rgb: np.ndarray | None = None,
        threads: int = 1,
    ):
        self.model, self.rig, self.options = model, rig, options or ColorOptions("normalized")
        _check(model, rig, self.options)
        if colors_rgb is None:
            colors_rgb = np.tile(np.array([shape.color_rgb for shape in model.shapes], dtype=np.float64), (len(rig), 1, 1))
        shown = [np.asarray(c) * np.array(camera.gain) ** (1.0 / camera.gamma) for c, camera in zip(colors_rgb, rig, strict=True)]
        self._colors = [np.unique(normalized(c), axis=0, return_inverse=True) for c in shown]
        self._errors: list[np.ndarray | None] = [None] * len(rig)

    def set_images(self, images: Sequence[np.ndarray | None]) -> None:
        """BGR images (h, w, 3) uint8 in the order of the rig; None for a camera that gave none."""
        self._errors = [None] * len(self.rig)
        for i, (camera, image) in enumerate(zip(self.rig, images, strict=True)):
            if image is None:
                continue
            if image.shape != (camera.model.height, camera.model.width, 3):
                expected = (camera.model.height, camera.model.width, 3)
                raise ValueError(f"camera '{camera.name}': expected an image {expected}, got {image.shape}")
            target = normalized(image[:, :, ::-1])
            different, _ = self._colors[i]
            self._errors[i] = np.stack([((target - color) ** 2).sum(axis=2) for color in different])

    def evaluate(self, state: State) -> ColorScore:
        """The score of one state, camera by camera."""
        squares, pixels = np.zeros(len(self.rig)), np.zeros(len(self.rig), dtype=np.int64)
        configuration, behind = Configuration(self.model, state), False
        for i, camera in enumerate(self.rig):
            if self._errors[i] is not None:
                centers = se3.apply(camera.T_cam_world, configuration.Ts_world_shape[:, :3, 3])
                behind = behind or bool((centers[:, 2] < NEAR).any())
                squares[i], pixels[i] = self._sums(configuration, i)
        with np.errstate(divide="ignore", invalid="ignore"):
            camera_rms = np.where(pixels > 0, np.sqrt(squares / (3.0 * pixels)), np.nan)
        total = int(pixels.sum())
        if behind:
            return ColorScore(math.inf, Verdict.BEHIND_CAMERA, camera_rms, pixels)
        if total * self.options.column_step < max(self.options.min_pixels, 1):
            return ColorScore(math.inf, Verdict.EMPTY_MASK, camera_rms, pixels)
        return ColorScore(math.sqrt(squares.sum() / (3.0 * total)), Verdict.SCORED, camera_rms, pixels)

    def _sums(self, configuration: Configuration, index: int) -> tuple[float, int]:
        """Squares and pixels of one camera."""
        camera, errors, step = self.rig.cameras[index], self._errors[index], self.options.column_step
        region = body_extent(configuration, camera, _whole(camera))
        if region is None or errors is None:
            return 0.0, 0
        u0, v0, u1, v1 = region
        labels = raycaster.render_view(configuration, camera, region).labels
        columns = slice(-u0 % step, None, step)  # every n-th of the image, not of the region
        labels, part = labels[:, columns], errors[:, v0:v1, u0:u1][:, :, columns]
        _, color_of_shape = self._colors[index]
        row, column = np.nonzero(labels)
        color = color_of_shape.ravel()[labels[row, column].astype(np.int64) - 1]
        return float(part[color, row, column].sum(dtype=np.float64)), len(row)

    def score(self, state: State) -> float:
        """rms over all cameras; infinite where the state cannot be scored."""
        return self.evaluate(state).rms

    def scores(self, states: Sequence[State]) -> np.ndarray:
        """(n,) of `score`."""
        return np.array([self.score(state) for state in states])

    def at_column_step(self, column_step: int) -> FlatColorObjective:
        """The same, on every n-th column of the images."""
        other = object.__new__(FlatColorObjective)
        other.__dict__ = {**self.__dict__, "options": replace(self.options, column_step=column_step)}
        return other


def normalized(rgb: np.ndarray) -> np.ndarray:
    """255 c / (r + g + b), float32, of colors (..., 3) in 0..255."""
    rgb = np.asarray(rgb, dtype=np.float32)
    return np.float32(255.0) * rgb / np.maximum(rgb.sum(axis=-1, keepdims=True), np.float32(1.0))


def _whole(camera: Camera) -> tuple[int, int, int, int]:
    return 0, 0, camera.model.width, camera.model.height


def _check(model: ArticulatedModel, rig: CameraRig, options: ColorOptions) -> None:
    if options.representation != "normalized":
        raise ValueError(f"expected the normalized representation, in which shading cancels, got {options.representation!r}")
    for light in rig.lights:
        if len(set(light.intensity)) > 1:
            raise ValueError(f"expected white lights, whose shading cancels, got an intensity of {light.intensity}")
    for shape in model.shapes:
        solid = shape.primitive
        if isinstance(solid, Box) and (solid.face_colors_rgb is not None or solid.textures is not None):
            raise ValueError(f"expected shapes of one color, got '{shape.name}' with several")
        if isinstance(solid, Mesh) and not solid.face_colors_rgb is solid.vertex_colors_rgb is solid.texture is None:
            raise ValueError(f"expected shapes of one color, got '{shape.name}' with several")
