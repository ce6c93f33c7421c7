"""Textures of a body's faces against images, in every camera's own brightness and contrast: by scores, or as least squares.

Points fixed to the textured faces carry the texture's colors; where they are seen, the image should have the same colors up to
a gain and an offset for each channel of each camera (the best for each state). So exposure, white balance and stray light do
not matter, and black-and-white textures work, whose intensity-normalized colors say nothing. A robust kernel tolerates hands in
front of the texture.

Faces must not hide each other: this is for boxes and plates, not for limbs.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ...camera.rig import CameraRig
from ...errors import ModelError
from ...model.articulated import ArticulatedModel, Shape
from ...model.configuration import Configuration, State
from ...model.shapes.primitives import BOX_FACES, Box
from ...parallel import Workers
from ..contour_residual import assemble
from ..normal_equations import NormalEquations
from . import texture_kernels as kernel

# Normal, direction of a texture's columns, and of its rows, of each face of a box (`model.shapes.primitives.Box`)
_FACE_AXES = {
    "+x": ((1, 0, 0), (0, 1, 0), (0, 0, -1)),
    "-x": ((-1, 0, 0), (0, -1, 0), (0, 0, -1)),
    "+y": ((0, 1, 0), (-1, 0, 0), (0, 0, -1)),
    "-y": ((0, -1, 0), (1, 0, 0), (0, 0, -1)),
    "+z": ((0, 0, 1), (1, 0, 0), (0, -1, 0)),
    "-z": ((0, 0, -1), (-1, 0, 0), (0, -1, 0)),
}


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points fixed to links.

    Attributes
    ----------
    positions, normals : (n, 3) in the frames of their links, meters; unit normals point outward.
    links : (n,) link of each point.
    colors : (n, 3) float32 RGB, 0..255, of the texture blurred as wide as the points are apart.
    spacing_m : distance of neighbors.
    """

    positions: np.ndarray
    normals: np.ndarray
    links: np.ndarray
    colors: np.ndarray
    spacing_m: float


def textured_extent(model: ArticulatedModel) -> float:
    """The longest edge of all textured faces, meters.

    Raises
    ------
    ModelError : when the model has no box with a texture on it.
    """
    edges = [max(abs(columns @ size), abs(rows @ size)) for _, size, (_, columns, rows), _ in _faces(model)]
    if not edges:
        raise ModelError(f"model '{model.name}' has no box with a texture on one of its faces (shapes.<name>.textures)")
    return float(max(edges))


def surface_points(model: ArticulatedModel, spacing_m: float) -> SurfacePoints:
    """A grid of points on every textured face.

    Parameters
    ----------
    model : with boxes that have textures.
    spacing_m : about how far apart points are.

    Returns
    -------
    The points of all faces.
    """
    textured_extent(model)
    positions, normals, links, colors = [], [], [], []
    for shape, size, (normal, columns, rows), texture in _faces(model):
        width, height = abs(columns @ size), abs(rows @ size)
        u, v = _cells(width, spacing_m), _cells(height, spacing_m)
        grid_u, grid_v = (g.ravel() for g in np.meshgrid(u, v))
        on_face = normal * size / 2.0 + np.outer((grid_u - 0.5) * width, columns) + np.outer((grid_v - 0.5) * height, rows)
        T = shape.T_link_shape
        positions.append(on_face @ T[:3, :3].T + T[:3, 3])
        normals.append(np.broadcast_to(T[:3, :3] @ normal, on_face.shape))
        links.append(np.full(len(on_face), model.chain.link_index(shape.link)))
        colors.append(_colors(texture, grid_u, grid_v, spacing_m, width, height))
    return SurfacePoints(
        np.concatenate(positions), np.concatenate(normals), np.concatenate(links), np.concatenate(colors), spacing_m
    )


def _faces(model: ArticulatedModel) -> list[tuple[Shape, np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray], np.ndarray]]:
    """(shape, size of its box, (normal, columns, rows) of the face, texture) of every face with a texture."""
    found = []
    for shape in model.shapes:
        if isinstance(shape.primitive, Box):
            for name, texture in zip(BOX_FACES, shape.primitive.textures or (), strict=False):
                if texture is not None:
                    normal, columns, rows = (np.array(axis, dtype=np.float64) for axis in _FACE_AXES[name])
                    found.append((shape, np.array(shape.primitive.size), (normal, columns, rows), texture))
    return found


def _cells(length: float, spacing: float) -> np.ndarray:
    """Centers, 0..1, of the cells that a length is divided into."""
    n = max(2, round(length / spacing))
    return (np.arange(n) + 0.5) / n


def _colors(texture: np.ndarray, u: np.ndarray, v: np.ndarray, spacing: float, width: float, height: float) -> np.ndarray:
    rows, columns = texture.shape[:2]
    blurred: np.ndarray = texture.astype(np.float32)
    sigma_x, sigma_y = 0.5 * spacing * columns / width, 0.5 * spacing * rows / height
    if max(sigma_x, sigma_y) > 0.3:
        blurred = cv2.GaussianBlur(blurred, (0, 0), max(sigma_x, 0.1), sigmaY=max(sigma_y, 0.1), borderType=cv2.BORDER_REPLICATE)
    x, y = (u * columns - 0.5).astype(np.float32), (v * rows - 0.5).astype(np.float32)
    # In strips: cv2.remap takes no more than 32767 rows
    strips = zip(np.array_split(x, 1 + x.size // 30000), np.array_split(y, 1 + y.size // 30000), strict=True)
    sampled = [cv2.remap(blurred, a[:, None], b[:, None], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for a, b in strips]
    return np.concatenate(sampled).reshape(-1, 3)


N_OCTAVES = 6
_DOUBT = 0.5  # views of all textures that weigh as much as not knowing


_POINTS_PER_EDGE = 72  # along the longest edge of a texture on the finest level; each coarser level has half as many
_LEVELS = 4  # 0 is the finest
_ROBUST_SCALE = 40.0  # gray levels of the texture at which a difference begins to count as something in front of it
_LEAST_COSINE = 0.2  # of a face's normal with the line of sight; flatter views are not used
_LEAST_POINTS = 100  # fewer, over all cameras, cannot be scored


@dataclass(frozen=True, eq=False)
class TextureScore:
    """Agreement of a state with the images.

    Attributes
    ----------
    score : robust cost as a fraction of what flat gray images would cost, 0 (perfect) to 1; infinite where nothing is compared.
        It is drawn towards 1 by as much as half a view of all textures weighs: little that is seen says little.
    camera_scores : the plain fraction of each camera, nan where it shows no textured face.
    camera_rms : robust rms difference, gray levels of the texture; 0 where there is none.
    camera_points : points that each camera shows.
    """

    score: float
    camera_scores: np.ndarray
    camera_rms: np.ndarray
    camera_points: np.ndarray


class TextureObjective:
    """Pictured faces against one image set at a time.

    Parameters
    ----------
    model : with boxes that have textures.
    workers : threads that share states; None: two.

    Raises
    ------
    ModelError : when no face of the model has a texture.
    """

    def __init__(self, model: ArticulatedModel, rig: CameraRig, workers: Workers | None = None):
        self.model, self.rig, self.workers = model, rig, workers or Workers(2)
        finest = textured_extent(model) / _POINTS_PER_EDGE
        self._points = [surface_points(model, finest * 2**k) for k in range(_LEVELS)]
        self._doubts = [_doubt(points.colors, _ROBUST_SCALE) for points in self._points]
        self._pyramids: list[list[np.ndarray] | None] = [None] * len(rig)

    @property
    def n_levels(self) -> int:
        return _LEVELS

    @property
    def sees(self) -> bool:
        """Whether any camera has an image."""
        return any(pyramid is not None for pyramid in self._pyramids)

    def set_images(self, images: Sequence[np.ndarray | None]) -> None:
        """BGR images (h, w, 3) uint8 in the order of the rig; None for a camera that gave none."""
        self._pyramids = [None if image is None else _pyramid(image) for image in images]

    def at_level(self, level: int) -> TextureLevel:
        """The objective on one level; what is seen is decided at its first linearization and kept."""
        return TextureLevel(self, self._points[level], self._pyramids, self._doubts[level])

    def at_row_step(self, row_step: int) -> TextureScores:
        """Scores on the level whose points are about ``row_step`` times as far apart as the finest."""
        return TextureScores(self, min(round(math.log2(row_step)), _LEVELS - 1))

    def evaluate(self, state: State, level: int = 0) -> TextureScore:
        """The score of one state, camera by camera.

        Parameters
        ----------
        state : of the body.
        level : of the pyramid, 0 the finest.

        Returns
        -------
        The score, and that of each camera.
        """
        return self.at_level(level).evaluate(state)

    def score(self, state: State) -> float:
        """Score of a state; infinite where it cannot be scored."""
        return self.evaluate(state).score

    def scores(self, states: Sequence[State]) -> np.ndarray:
        """(n,) of `score`."""
        return TextureScores(self, 0).scores(states)


def _doubt(colors: np.ndarray, scale: float) -> float:
    """What little that is seen weighs: a share of the robust cost of flat images."""
    return _DOUBT * scale**2 * float(np.log1p(((colors - colors.mean(axis=0)) / scale) ** 2).sum())


class TextureScores:
    """`TextureObjective` by scores alone, on one level."""

    def __init__(self, objective: TextureObjective, level: int):
        self._objective, self._level = objective, level

    def at_row_step(self, row_step: int) -> TextureScores:
        return self._objective.at_row_step(row_step)

    def score(self, state: State) -> float:
        return self._objective.evaluate(state, self._level).score

    def scores(self, states: Sequence[State]) -> np.ndarray:
        """(n,) of `score`, over the threads of the objective."""

        def run(part: Sequence[State]) -> list[float]:
            level = self._objective.at_level(self._level)
            return [level.evaluate(state).score for state in part]

        n = self._objective.workers.threads
        if n < 2 or len(states) < 8:
            return np.array(run(states))
        cuts = [len(states) * i // n for i in range(n + 1)]
        parts = self._objective.workers.map(run, [states[a:b] for a, b in itertools.pairwise(cuts)])
        return np.concatenate([np.array(part) for part in parts])


class TextureLevel:
    """Least squares on one level (`LeastSquaresObjective`)."""

    def __init__(
        self, objective: TextureObjective, points: SurfacePoints, pyramids: Sequence[list[np.ndarray] | None], doubt: float
    ):  # fmt: skip
        self.model = objective.model
        self._points = points
        self._pyramids = pyramids
        n, n_cameras = len(points.positions), len(objective.rig)
        self._kernel_points = (points.positions, np.ascontiguousarray(points.normals), points.links)
        self._cameras = [_camera(camera, _LEAST_COSINE) for camera in objective.rig]
        self._flags = np.zeros((n_cameras, n), dtype=np.uint8)
        self._values, self._gradients, self._places = np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 3))
        self._weights = np.empty(n)
        self._frozen: list[int] | None = None  # octave of each camera
        self._doubt = doubt

    def linearize(self, state: State) -> NormalEquations:
        """Normal equations in squared gray levels; the points that count are those seen at the first call."""
        configuration = Configuration(self.model, state)
        octaves, frozen = self._octaves(configuration), self._frozen is not None
        self._frozen = octaves
        chain = self.model.chain
        n_links = len(chain.links)
        normal, gradient = np.zeros((n_links, 6, 6)), np.zeros((n_links, 6))
        shared: list[np.ndarray] = []
        cost, count = 0.0, 0
        for i, octave in enumerate(octaves):
            if not self._look(i, octave, configuration, frozen):
                continue
            for channel in range(3):
                fit = self._fit(i, channel)
                cost, count = cost + fit[5], count + fit[7]
                if fit[4] <= 0.0:
                    continue
                rows = np.zeros((2, n_links, 6))
                kernel.add_channel(
                    self._points.colors, self._values, self._gradients, self._places, self._points.links, self._flags[i],
                    channel, fit[:5], self._weights, normal, gradient, rows,
                )  # fmt: skip
                shared.append(rows)
        H, g = np.zeros((chain.n_dof, chain.n_dof)), np.zeros(chain.n_dof)
        assemble(normal, gradient, chain.link_moved_by, configuration.twists, H, g)
        for rows in shared:
            # (2, n_dof): what gain and offset would explain
            explained = np.einsum("sla,da,ld->sd", rows, configuration.twists, chain.link_moved_by.astype(np.float64))
            H -= explained.T @ explained
        return NormalEquations(H, g, cost, count)

    def camera_equations(self, state: State) -> list[None]:
        """Gray levels of cameras are not compared."""
        return [None] * len(self._cameras)

    def evaluate(self, state: State) -> TextureScore:
        """Score of a state by what is seen in it."""
        configuration = Configuration(self.model, state)
        n_cameras = len(self._cameras)
        costs, flats, points = np.zeros(n_cameras), np.zeros(n_cameras), np.zeros(n_cameras, dtype=np.int64)
        for i, octave in enumerate(self._octaves(configuration)):
            if self._look(i, octave, configuration, False):
                fits = [self._fit(i, channel) for channel in range(3)]
                costs[i], flats[i] = sum(fit[5] for fit in fits), sum(fit[6] for fit in fits)
                points[i] = fits[0][7]
        camera_scores = costs / np.where(flats > 0.0, flats, np.nan)
        camera_rms = np.sqrt(costs / np.maximum(3 * points, 1))
        if points.sum() < _LEAST_POINTS or flats.sum() <= 0.0:
            return TextureScore(math.inf, camera_scores, camera_rms, points)
        score = (costs.sum() + self._doubt) / (flats.sum() + self._doubt)
        return TextureScore(float(score), camera_scores, camera_rms, points)

    def _octaves(self, configuration: Configuration) -> list[int]:
        """For each camera, how many times its image is halved so that points are about two pixels apart; -1 without an image."""
        if self._frozen is not None:
            return self._frozen
        center = configuration.Ts_world_link[self._points.links[0], :3, 3]
        octaves = []
        for (params, R, t, _, _), pyramid in zip(self._cameras, self._pyramids, strict=True):
            depth = max(float(R[2] @ center + t[2]), 0.05)
            pixels = self._points.spacing_m * params[0] / depth
            octave = round(math.log2(max(pixels, 1.0) / 2.0))
            octaves.append(-1 if pyramid is None else min(max(octave, 0), len(pyramid) - 1))
        return octaves

    def _look(self, i: int, octave: int, configuration: Configuration, frozen: bool) -> bool:
        """Fill the work arrays for camera ``i``; False where it shows too little."""
        pyramid = self._pyramids[i]
        if pyramid is None:
            return False
        inside = kernel.look(
            self._kernel_points, configuration.Ts_world_link, self._cameras[i], (pyramid[octave], octave), frozen,
            self._flags[i], self._values, self._gradients, self._places,
        )  # fmt: skip
        if not frozen and inside < kernel.LEAST_POINTS:
            self._flags[i] = kernel.UNSEEN  # not counted later either
            return False
        return True

    def _fit(self, i: int, channel: int) -> tuple:
        return kernel.fit_brightness(
            self._points.colors, self._values, self._flags[i], channel, _ROBUST_SCALE, self._weights
        )


def _camera(camera, least_cosine: float) -> tuple:
    T = camera.T_cam_world
    R, t = np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3])
    return camera.model.params, R, t, np.ascontiguousarray(camera.center), least_cosine


def _pyramid(image: np.ndarray) -> list[np.ndarray]:
    """The RGB image, and again and again at half its size; pixel (u, v) of a level is (2u, 2v) of the one before."""
    levels = [cv2.cvtColor(image, cv2.COLOR_BGR2RGB)]
    while len(levels) < N_OCTAVES and min(levels[-1].shape[:2]) > 8:
        levels.append(cv2.pyrDown(levels[-1]))
    return levels
