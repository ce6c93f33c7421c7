"""A rig from the images of a tracked body: where the cameras stand, how late they are, and, if asked for, their focal lengths.

The body is the calibration object: its size is about known, its poses are not. All are sought together (`solver`), so that
the contours in all cameras agree. Images do not tell where the world is, nor when now is: of all rigs that agree as well the one
is taken that leaves most cameras where they were, and most clocks as they were. A body in clothes that is fitted without them has
all cameras nearer by some percent; the scale stays that of the calibration, then, unless the body's is asked for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...camera.rig import CameraRig
from ...errors import CalibrationError
from ...geometry import se3, so3
from ...loaders.rig.rig_yaml import RigFile
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.shape_parameters import ShapeSpace
from ...objective.shape_jacobian import FOCAL, N_CAMERA, TIME, ContourLines
from ...observation.image_set import ImageSet
from ...tracking.constraints import constraints_of
from .body_fit import (
    CORRELATION,
    ROBUST_PX,
    BodyFitOptions,
    JointFit,
    LineMetrics,
    Progress,
    line_metrics,
    misfit_of,
    motions_of,
    pose_priors,
    residuals_of,
)
from .lines import LineEvidence, RegionEvidence
from .solver import Estimate, Problem, SharedPrior, clustered_covariance, moved_camera, shared_covariance

SURE_SIGMAS = 3.0  # a delay of fewer is taken for none
METER_RAD = 0.2  # that count as much as a meter
LEAST_LINES = 30  # of a camera; fewer do not hold six numbers
_ROTATION_SIGMA_RAD, _TIME_SIGMA_S, _FOCAL_SIGMA = 0.03, 0.05, 0.03  # how far a camera may be from what the rig says


@dataclass(frozen=True)
class RigFitOptions:
    """How to fit.

    Parameters
    ----------
    places, times, focal : what of the cameras is sought.
    scale : the cameras may all be nearer to each other, or farther, by one factor, as the size of the body says.
    center_sigma_m : how far a camera may be from where the rig says.
    sure_sigmas : a delay of fewer standard deviations is taken for none; 0 leaves them all.
    body : how poses are fitted; its ``groups`` say what of the body may change as well (by default nothing).
    """

    places: bool = True
    times: bool = True
    focal: bool = False
    scale: bool = False
    center_sigma_m: float = 0.03
    sure_sigmas: float = SURE_SIGMAS
    body: BodyFitOptions = field(default_factory=lambda: BodyFitOptions(groups=()))

    def sigmas(self) -> np.ndarray:
        """(`N_CAMERA`,) of one camera's departure; 0 for what is held."""
        result = np.zeros(N_CAMERA)
        if self.places:
            result[:3], result[3:6] = self.center_sigma_m, _ROTATION_SIGMA_RAD
        if self.focal:
            result[FOCAL] = _FOCAL_SIGMA
        if self.times:
            result[TIME] = _TIME_SIGMA_S
        return result


@dataclass(frozen=True)
class CameraFit:
    """What has been found about one camera.

    Parameters
    ----------
    before, after : of its contour lines, with the given rig (poses fitted to it) and with the new one.
    moved_m, turned_rad : how far its center and its axes went. later_s : how much later its images are than their stamps say.
    focal_scale : its focal length as a multiple of the given one.
    moved_sigma_m, turned_sigma_rad, later_sigma_s, focal_sigma : standard deviations of these.
    """

    before: LineMetrics
    after: LineMetrics
    moved_m: float
    turned_rad: float
    later_s: float
    focal_scale: float
    moved_sigma_m: float
    turned_sigma_rad: float
    later_sigma_s: float
    focal_sigma: float


@dataclass(frozen=True, eq=False)
class RigFit:
    """A fitted rig, the body (as given, unless it was sought too), its states, and what has been found by camera name.

    ``scale``: how far cameras are from each other by the size of the body, as a multiple of what was given.
    """

    rig: CameraRig
    model: ArticulatedModel
    states: tuple[State, ...]
    states_before: tuple[State, ...]
    cameras: Mapping[str, CameraFit]
    overall: tuple[LineMetrics, LineMetrics]
    n_sets: int
    iterations: int
    scale: float


def fit_rig(
    model: ArticulatedModel,
    rig: CameraRig,
    image_sets: Sequence[ImageSet],
    states: Sequence[State],
    velocities: Sequence[np.ndarray],
    options: RigFitOptions | None = None,
    progress: Progress | None = None,
    evidence: LineEvidence | None = None,
) -> RigFit:
    """The rig in which a body of known size agrees best with some image sets.

    Parameters
    ----------
    model : the body, of known size.
    rig : the cameras as calibrated.
    image_sets : ten to thirty sets, with stamps.
    states, velocities : where the body about is in each set, and how fast it moves (tangent a second); only fast motion makes
        times observable.
    options : what may change, and how the body is fitted.
    progress, evidence : as for `body_fit.fit_body`.

    Returns
    -------
    The rig, what changed by camera, and the states.

    Raises
    ------
    ValueError : not a state and a velocity for each set. CalibrationError : a camera that hardly sees the body.
    """
    options = options or RigFitOptions()
    if not image_sets or not len(image_sets) == len(states) == len(velocities):
        got = f"{len(image_sets)} sets, {len(states)} states and {len(velocities)} velocities"
        raise ValueError(f"expected image sets with a state and a velocity each, got {got}")
    body = options.body
    evidence = evidence or RegionEvidence(image_sets, body.config)
    space = ShapeSpace(model, body.symmetric, body.groups)
    held = Problem(
        space, rig, motions_of(rig, image_sets, model.n_dof, velocities), pose_priors(model, states, body.config),
        SharedPrior(np.zeros(len(space)), np.zeros((len(rig), N_CAMERA))), CORRELATION,
        constraints_of(model, body.config),
    )  # fmt: skip
    free = SharedPrior(space.sigmas, np.tile(options.sigmas(), (len(rig), 1)))
    problem = replace(held, shared=free)
    n_rounds = body.pose_rounds + body.rounds * (len(ROBUST_PX) + options.times)
    loop = JointFit(evidence, n_rounds, progress or (lambda *_: None))
    start = Estimate(tuple(states), np.zeros(len(space)), np.zeros((len(rig), N_CAMERA)))
    before = loop.run("poses", held, start, ROBUST_PX[0], body.pose_rounds).found
    after = before
    for robust_px in ROBUST_PX:
        after = loop.run("cameras", problem, after, robust_px, body.rounds).found
    problem, after, time_sigmas_s = _without_doubtful_times(problem, after, loop, options)
    lines = loop.draw(held, before), loop.draw(problem, after)
    residuals = residuals_of(held, before, lines[0]), residuals_of(problem, after, lines[1])
    for i, camera in enumerate(rig):
        count = int(np.sum(residuals[1][:, 0] == i))
        if count < LEAST_LINES:
            raise CalibrationError(camera.name, f"hardly sees the body: {count} contour lines in {len(states)} image sets")
    sigmas = _sigmas(problem, after, lines[1], ROBUST_PX[-1], options.scale)
    sigmas[:, TIME] = time_sigmas_s
    fitted, moved, scale = settled(rig, problem, after, options.scale)
    cameras = {c.name: _camera_fit(i, c, fitted.cameras[i], after.cameras[i], sigmas[i], residuals) for i, c in enumerate(rig)}
    overall = line_metrics(residuals[0][:, 2]), line_metrics(residuals[1][:, 2])
    return RigFit(fitted, space.body(after.s), moved, before.states, cameras, overall, len(states), loop.iterations, scale)


def _sigmas(
    problem: Problem, estimate: Estimate, lines: Sequence[ContourLines], robust_px: float, scaled: bool
) -> np.ndarray:  # fmt: skip
    """(n_cameras, `N_CAMERA`) standard deviations: by lines as bad as their residuals, or by image sets, whichever says more."""
    _, covariance = shared_covariance(problem, lines, estimate, robust_px)
    by_lines = np.sqrt(max(1.0, misfit_of(problem, estimate, lines))) * _settled_sigmas(problem.rig, covariance, scaled)
    by_sets = _settled_sigmas(problem.rig, clustered_covariance(problem, lines, estimate, robust_px), scaled)
    return np.maximum(by_lines, by_sets)


def _without_doubtful_times(problem: Problem, estimate: Estimate, loop: JointFit, options: RigFitOptions):
    """The problem and the estimate with those cameras held in common time whose delay is not surely one.

    A slow body says little about time, and a rig with wrong time offsets makes no image sets. With them the standard deviations
    of all delays, seconds, those that are held included.
    """
    if not np.any(problem.shared.cameras[:, TIME]):
        return problem, estimate, np.zeros(len(problem.rig))
    sigmas = _sigmas(problem, estimate, loop.draw(problem, estimate), ROBUST_PX[-1], options.scale)[:, TIME]
    cameras = estimate.cameras.copy()
    common_s = float(np.median(cameras[:, TIME]))
    cameras[:, TIME] -= common_s
    doubtful = np.abs(cameras[:, TIME]) < options.sure_sigmas * sigmas
    cameras[doubtful, TIME] = 0.0
    states = tuple(s.retract(common_s * m.velocity) for s, m in zip(estimate.states, problem.motions, strict=True))
    shared = problem.shared.cameras.copy()
    shared[doubtful, TIME] = 0.0
    problem = replace(problem, shared=SharedPrior(problem.shared.shape, shared))
    start = Estimate(states, estimate.s, cameras)
    return problem, loop.run("cameras", problem, start, ROBUST_PX[-1], options.body.rounds).found, sigmas


def settled(
    rig: CameraRig, problem: Problem, estimate: Estimate, scaled: bool
) -> tuple[CameraRig, tuple[State, ...], float]:  # fmt: skip
    """Rig and states of an estimate, in the world and the time in which most cameras stay what they were.

    Parameters
    ----------
    rig : the cameras as given.
    problem, estimate : what was given, and what has been estimated.
    scaled : the distances between cameras are those of the estimate; else as they were given but for what single cameras move.

    Returns
    -------
    The rig, with time offsets.
    The states, one a set.
    How far cameras are from each other in the estimate, as a multiple of what was given.
    """
    late_s = estimate.cameras[:, TIME]
    common_s = float(np.median(late_s))
    cameras = [moved_camera(c, d) for c, d in zip(rig, estimate.cameras, strict=True)]
    found, given_poses = (np.array([c.T_world_cam for c in each]) for each in (cameras, rig))
    T, factor = world_of_most(found, given_poses)
    scale = 1.0 / factor
    if scaled:
        T, factor = world_of_most(found, given_poses, scaled=False)
    result = []
    for camera, given, seconds in zip(cameras, rig, late_s, strict=True):
        offset_ns = given.time_offset_ns + round(1e9 * (seconds - common_s))
        placed = se3.nearest_rigid(T @ se3.scaled(camera.T_world_cam, factor))
        result.append(replace(camera, T_world_cam=placed, time_offset_ns=offset_ns))
    states = []
    for state, motion in zip(estimate.states, problem.motions, strict=True):
        moved = state.retract(common_s * motion.velocity)
        states.append(State(se3.nearest_rigid(T @ se3.scaled(moved.T_world_root, factor)), moved.joint_positions))
    return replace(rig, cameras=tuple(result)), tuple(states), scale


def _settled_sigmas(rig: CameraRig, covariance: np.ndarray, scaled: bool) -> np.ndarray:
    """(n_cameras, `N_CAMERA`) standard deviations of departures, without the move and the delay that all cameras share, and
    without the scale unless that is ``scaled``."""
    n = len(rig)
    common, middle = np.zeros((n, N_CAMERA, 8)), np.mean([camera.center for camera in rig], axis=0)
    for i, camera in enumerate(rig):
        T = camera.T_cam_world
        common[i, :3, :3], common[i, 3:6, 3:6] = T[:3, :3], T[:3, :3]
        common[i, :3, 3:6] = so3.hat(T[:3, 3]) @ T[:3, :3]
        common[i, TIME, 6] = 1.0
        common[i, :3, 7] = 0.0 if scaled else T[:3, :3] @ (camera.center - middle)
    scale = np.tile(np.r_[[METER_RAD] * 3, [1.0] * (N_CAMERA - 3)], n)
    A = scale[:, None] * common.reshape(n * N_CAMERA, 8)
    rest = np.eye(len(A)) - A @ np.linalg.pinv(A)
    rest = rest * scale[None, :] / scale[:, None]
    return np.sqrt(np.maximum(np.diag(rest @ covariance @ rest.T), 0.0)).reshape(n, N_CAMERA)


def world_of_most(Ts_world_cam: np.ndarray, given: np.ndarray, scaled: bool = True) -> tuple[np.ndarray, float]:
    """Transform, and factor of all places, that bring most cameras back to their given poses.

    Least sum of distances (not of squares), by reweighting; a meter counts as much as `METER_RAD` radians.

    Parameters
    ----------
    Ts_world_cam, given : (n, 4, 4) poses, and those that they are to be near.
    scaled : the factor is sought; else it is 1.

    Returns
    -------
    T (4, 4) and a factor such that ``T @ Ts_world_cam``, their places times the factor before, are near ``given``.
    """
    T, factor, weights, scaled = np.eye(4), 1.0, np.ones(len(given)), scaled and len(given) > 1
    middle = given[:, :3, 3].mean(axis=0)
    for _ in range(50):
        H, g = 1e-9 * np.eye(7), np.zeros(7)
        now = T @ se3.scaled(Ts_world_cam, factor)
        for i, (pose, wanted) in enumerate(zip(now, given, strict=True)):
            J = np.zeros((6, 7))  # of (v, omega, logarithm of the factor) about the middle of the cameras
            J[:3, :3], J[:3, 3:6], J[3:, 3:6] = METER_RAD * np.eye(3), -METER_RAD * so3.hat(pose[:3, 3] - middle), np.eye(3)
            J[:3, 6] = METER_RAD * (pose[:3, 3] - middle) * scaled
            turn = so3.log(wanted[:3, :3] @ pose[:3, :3].T)
            off = np.concatenate([METER_RAD * (wanted[:3, 3] - pose[:3, 3]), turn])
            weights[i] = 1.0 / max(float(np.linalg.norm(off)), 1e-5)
            H += weights[i] * J.T @ J
            g += weights[i] * J.T @ off
        step = np.linalg.solve(H, g)
        R, growth = so3.exp(step[3:6]), float(np.exp(step[6]))
        T[:3, 3], factor = middle + growth * (T[:3, 3] - middle), growth * factor
        T = se3.from_rotation_translation(R, middle + step[:3] - R @ middle) @ T
        if np.abs(step).max() < 1e-9:
            break
    return T, factor


def _camera_fit(index: int, given, fitted, departure: np.ndarray, sigmas: np.ndarray, residuals) -> CameraFit:
    before, after = (line_metrics(f[:, 2][f[:, 0] == index]) for f in residuals)
    return CameraFit(
        before,
        after,
        moved_m=float(np.linalg.norm(fitted.center - given.center)),
        turned_rad=float(np.linalg.norm(so3.log(given.T_world_cam[:3, :3].T @ fitted.T_world_cam[:3, :3]))),
        later_s=1e-9 * (fitted.time_offset_ns - given.time_offset_ns),
        focal_scale=float(np.exp(departure[FOCAL])),
        moved_sigma_m=float(np.linalg.norm(sigmas[:3])),
        turned_sigma_rad=float(np.linalg.norm(sigmas[3:6])),
        later_sigma_s=float(sigmas[TIME]),
        focal_sigma=float(sigmas[FOCAL]),
    )


def with_fit(rig_file: RigFile, fit: RigFit) -> RigFile:
    """The rig file with the places, time offsets and focal lengths of a fit.

    Parameters
    ----------
    rig_file : as it was read.
    fit : of the rig.

    Returns
    -------
    A copy.
    """
    placed = rig_file.with_extrinsics({camera.name: camera.T_world_cam for camera in fit.rig})
    changes: dict[str, dict] = {}
    for name, found in fit.cameras.items():
        entry = placed.cameras[name]
        changes[name] = values = {"time_offset_s": entry.time_offset_s + found.later_s}
        if found.focal_scale != 1.0:
            (fx, skew, cx), (zero, fy, cy), last = entry.K
            s = found.focal_scale
            values["K"] = ((s * fx, s * skew, cx), (zero, s * fy, cy), last)
    return placed.with_cameras(changes)
