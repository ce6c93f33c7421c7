"""A second renderer: triangles drawn by OpenGL through pyrender, without a display, on a GPU or in software.

It draws ground truth, and checks the first renderer. Traps that this module deals with: pyrender's platform is chosen before its
first import, by an environment variable; and closing one of its EGL contexts would end the display that all contexts of the
process share.
"""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...camera.light import Light, pack_lights
from ...camera.rig import Camera
from ...closing import Closing
from ...errors import TrackerError
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration
from ..raycast.extent import body_extent, corners_in_camera
from ..raycast.raycaster import checked_region
from ..renderer import ColoredView, Region, RenderedView
from .tessellation import Patch, tessellate

_PLATFORMS = (("egl", ("libEGL.so.1",)), ("osmesa", ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so")))
_INSTALL = (
    "install a software OpenGL: sudo apt-get install libegl1 libgl1-mesa-dri libgl1 (or libosmesa6 with"
    " PYOPENGL_PLATFORM=osmesa); the ray-caster needs none (renderer 'raycaster')"
)


class RendererError(TrackerError):
    """No OpenGL to render with."""


def platform() -> str:
    """PyOpenGL's name of the platform to draw on without a display: what the environment says, else what is installed."""
    if "PYOPENGL_PLATFORM" in os.environ:
        return os.environ["PYOPENGL_PLATFORM"]
    for name, libraries in _PLATFORMS:
        for library in libraries:
            try:
                ctypes.CDLL(library)
            except OSError:
                continue
            return name
    return "egl"


def import_pyrender() -> Any:
    """The module ``pyrender``, on a platform that needs no display.

    Raises
    ------
    RendererError : PyOpenGL finds no library for the platform.
    """
    os.environ["PYOPENGL_PLATFORM"] = name = platform()
    try:
        import pyrender
    except Exception as error:  # PyOpenGL raises many kinds, and all mean the same to a user
        raise RendererError(f"pyrender cannot start with PYOPENGL_PLATFORM={name} ({_line(error)}); {_INSTALL}") from None
    return pyrender


class OpenGLContext:
    """An OpenGL context with pyrender's renderer. Close it with `close`, and use it on the thread that made it.

    Attributes
    ----------
    pyrender : the module.
    offscreen : its ``OffscreenRenderer``.
    """

    def __init__(self):
        self.pyrender = import_pyrender()
        try:
            self.offscreen = self.pyrender.OffscreenRenderer(64, 64)
        except Exception as error:
            raise RendererError(
                f"no OpenGL context with PYOPENGL_PLATFORM={platform()} ({_line(error)}); {_INSTALL}"
            ) from None  # fmt: skip

    @property
    def is_open(self) -> bool:
        return self.offscreen is not None

    def close(self) -> None:
        """Free what the context holds."""
        if not self.is_open:
            return
        egl = self.offscreen._platform
        if hasattr(egl, "_egl_display"):
            from OpenGL.EGL import eglDestroyContext

            egl.make_current()
            self.offscreen._renderer.delete()
            eglDestroyContext(egl._egl_display, egl._egl_context)
            egl._egl_display = None  # so that pyrender does not end the display, which other contexts use
            self.offscreen._renderer = self.offscreen._platform = None
        else:
            self.offscreen.delete()
        self.offscreen = None


def _line(error: Exception) -> str:
    """An error in one line."""
    text = str(error).strip().splitlines()
    return f"{type(error).__name__}: {text[0]}" if text else type(error).__name__


_NEAREST = 0.01  # meters: what is nearer is cut away, since the depth buffer has no room for it
_CROP_STEP = 32  # crops are rounded up to this, so that few sizes of images occur


class PyrenderRenderer(Closing):
    """Draws bodies with OpenGL. Use it in a ``with`` statement, or `close` it; and only on the thread that made it.

    It is a `renderer.Renderer`. Only the body's bounding box is drawn and read back. Shapes that reach nearer than a centimeter
    are cut there.

    Raises
    ------
    RendererError : there is no OpenGL.
    """

    def __init__(self):
        self._context, self._thread = OpenGLContext(), threading.get_ident()
        from . import lambert as opengl_lambert  # imports pyrender, which the context has set up

        self._lambert = opengl_lambert
        offscreen = self._context.offscreen
        offscreen._renderer.delete()
        self._renderer = offscreen._renderer = opengl_lambert.LambertRenderer(64, 64)
        self._model: ArticulatedModel | None = None
        self._nodes: list[Any] = []

    def close(self) -> None:
        """Free the OpenGL context."""
        self._context.close()

    def render_view(self, configuration: Configuration, camera: Camera, region: Region | None = None) -> RenderedView:
        """Labels and depth of a body, as of `Renderer.render_view`.

        Parameters
        ----------
        configuration : the posed body.
        camera : with its lens and pose.
        region : (u0, v0, u1, v1) of the image to draw; the whole image without it.

        Returns
        -------
        Labels and depth on the region.
        """
        view = self.render_color(configuration, camera, (), region)
        return RenderedView(view.labels, view.depth, view.region)

    def render_color(
        self, configuration: Configuration, camera: Camera, lights: Sequence[Light] = (), region: Region | None = None
    ) -> ColoredView:
        """Labels, depth and colors of a body, in steps of one gray level (see `camera.light`).

        Parameters
        ----------
        configuration : the posed body.
        camera : with its lens, pose, gain and gamma.
        lights : in the world; none stands for an ambient light of intensity one.
        region : (u0, v0, u1, v1) of the image to draw; the whole image without it.

        Returns
        -------
        Labels, depth and colors on the region.
        """
        region = checked_region(region, camera.model)
        height, width = region[3] - region[1], region[2] - region[0]
        labels, depth = np.zeros((height, width), dtype=np.uint8), np.full((height, width), np.inf, dtype=np.float32)
        rgb = np.zeros((height, width, 3), dtype=np.float32)
        extent = body_extent(configuration, camera, region)
        if extent is not None:
            crop = _rounded_up(extent, region)
            color, meters = self._draw(configuration, camera, lights, crop)
            rows, columns = slice(crop[1] - region[1], crop[3] - region[1]), slice(crop[0] - region[0], crop[2] - region[0])
            rgb[rows, columns], labels[rows, columns], depth[rows, columns] = color[..., :3], color[..., 3], meters
        return ColoredView(labels, depth, region, rgb)

    def _show(self, model: ArticulatedModel) -> None:
        """Make the shapes of ``model``, and no others, the content of the scene."""
        if not self._context.is_open:
            raise ValueError("expected an open renderer, got one that is closed")
        if threading.get_ident() != self._thread:
            raise ValueError("expected a call on the thread that made the renderer: OpenGL knows no other")
        if model is self._model:
            return
        pyrender = self._context.pyrender
        self._scene = pyrender.Scene(bg_color=[0.0, 0.0, 0.0, 0.0])
        self._camera = self._scene.add(self._lambert.LensCamera(np.eye(4), 0.1, 1.0))
        self._nodes = []
        for shape in model.shapes:
            patches = tessellate(shape.primitive, shape.color_rgb)
            self._nodes.append(self._scene.add(pyrender.Mesh([self._primitive(patch) for patch in patches])))
        self._renderer.labels = {node: i + 1 for i, node in enumerate(self._nodes)}
        self._model = model

    def _primitive(self, patch: Patch) -> Any:
        pyrender = self._context.pyrender
        texture = None
        if patch.texture is not None:
            sampler = pyrender.Sampler(wrapS=pyrender.GLTF.CLAMP_TO_EDGE, wrapT=pyrender.GLTF.CLAMP_TO_EDGE)
            # Four channels: OpenGL expects rows of whole words, and pyrender does not see to that
            texture = pyrender.Texture(sampler=sampler, source=patch.texture, source_channels="RGBA")
        uv = np.zeros((len(patch.vertices), 2)) if patch.uv is None else patch.uv
        return pyrender.Primitive(
            positions=patch.vertices, normals=patch.normals, texcoord_0=uv, color_0=np.asarray(patch.colors, dtype=np.float32),
            indices=patch.faces,
            material=pyrender.MetallicRoughnessMaterial(baseColorTexture=texture, doubleSided=patch.two_sided),
        )  # fmt: skip

    def _draw(
        self, configuration: Configuration, camera: Camera, lights: Sequence[Light], crop: Region
    ) -> tuple[np.ndarray, np.ndarray]:
        """RGBA (h, w, 4) uint8 with labels as alpha, and depth (h, w), of ``crop``."""
        self._show(configuration.model)
        packed = pack_lights(lights)
        if len(packed) > self._lambert.MAX_LIGHTS:
            raise ValueError(f"expected at most {self._lambert.MAX_LIGHTS} lights, got {len(packed)}")
        z = corners_in_camera(configuration, camera)[..., 2]
        near, far = max(0.999 * float(z.min()), _NEAREST), max(1.001 * float(z.max()), 2.0 * _NEAREST)
        for node, T in zip(self._nodes, configuration.Ts_world_shape, strict=True):
            self._scene.set_pose(node, T)
        self._camera.camera = self._lambert.LensCamera(_projection(camera.model.K, crop, near, far), near, far)
        self._scene.set_pose(self._camera, camera.T_world_cam)
        renderer, offscreen = self._renderer, self._context.offscreen
        renderer.lights, renderer.lens, renderer.gain, renderer.gamma = packed, camera.model.params, camera.gain, camera.gamma
        renderer.viewport_width, renderer.viewport_height = crop[2] - crop[0], crop[3] - crop[1]
        offscreen._platform.make_current()
        # Not by offscreen.render, which thinks that OSMesa has no framebuffers
        return renderer.render(self._scene, self._context.pyrender.RenderFlags.OFFSCREEN)


def _projection(K: np.ndarray, crop: Region, near: float, far: float) -> np.ndarray:
    """Clip coordinates (4, 4) of points in optical axes (x right, y down, z forward); pixel centers lie at whole numbers."""
    u0, v0, u1, v1 = crop
    to_clip = np.array([
        [2.0 / (u1 - u0), 0.0, -(2.0 * u0 - 1.0) / (u1 - u0) - 1.0],
        [0.0, -2.0 / (v1 - v0), (2.0 * v0 - 1.0) / (v1 - v0) + 1.0],
    ])  # fmt: skip
    P = np.zeros((4, 4))
    P[:2, :3] = to_clip @ K
    P[2, 2:] = (far + near) / (far - near), -2.0 * far * near / (far - near)
    P[3, 2] = 1.0
    return P


def _rounded_up(extent: Region, region: Region) -> Region:
    """A part of ``region`` that holds ``extent``, its sides multiples of `_CROP_STEP` where there is room."""
    ends = []
    for axis in range(2):
        length = min(-(-(extent[axis + 2] - extent[axis]) // _CROP_STEP) * _CROP_STEP, region[axis + 2] - region[axis])
        ends.append(min(extent[axis], region[axis + 2] - length))
        ends.append(ends[-1] + length)
    return ends[0], ends[2], ends[1], ends[3]
