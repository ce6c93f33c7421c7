"""Bundle adjustment over cameras, lenses and the poses of a board that they see.

Levenberg-Marquardt with analytic derivatives and a robust loss (Cauchy); the board's poses are eliminated (Schur complement),
since each stands in few of the equations (Triggs et al., "Bundle adjustment: a modern synthesis", 2000, section 6). The first
camera holds the world. A lens is a `lens_vector`; its prior is weak.

Cameras that do not expose at one time see a moving board at different places. With ``velocities`` each view sees the board
where it is at the view's own time; by how much a camera's clock is wrong, and by how much the stamp of each single view, can then
be sought as well (the stamps are eliminated, too: each stands in its view's equations only).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...camera.model import CameraModel
from ...geometry import se3, so3
from ...optimize.descent import ArrowEquations, descend

# Coefficients that are sought, in the orders of `camera.distortion`, and how large each may be expected to be (a weak prior, so
# that few or central views do not blow up what they do not tell)
COEFFICIENTS = {
    "none": (),
    "plumb_bob": ("k1", "k2", "p1", "p2", "k3"),
    "rational_polynomial": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "equidistant": ("k1", "k2", "k3", "k4"),
}
COEFFICIENT_SIGMA = {"k1": 1.0, "k2": 1.0, "p1": 0.02, "p2": 0.02, "k3": 1.0, "k4": 0.5, "k5": 0.5, "k6": 0.5}
N_PINHOLE = 4


def lens_vector(model: CameraModel) -> np.ndarray:
    """(4 + n,) of a lens without skew; n as in `COEFFICIENTS`, whatever the model has."""
    coefficients = np.zeros(len(COEFFICIENTS[model.distortion_model]))
    coefficients[: model.distortion.size] = model.distortion
    return np.concatenate([[model.K[0, 0], model.K[1, 1], model.K[0, 2], model.K[1, 2]], coefficients])


def lens_of_vector(vector: np.ndarray, like: CameraModel) -> CameraModel:
    """The lens of a vector.

    Parameters
    ----------
    vector : (4 + n,) see `lens_vector`.
    like : lens with the image size and the kind of distortion.

    Returns
    -------
    A lens without skew.

    Raises
    ------
    ValueError : a focal length that is not positive.
    """
    fx, fy, cx, cy = vector[:N_PINHOLE]
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return CameraModel(like.width, like.height, K, like.distortion_model, vector[N_PINHOLE:])


def lens_prior(model: CameraModel) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation (4 + n,) of what a lens may be: the principal point near the middle, little distortion.

    Focal lengths are left alone: their deviation is infinite.
    """
    width, height = model.width, model.height
    names = COEFFICIENTS[model.distortion_model]
    mean = np.concatenate([np.zeros(2), [(width - 1) / 2.0, (height - 1) / 2.0], np.zeros(len(names))])
    near = 0.1 * max(width, height)
    return mean, np.concatenate([[np.inf, np.inf, near, near], [COEFFICIENT_SIGMA[name] for name in names]])


def lens_jacobian(model: CameraModel, points_cam: np.ndarray) -> np.ndarray:
    """Derivative of pixels by the lens vector.

    Parameters
    ----------
    model : the lens.
    points_cam : (m, 3) in the camera's frame, in front of it.

    Returns
    -------
    (m, 2, 4 + n).
    """
    x, y = points_cam[:, 0] / points_cam[:, 2], points_cam[:, 1] / points_cam[:, 2]
    by_distortion = _distortion_jacobian(model, x, y)
    fx, fy, cx, cy = lens_vector(model)[:N_PINHOLE]
    pixels, _ = model.project(points_cam)
    result = np.zeros((len(points_cam), 2, N_PINHOLE + by_distortion.shape[2]))
    result[:, 0, 0], result[:, 1, 1] = (pixels[:, 0] - cx) / fx, (pixels[:, 1] - cy) / fy
    result[:, 0, 2] = result[:, 1, 3] = 1.0
    result[:, 0, N_PINHOLE:], result[:, 1, N_PINHOLE:] = fx * by_distortion[:, 0], fy * by_distortion[:, 1]
    return result


def _distortion_jacobian(model: CameraModel, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(m, 2, n): change of the distorted normalized coordinates with the coefficients."""
    r2 = x * x + y * y
    if model.distortion_model == "none":
        return np.zeros((len(x), 2, 0))
    if model.distortion_model == "equidistant":
        r = np.sqrt(r2)
        theta = np.arctan(r)
        over_r = np.where(r > 1e-8, 1.0 / np.maximum(r, 1e-8), 0.0)
        radial = [theta ** (2 * i + 3) * over_r for i in range(4)]
        return np.stack([np.stack([x * f, y * f], axis=1) for f in radial], axis=2)
    k = np.zeros(8)
    k[: model.distortion.size] = model.distortion
    top = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))
    bottom = 1.0 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]))
    numerator, denominator = [r2**i / bottom for i in (1, 2, 3)], [-top * r2**i / bottom**2 for i in (1, 2, 3)]
    columns = [np.stack([x * f, y * f], axis=1) for f in (*numerator[:2], numerator[2], *denominator)]
    tangential = [np.stack([2 * x * y, r2 + 2 * y * y], axis=1), np.stack([r2 + 2 * x * x, 2 * x * y], axis=1)]
    n = len(COEFFICIENTS[model.distortion_model])
    return np.stack([*columns[:2], *tangential, *columns[2:]], axis=2)[:, :, :n]


_CORNER_SIGMA_PX = 0.3  # error of a corner, against which priors count
CLOCK, N_PLACE = 6, 7  # of a camera's parameters: six for its place, then the clock, then the lens


@dataclass(frozen=True, eq=False)
class CameraRows:
    """What one camera saw: m corners at the time steps ``time_step`` (m,), weights (m,), residuals (m, 2) and derivatives.

    ``by_camera`` (m, 2, p), ``by_pose`` (m, 2, 6) of the board, ``by_stamp`` (m, 2) of the time of the image.
    """

    camera: int
    time_step: np.ndarray
    weights: np.ndarray
    residuals: np.ndarray
    by_camera: np.ndarray
    by_pose: np.ndarray
    by_stamp: np.ndarray


class BoardEquations(ArrowEquations):
    """Cameras share the poses of the board at the time steps, which are the blocks; stamps are eliminated before.

    Parameters
    ----------
    offsets : (c + 1,) where each camera's parameters begin.
    n_time_steps : poses.
    """

    def __init__(self, offsets: np.ndarray, n_time_steps: int):
        super().__init__(int(offsets[-1]), n_time_steps, 6)
        self.offsets, self.n_time_steps = offsets, n_time_steps
        self.stamps: list[_Stamps] = []

    def part(self, camera: int) -> slice:
        return slice(self.offsets[camera], self.offsets[camera + 1])

    def add(self, rows: CameraRows) -> None:
        part = self.part(rows.camera)
        weighted_camera = rows.weights[:, None, None] * rows.by_camera
        weighted_pose = rows.weights[:, None, None] * rows.by_pose
        self.shared[part, part] += np.einsum("mri,mrj->ij", weighted_camera, rows.by_camera)
        self.gradient_shared[part] += np.einsum("mri,mr->i", weighted_camera, rows.residuals)
        self.blocks += self._by_time_step(rows, np.einsum("mri,mrj->mij", weighted_pose, rows.by_pose))
        self.gradient_blocks += self._by_time_step(rows, np.einsum("mri,mr->mi", weighted_pose, rows.residuals))
        self.mixed[:, part] += self._by_time_step(rows, np.einsum("mri,mrj->mij", weighted_camera, rows.by_pose))

    def eliminate_stamps(self, rows: CameraRows, late_s: np.ndarray, prior: float) -> None:
        """Eliminate the errors of the stamps of one camera's views.

        Parameters
        ----------
        rows : what the camera saw.
        late_s : (n,) seconds by which the views are later so far.
        prior : precision of a stamp, in the units of the cost.
        """
        weighted = rows.weights[:, None] * rows.by_stamp
        stamps = _Stamps(
            rows.camera,
            self._by_time_step(rows, (weighted * rows.by_stamp).sum(axis=1)) + prior,
            self._by_time_step(rows, (weighted * rows.residuals).sum(axis=1)) + prior * late_s,
            self._by_time_step(rows, np.einsum("mr,mri->mi", weighted, rows.by_camera)),
            self._by_time_step(rows, np.einsum("mr,mri->mi", weighted, rows.by_pose)),
        )
        part, slope = self.part(rows.camera), stamps.gradient / stamps.precision
        with_camera, with_pose = stamps.with_camera / stamps.precision[:, None], stamps.with_pose / stamps.precision[:, None]
        self.shared[part, part] -= stamps.with_camera.T @ with_camera
        self.gradient_shared[part] -= stamps.with_camera.T @ slope
        self.blocks -= with_pose[:, :, None] * stamps.with_pose[:, None]
        self.gradient_blocks -= stamps.with_pose * slope[:, None]
        self.mixed[:, part] -= with_camera[:, :, None] * stamps.with_pose[:, None]
        self.stamps.append(stamps)

    def add_lens_prior(self, camera: int, gradient: np.ndarray, precision: np.ndarray) -> None:
        """Add the prior on a camera's lens.


        Parameters
        ----------
        camera : its index.
        gradient, precision : (p,) half gradient and second derivative of the prior's cost, by lens parameter.
        """
        lens = np.arange(self.offsets[camera] + N_PLACE, self.offsets[camera + 1])
        self.shared[lens, lens] += precision
        self.gradient_shared[lens] += gradient

    def hold(self, free_cameras: bool, free_clocks: bool, free_lenses: bool) -> None:
        """Say what is estimated; place and clock of the first camera are always held.

        Parameters
        ----------
        free_cameras, free_clocks, free_lenses : places of the cameras, offsets of their clocks, lenses.
        """
        for k, start in enumerate(self.offsets[:-1]):
            self.free[start : start + CLOCK] = free_cameras and k > 0
            self.free[start + CLOCK] = free_clocks and k > 0
            self.free[start + N_PLACE : self.offsets[k + 1]] = free_lenses

    def step(self, damping: float) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
        """One damped Gauss-Newton step: moves of every camera's parameters, of the poses (n, 6), and of the stamps (n, c)."""
        moves, poses = self.move(damping)
        late_s = np.zeros((self.n_time_steps, len(self.offsets) - 1))
        for stamps in self.stamps:
            change = stamps.with_camera @ moves[self.part(stamps.camera)] + (stamps.with_pose * poses).sum(axis=1)
            late_s[:, stamps.camera] = -(stamps.gradient + change) / stamps.precision
        return np.split(moves, self.offsets[1:-1]), poses, late_s

    def covariance(self) -> np.ndarray:
        """(d, d) of all cameras' parameters for residuals with an error of one pixel; zeros for what is held."""
        return self.expanded(np.linalg.pinv(self.reduced(self.inverses(0.0), 0.0), hermitian=True))

    def _by_time_step(self, rows: CameraRows, values: np.ndarray) -> np.ndarray:
        """(n, ...) sums of values (m, ...) of the same time step."""
        result = np.zeros((self.n_time_steps, *values.shape[1:]))
        np.add.at(result, rows.time_step, values)
        return result


@dataclass(frozen=True, eq=False)
class _Stamps:
    """One camera's stamps before they were eliminated: precision and gradient (n,), mixed with camera (n, p) and poses (n, 6)."""

    camera: int
    precision: np.ndarray
    gradient: np.ndarray
    with_camera: np.ndarray
    with_pose: np.ndarray


@dataclass(frozen=True, eq=False)
class BoardObservations:
    """Corners in images, one row each.

    Attributes
    ----------
    camera, time_step, corner : (m,) indices.
    pixels : (m, 2).
    late_s : (m,) by how much the image's stamp is later than the time step.
    """

    camera: np.ndarray
    time_step: np.ndarray
    corner: np.ndarray
    pixels: np.ndarray
    late_s: np.ndarray


@dataclass(frozen=True, eq=False)
class BoardState:
    """Everything that is sought.

    Attributes
    ----------
    lenses : one a camera.
    Ts_cam_world : (c, 4, 4).
    Ts_world_board : (n, 4, 4) at the time steps.
    clocks_s : (c,) by how much each camera's images are later than they say.
    jitter_s : (n, c) by how much single images are later, besides.
    """

    lenses: tuple[CameraModel, ...]
    Ts_cam_world: np.ndarray
    Ts_world_board: np.ndarray
    clocks_s: np.ndarray
    jitter_s: np.ndarray

    @classmethod
    def at(cls, lenses: tuple[CameraModel, ...], Ts_cam_world: np.ndarray, Ts_world_board: np.ndarray) -> BoardState:
        """The state with clocks and stamps that are right.

        Parameters
        ----------
        lenses : one a camera.
        Ts_cam_world : (c, 4, 4).
        Ts_world_board : (n, 4, 4) at the time steps.

        Returns
        -------
        The state; offsets of clocks and stamps are zero.
        """
        n, c = len(Ts_world_board), len(lenses)
        return cls(lenses, Ts_cam_world, Ts_world_board, np.zeros(c), np.zeros((n, c)))


@dataclass(frozen=True)
class BoardAdjustmentOptions:
    """How to adjust.

    Parameters
    ----------
    robust_scale_px : residual at which a corner's pull stops growing.
    free_lenses, free_cameras : what may change besides the board's poses.
    free_clocks : also seek the clocks, of all cameras but the first; needs velocities.
    jitter_sigma_s : standard deviation of single stamps; 0: they are exact. Needs velocities.
    max_iterations, tolerance : stop after so many steps, or when a step lowers the cost by less than this fraction.
    """

    robust_scale_px: float = 2.0
    free_lenses: bool = True
    free_cameras: bool = True
    free_clocks: bool = False
    jitter_sigma_s: float = 0.0
    max_iterations: int = 60
    tolerance: float = 1e-7


@dataclass(frozen=True, eq=False)
class BoardAdjustment:
    """Result of `adjust_boards`.

    Attributes
    ----------
    state : at the minimum.
    residuals_px : (m, 2) projected minus seen.
    sigmas : per camera (p,) standard deviations of twist (v, omega; in its own frame), clock and lens vector, for corners with an
        independent error of one pixel; zeros where something is held.
    iterations, converged : of the last step.
    """

    state: BoardState
    residuals_px: np.ndarray
    sigmas: tuple[np.ndarray, ...]
    iterations: int
    converged: bool


def adjust_boards(
    corners: np.ndarray,
    seen: BoardObservations,
    start: BoardState,
    options: BoardAdjustmentOptions | None = None,
    velocities: np.ndarray | None = None,
) -> BoardAdjustment:
    """Cameras, lenses and board poses that explain the corners best.

    Parameters
    ----------
    corners : (k, 3) in the board's frame, meters.
    seen : the corners in the images.
    start : from where to go; its first camera stays where it is.
    options : what is free, robust scale, when to stop.
    velocities : (n, 6) twists of the board a second, in its own frame; None: it stands still around each time step.

    Returns
    -------
    State at the minimum, residuals and standard deviations.

    Raises
    ------
    ValueError : no observations, or a start in which a corner lies behind the camera that sees it.
    """
    if len(seen.camera) == 0:
        raise ValueError("expected observations, got none")
    return _Problem(corners, seen, options or BoardAdjustmentOptions(), velocities).solve(start)


class _Problem:
    def __init__(self, corners, seen: BoardObservations, options: BoardAdjustmentOptions, velocities: np.ndarray | None):
        self.corners, self.seen, self.options = corners[seen.corner], seen, options
        self.moving = velocities is not None
        self.jitters = self.moving and options.jitter_sigma_s > 0.0
        twists = np.zeros((len(seen.camera), 6)) if velocities is None else velocities[seen.time_step]
        self.speeds = twists[:, :3] + np.cross(twists[:, 3:], self.corners)  # of each corner, in the board's frame

    def solve(self, state: BoardState) -> BoardAdjustment:
        if not np.isfinite(self.cost(state)):
            raise ValueError("expected a start in which every corner is in front of the camera that sees it")
        end = descend(state, self.cost, self._steps, self.options.max_iterations, self.options.tolerance)
        last = self.linearize(end.found)
        sigmas = np.split(np.sqrt(np.maximum(np.diag(last.covariance()), 0.0)), last.offsets[1:-1])
        return BoardAdjustment(end.found, self.residuals(end.found)[0], tuple(sigmas), end.iterations, end.converged)

    def _steps(self, state: BoardState) -> Callable[[float], BoardState | None]:
        """From a damping to the state after a step from ``state``."""
        equations = self.linearize(state)
        return lambda damping: _moved(state, *equations.step(damping))

    def points(self, state: BoardState) -> np.ndarray:
        """(m, 3) in the frame that the board has at the time step; to first order, a board turns little between two cameras."""
        camera, time_step = self.seen.camera, self.seen.time_step
        late_s = self.seen.late_s + state.clocks_s[camera] + state.jitter_s[time_step, camera]
        return self.corners + self.speeds * late_s[:, None]

    def residuals(self, state: BoardState) -> tuple[np.ndarray, np.ndarray]:
        """(m, 2) projected minus seen, (m,) whether it can be seen at all."""
        n, world = len(self.seen.camera), _in_world(state, self.seen, self.points(state))
        result, valid = np.zeros((n, 2)), np.zeros(n, dtype=bool)
        for i, lens in enumerate(state.lenses):
            rows = np.flatnonzero(self.seen.camera == i)
            pixels, valid[rows] = lens.project(se3.apply(state.Ts_cam_world[i], world[rows]))
            result[rows] = pixels - self.seen.pixels[rows]
        return result, valid

    def cost(self, state: BoardState) -> float:
        """Sum of Cauchy losses (px²) and the priors; infinite where a corner would lie behind its camera."""
        residuals, valid = self.residuals(state)
        if not valid.all():
            return np.inf
        scale_sq = self.options.robust_scale_px**2
        cost, priors = scale_sq * np.log1p((residuals**2).sum(axis=1) / scale_sq).sum(), 0.0
        if self.options.free_lenses:
            for lens in state.lenses:
                mean, sigma = lens_prior(lens)
                priors += (((lens_vector(lens) - mean) / sigma) ** 2).sum()
        if self.jitters:
            priors += ((state.jitter_s / self.options.jitter_sigma_s) ** 2).sum()
        return float(cost + _CORNER_SIGMA_PX**2 * priors)

    def linearize(self, state: BoardState) -> BoardEquations:
        """Half the gradient of the cost, and its Gauss-Newton matrix."""
        options, points = self.options, self.points(state)
        world = _in_world(state, self.seen, points)
        sizes = [N_PLACE + len(lens_vector(lens)) for lens in state.lenses]
        equations = BoardEquations(np.concatenate([[0], np.cumsum(sizes)]).astype(int), len(state.Ts_world_board))
        for i, lens in enumerate(state.lenses):
            rows = self._rows(state, i, points, world)
            equations.add(rows)
            if self.jitters:
                precision = (_CORNER_SIGMA_PX / options.jitter_sigma_s) ** 2
                equations.eliminate_stamps(rows, state.jitter_s[:, i], precision)
            if options.free_lenses:
                mean, sigma = lens_prior(lens)
                precisions = (_CORNER_SIGMA_PX / sigma) ** 2
                equations.add_lens_prior(i, (lens_vector(lens) - mean) * precisions, precisions)
        equations.hold(options.free_cameras, options.free_clocks and self.moving, options.free_lenses)
        return equations

    def _rows(self, state: BoardState, i: int, points: np.ndarray, world: np.ndarray) -> CameraRows:
        rows, lens, T_cam_world = np.flatnonzero(self.seen.camera == i), state.lenses[i], state.Ts_cam_world[i]
        time_step = self.seen.time_step[rows]
        local = se3.apply(T_cam_world, world[rows])
        pixels, by_point, _ = lens.project_with_jacobian(local)
        residuals = pixels - self.seen.pixels[rows]
        weights = 1.0 / (1.0 + (residuals**2).sum(axis=1) / self.options.robust_scale_px**2)
        by_corner = by_point @ T_cam_world[:3, :3] @ state.Ts_world_board[time_step, :3, :3]
        by_stamp = by_corner @ self.speeds[rows, :, None]
        by_camera = np.concatenate([by_point, -by_point @ so3.hat(local), by_stamp, lens_jacobian(lens, local)], axis=2)
        by_pose = np.concatenate([by_corner, -by_corner @ so3.hat(points[rows])], axis=2)
        return CameraRows(i, time_step, weights, residuals, by_camera, by_pose, by_stamp[:, :, 0])


def _in_world(state: BoardState, seen: BoardObservations, points: np.ndarray) -> np.ndarray:
    Ts = state.Ts_world_board[seen.time_step]
    return np.einsum("mij,mj->mi", Ts[:, :3, :3], points) + Ts[:, :3, 3]


def _moved(state: BoardState, cameras: list[np.ndarray], poses: np.ndarray, late_s: np.ndarray) -> BoardState | None:
    """The state after a step; None where a focal length would not be positive."""
    lenses = []
    for lens, move in zip(state.lenses, cameras, strict=True):
        vector = lens_vector(lens) + move[N_PLACE:]
        if min(vector[:2]) <= 0.0:
            return None
        lenses.append(lens_of_vector(vector, lens) if move[N_PLACE:].any() else lens)
    return BoardState(
        tuple(lenses),
        np.array([se3.exp(move[:CLOCK]) @ T for move, T in zip(cameras, state.Ts_cam_world, strict=True)]),
        np.array([T @ se3.exp(move) for move, T in zip(poses, state.Ts_world_board, strict=True)]),
        state.clocks_s + [move[CLOCK] for move in cameras],
        state.jitter_s + late_s,
    )
