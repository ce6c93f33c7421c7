"""A person's body from images: segment lengths, girths and the like, together with the poses, so that contours agree everywhere.

Lines are drawn at the contours of the present body in its present poses, all unknowns solved for at once with the lines held
(`solver`), and the lines drawn anew. What images do not tell is left to what people differ by
(`model.shape_parameters`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...camera.rig import CameraRig
from ...errors import TrackerError
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF
from ...model.shape_parameters import GROUPS, ShapeSpace
from ...objective.constraints.prior import Prior
from ...objective.shape_jacobian import N_CAMERA, ContourLines, line_residuals
from ...observation.image_set import ImageSet
from ...tracking.config import TrackerConfig
from ...tracking.constraints import PX2_PER_INFORMATION, constraints_of
from .lines import LineEvidence, RegionEvidence
from .solver import BodyMotion, Estimate, Problem, SharedPrior, Solution, shared_covariance, solve

Progress = Callable[[str, int, int], None]
_MEDIAN_OF_CHI2 = 0.455  # of one degree of freedom
LEAST_LINES = 50  # of all sets together
ROBUST_PX = 8.0, 3.0, 3.0  # scales of the robust kernel, from coarse to fine; the images are observed anew for each
CORRELATION = 8.0  # neighboring lines share one error
_STAY_SIGMA_M, _STAY_SIGMA_RAD = 0.2, 0.3  # how far root and joints may be from the states given


@dataclass(frozen=True)
class BodyFitOptions:
    """How to fit.

    Parameters
    ----------
    symmetric : left and right are alike.
    groups : what of the body may change, of `model.shape_parameters.GROUPS`.
    rounds : how often lines are drawn anew for each robust scale. pose_rounds : the same before the body may change.
    config : how the images are processed.
    """

    symmetric: bool = True
    groups: tuple[str, ...] = GROUPS
    rounds: int = 4
    pose_rounds: int = 4
    config: TrackerConfig = field(default_factory=TrackerConfig)


@dataclass(frozen=True)
class LineMetrics:
    """Of the lines of one camera or part: their number, rms and median distance, pixels."""

    count: int
    rms_px: float
    median_px: float


@dataclass(frozen=True)
class FittedParameter:
    """A shape parameter: its fitted value, its standard deviation, that of the prior (all as in `ShapeSpace`)."""

    name: str
    value: float
    sigma: float
    prior_sigma: float


@dataclass(frozen=True, eq=False)
class BodyFitReport:
    """How a fit came about; ``before`` is the given body in poses of its own, fitted to the same images."""

    parameters: tuple[FittedParameter, ...]
    cameras: Mapping[str, tuple[LineMetrics, LineMetrics]]
    parts: Mapping[str, tuple[LineMetrics, LineMetrics]]
    overall: tuple[LineMetrics, LineMetrics]
    n_sets: int
    iterations: int
    states_before: tuple[State, ...] = field(default=(), repr=False)


@dataclass(frozen=True, eq=False)
class BodyFit:
    """A fitted body, its state in every image set, and the report."""

    model: ArticulatedModel
    states: tuple[State, ...]
    report: BodyFitReport


def fit_body(
    model: ArticulatedModel,
    rig: CameraRig,
    image_sets: Sequence[ImageSet],
    states: Sequence[State],
    options: BodyFitOptions | None = None,
    progress: Progress | None = None,
    evidence: LineEvidence | None = None,
    velocities: Sequence[np.ndarray] | None = None,
) -> BodyFit:
    """The body that best explains some image sets, and its poses in them.

    Parameters
    ----------
    model : the body to start from; the prior is centered on it.
    rig : the cameras.
    image_sets, states : ten to thirty sets with different poses, and where the body about is in each (a tracker's states).
    options : what of the body may change, priors, rounds.
    progress : called with what is done, how often it has been done, and how often it will be.
    evidence : of the contours; default: the colors on either side of them, without images of the empty scene.
    velocities : (n_dof,) tangent a second of every set, for cameras that do not expose at one time.

    Returns
    -------
    The body, its states, and the report.

    Raises
    ------
    ValueError : no sets, or not one state each. TrackerError : the body is hardly seen in them.
    """
    options = options or BodyFitOptions()
    if not image_sets or len(image_sets) != len(states):
        raise ValueError(f"expected image sets with a state each, got {len(image_sets)} sets and {len(states)} states")
    evidence = evidence or RegionEvidence(image_sets, options.config)
    space = ShapeSpace(model, options.symmetric, options.groups)
    problem = Problem(
        space, rig, motions_of(rig, image_sets, model.n_dof, velocities), pose_priors(model, states, options.config),
        SharedPrior(space.sigmas, np.zeros((len(rig), N_CAMERA))), CORRELATION,
        constraints_of(model, options.config),
    )  # fmt: skip
    held = replace(problem, shared=SharedPrior(np.zeros(len(space)), problem.shared.cameras))
    loop, held_by = JointFit(evidence, options.pose_rounds + options.rounds * len(ROBUST_PX), progress or _silent), 1.0
    start = Estimate(tuple(states), np.zeros(len(space)), np.zeros((len(rig), N_CAMERA)))
    before = loop.run("poses", held, start, ROBUST_PX[0], options.pose_rounds)
    count = sum(len(lines) for lines in loop.draw(held, before.found))
    if count < LEAST_LINES:
        raise TrackerError(f"the body is hardly seen in these images: {count} contour lines in {len(states)} sets")
    after = before
    for stage, robust_px in enumerate(ROBUST_PX):
        loop.look(problem, after.found, robust_px)
        if 0 < stage == len(ROBUST_PX) - 1:  # by now it shows how well a body of such shapes can fit at all
            # Where the lines fit worse than they should, by a factor m in their variance, the body's shapes cannot represent the
            # person. Of that a part is the same in all n sets, so more sets do not help as much as they seem to, and the prior
            # counts more: its variances are divided by 1 + sqrt(n) (m - 1).
            excess = misfit_of(problem, after.found, loop.draw(problem, after.found)) - 1.0
            held_by = float(np.sqrt(1.0 + np.sqrt(len(states)) * max(0.0, excess)))
            problem = replace(problem, shared=SharedPrior(space.sigmas / held_by, problem.shared.cameras))
        after = loop.rounds("body", problem, after, robust_px, options.rounds)
    lines = loop.draw(problem, after.found), loop.draw(problem, before.found)
    covariance, _ = shared_covariance(problem, lines[0], after.found, ROBUST_PX[-1])
    report = _report(problem, before, after, lines[1], lines[0], held_by * np.sqrt(np.diag(covariance)), loop.iterations)
    body = replace(space.body(after.found.s), clothed=model.clothed or "girth" in options.groups)
    return BodyFit(body, after.found.states, report)


def _silent(what: str, done: int, total: int) -> None:
    """Progress that nobody wants to see."""


class JointFit:
    """The loop around the solver: observe the images, draw lines, solve, draw lines again."""

    def __init__(self, evidence: LineEvidence, n_rounds: int, progress: Progress):
        self._evidence, self._n_rounds, self._progress = evidence, n_rounds, progress
        self._done, self.iterations = 0, 0

    def run(self, what: str, problem: Problem, start: Estimate, robust_px: float, rounds: int) -> Solution:
        """Observe the images around a start, then draw lines and solve.

        Parameters
        ----------
        what : name of the stage, for progress.
        problem : what is given, and what is free.
        start : the unknowns.
        robust_px : scale of the robust kernel.
        rounds : how often lines are drawn.

        Returns
        -------
        Where the last round ended.
        """
        self.look(problem, start, robust_px)
        return self.rounds(what, problem, Solution(start, np.inf, 0, False), robust_px, rounds)

    def look(self, problem: Problem, estimate: Estimate, robust_px: float) -> None:
        """Observe the images around an estimate.

        Parameters
        ----------
        problem : what is given.
        estimate : where the body and the cameras about are.
        robust_px : by how much they may be off.
        """
        states = [problem.states_of(estimate, k) for k in range(len(estimate.states))]
        self._evidence.look(problem.space.body(estimate.s), problem.rig_of(estimate), states, robust_px)

    def rounds(self, what: str, problem: Problem, solution: Solution, robust_px: float, rounds: int) -> Solution:
        """Draw lines and solve, several times.

        Parameters
        ----------
        what : name of the stage, for progress.
        problem : what is given, and what is free.
        solution : where to go on from.
        robust_px : scale of the robust kernel.
        rounds : how often.

        Returns
        -------
        Where the last round ended.
        """
        for _ in range(rounds):
            self._progress(what, self._done, self._n_rounds)
            solution = solve(problem, self.draw(problem, solution.found), solution.found, robust_px)
            self.iterations += solution.iterations
            self._done += 1
        self._progress(what, self._done, self._n_rounds)
        return solution

    def draw(self, problem: Problem, estimate: Estimate) -> list[ContourLines]:
        """Draw lines at the contours of an estimate.

        Parameters
        ----------
        problem : what is given.
        estimate : body, poses and cameras.

        Returns
        -------
        The lines of every image set.
        """
        model, rig = problem.space.body(estimate.s), problem.rig_of(estimate)
        return [self._evidence.lines(k, model, rig, problem.states_of(estimate, k)) for k in range(len(estimate.states))]


def motions_of(
    rig: CameraRig, image_sets: Sequence[ImageSet], n_dof: int, velocities: Sequence[np.ndarray] | None
) -> list[BodyMotion]:
    """Velocities with the delays that the images' own stamps state.

    Parameters
    ----------
    rig : the cameras.
    image_sets : n of them.
    n_dof : degrees of freedom of the body.
    velocities : (n_dof,) tangent a second of each set; None: zeros.

    Returns
    -------
    One a set; without a velocity delays are zero.
    """
    result = []
    for k, images in enumerate(image_sets):
        found = [images.get(camera.name) for camera in rig]
        delays_s = np.array([0.0 if image is None else 1e-9 * (image.stamp_ns - images.stamp_ns) for image in found])
        velocity = np.zeros(n_dof) if velocities is None else np.asarray(velocities[k], dtype=np.float64)
        result.append(BodyMotion(velocity, delays_s if velocity.any() else np.zeros(len(rig))))
    return result


def pose_priors(model: ArticulatedModel, states: Sequence[State], config: TrackerConfig) -> list[list[Prior]]:
    """Priors on the poses: weakly at the states given, and the model's own at neutral angles.

    Parameters
    ----------
    model : the body.
    states : one a set.
    config : with the pull to neutral angles.

    Returns
    -------
    Two priors a set.
    """
    stay = np.full(model.n_dof, _STAY_SIGMA_RAD**-2.0)
    stay[:3] = _STAY_SIGMA_M**-2.0
    neutral = np.zeros(model.n_dof)
    neutral[N_ROOT_DOF:] = [config.motion.neutral_angle * axis.stiffness / PX2_PER_INFORMATION for axis in model.chain.axes]
    return [[Prior(state, stay), Prior(State.neutral(model, state.T_world_root), neutral)] for state in states]


def _report(
    problem: Problem, before: Solution, after: Solution, lines_before, lines_after, sigmas, iterations: int
) -> BodyFitReport:
    space, rig = problem.space, problem.rig
    residuals = [residuals_of(problem, s.found, lines) for s, lines in ((before, lines_before), (after, lines_after))]
    parameters = tuple(
        FittedParameter(p.name, float(value), float(sigma), float(prior))
        for p, value, sigma, prior in zip(space.parameters, after.found.s, sigmas, space.sigmas, strict=True)
    )

    def both(column: int, index: int) -> tuple[LineMetrics, LineMetrics]:
        first, second = (line_metrics(f[:, 2][f[:, column] == index]) for f in residuals)
        return first, second

    return BodyFitReport(
        parameters,
        {camera.name: both(0, i) for i, camera in enumerate(rig)},
        {shape.name: both(1, i) for i, shape in enumerate(space.model.shapes)},
        (line_metrics(residuals[0][:, 2]), line_metrics(residuals[1][:, 2])),
        len(after.found.states),
        iterations,
        before.found.states,
    )


def residuals_of(problem: Problem, estimate: Estimate, lines: Sequence[ContourLines]) -> np.ndarray:
    """Residuals of all lines that can be evaluated.

    Parameters
    ----------
    problem, estimate : what is given, and what has been estimated.
    lines : of every image set.

    Returns
    -------
    (n, 4) camera, shape, residual in pixels and its variance.
    """
    model, rig = problem.space.body(estimate.s), problem.rig_of(estimate)
    rows = []
    for k, own in enumerate(lines):
        residuals, valid = line_residuals(own, model, rig, problem.states_of(estimate, k))
        rows.append(np.column_stack([own.camera, own.shape, residuals, own.variances])[valid])
    return np.concatenate(rows)


def misfit_of(problem: Problem, estimate: Estimate, lines: Sequence[ContourLines]) -> float:
    """Squared residuals of the lines as a multiple of their variances.

    Parameters
    ----------
    problem, estimate : what is given, and what has been estimated.
    lines : of every image set.

    Returns
    -------
    Of the median residual: 1 where lines are as accurate as their variances state.
    """
    residuals, variances = residuals_of(problem, estimate, lines)[:, 2:].T
    return float(np.median(residuals**2 / variances)) / _MEDIAN_OF_CHI2


def line_metrics(residuals: np.ndarray) -> LineMetrics:
    """Of residuals (n,), pixels."""
    if not len(residuals):
        return LineMetrics(0, 0.0, 0.0)
    return LineMetrics(len(residuals), float(np.sqrt(np.mean(residuals**2))), float(np.median(np.abs(residuals))))
