"""Images and rays of all cameras, flat and planar, as the color kernels read them.

What the color kernels take of a body, a rig and its lights, and that no state changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from ...camera.light import AMBIENT, COS_OUTER, DIRECTIONAL, INTENSITY, KIND, POINT, SPOT, pack_lights
from ...camera.model import CameraModel
from ...camera.rig import Camera, CameraRig
from ...model.articulated import ArticulatedModel
from ...render.shape_arrays import OTHER, ShapeArrays, ray_table
from . import drawing as kernel


def is_pinhole(camera: Camera) -> bool:
    """Whether rays are linear in the pixel's column and row alone."""
    return camera.model.K[0, 1] == 0.0 and not np.any(camera.model.distortion)


def every_nth(rig: CameraRig, columns: int, rows: int = 1) -> CameraRig:
    """The rig for images of which only every n-th column and row is kept, the first among them.

    Parameters
    ----------
    rig : of the whole images.
    columns, rows : n of each.

    Returns
    -------
    The same cameras with smaller images.
    """

    def thinned(camera: Camera) -> Camera:
        width, height = -(-camera.model.width // columns), -(-camera.model.height // rows)
        pixel_map = np.array([[1.0 / columns, 0.0, 0.0], [0.0, 1.0 / rows, 0.0]])
        return replace(camera, model=camera.model.mapped(pixel_map, width, height))

    return replace(rig, cameras=tuple(thinned(camera) for camera in rig))


EXCHANGE = np.array([[0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""Exchanges the x and y axes of a camera frame."""


def lying(camera: Camera) -> Camera:
    """The lens of an undistorted camera for images whose rows and columns are exchanged.

    What it sees is a mirror image in camera axes that `EXCHANGE` gives, which a score does not mind.
    """
    K = camera.model.K
    exchanged = np.array([[K[1, 1], 0.0, K[1, 2]], [0.0, K[0, 0], K[0, 2]], [0.0, 0.0, 1.0]])
    return replace(camera, model=CameraModel(camera.model.height, camera.model.width, exchanged))


class ColorViews:
    """Where the pixels and rays of every camera lie, and the pixels of one image set.

    Attributes
    ----------
    views : (n_cameras, `kernel.N_VIEW`) int64.
    rays : (.,) float32; an undistorted camera has one row of x, and one y a row of pixels (sixteen times); others have a table.
    planes : (.,) uint8; red, green and blue of each camera.
    params, limits : (n_cameras, .), of the lenses and their rays.
    """

    def __init__(self, cameras: Sequence[Camera]):
        self.views = np.zeros((len(cameras), kernel.N_VIEW), dtype=np.int64)
        rays: list[np.ndarray] = []
        n_rays = n_pixels = 0
        for view, camera in zip(self.views, cameras, strict=True):
            xs, ys = _rays(camera)
            height, width = camera.model.height, camera.model.width
            view[kernel.PLANES], view[kernel.XS], view[kernel.YS] = n_pixels, n_rays, n_rays + xs.size
            view[kernel.WIDTH], view[kernel.HEIGHT], view[kernel.DISTORTED] = width, height, not is_pinhole(camera)
            rays += [xs.ravel(), ys.ravel()]
            n_rays += xs.size + ys.size
            n_pixels += 3 * width * height
        self.rays = np.concatenate(rays)
        self.planes = np.zeros(n_pixels + kernel.LANES, dtype=np.uint8)  # lanes reach beyond the last pixel
        self.params = np.stack([camera.model.params for camera in cameras])
        self.limits = np.stack([ray_table(camera.model).limits for camera in cameras])

    def fill(self, images: Sequence[np.ndarray | None]) -> None:
        """Take in BGR images (h, w, 3) uint8, or None for a camera without one, whose pixels then are never asked for."""
        for view, image in zip(self.views, images, strict=True):
            if image is not None:
                cv2.split(image, [self.plane(view, channel) for channel in (2, 1, 0)])  # into these very planes

    def plane(self, view: np.ndarray, channel: int) -> np.ndarray:
        """The pixels of one channel of one camera.

        Parameters
        ----------
        view : the camera's row of ``views``.
        channel : 0 is red, 1 green, 2 blue.

        Returns
        -------
        (h, w) uint8, a view.
        """
        width, height = int(view[kernel.WIDTH]), int(view[kernel.HEIGHT])
        start = int(view[kernel.PLANES]) + channel * width * height
        return self.planes[start : start + width * height].reshape(height, width)


def _rays(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """x and y of the rays, as `ColorViews` lays them out; not a number to the right of the image."""
    model = camera.model
    if is_pinhole(camera):
        xs = np.full(model.width + kernel.LANES, np.nan, dtype=np.float32)
        xs[: model.width] = (np.arange(model.width) - model.K[0, 2]) / model.K[0, 0]
        ys = np.repeat((np.arange(model.height) - model.K[1, 2]) / model.K[1, 1], kernel.LANES).astype(np.float32)
        return xs, ys
    table = ray_table(model)
    padded = np.full((2, model.height, model.width + kernel.LANES), np.nan, dtype=np.float32)
    padded[0, :, : model.width], padded[1, :, : model.width] = table.xs[:, : model.width], table.ys[:, : model.width]
    return padded[0], padded[1]


REPRESENTATIONS = ("raw", "normalized", "blend")


class ColorConstants:
    """Packed shapes, colors and lights.

    Attributes
    ----------
    kinds, dims, links : of `ShapeArrays`.
    colors_rgb : (n_cameras, n_shapes, 3); ``recolored`` when they were given and do not come from the model.
    lights : (n, .) of `pack_lights`, all of them; ``directed`` those with a direction, float32, directional ones first.
    base : (n_cameras, 4) float32, the light that every pixel gets before those, and 1 / gamma.
    weights : of the raw and of the normalized difference.
    smooth, vectorized : all shapes are ellipsoids or cones; and there is no gamma that bends what directed lights do.
    """

    def __init__(
        self,
        model: ArticulatedModel,
        rig: CameraRig,
        representation: str = "raw",
        normalized_weight: float = 0.5,
        colors_rgb: np.ndarray | None = None,
    ):
        if representation not in REPRESENTATIONS:
            raise ValueError(f"expected a representation, one of {REPRESENTATIONS}, got {representation!r}")
        arrays = ShapeArrays.from_model(model)
        self.kinds, self.dims, self.links = arrays.kinds, arrays.dims, arrays.links
        self.smooth = OTHER not in arrays.kinds
        self.weights = {"raw": (1.0, 0.0), "normalized": (0.0, 1.0)}.get(
            representation, (1.0 - normalized_weight, normalized_weight)
        )
        self.lights = pack_lights(rig.lights)
        lights = self.lights.astype(np.float32)
        kinds = lights[:, KIND].astype(int)
        ambient = lights[kinds == AMBIENT, INTENSITY : INTENSITY + 3].sum(axis=0)
        suns, spots = lights[kinds == DIRECTIONAL], lights[(kinds == SPOT) | (kinds == POINT)]
        spots[spots[:, KIND] == POINT, COS_OUTER] = -3.0  # every direction is well within the cone
        tinted = np.ptp(lights[:, INTENSITY : INTENSITY + 3], axis=1).any()
        if self.weights[0] == 0.0 and not tinted:  # shading by white light cancels
            suns, spots, ambient = suns[:0], spots[:0], np.ones(3)
        self.n_directional, self.n_spots, self.directed = len(suns), len(spots), np.concatenate([suns, spots])
        self.gain, gamma = np.array([camera.gain for camera in rig]), np.array([camera.gamma for camera in rig])
        self.bent = len(self.directed) > 0 and bool((gamma != 1.0).any())
        self.vectorized = self.smooth and not self.bent
        base = self.gain * ambient
        if len(self.directed) == 0:
            base = base ** (1.0 / gamma[:, None])
        self.base = np.column_stack([base, 1.0 / gamma]).astype(np.float32)
        self.Ts_cam_world = np.stack([camera.T_cam_world for camera in rig])
        self.set_colors(model, rig, colors_rgb)

    def set_colors(self, model: ArticulatedModel, rig: CameraRig, colors_rgb: np.ndarray | None) -> None:
        """Take other colors.

        Parameters
        ----------
        model, rig : body and cameras.
        colors_rgb : (n_cameras, n_shapes, 3) in 0..255; None: the shapes' own in every camera.
        """
        self.recolored = colors_rgb is not None
        if colors_rgb is None:
            of_model = np.array([shape.color_rgb for shape in model.shapes], dtype=np.float64)
            self.colors_rgb = np.tile(of_model, (len(rig), 1, 1))
            return
        shape = (len(rig), len(model.shapes), 3)
        if np.shape(colors_rgb) != shape:
            raise ValueError(f"expected colors {shape}: one of each shape by camera, got {np.shape(colors_rgb)}")
        self.colors_rgb = np.array(colors_rgb, dtype=np.float64)
