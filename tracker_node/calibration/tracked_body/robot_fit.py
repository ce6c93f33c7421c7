"""Where the base of a robot stands in the world of the cameras, from images in which it says where its joints are.

The robot is the calibration object: its size and its poses are known, but for a place that all image sets share, and for the
zeros of its joints, which may be off a little. Lines are drawn at its contours, all sets solved for at once with the lines held,
and the lines drawn anew. Where cameras stand in the robot's frame (hand-eye calibration with cameras beside the robot) follows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...camera.rig import CameraRig
from ...errors import TrackerError
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF
from ...model.shape_parameters import ShapeSpace
from ...objective.constraints.prior import CouplingObjective, Prior
from ...objective.shape_jacobian import linearize_lines, normal_equations
from ...observation.image_set import ImageSet
from ...optimize.levenberg_marquardt import clip_to_limits
from ...tracking.config import TrackerConfig
from .body_fit import CORRELATION, LEAST_LINES, LineMetrics, Progress, line_metrics
from .lines import LineEvidence, RegionEvidence
from .solver import line_weights

Poses = Sequence[Sequence[np.ndarray]]
"""(n_axes,) positions of the joints by image set and camera, radians or meters: a moving robot is elsewhere for a late camera."""


_OFFSET_SIGMA_M = 0.001  # how far the zeros of sliding joints may be off
_PLACE_SIGMAS = (0.3,) * 6  # how far the base may be from where it is said to be, meters and radians
_ROBUST_PX = 24.0, 12.0, 6.0, 3.0, 3.0  # scales of the robust kernel; the images are observed anew for each
_ROUNDS = 4  # lines are drawn anew for each of these


@dataclass(frozen=True, eq=False)
class RobotFit:
    """A fitted place.

    Attributes
    ----------
    T_world_base : (4, 4).
    offsets : (n_axes,) what has to be added to what the robot says of each joint, radians or meters.
    covariance : (n_dof, n_dof) of the tangent of the base's place, and of the offsets.
    states, states_before : of every image set, as its first camera sees it.
    cameras : camera -> its lines before and after.
    overall : all lines before and after.
    """

    T_world_base: np.ndarray
    offsets: np.ndarray
    covariance: np.ndarray
    states: tuple[State, ...]
    states_before: tuple[State, ...]
    cameras: Mapping[str, tuple[LineMetrics, LineMetrics]]
    overall: tuple[LineMetrics, LineMetrics]

    @property
    def sigmas(self) -> np.ndarray:
        """(n_dof,) standard deviations."""
        return np.sqrt(np.diag(self.covariance))


def fit_robot(
    model: ArticulatedModel,
    rig: CameraRig,
    image_sets: Sequence[ImageSet],
    poses: Poses,
    T_world_base: np.ndarray,
    config: TrackerConfig,
    offset_sigma_rad: float,
    progress: Progress | None = None,
) -> RobotFit:
    """The place of a robot's base, by what the robot says of its joints.

    Parameters
    ----------
    model, rig : the robot and the cameras.
    image_sets, poses : ten to thirty sets with different poses, and what the robot says in each.
    T_world_base : (4, 4) about where its base is: within a tenth of its size, and 15 degrees.
    config : how the images are processed.
    offset_sigma_rad : how far the zeros of turning joints may be off, standard deviation; 0: they are right.
    progress : called with what is done, how often it has been done, and how often it will be.

    Returns
    -------
    The place, the offsets of its joints, and their covariance.

    Raises
    ------
    ValueError : no sets, or not one pose each. TrackerError : the robot is hardly seen in them.
    """
    if not image_sets or len(image_sets) != len(poses):
        raise ValueError(f"expected image sets with a pose each, got {len(image_sets)} sets and {len(poses)} poses")
    fit = _Fit(model, rig, poses, offset_sigma_rad, RegionEvidence(image_sets, config))
    start = State(np.array(T_world_base, dtype=np.float64), np.zeros(len(model.chain.axes)))
    found, total = start, len(_ROBUST_PX) * _ROUNDS
    fit.look(start, _ROBUST_PX[-1])
    before = fit.linearized(start, start, _ROBUST_PX[-1])
    for stage, robust_px in enumerate(_ROBUST_PX):
        fit.look(found, robust_px)
        for done in range(_ROUNDS):
            found = fit.stepped(found, start, robust_px)
            if progress is not None:
                progress("place", stage * _ROUNDS + done + 1, total)
    after = fit.linearized(found, start, _ROBUST_PX[-1])
    if len(after.residuals) < LEAST_LINES:
        raise TrackerError(f"the robot is hardly seen in these images: {len(after.residuals)} contour lines in {len(poses)} sets")
    cameras = {name: (before.of_camera(i), after.of_camera(i)) for i, name in enumerate(rig.names)}
    return RobotFit(
        found.T_world_root, found.joint_positions, after.covariance(), tuple(fit.states(found)), tuple(fit.states(start)),
        cameras, (line_metrics(before.residuals), line_metrics(after.residuals)),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Equations:
    """Normal equations of all lines; ``H_prior`` is within ``H``. ``by_set`` and ``by_camera``: gradients of their lines alone.
    ``H_camera``: of each camera's lines."""

    H: np.ndarray
    g: np.ndarray
    H_prior: np.ndarray
    by_set: np.ndarray
    by_camera: np.ndarray
    H_camera: np.ndarray
    residuals: np.ndarray
    camera: np.ndarray

    def of_camera(self, index: int) -> LineMetrics:
        return line_metrics(self.residuals[self.camera == index])

    def covariance(self) -> np.ndarray:
        """By how much image sets contradict each other (cluster-robust sandwich: Liang and Zeger, 1986), and cameras, whichever
        is more: of what a camera sees wrongly, much is the same in all its images. These by the jackknife."""
        inverse, n, m = np.linalg.inv(self.H), len(self.by_set), len(self.by_camera)
        scores = self.by_set - self.by_set.mean(axis=0)
        spread = scores.T @ scores * (n / max(n - 1, 1)) + self.H_prior
        by_sets = inverse @ spread @ inverse
        if m < 2:
            return by_sets
        pairs = zip(self.H_camera, self.by_camera, strict=True)
        without = np.array([-np.linalg.solve(self.H - H, self.g - g) for H, g in pairs])
        apart = np.sqrt((m - 1) / m * np.sum((without - without.mean(axis=0)) ** 2, axis=0))
        factors = np.maximum(apart / np.sqrt(np.diag(by_sets)), 1.0)
        return factors[:, None] * by_sets * factors


class _Fit:
    """The lines of all image sets around a place and offsets, both in one `State`."""

    def __init__(
        self, model: ArticulatedModel, rig: CameraRig, poses: Poses, offset_sigma_rad: float, evidence: LineEvidence
    ):  # fmt: skip
        self._model, self._rig, self._poses, self._evidence = model, rig, poses, evidence
        self._space = ShapeSpace(model, False, ())
        slides = np.array([axis.prismatic for axis in model.chain.axes], dtype=bool)
        sigmas = np.where(slides, _OFFSET_SIGMA_M, offset_sigma_rad)
        self._information = np.concatenate([_PLACE_SIGMAS, np.where(sigmas > 0.0, sigmas, 1e-6)]) ** -2.0
        self._H_coupled = np.zeros((model.n_dof, model.n_dof))  # of offsets as of positions: one gear drives both
        if model.chain.couplings:
            self._H_coupled = CouplingObjective(model.chain).linearize(State.neutral(model)).H

    def _state(self, place: State, said: np.ndarray) -> State:
        return clip_to_limits(State(place.T_world_root, said + place.joint_positions), self._model.chain)

    def states(self, place: State) -> list[State]:
        """Of every image set, as its first camera sees it."""
        return [self._state(place, poses[0]) for poses in self._poses]

    def _by_camera(self, place: State) -> list[list[State]]:
        return [[self._state(place, said) for said in poses] for poses in self._poses]

    def look(self, place: State, robust_px: float) -> None:
        self._evidence.look(self._model, self._rig, self._by_camera(place), robust_px)

    def linearized(self, place: State, start: State, robust_px: float) -> _Equations:
        n, states = self._model.n_dof, self._by_camera(place)
        by_set, H_camera, by_camera = np.zeros((len(states), n)), np.zeros((len(self._rig), n, n)), np.zeros((len(self._rig), n))
        residuals, cameras = [], []
        for k, own in enumerate(states):
            lines = self._evidence.lines(k, self._model, self._rig, own)
            found = linearize_lines(lines, self._space, np.zeros(len(self._space)), self._model, self._rig, own)
            _, weights = line_weights(found.residuals, lines.variances, robust_px, CORRELATION)
            weights = np.where(found.valid, weights, 0.0)
            for i in range(len(self._rig)):
                rows, g = lines.camera == i, np.zeros(n)
                normal_equations(found.by_state[rows], found.residuals[rows], weights[rows], H_camera[i], g)
                by_set[k] += g
                by_camera[i] += g
            residuals.append(found.residuals[found.valid])
            cameras.append(lines.camera[found.valid])
        H_prior, g = np.zeros((n, n)), np.zeros(n)
        Prior(start, self._information).add_to(H_prior, g, place)
        H_prior += self._H_coupled
        g += self._H_coupled[:, N_ROOT_DOF:] @ place.joint_positions
        H, g = H_camera.sum(axis=0) + H_prior, by_camera.sum(axis=0) + g
        return _Equations(H, g, H_prior, by_set, by_camera, H_camera, np.concatenate(residuals), np.concatenate(cameras))

    def stepped(self, place: State, start: State, robust_px: float) -> State:
        equations = self.linearized(place, start, robust_px)
        return place.retract(-np.linalg.solve(equations.H, equations.g))


def rig_on_base(rig: CameraRig, fit: RobotFit) -> dict[str, np.ndarray]:
    """Where the cameras stand in the robot's frame.

    Parameters
    ----------
    rig, fit : the cameras in their world; the robot in it.

    Returns
    -------
    Camera -> T_base_cam (4, 4).
    """
    T_base_world = np.linalg.inv(fit.T_world_base)
    return {camera.name: T_base_world @ camera.T_world_cam for camera in rig}

