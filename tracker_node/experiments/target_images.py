"""Images of a posed body in its own colors, drawn by another renderer than the one that scores: what experiments track.

Every pixel is the mean of several, so that outlines mix with the background in proportion, as on a sensor.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace

import cv2
import numpy as np

from ..camera.rig import Camera, CameraRig
from ..errors import UnknownNameError
from ..model.configuration import Configuration
from ..render.raycast.extent import body_extent
from ..render.raycast.raycaster import RaycastRenderer
from ..render.renderer import Region, Renderer

BACKENDS = ("raycaster", "pyrender")


@contextmanager
def make_renderer(name: str = "raycaster") -> Iterator[Renderer]:
    """The renderer ``name``, one of `BACKENDS`, for a ``with`` statement.

    Raises
    ------
    UnknownNameError : there is no such renderer.
    RendererError : ``pyrender`` finds no OpenGL; the ray-caster needs none.
    """
    if name == "raycaster":
        yield RaycastRenderer()
    elif name == "pyrender":
        from ..render.opengl.renderer import PyrenderRenderer  # PyOpenGL is loaded only where it is wanted

        with PyrenderRenderer() as renderer:
            yield renderer
    else:
        raise UnknownNameError("renderer", name, BACKENDS)


class TargetStudio:
    """Takes images of bodies under the lights of a rig. Use it in a ``with`` statement (it may hold an OpenGL context).

    Parameters
    ----------
    rig : cameras, with their gain, gamma and distortion, and the lights.
    backend : of `BACKENDS`.
    supersampling : a pixel is the mean of its square, samples.
    noise_levels : standard deviation of the sensor noise at middle gray, gray levels; half of its variance is constant, half
        grows with the signal.
    seed : of the noise.

    Raises
    ------
    UnknownNameError, RendererError : see `make_renderer`.
    """

    def __init__(
        self, rig: CameraRig, backend: str = "pyrender", supersampling: int = 2, noise_levels: float = 0.0, seed: int = 0
    ):
        if supersampling < 1:
            raise ValueError(f"expected a supersampling of 1 or more, got {supersampling}")
        self.rig, self.backend, self.supersampling = rig, backend, int(supersampling)
        self.noise_levels, self.seed = noise_levels, seed
        self._large = [self._enlarged(camera) for camera in rig]
        self._stack = ExitStack()
        self._renderer = self._stack.enter_context(make_renderer(backend))

    def __enter__(self) -> TargetStudio:
        return self

    def __exit__(self, *_) -> None:
        self._stack.close()

    def _enlarged(self, camera: Camera) -> Camera:
        n, lens = self.supersampling, camera.model
        return replace(camera, model=lens.resized(n * lens.width, n * lens.height))

    def images(
        self, configuration: Configuration, backgrounds: Sequence[np.ndarray | None] | None = None, image_number: int = 0
    ) -> list[np.ndarray]:
        """Images of a body by every camera.

        Parameters
        ----------
        configuration : the body in a state.
        backgrounds : a BGR image per camera, or None for black.
        image_number : each has another noise.

        Returns
        -------
        (h, w, 3) uint8 BGR, in the order of the rig.
        """
        backgrounds = [None] * len(self.rig) if backgrounds is None else backgrounds
        if len(backgrounds) != len(self.rig):
            raise ValueError(f"expected a background for each of {len(self.rig)} cameras, got {len(backgrounds)}")
        return [self.image(i, configuration, background, image_number) for i, background in enumerate(backgrounds)]

    def image(
        self, index: int, configuration: Configuration, background: np.ndarray | None = None, image_number: int = 0
    ) -> np.ndarray:
        """Image of a body by one camera.

        Parameters
        ----------
        index : of the camera in the rig.
        configuration : the body in a state.
        background : (h, w, 3) uint8 BGR; None: black.
        image_number : each has another noise.

        Returns
        -------
        (h, w, 3) uint8 BGR.
        """
        camera = self.rig.cameras[index]
        whole = 0, 0, camera.model.width, camera.model.height
        shape = camera.model.height, camera.model.width, 3
        image = np.zeros(shape, dtype=np.uint8) if background is None else background.copy()
        if image.shape != shape or image.dtype != np.uint8:
            raise ValueError(f"camera '{camera.name}': expected a background {shape} uint8, got {image.shape} {image.dtype}")
        u0, v0, u1, v1 = region = body_extent(configuration, camera, whole) or (0, 0, 0, 0)
        part = image[v0:v1, u0:u1].astype(np.float32)
        if part.size:
            bgr, cover = self._body(index, configuration, region)
            part *= 1.0 - cover[:, :, None]
            part += bgr
        if self.noise_levels == 0.0:
            image[v0:v1, u0:u1] = _rounded(part)
            return image
        seen = image.astype(np.float32)
        seen[v0:v1, u0:u1] = part
        rng = np.random.default_rng([self.seed, index, image_number])
        sigma = self.noise_levels * np.sqrt(0.5 + seen / 255.0)
        return _rounded(seen + sigma * rng.standard_normal(shape, dtype=np.float32))

    def _body(self, index: int, configuration: Configuration, region: Region) -> tuple[np.ndarray, np.ndarray]:
        """Colors (h, w, 3) BGR float32, weighted by the fraction (h, w) of each pixel of ``region`` that the body covers."""
        n = self.supersampling
        u0, v0, u1, v1 = (n * end for end in region)
        view = self._renderer.render_color(configuration, self._large[index], self.rig.lights, (u0, v0, u1, v1))
        size = (u1 - u0) // n, (v1 - v0) // n
        cover = cv2.resize((view.labels > 0).astype(np.float32), size, interpolation=cv2.INTER_AREA)
        return cv2.resize(view.rgb, size, interpolation=cv2.INTER_AREA)[:, :, ::-1], cover


def _rounded(image: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(image), 0.0, 255.0).astype(np.uint8)
