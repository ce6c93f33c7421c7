"""Images of triangle meshes through pyrender (OpenGL, software or not): another renderer than the tracker's own.

Traps that this module deals with: pyrender's principal point is for pixel *corners* (ours is for centers: half a pixel is
added), and its cameras look along -z with y up. Those of its platforms: `render.opengl.renderer`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from trimesh.geometry import mean_vertex_normals

from ...camera.rig import Camera
from ...closing import Closing
from ...render.opengl.renderer import OpenGLContext

AMBIENT = 0.32
# Direction of travel (world, Z up), intensity: a key light from above, and two fills.
LIGHTS = (((0.25, 0.35, -1.0), 2.3), ((0.8, -0.5, -0.35), 0.9), ((-0.7, -0.6, -0.3), 0.7))
KEY_DIRECTION = np.array(LIGHTS[0][0]) / np.linalg.norm(LIGHTS[0][0])
_NEAR, _FAR = 0.05, 40.0
_OPTICAL_FROM_GL = np.diag([1.0, -1.0, -1.0, 1.0])
_CROP_STEP = 32  # crops are rounded up to this, so that few framebuffer sizes occur


@dataclass(frozen=True, eq=False)
class ColoredMesh:
    """Triangles with a color per vertex: ``vertices`` (n, 3) meters world, ``faces`` (m, 3), ``colors_rgb`` (n, 3) uint8.

    ``normals`` (n, 3) outward unit; None: averaged from the faces.
    """

    vertices: np.ndarray
    faces: np.ndarray
    colors_rgb: np.ndarray
    normals: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class TexturedMesh:
    """Triangles with a texture: ``uv`` (n, 2) with v upward, ``texture`` (h, w, 3) uint8 RGB."""

    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray
    texture: np.ndarray


class Rasterizer(Closing):
    """One OpenGL context with fixed lights. Close it with `close` (or use it in a ``with`` statement)."""

    def __init__(self):
        self._context = OpenGLContext()
        self._pyrender = pyrender = self._context.pyrender
        self._scene = pyrender.Scene(bg_color=[0.0, 0.0, 0.0, 0.0], ambient_light=[AMBIENT] * 3)
        for direction, intensity in LIGHTS:
            light = pyrender.DirectionalLight(color=[1.0, 0.98, 0.95], intensity=intensity)
            self._scene.add(light, pose=_looking_along(np.array(direction)))
        self._camera = self._scene.add(pyrender.IntrinsicsCamera(1.0, 1.0, 0.0, 0.0))
        self._nodes: list = []

    def close(self) -> None:
        """Free the OpenGL context."""
        self._context.close()

    def show(self, *meshes: ColoredMesh | TexturedMesh) -> None:
        """Make these meshes, and no others, the content of the scene."""
        for node in self._nodes:
            self._scene.remove_node(node)
        self._nodes = [self._scene.add(self._mesh(mesh)) for mesh in meshes]

    def _mesh(self, mesh: ColoredMesh | TexturedMesh):
        pyrender = self._pyrender
        arguments: dict = {"baseColorFactor": [1.0, 1.0, 1.0, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.85}
        if isinstance(mesh, TexturedMesh):
            texture = pyrender.Texture(source=np.ascontiguousarray(mesh.texture), source_channels="RGB")
            material = pyrender.MetallicRoughnessMaterial(baseColorTexture=texture, doubleSided=True, **arguments)
            extra = {"texcoord_0": mesh.uv.astype(np.float32)}
            normals = vertex_normals(mesh.vertices, mesh.faces)
        else:
            material = pyrender.MetallicRoughnessMaterial(**arguments)
            linear = (mesh.colors_rgb / 255.0) ** 2.2
            extra = {"color_0": np.hstack([linear, np.ones((len(linear), 1))]).astype(np.float32)}
            normals = vertex_normals(mesh.vertices, mesh.faces) if mesh.normals is None else mesh.normals
        primitive = pyrender.Primitive(
            positions=mesh.vertices.astype(np.float32), normals=normals.astype(np.float32), material=material,
            indices=np.ascontiguousarray(mesh.faces, dtype=np.uint32), **extra,
        )  # fmt: skip
        return pyrender.Mesh([primitive])

    def render(self, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """Premultiplied RGBA (h, w, 4) uint8 with anti-aliased edges, and depth (h, w) float32 (meters along z, 0: nothing)."""
        K = camera.model.K
        self._camera.camera = self._pyrender.IntrinsicsCamera(
            K[0, 0], K[1, 1], K[0, 2] + 0.5, K[1, 2] + 0.5, znear=_NEAR, zfar=_FAR
        )
        self._scene.set_pose(self._camera, camera.T_world_cam @ _OPTICAL_FROM_GL)
        return self._draw(camera.model.width, camera.model.height)

    def render_region(self, camera: Camera, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, tuple[slice, slice]]:
        """As `render`, but only the window around some points.

        Parameters
        ----------
        camera : without distortion.
        points : (n, 3) world, in front of it.

        Returns
        -------
        RGBA (h, w, 4) uint8, premultiplied.
        Depth (h, w) float32, meters, 0 where there is nothing.
        (rows, columns) of the window in the image.
        """
        pixels, _ = camera.project(points)
        low = np.floor(pixels.min(axis=0)).astype(int) - 2
        high = np.ceil(pixels.max(axis=0)).astype(int) + 3
        size = (camera.model.width, camera.model.height)
        window = []
        for axis in range(2):
            length = min(-(-(high[axis] - low[axis]) // _CROP_STEP) * _CROP_STEP, size[axis])
            start = int(np.clip(low[axis], 0, size[axis] - length))
            window.append((start, int(length)))
        (u0, width), (v0, height) = window
        cropped = camera.model.mapped(np.array([[1.0, 0.0, -u0], [0.0, 1.0, -v0]]), width, height)
        color, depth = self.render(replace(camera, model=cropped))
        return color, depth, (slice(v0, v0 + height), slice(u0, u0 + width))

    def render_from_light(self, center: np.ndarray, half_size: float, n_pixels: int) -> np.ndarray:
        """Coverage of the meshes as the key light sees them, orthographic.

        Parameters
        ----------
        center : (3,) middle of the image, world.
        half_size : of the image, meters.
        n_pixels : width and height of the image.

        Returns
        -------
        (n, n) float32, 0 to 1.
        """
        pose = _looking_along(KEY_DIRECTION)
        pose[:3, 3] = center - 10.0 * KEY_DIRECTION
        self._camera.camera = self._pyrender.OrthographicCamera(half_size, half_size, znear=_NEAR, zfar=_FAR)
        self._scene.set_pose(self._camera, pose)
        return self._draw(n_pixels, n_pixels)[0][:, :, 3].astype(np.float32) / 255.0

    def _draw(self, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
        if not self._context.is_open:
            raise ValueError("expected an open rasterizer, got one that is closed")
        renderer = self._context.offscreen
        renderer.viewport_width, renderer.viewport_height = width, height
        return renderer.render(self._scene, flags=self._pyrender.RenderFlags.RGBA)


def light_coordinates(points: np.ndarray, center: np.ndarray, half_size: float, n_pixels: int) -> np.ndarray:
    """Pixels of an image of `Rasterizer.render_from_light` where world points lie.

    Parameters
    ----------
    points : (..., 3) world.
    center : (3,) middle of the image, world.
    half_size : of the image, meters.
    n_pixels : width and height of the image.

    Returns
    -------
    (..., 2) pixels.
    """
    axes = _looking_along(KEY_DIRECTION)[:3, :3]
    local = (points - center) @ axes
    u = (local[..., 0] / half_size + 1.0) * 0.5 * n_pixels - 0.5
    v = (1.0 - local[..., 1] / half_size) * 0.5 * n_pixels - 0.5
    return np.stack([u, v], axis=-1)


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Normals of vertices: those of their faces, averaged by area.

    Parameters
    ----------
    vertices : (n, 3).
    faces : (m, 3) vertex indices.

    Returns
    -------
    (n, 3) unit normals.
    """
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return mean_vertex_normals(len(vertices), faces, np.cross(b - a, c - a))


def _looking_along(direction: np.ndarray) -> np.ndarray:
    """Pose (4, 4) of a GL camera or light at the origin that looks (-z) along ``direction``, x horizontal."""
    z = -direction / np.linalg.norm(direction)
    x = np.cross([0.0, 0.0, 1.0], z)
    x = x / np.linalg.norm(x) if np.linalg.norm(x) > 1e-9 else np.array([1.0, 0.0, 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    return pose
