"""Direct photometric alignment: the colors that the surface of a body should have, against blurred images, as least squares.

On each level of an image pyramid, points of the drawn body's surface are frozen with their colors and moved with the body; the
residual is the blurred image's color where a point is seen, less its own. The blur makes a limb's outline attract from both
sides, where the score of the mask lets a limb slide within its own color; frozen points cannot be won by hiding.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...camera.model import project_point
from ...camera.rig import Camera, CameraRig
from ...compiled.kernels import compiled
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...parallel import serial
from ...render.raycast.raycaster import render_color, render_labels
from ..contour_residual import assemble
from ..gains import gains_of
from ..normal_equations import NormalEquations
from ..per_camera import bodies_seen, cameras_by_body, moved_state

_BLUR = 1.2  # px, before every halving
_FINEST_BLUR = 0.7  # px
_GAIN_STEP_PX = 4  # from pixel to pixel, across and down, that tell of an image's gain
_REWEIGHTED = 3  # times that gains of images are found, each with the weights of the one before
_LEAST_SUM = np.float32(20.0)  # of red, green and blue, for the intensity-normalized color of a dark pixel
_WHITE = np.float32(255.0)


Offsets = Sequence[np.ndarray | None]

Picture = tuple[np.ndarray, float, float, int]
"""Features (h, w, c) float32 of a part of an image, its first column and row in the whole one, and how often that was halved."""


@dataclass(frozen=True)
class PhotometryOptions:
    """What is compared, and how finely.

    Attributes
    ----------
    representation, normalized_weight : see `objective.color.score.ColorOptions`.
    levels : of the pyramid; level 0 has the full resolution.
    step : every n-th pixel of a level in both directions gives a point (at least every second pixel of the full image).
    robust_scale : gray levels at which a difference begins to count as something else in front of the body, on the finest level;
        the second has twice as many and so on, for a body that is off differs much at first.
    """

    representation: str = "raw"
    normalized_weight: float = 0.5
    levels: int = 4
    step: int = 1
    robust_scale: float = 100.0


def features_of(rgb: np.ndarray, options: PhotometryOptions) -> np.ndarray:
    """What the representation compares of colors; squared distances are those of the score, but for dark pixels.

    Colors over intensity are divided by the sum of red, green and blue, here by 20 at least, in the score
    (`objective.color`) by 1 at least.

    Parameters
    ----------
    rgb : (..., 3) in 0..255.
    options : with the representation.

    Returns
    -------
    (..., 3 or 6) float32.
    """
    rgb = np.asarray(rgb, dtype=np.float32)
    if options.representation == "raw":
        return rgb
    weight = 1.0 if options.representation == "normalized" else options.normalized_weight
    n = 3 if options.representation == "normalized" else 6
    features = np.empty((*rgb.shape[:-1], n), dtype=np.float32)
    shares = np.float32(math.sqrt(1.0 - weight)), np.float32(math.sqrt(weight))
    _fill_features(np.ascontiguousarray(rgb).reshape(-1, 3), *shares, features.reshape(-1, n))
    return features


@compiled
def _fill_features(rgb, raw_share, normalized_share, out):
    """Weighted RGB, where there is room for it, and then weighted RGB over intensity."""
    n = out.shape[1]
    for i in range(rgb.shape[0]):
        r, g, b = rgb[i, 0], rgb[i, 1], rgb[i, 2]
        over = max(r + g + b, _LEAST_SUM)
        if n == 6:
            out[i, 0], out[i, 1], out[i, 2] = raw_share * r, raw_share * g, raw_share * b
        out[i, n - 3] = normalized_share * (_WHITE * r / over)
        out[i, n - 2] = normalized_share * (_WHITE * g / over)
        out[i, n - 1] = normalized_share * (_WHITE * b / over)


@dataclass(frozen=True, eq=False)
class _Points:
    """Surface points of one camera: positions (n, 3) in the frames of links (n,), features (n, c), where they are in the image
    (n, 2), image pixels per point."""

    positions: np.ndarray
    links: np.ndarray
    features: np.ndarray
    pixels: np.ndarray
    area: float


class SurfacePhotometry:
    """A colored body against one image set at a time.

    Parameters
    ----------
    model, rig : body with colors, cameras with lights.
    parallel : maps a function over cameras.
    """

    def __init__(
        self,
        model: ArticulatedModel,
        rig: CameraRig,
        options: PhotometryOptions | None = None,
        parallel: Callable[[Callable, list], list] = serial,
    ):
        self.model, self.rig, self.options, self.parallel = model, rig, options or PhotometryOptions(), parallel
        self.painted = [model] * len(rig)
        self.pictures: list[list[Picture] | None] = [None] * len(rig)
        self.cameras = [_kernel_camera(camera) for camera in rig]

    @property
    def n_levels(self) -> int:
        return self.options.levels

    def set_colors(self, colors_rgb: np.ndarray | None) -> None:
        """(n_cameras, n_shapes, 3) in 0..255: the shapes' colors as each camera shows them; None: those of the model."""
        if colors_rgb is None:
            self.painted = [self.model] * len(self.rig)
        else:
            self.painted = [_painted(self.model, colors) for colors in colors_rgb]

    def set_images(
        self, images: Sequence[np.ndarray | None], expected: State, margin_px: int, offsets: Offsets | None = None
    ) -> None:
        """Take the images of one set.

        Parameters
        ----------
        images : BGR, in the order of the rig; None for a camera that gave none.
        expected, margin_px : images are processed within this margin about the body in this state.
        offsets : of each camera, see `correspond`.
        """
        bodies = bodies_seen(self.model, expected, offsets or [None] * len(self.rig))

        def look(i: int) -> list | None:
            image = images[i]
            found = None if image is None else render_labels(bodies[i], self.rig.cameras[i], margin_px)
            return None if image is None or found is None else _pyramid(image, found[0], self.options)

        self.pictures = self.parallel(look, list(range(len(self.rig))))

    def gains(self, images: Sequence[np.ndarray | None], state: State) -> np.ndarray:
        """What brings images into the light of the model, see `objective.gains`.

        Parameters
        ----------
        images : BGR, in the order of the rig; None for a camera that gave none.
        state : where the body is in them.

        Returns
        -------
        (n_cameras, 3) of red, green and blue; 1 of a camera that does not show the body.
        """
        raw = PhotometryOptions()

        def look(i: int) -> np.ndarray:
            image = images[i]
            points = None if image is None else _sample(self.painted[i], state, self.rig.cameras[i], self.rig, raw, _GAIN_STEP_PX)
            return np.ones(3) if image is None or points is None else _gains(points, image, self.options.robust_scale)

        return np.array(self.parallel(look, list(range(len(self.rig)))))

    def correspond(self, state: State, level: int, offsets: Offsets | None = None) -> SurfaceCorrespondences:
        """Points of the surface that is seen.

        Parameters
        ----------
        state : of the body.
        level : of the pyramid, 0 the finest.
        offsets : of each camera the tangent (n_dof,) from a state to where the body is when it exposes; None: where it says.

        Returns
        -------
        Points with the colors that they should have; they ride on the body, whatever its state.
        """
        spacing, offsets = max(2, self.options.step << level), offsets or [None] * len(self.rig)

        def sample(i: int) -> _Points | None:
            if self.pictures[i] is None:
                return None
            seen = moved_state(state, offsets[i])
            return _sample(self.painted[i], seen, self.rig.cameras[i], self.rig, self.options, spacing)

        points = self.parallel(sample, list(range(len(self.rig))))
        pictures = [None if pyramid is None else pyramid[level] for pyramid in self.pictures]
        all_links = np.ones(len(self.model.chain.links), dtype=np.bool_)
        scale = self.options.robust_scale * (1 + level)
        return SurfaceCorrespondences(self.model, self.cameras, points, pictures, scale, all_links, offsets, self.parallel)


@dataclass(frozen=True, eq=False)
class SurfaceCorrespondences:
    """Points of a surface against the images of one set, on one level of the pyramid (`Correspondences`), in gray levels squared.

    Attributes
    ----------
    model, cameras : the body, and the cameras' constants.
    points, pictures : of each camera, None where it shows nothing.
    robust_scale : gray levels at which a difference begins to count as something else.
    links : (n_links,) mask of those whose points count.
    offsets : of each camera, see `SurfacePhotometry.correspond`.
    parallel : maps a function over cameras.
    """

    model: ArticulatedModel
    cameras: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]]
    points: Sequence[_Points | None]
    pictures: Sequence[Picture | None]
    robust_scale: float
    links: np.ndarray
    offsets: Offsets
    parallel: Callable[[Callable, list], list]

    def on_links(self, links: np.ndarray) -> SurfaceCorrespondences:
        """Only the points on some links (mask (n_links,))."""
        return replace(self, links=links)

    def linearize(self, state: State) -> NormalEquations:
        """Normal equations in gray levels squared."""
        chain, n_links = self.model.chain, len(self.links)
        bodies, cameras = bodies_seen(self.model, state, self.offsets), self._cameras
        sums = np.zeros((len(self.cameras), N_SUMS))
        found = dict(zip(cameras, self._run(bodies, True, sums), strict=True))
        H, g = np.zeros((chain.n_dof, chain.n_dof)), np.zeros(chain.n_dof)
        for together in cameras_by_body(cameras, bodies):
            link_normal, link_gradient = np.zeros((n_links, 6, 6)), np.zeros((n_links, 6))
            for i in together:
                link_normal += found[i][0]
                link_gradient += found[i][1]
            mirror(link_normal)
            assemble(link_normal, link_gradient, chain.link_moved_by, bodies[together[0]].twists, H, g)
        return NormalEquations(H, g, float(sums[:, COST].sum()), int(sums[:, COUNT].sum()))

    def link_information(self, state: State) -> np.ndarray:
        """(n_links, 6, 6) what of H is about the spatial twist of each link."""
        result = np.zeros((len(self.links), 6, 6))
        for normal, _ in self._run(bodies_seen(self.model, state, self.offsets), True, np.zeros((len(self.cameras), N_SUMS))):
            result += normal
        mirror(result)
        return result

    def camera_equations(self, state: State) -> list[None]:
        """Gray levels of cameras are not compared."""
        return [None] * len(self.cameras)

    def cost(self, state: State) -> float:
        """Robust cost alone."""
        return float(self.sums(state)[:, COST].sum())

    def sums(self, state: State) -> np.ndarray:
        """(n_cameras, `N_SUMS`), weighted by the image pixels that a point stands for."""
        sums = np.zeros((len(self.cameras), N_SUMS))
        self._run(bodies_seen(self.model, state, self.offsets), False, sums)
        return sums

    @property
    def _cameras(self) -> list[int]:
        """Indices of those that show the body."""
        return [i for i, mine in enumerate(self.points) if mine is not None]

    def _run(self, bodies: Sequence[Configuration], derivatives: bool, sums: np.ndarray) -> list:
        n_links = len(self.links) if derivatives else 0

        def run(i: int) -> tuple[np.ndarray, np.ndarray]:
            mine, picture = self.points[i], self.pictures[i]
            assert mine is not None and picture is not None
            normal, gradient = np.zeros((n_links, 6, 6)), np.zeros((n_links, 6))
            add_points(
                (mine.positions, mine.links, mine.features), self.links, bodies[i].Ts_world_link, self.cameras[i],
                picture, self.robust_scale, derivatives, normal, gradient, sums[i],
            )  # fmt: skip
            sums[i] *= mine.area
            return mine.area * normal, mine.area * gradient

        return self.parallel(run, self._cameras)


def _kernel_camera(camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    T = camera.T_cam_world
    return camera.model.params, np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3])


def _painted(model: ArticulatedModel, colors: np.ndarray) -> ArticulatedModel:
    shapes = []
    for shape, (r, g, b) in zip(model.shapes, np.rint(colors).astype(int).tolist(), strict=True):
        shapes.append(replace(shape, color_rgb=(r, g, b)))
    return replace(model, shapes=tuple(shapes))


def _pyramid(bgr: np.ndarray, region: tuple[int, int, int, int], options: PhotometryOptions) -> list:
    """Features on each level, with the place of the first pixel in the image and the number of halvings."""
    u0, v0, u1, v1 = region
    smooth = cv2.GaussianBlur(cv2.cvtColor(np.ascontiguousarray(bgr[v0:v1, u0:u1]), cv2.COLOR_BGR2RGB).astype(np.float32),
                              (0, 0), _FINEST_BLUR)  # fmt: skip
    levels = [(features_of(smooth, options), float(u0), float(v0), 0)]
    for octave in range(1, options.levels):
        if min(smooth.shape[:2]) < 4:
            levels.append(levels[-1])
            continue
        smooth = cv2.GaussianBlur(smooth, (0, 0), _BLUR)
        height, width = smooth.shape[0] // 2, smooth.shape[1] // 2
        smooth = cv2.resize(smooth[: 2 * height, : 2 * width], (width, height), interpolation=cv2.INTER_AREA)
        levels.append((features_of(smooth, options), float(u0), float(v0), octave))
    return levels


def _sample(
    model: ArticulatedModel, state: State, camera: Camera, rig: CameraRig, options: PhotometryOptions, spacing: int
) -> _Points | None:
    """Every ``spacing``-th pixel of the drawn body, back on the surface."""
    configuration = Configuration(model, state)
    found = render_labels(configuration, camera)
    if found is None:
        return None
    region, _ = found
    view = render_color(configuration, camera, rig.lights, region)
    grid = np.s_[spacing // 2 :: spacing, spacing // 2 :: spacing]
    rows, columns = np.nonzero(view.labels[grid])
    v, u = spacing * rows + spacing // 2, spacing * columns + spacing // 2
    rays, _ = camera.model.rays(np.stack([u + region[0], v + region[1]], axis=-1).astype(np.float64))
    local = rays / rays[:, 2:] * view.depth[v, u, None]
    T = camera.T_world_cam
    world = local @ T[:3, :3].T + T[:3, 3]
    links = model.shape_links[view.labels[v, u].astype(np.int64) - 1]
    Ts = configuration.Ts_world_link[links]
    positions = np.einsum("nji,nj->ni", Ts[:, :3, :3], world - Ts[:, :3, 3])
    features = features_of(view.rgb[v, u], options).astype(np.float64)
    pixels = np.stack([u + region[0], v + region[1]], axis=-1)
    return _Points(np.ascontiguousarray(positions), links, np.ascontiguousarray(features), pixels, float(spacing * spacing))


def _gains(points: _Points, bgr: np.ndarray, robust_scale: float) -> np.ndarray:
    """(3,) of an image, by points with raw features; some may show something else."""
    u, v = points.pixels.T
    seen, expected = bgr[v, u, ::-1].astype(np.float64), points.features
    gains, weights = np.ones(3), np.ones((len(seen), 1))
    for _ in range(_REWEIGHTED):
        gains = gains_of((weights * expected * seen).sum(axis=0), (weights * seen * seen).sum(axis=0))
        weights = (1.0 + np.sum((expected - gains * seen) ** 2, axis=1, keepdims=True) / robust_scale**2) ** -2
    return gains


COST, WEIGHTED_SQUARES, WEIGHT, COUNT, N_SUMS = 0, 1, 2, 3, 4


@compiled
def _spline(t, at, by):
    """Fill weights (4,) of the pixels around, and their derivatives, at ``t`` from the second to the third: quadratic B-splines.

    Their slope is that of central differences, interpolated; where a bilinear surface has an edge at each pixel, and points that
    begin in the middle of pixels would be held there.
    """
    at[0], at[1], at[2], at[3] = 0.25 * (1.0 - t) ** 2, 0.25 * (2.0 - t * t), 0.25 * (1.0 + 2.0 * t - t * t), 0.25 * t * t
    by[0], by[1], by[2], by[3] = -0.5 * (1.0 - t), -0.5 * t, 0.5 * (1.0 - t), 0.5 * t


@compiled
def add_points(points, used_links, Ts_world_link, camera, picture, robust_scale, derivatives, normal, gradient, sums):
    """Add the points of some links to a camera's sums.

    A point that has left the image costs what a difference of ``robust_scale`` does, wherever it goes.

    Parameters
    ----------
    points : positions (n, 3) in the frames of their links, links (n,), features (n, n_channels) that they should have.
    used_links : (n_links,) mask.
    Ts_world_link : (n_links, 4, 4).
    camera : params, R_cam_world (3, 3), t_cam_world (3,).
    picture : features (h, w, n_channels) float32, first column and row (of the full image), and how often that was halved.
    robust_scale : gray levels at which a difference begins to count as something else.
    derivatives : False leaves ``normal`` and ``gradient`` alone.
    normal, gradient : (n_links, 6, 6) and (n_links, 6), about twists (v, omega) at the world's origin, added to.
    sums : (`N_SUMS`,) robust cost, weighted squares, weights and number of points, added to.
    """
    positions, links, features = points
    params, R, t = camera
    pixels, u0, v0, octave = picture
    height, width, n_channels = pixels.shape
    shrink, scale2 = 1.0 / (1 << octave), robust_scale * robust_scale
    x, g, b, M = np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3))
    at_u, by_u, at_v, by_v = np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    W = np.zeros((6, 3))  # wrench_D_force of a point: the force, and its moment about the world's origin
    W[0, 0], W[1, 1], W[2, 2] = 1.0, 1.0, 1.0
    for i in range(positions.shape[0]):
        link = links[i]
        if not used_links[link]:
            continue
        T, p = Ts_world_link[link], positions[i]
        for a in range(3):
            x[a] = T[a, 0] * p[0] + T[a, 1] * p[1] + T[a, 2] * p[2] + T[a, 3]
        ok, u, v, ux, uy, uz, vx, vy, vz = project_point(
            params,
            R[0, 0] * x[0] + R[0, 1] * x[1] + R[0, 2] * x[2] + t[0],
            R[1, 0] * x[0] + R[1, 1] * x[1] + R[1, 2] * x[2] + t[1],
            R[2, 0] * x[0] + R[2, 1] * x[1] + R[2, 2] * x[2] + t[2],
        )
        sums[COUNT] += 1.0
        u, v = (u - u0 + 0.5) * shrink - 0.5, (v - v0 + 0.5) * shrink - 0.5
        if not ok or u < 1.0 or v < 1.0 or u >= width - 2.0 or v >= height - 2.0:
            sums[COST] += scale2 * math.log(2.0)
            continue
        left, top = int(u), int(v)
        _spline(u - left, at_u, by_u)
        _spline(v - top, at_v, by_v)
        square = 0.0
        for a in range(3):
            b[a] = 0.0
            for c in range(3):
                M[a, c] = 0.0
        for c in range(n_channels):
            value, along_u, along_v = 0.0, 0.0, 0.0
            for j in range(4):
                across, slope = 0.0, 0.0
                for k in range(4):
                    pixel = pixels[top + j - 1, left + k - 1, c]
                    across += at_u[k] * pixel
                    slope += by_u[k] * pixel
                value += at_v[j] * across
                along_u += at_v[j] * slope
                along_v += by_v[j] * across
            r = value - features[i, c]
            square += r * r
            if derivatives:
                along_u, along_v = along_u * shrink, along_v * shrink
                gx, gy, gz = along_u * ux + along_v * vx, along_u * uy + along_v * vy, along_u * uz + along_v * vz
                for a in range(3):
                    g[a] = gx * R[0, a] + gy * R[1, a] + gz * R[2, a]
                for a in range(3):
                    b[a] += g[a] * r
                    for d in range(3):
                        M[a, d] += g[a] * g[d]
        off = square / scale2
        weight = 1.0 / (1.0 + off)  # Cauchy
        sums[COST] += scale2 * math.log(1.0 + off)
        sums[WEIGHTED_SQUARES] += weight * square
        sums[WEIGHT] += weight
        if derivatives:
            W[3, 1], W[3, 2], W[4, 0], W[4, 2], W[5, 0], W[5, 1] = -x[2], x[1], x[2], -x[0], -x[1], x[0]
            for a in range(6):
                gradient[link, a] += weight * (W[a, 0] * b[0] + W[a, 1] * b[1] + W[a, 2] * b[2])
                for d in range(a, 6):
                    value = 0.0
                    for e in range(3):
                        value += W[a, e] * (M[e, 0] * W[d, 0] + M[e, 1] * W[d, 1] + M[e, 2] * W[d, 2])
                    normal[link, a, d] += weight * value


@compiled
def mirror(normal):
    """Fill the lower triangles of (n, 6, 6)."""
    for link in range(normal.shape[0]):
        for a in range(6):
            for b in range(a):
                normal[link, a, b] = normal[link, b, a]
