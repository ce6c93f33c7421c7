"""A furnished room, cameras around its middle, and the imaging: shadow, lens distortion, blur, noise.

A room in which everything is patterned and strongly colored, so that no color is the body's own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np

from ...camera.model import CameraModel
from ...camera.rig import Camera, CameraRig
from ...errors import UnknownNameError
from ...geometry import se3
from . import room
from .rasterizer import ColoredMesh, Rasterizer, TexturedMesh, light_coordinates
from .room import HALF_SIZE, HEIGHT, quad

_TEXELS_PER_M = 90.0


def meshes(seed: int) -> list[TexturedMesh]:
    """Floor, ceiling and walls, meters, Z up, floor at z = 0."""
    rng = np.random.default_rng([seed, 11])
    s, h = HALF_SIZE, HEIGHT
    corners = [(-s, -s), (s, -s), (s, s), (-s, s), (-s, -s)]
    result = [quad([(-s, -s, 0), (s, -s, 0), (s, s, 0), (-s, s, 0)], patches(rng, 2 * s, 2 * s))]
    result.append(quad([(-s, s, h), (s, s, h), (s, -s, h), (-s, -s, h)], patches(rng, 2 * s, 2 * s)))
    for (xa, ya), (xb, yb) in pairwise(corners):
        result.append(quad([(xb, yb, 0), (xa, ya, 0), (xa, ya, h), (xb, yb, h)], patches(rng, 2 * s, h)))
    return result


def patches(rng: np.random.Generator, width_m: float, height_m: float) -> np.ndarray:
    """Texture of things of 0.1 to 0.9 m over each other, half of them strongly colored.

    Parameters
    ----------
    rng : random numbers.
    width_m, height_m : of the surface.

    Returns
    -------
    (h, w, 3) uint8 RGB.
    """
    width, height = int(width_m * _TEXELS_PER_M), int(height_m * _TEXELS_PER_M)
    image: np.ndarray = np.empty((height, width, 3), dtype=np.float32)
    image[:] = _color(rng)
    for _ in range(int(9.0 * width_m * height_m)):
        w, h = (rng.uniform(0.1, 0.9, 2) ** 1.5 * _TEXELS_PER_M).astype(int) + 4
        thing: np.ndarray = np.empty((h, w, 3), dtype=np.float32)
        thing[:] = _color(rng)
        kind = rng.integers(4)
        if kind == 0:
            rows, columns = np.indices((h, w)) // int(rng.integers(4, 14))
            thing[(rows + columns) % 2 == 1] = _color(rng)
        elif kind == 1:
            thing[:, (np.arange(w) // int(rng.integers(3, 10))) % 2 == 1] = _color(rng)
        _lay(image, thing, rng)
    grain = rng.standard_normal((height, width, 1)).astype(np.float32)
    return np.clip(image + 6.0 * cv2.GaussianBlur(grain, (0, 0), 0.7)[:, :, None], 0, 255).astype(np.uint8)


def _lay(image: np.ndarray, thing: np.ndarray, rng: np.random.Generator) -> None:
    """``thing`` on ``image``, turned by any angle, anywhere."""
    (h, w), (height, width) = thing.shape[:2], image.shape[:2]
    turn = cv2.getRotationMatrix2D((0.5 * w, 0.5 * h), float(rng.uniform(0.0, 180.0)), 1.0)
    x, y = rng.uniform(0, width), rng.uniform(0, height)
    reach = 0.5 * np.hypot(w, h) + 2.0
    x0, x1 = max(0, int(x - reach)), min(width, int(x + reach) + 1)
    y0, y1 = max(0, int(y - reach)), min(height, int(y + reach) + 1)
    turn[:, 2] += (x - x0 - 0.5 * w, y - y0 - 0.5 * h)
    window = np.ascontiguousarray(image[y0:y1, x0:x1])
    cv2.warpAffine(thing, turn, (x1 - x0, y1 - y0), dst=window, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_TRANSPARENT)
    image[y0:y1, x0:x1] = window


def _color(rng: np.random.Generator) -> np.ndarray:
    """RGB (3,): every other one gray or pale, the others of any hue and strong."""
    saturation = rng.uniform(0.45, 0.95) if rng.random() < 0.5 else rng.uniform(0.0, 0.35)
    hsv = np.array([[[rng.uniform(0.0, 360.0), saturation, rng.uniform(0.25, 0.95)]]], dtype=np.float32)
    return 255.0 * cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)[0, 0]


_SHADOW_HALF_SIZE = 3.2  # meters about the middle of the floor that the shadow map covers
_SHADOW_PIXELS = 512
_SHADOW_DEPTH = 0.34  # fraction of the light that is lost in the full shadow
_BACKGROUND_SUPERSAMPLING = 2

SURROUNDINGS = {"room": room.meshes, "clutter": meshes}


@dataclass(frozen=True)
class SceneConfig:
    """Cameras on a circle about the world's origin, and what they do to an image.

    Parameters
    ----------
    n_cameras, width, height : the rig.
    radius, target_height : meters; cameras stand ``radius`` from the axis and look at (0, 0, target_height).
    focal_px : focal length.
    distortion : plumb_bob k1 k2 p1 p2 of every lens, or () for none.
    noise_levels : standard deviation of the sensor noise at middle gray, gray levels.
    blur_px : standard deviation of the optics' blur.
    shadow : whether the subject casts one.
    surroundings : of `SURROUNDINGS`.
    backgrounds : whether the empty room is recorded too.
    lossless : whether images are written as PNG, or as JPEG of high quality.
    seed : of the noise and of the small irregularities of the rig.
    """

    n_cameras: int = 6
    width: int = 640
    height: int = 480
    radius: float = 4.0
    target_height: float = 0.92
    focal_px: float = 580.0
    distortion: tuple[float, ...] = (-0.11, 0.045, 0.0006, -0.0004)
    noise_levels: float = 2.5
    blur_px: float = 0.5
    shadow: bool = True
    seed: int = 1
    surroundings: str = "room"
    backgrounds: bool = True
    lossless: bool = False

    def __post_init__(self):
        if self.surroundings not in SURROUNDINGS:
            raise UnknownNameError("surroundings", self.surroundings, list(SURROUNDINGS))


def make_rig(config: SceneConfig) -> CameraRig:
    """Cameras ``cam01``... on a circle, at alternating heights, none exactly like the next."""
    rng = np.random.default_rng(config.seed)
    cameras = []
    for i in range(config.n_cameras):
        angle = 2.0 * np.pi * (i + 0.3) / config.n_cameras + rng.uniform(-0.08, 0.08)
        radius = config.radius * rng.uniform(0.96, 1.04)
        height = (1.15, 2.1)[i % 2] + rng.uniform(-0.1, 0.1)
        center = np.array([radius * np.cos(angle), radius * np.sin(angle), height])
        target = np.array([0.0, 0.0, config.target_height]) + rng.uniform(-0.05, 0.05, 3)
        focal = config.focal_px * rng.uniform(0.98, 1.02)
        principal = 0.5 * np.array([config.width - 1, config.height - 1]) + rng.uniform(-6.0, 6.0, 2)
        K = np.array([[focal, 0.0, principal[0]], [0.0, focal, principal[1]], [0.0, 0.0, 1.0]])
        kind = "plumb_bob" if config.distortion else "none"
        lens = CameraModel(config.width, config.height, K, kind, np.array(config.distortion))
        cameras.append(Camera(f"cam{i + 1:02d}", lens, looking_at(center, target)))
    return CameraRig(tuple(cameras))


def looking_at(center: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Pose of a level camera.

    Parameters
    ----------
    center : (3,) of the camera, world.
    target : (3,) point that it looks at.

    Returns
    -------
    T_world_cam (4, 4), optical axes.
    """
    z = (target - center) / np.linalg.norm(target - center)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    return se3.from_rotation_translation(np.stack([x, np.cross(z, x), z], axis=1), center)


class CameraImaging:
    """What one camera does: an undistorted view with a margin is rendered, and pulled through its lens.

    Attributes
    ----------
    pinhole : the undistorted view that covers every pixel of the real one.
    """

    def __init__(self, camera: Camera, config: SceneConfig):
        self.camera, self._config = camera, config
        lens = camera.model
        u, v = np.meshgrid(np.arange(lens.width, dtype=float), np.arange(lens.height, dtype=float))
        rays, valid = lens.rays(np.stack([u, v], axis=-1))
        if not valid.all():
            raise ValueError(f"camera '{camera.name}': expected a lens that is invertible on its whole image")
        K = lens.K.copy()
        straight = (rays @ K.T)[..., :2] / rays[..., 2:]
        low = np.floor(straight.reshape(-1, 2).min(axis=0)) - 3.0
        size = np.ceil(straight.reshape(-1, 2).max(axis=0)) + 4.0 - low
        K[:2, 2] -= low
        self.pinhole = Camera(camera.name, CameraModel(int(size[0]), int(size[1]), K), camera.T_world_cam)
        self._map_u = np.ascontiguousarray(straight[..., 0] - low[0], dtype=np.float32)
        self._map_v = np.ascontiguousarray(straight[..., 1] - low[1], dtype=np.float32)
        self._straight = lens.distortion_model == "none"

    def expose(self, view_rgb: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Image of a view: lens, blur, noise.

        Parameters
        ----------
        view_rgb : (h, w, 3) float32 RGB, 0 to 255, of ``pinhole``.
        rng : random numbers of the noise.

        Returns
        -------
        (height, width, 3) uint8 BGR.
        """
        interpolation = cv2.INTER_NEAREST if self._straight else cv2.INTER_CUBIC
        image = cv2.remap(np.ascontiguousarray(view_rgb[:, :, ::-1]), self._map_u, self._map_v, interpolation)
        if self._config.blur_px > 0.0:
            image = cv2.GaussianBlur(image, (0, 0), self._config.blur_px)
        return self._noisy(image, rng)

    def _noisy(self, image: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """uint8 image with sensor noise: half of its variance is constant, half grows with the signal."""
        if self._config.noise_levels > 0.0:
            sigma = self._config.noise_levels * np.sqrt(0.5 + image.clip(0.0, 255.0) / 255.0)
            image = image + sigma * rng.standard_normal(image.shape, dtype=np.float32)
        return np.clip(np.rint(image), 0, 255).astype(np.uint8)


class Studio:
    """The room and its cameras; takes images of a subject. Use it in a ``with`` statement (it holds an OpenGL context)."""

    def __init__(self, rig: CameraRig, config: SceneConfig):
        self.rig, self.config = rig, config
        self._rasterizer = Rasterizer()
        self.imaging = [CameraImaging(camera, config) for camera in rig]
        self._rasterizer.show(*SURROUNDINGS[config.surroundings](config.seed))
        self._backgrounds, self._shadow_maps = [], []
        for imaging in self.imaging:
            background, points = self._background(imaging.pinhole)
            self._backgrounds.append(background)
            coordinates = light_coordinates(points, np.zeros(3), _SHADOW_HALF_SIZE, _SHADOW_PIXELS)
            self._shadow_maps.append([np.ascontiguousarray(coordinates[..., i], dtype=np.float32) for i in (0, 1)])

    def __enter__(self) -> Studio:
        return self

    def __exit__(self, *_) -> None:
        self._rasterizer.close()

    def _background(self, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """Empty room: float32 RGB of the view, and the world points (h, w, 3) seen in it."""
        K, size = camera.model.K, (camera.model.width, camera.model.height)
        large = camera.model.resized(*(_BACKGROUND_SUPERSAMPLING * length for length in size))
        color, depth = self._rasterizer.render(replace(camera, model=large))
        background = cv2.resize(color[:, :, :3], size, interpolation=cv2.INTER_AREA).astype(np.float32)
        depth = cv2.resize(depth, size, interpolation=cv2.INTER_NEAREST)
        u, v = np.meshgrid(*map(np.arange, size))
        rays = np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones_like(u)], -1)
        return background, se3.apply(camera.T_world_cam, rays * depth[:, :, None])

    def empty_image(self, index: int, image_number: int) -> np.ndarray:
        """Image of the empty room.

        Parameters
        ----------
        index : of the camera.
        image_number : each has another noise.

        Returns
        -------
        (h, w, 3) uint8 BGR.
        """
        return self.imaging[index].expose(self._backgrounds[index], self._rng(index, -1 - image_number))

    def images(self, subject: ColoredMesh, image_number: int) -> list[np.ndarray]:
        """Images of the subject in the room by every camera, at one time step.

        Parameters
        ----------
        subject : mesh in the world.
        image_number : each has another noise.

        Returns
        -------
        (h, w, 3) uint8 BGR, in the order of the rig.
        """
        return self.exposed(self.views(subject), image_number)

    def exposed(self, views: list[np.ndarray], image_number: int) -> list[np.ndarray]:
        """Images of views.

        Parameters
        ----------
        views : float32 RGB, one a camera, see `views`.
        image_number : each has another noise.

        Returns
        -------
        (h, w, 3) uint8 BGR, in the order of the rig.
        """
        return [self.imaging[i].expose(view, self._rng(i, image_number)) for i, view in enumerate(views)]

    def views(self, subject: ColoredMesh) -> list[np.ndarray]:
        """What every camera's `CameraImaging.pinhole` sees of the subject in the room: float32 RGB."""
        self._rasterizer.show(subject)
        shadow = None
        if self.config.shadow:
            cover = self._rasterizer.render_from_light(np.zeros(3), _SHADOW_HALF_SIZE, _SHADOW_PIXELS)
            shadow = cv2.GaussianBlur(cover, (0, 0), 3.0)
        return [self._view(i, subject, shadow) for i in range(len(self.rig))]

    def _view(self, index: int, subject: ColoredMesh, shadow: np.ndarray | None) -> np.ndarray:
        imaging = self.imaging[index]
        view = self._backgrounds[index]
        if shadow is not None:
            map_u, map_v = self._shadow_maps[index]
            darkness = cv2.remap(shadow, map_u, map_v, cv2.INTER_LINEAR)
            view = view * (1.0 - _SHADOW_DEPTH * darkness[:, :, None])
        else:
            view = view.copy()
        color, _, window = self._rasterizer.render_region(imaging.pinhole, subject.vertices)
        color = color.astype(np.float32)
        view[window] = color[:, :, :3] + (1.0 - color[:, :, 3:] / 255.0) * view[window]
        return view

    def _rng(self, index: int, image_number: int) -> np.random.Generator:
        return np.random.default_rng([self.config.seed, index, image_number + 1_000_000])
