"""All that is measured on one run: against truth, where there is any, and what the run says of itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..camera.rig import CameraRig
from ..errors import FileFormatError
from ..model.articulated import ArticulatedModel
from ..model.humans.masses import mass_center
from ..runs.data import RunData
from ..runs.motion import RunMotion, at_constant_rate, motion_of_run
from ..runs.writer import SMOOTHED
from ..tracking.estimate import Status
from . import pose_metrics
from .consistency import NeesSeries, landmark_nees, state_nees
from .evaluate import Evaluation, EvaluationOptions, SilhouetteScores, evaluate, expected_sets, placements
from .masks.silhouettes import Picture
from .metrics import Spread, intervals, reacquisition_times, spread_of, times_with_gaps
from .motion.gait import Gait, find_gait, foot_contacts
from .motion.inverse_kinematics import InverseKinematics
from .motion.joint_motion import AUTO, CUTOFFS, JointMotion, Ranges, joint_motion, ranges, treatment
from .motion.jumps import FootContacts, Jump, contact_metrics, find_jumps, jump_metrics
from .motion.kinematics import MOST_OF_RATE
from .pose_metrics import ROWS, RigidErrors, SegmentErrors, StateErrors, link_poses, rigid_errors, segment_errors, state_errors
from .truth.association import image_period_ns
from .truth.files import TrueStates, Truth, common_bones, unwrapped

STAGES = ("observe", "optimize", "total")
PERCENTILES = (50, 95, 99)
_LENGTHS_MM = {"mpjpe": "raw", "mpjpe_offset_free": "offset_free"}


@dataclass(frozen=True, eq=False)
class SegmentDirections:
    """Segments between two joints: errors of their direction (n, b) in degrees and of their middle in mm, where ``valid``.

    ``free_...``: from joints without their constant offsets.
    """

    bones: tuple[tuple[str, str], ...]
    valid: np.ndarray
    angle_deg: np.ndarray
    middle_mm: np.ndarray
    free_angle_deg: np.ndarray
    free_middle_mm: np.ndarray


@dataclass(frozen=True, eq=False)
class Review:
    """One run, n image sets; what is None or empty could not be measured."""

    name: str
    run: RunData
    model: ArticulatedModel
    period_s: float
    image_sets: int  # that there should be
    first_image: int = 0  # number of the image that the first set shows
    joints: Evaluation | None = None
    directions: SegmentDirections | None = None
    states: StateErrors | None = None
    segments: SegmentErrors | None = None
    rigid: RigidErrors | None = None
    axes_deg: np.ndarray | None = None  # (n, 3) between the root's axes and where they are; NaN without truth
    landmark_nees: NeesSeries | None = None
    landmark_nees_free: NeesSeries | None = None
    state_nees: NeesSeries | None = None
    silhouettes: SilhouetteScores = field(default_factory=SilhouetteScores)
    pictures: Sequence[Picture] = ()
    problems: Sequence[str] = ()
    rig: CameraRig | None = None
    sources: Mapping[str, str] = field(default_factory=dict)
    opensim: InverseKinematics | None = None
    cutoff_hz: float | str = AUTO  # of the filter of joint angles, as of `motion.joint_motion`

    @property
    def times_s(self) -> np.ndarray:
        """(n,) since image 0."""
        return (self.run.stamps_ns - self.run.stamps_ns[0]) * 1e-9 + self.first_image * self.period_s

    def over_time(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Times (k,) and ``values`` (n, ...) at them (k, ...), not-a-number where sets are missing."""
        times, sets = times_with_gaps(self.times_s, self.period_s)
        return times, np.where((sets < 0).reshape(-1, *[1] * (values.ndim - 1)), np.nan, values[sets])

    def lost_over_time(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (k,), where it was lost (k,), missing sets included, and where that is known (k,). Needs joints."""
        assert self.joints is not None
        times, sets = times_with_gaps(self.times_s, self.period_s)
        judged = np.any(self.joints.raw.valid, axis=1)
        judged |= ~self.run.has_state  # without a state it is lost, whatever the truth
        return times, (sets < 0) | self.joints.lost[sets], (sets < 0) | judged[sets]

    @cached_property
    def landmarks_m(self) -> np.ndarray:
        """(n, m, 3) the model's landmarks in the world; not-a-number without a state."""
        points = np.full((len(self.run), len(self.model.landmark_names), 3), np.nan)
        for i in np.flatnonzero(self.run.has_state):
            points[i] = self.run.configuration(self.model, int(i)).landmarks_world
        return points

    @cached_property
    def variables(self) -> np.ndarray:
        """(n, d) the body's variables, radians and meters, angles without full turns from set to set."""
        return unwrapped(self.run.values)

    @cached_property
    def motion(self) -> RunMotion | None:
        """At a constant rate, gaps where the body is lost; None without two such states."""
        try:
            motion = motion_of_run(self.run, self.model)
            return at_constant_rate(motion)[0] if motion.valid.sum() > 1 else None
        except FileFormatError:  # no state, or stamps that no rate leads through
            return None

    @property
    def treatment(self) -> str:
        """What has been done to the states against noise."""
        return treatment(self.run.path.name == SMOOTHED)

    @cached_property
    def joint_motion(self) -> JointMotion | None:
        """Angles of the joints, filtered, with velocities; times since image 0."""
        if self.motion is None:
            return None
        found = joint_motion(self.motion, self.cutoff_hz, self.run.path.name == SMOOTHED)
        return replace(found, times_s=found.times_s + self.times_s[0])

    @cached_property
    def _points(self) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray | None]:
        """Times (k,), landmarks -> (k, 3) and center of mass (k, 3) of `motion`, not-a-number in gaps."""
        assert self.motion is not None
        points = self.motion.landmarks_or_nan_m()
        named = dict(zip(self.model.landmark_names, np.swapaxes(points, 0, 1), strict=True))
        return self.motion.times_s + self.times_s[0], named, mass_center(self.model.landmark_names, points)

    @cached_property
    def gait(self) -> Gait | None:
        """Strides, where somebody walks; sets that are lost are left out."""
        if self.motion is None or self.joint_motion is None:
            return None
        times, points, _ = self._points
        angles = dict(zip(self.joint_motion.names, self.joint_motion.values.T, strict=True))
        return find_gait(times, points, angles, self.motion.rate_hz)

    @cached_property
    def jumps(self) -> list[Jump]:
        """Where somebody jumps."""
        return find_jumps(*self._points) if self.motion is not None else []

    @cached_property
    def contacts(self) -> dict[str, FootContacts]:
        """Side -> when the foot is on the floor."""
        if self.motion is None:
            return {}
        times, points, _ = self._points
        return foot_contacts(times, points, self.gait)

    @property
    def center_m(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Times (k,) and center of mass (k, 3), not-a-number in gaps; None of a body without one."""
        if self.motion is None or self._points[2] is None:
            return None
        return self._points[0], self._points[2]

    @property
    def cycles(self) -> dict[str, list[tuple[float, float]]] | None:
        """Side -> start and end of each stride; None where nobody walks."""
        if self.gait is None:
            return None
        return {side: list(zip(foot.starts_s, foot.ends_s, strict=True)) for side, foot in self.gait.strides.items()}

    @cached_property
    def ranges(self) -> dict[str, Ranges]:
        """Of every joint angle: over strides, or over the run where nobody walks."""
        return {} if self.joint_motion is None else ranges(self.joint_motion, self.cycles)

    @property
    def said_lost(self) -> np.ndarray:
        """(n,) what the tracker says."""
        return self.run.status == Status.LOST

    @property
    def timings(self) -> dict[str, np.ndarray]:
        """Stage -> milliseconds of the sets that have them."""
        if self.run.details is None:
            return {}
        known = np.isfinite(self.run.details.timings_ms).all(axis=1)
        return {stage: self.run.details.timings_ms[known, i] for i, stage in enumerate(STAGES) if known.any()}

    def metrics(self) -> dict[str, float | int]:
        """Metrics by key, the run's name before each."""
        if self.joints is not None:
            metrics = {key.removeprefix(f"{self.name}."): value for key, value in self.joints.metrics().items()}
        else:
            metrics = {"image_sets": self.image_sets, **_own(self.run)}
        for part in (self._joint_metrics, self._loss_metrics, self._state_metrics, self._nees_metrics, self._own_metrics):
            metrics |= part()
        metrics |= {} if self.gait is None else self.gait.metrics()
        metrics |= contact_metrics(self.contacts)
        metrics |= jump_metrics(self.jumps)
        metrics |= {} if self.opensim is None else self.opensim.metrics()
        landmarks = {key: metrics.pop(key) for key in list(metrics) if key.startswith("landmark_mm.")}
        return {f"{self.name}.{key}": value for key, value in {**metrics, **landmarks}.items()}

    def joint_spreads(self, j: int | None = None) -> tuple[Spread, Spread]:
        """Of one joint's errors, or all joints', in mm: as they are and without their constant offset in the segment."""
        assert self.joints is not None
        columns = slice(None) if j is None else j
        both = (self.joints.raw, self.joints.offset_free)
        raw, free = (spread_of(1e3 * e.errors_m[:, columns], e.valid[:, columns]) for e in both)
        return raw, free

    def _joint_metrics(self) -> dict[str, float | int]:
        e = self.joints
        if e is None:
            return {}
        metrics: dict[str, float | int] = {}
        for key, spread in zip(_LENGTHS_MM, self.joint_spreads(), strict=True):
            metrics |= {f"{key}_rms_mm": spread.rms, f"{key}_p95_mm": spread.p95, f"{key}_max_mm": spread.max}
        metrics["pa_mpjpe_mm"] = 1e3 * pose_metrics.pa_mpjpe(e.estimate_m, e.truth_m, e.raw.valid)
        fractions = pose_metrics.pck(e.raw.errors_m, e.raw.valid, np.array(pose_metrics.PCK_THRESHOLDS_M))
        metrics |= {
            f"pck_{1e3 * m:.0f}mm": float(fraction) for m, fraction in zip(pose_metrics.PCK_THRESHOLDS_M, fractions, strict=True)
        }
        metrics["pck_auc_150mm"] = pose_metrics.pck_auc(e.raw.errors_m, e.raw.valid)
        if self.directions is not None:
            metrics["segment_direction_deg"] = spread_of(self.directions.angle_deg, self.directions.valid).mean
            metrics["segment_direction_offset_free_deg"] = spread_of(self.directions.free_angle_deg, self.directions.valid).mean
        return metrics

    def _loss_metrics(self) -> dict[str, float | int]:
        if self.joints is None:
            return {}
        times, lost, known = self.lost_over_time()
        return _losses(lost, times, known)

    def _state_metrics(self) -> dict[str, float | int]:
        metrics: dict[str, float | int] = {}
        if self.states is not None:
            for k, (name, unit) in enumerate(zip(self.states.names, self.states.units, strict=True)):
                raw, free = self.states.spreads(k)
                metrics |= {f"dof_rms.{name}_{unit}": raw.rms, f"dof_max.{name}_{unit}": raw.max}
                metrics[f"dof_offset_free_rms.{name}_{unit}"] = free.rms
            of_joints = enumerate(zip(self.states.names, self.states.units, strict=True))
            angles = [k for k, (name, unit) in of_joints if name not in ROWS.values() and unit == "deg"]
            metrics["joint_angle_deg"] = spread_of(self.states.errors[:, angles], self.states.valid[:, angles]).mean
        if self.segments is not None:
            ok = self.segments.valid
            metrics["segment_position_mm"] = spread_of(self.segments.position_mm[ok]).mean
            metrics["segment_angle_deg"] = spread_of(self.segments.angle_deg[ok]).mean
            root = 1e-3 * self.segments.position_mm[ok, 0], np.deg2rad(self.segments.angle_deg[ok, 0])
            metrics["root_5cm_5deg"] = pose_metrics.fraction_near(*root)
        if self.axes_deg is not None:
            metrics |= {f"root_axis_{axis}_deg": spread_of(self.axes_deg[:, i]).mean for i, axis in enumerate("xyz")}
        if self.rigid is not None:
            metrics |= {"add_mm": spread_of(self.rigid.add_mm).mean, "add_s_mm": spread_of(self.rigid.add_s_mm).mean}
        return metrics

    def _nees_metrics(self) -> dict[str, float | int]:
        metrics: dict[str, float | int] = {}
        for key, series in (("landmark_nees", self.landmark_nees), ("landmark_nees_offset_free", self.landmark_nees_free)):
            if series is not None:
                metrics[key] = float(np.nanmean(series.values))
                metrics[f"{key}_in_bounds"] = float(series.in_bounds.mean())
        if self.state_nees is not None:
            low, high = self.state_nees.bounds[0]
            metrics |= {"state_nees": float(self.state_nees.means[0]), "state_nees_low": low, "state_nees_high": high}
        return metrics

    def _own_metrics(self) -> dict[str, float | int]:
        metrics: dict[str, float | int] = {
            "sets_without_state": int((~self.run.has_state).sum()) + self.image_sets - len(self.run),
            "said_lost_sets": int(self.said_lost.sum()),
            "said_degraded_sets": int((self.run.status == Status.DEGRADED).sum()),
        }
        metrics |= {f"said_{key}": value for key, value in _losses(self.said_lost, self.times_s).items()}
        for stage, values in self.timings.items():
            at = np.percentile(values, PERCENTILES)
            metrics |= {f"{stage}_ms_p{p}": float(value) for p, value in zip(PERCENTILES, at, strict=True)}
        return metrics


def review(
    run: RunData, model: ArticulatedModel, truth: Truth, options: EvaluationOptions, sources: Mapping[str, str] | None = None
) -> Review:
    """Compare a run with whatever truth there is. Pictures and silhouettes are added by the caller, who has the images.

    Parameters
    ----------
    run : states over time.
    model : body of the run.
    truth : joints, states, both or nothing.
    options : as of `evaluate`.
    sources : label -> where something came from, for the report.

    Returns
    -------
    All that could be measured.

    Raises
    ------
    FileFormatError : run and truth have no joint, or no time, in common; a cutoff that the run's rate does not allow.
    """
    period_ns = image_period_ns(run.stamps_ns) if len(run) > 1 else 1e9
    expected = expected_sets(run, period_ns, options.image_sets)
    _check_cutoff(options.cutoff_hz, 1e9 / period_ns)
    found = Review(options.name, run, model, period_ns * 1e-9, expected, options.first_image, sources=sources or {})
    found = replace(found, cutoff_hz=options.cutoff_hz)
    joints = truth.joints
    if joints is None and truth.states is not None:
        joints = truth.states.joints(model)
        joints = joints if joints.valid.any() else None
    own_time = truth.joints_own_time if truth.joints is not None else truth.states_own_time
    evaluation = None if joints is None else evaluate(run, model, joints, options, own_time)
    if evaluation is not None:
        found = replace(found, joints=evaluation, directions=segment_directions(evaluation), period_s=evaluation.period_s)
        found = replace(found, problems=evaluation.doubts)
        raw, free = (landmark_nees(run, model, evaluation, offset_free) for offset_free in (False, True))
        found = replace(found, landmark_nees=raw, landmark_nees_free=free)
    if truth.states is not None:
        lag = evaluation.lag_images if evaluation is not None else options.lag_images or 0.0
        shift_ns = evaluation.shift_ns if evaluation is not None and truth.joints is None else None
        at_sets = _at_sets(truth, run, model, options, lag, period_ns, shift_ns)
        found = replace(found, **_against_states(run, model, at_sets))
    return found


def _check_cutoff(cutoff_hz: float | str, rate_hz: float) -> None:
    highest = MOST_OF_RATE * rate_hz
    if cutoff_hz not in CUTOFFS and not (isinstance(cutoff_hz, float) and 0.0 < cutoff_hz <= highest):
        expected = f"one of {', '.join(CUTOFFS)}, or a cutoff in (0, {highest:.3g}] Hz"
        raise FileFormatError("command line", "--filter", expected, cutoff_hz)


def segment_directions(e: Evaluation) -> SegmentDirections | None:
    """Directions and middles of the segments between judged joints; None where there is no such segment."""
    bones = common_bones(e.joints)
    if not bones:
        return None
    a, b = ([e.joints.index(bone[end]) for bone in bones] for end in (0, 1))
    found = []
    for points in (e.estimate_m, e.corrected_m):
        true = e.truth_m[:, b] - e.truth_m[:, a]
        found.append(np.degrees(pose_metrics.direction_errors(points[:, b] - points[:, a], true)))
        middles = 0.5 * (points[:, a] + points[:, b] - e.truth_m[:, a] - e.truth_m[:, b])
        found.append(1e3 * np.linalg.norm(middles, axis=-1))
    return SegmentDirections(bones, e.raw.valid[:, a] & e.raw.valid[:, b], *found)


def _at_sets(
    truth: Truth,
    run: RunData,
    model: ArticulatedModel,
    options: EvaluationOptions,
    lag: float,
    period_ns: float,
    shift_ns: int | None,
) -> TrueStates:
    """True states at the run's stamps, matched in time as their joints are, by ``shift_ns``, or else of themselves."""
    assert truth.states is not None
    if shift_ns is not None:
        return truth.states.shifted(shift_ns).at(run.stamps_ns, lag * period_ns)
    image_0_ns = int(run.stamps_ns[0]) - round(options.first_image * period_ns)
    placed = placements(truth.states, run.stamps_ns, image_0_ns, options.align, truth.states_own_time)
    at_sets = [each.at(run.stamps_ns, lag * period_ns) for each in placed]
    if len(at_sets) == 1:
        return at_sets[0]
    return min(at_sets, key=lambda each: state_errors(run, model, each).misfit)


def _against_states(run: RunData, model: ArticulatedModel, truth: TrueStates) -> dict:
    whole = [state if there else None for state, there in zip(truth.states(model), run.has_state, strict=True)]
    found: dict = {"states": state_errors(run, model, truth)}
    if any(state is not None for state in whole):
        segments = segment_errors(run, model, whole)
        found |= {"segments": segments, "rigid": rigid_errors(run, model, whole), "state_nees": state_nees(run, whole)}
        tracked, true = link_poses(run, model, whole)
        axes = np.full((len(run), 3), np.nan)
        mine, theirs = (np.swapaxes(poses[:, 0, :3, :3], 1, 2) for poses in (tracked, true))
        axes[segments.valid] = np.degrees(pose_metrics.direction_errors(mine, theirs))
        found["axes_deg"] = axes
    return found


def _own(run: RunData) -> dict[str, float | int]:
    """What stands in `Evaluation.metrics` too, of a run without truth."""
    metrics: dict[str, float | int] = {run.residual_key: _mean(run.residual[run.has_state])}
    for i, camera in enumerate(run.cameras):
        seen = run.camera_residuals[run.camera_residuals[:, i] > 0, i]
        metrics[f"{run.residual_key}_{camera}"] = _mean(seen)
    return metrics | {"iterations": _mean(run.iterations[run.has_state])}


def _mean(values: np.ndarray) -> float:
    return float(np.mean(values)) if len(values) else float("nan")


def _losses(lost: np.ndarray, times_s: np.ndarray, known: np.ndarray | None = None) -> dict[str, float | int]:
    """How often it was lost, and how long until it was found again."""
    found = reacquisition_times(lost, times_s, known)
    losses = intervals(lost, known)
    return {
        "losses": len(losses),
        "not_reacquired": sum(not loss.ended for loss in losses),
        "reacquisition_s_median": float(np.median(found)) if len(found) else float("nan"),
        "reacquisition_s_max": float(found.max()) if len(found) else float("nan"),
    }
