"""A run compared with true joints: everything that the report shows, in numbers."""

from __future__ import annotations

from dataclasses import dataclass, field
from numbers import Real
from typing import TypeVar

import numpy as np

from ..errors import FileFormatError
from ..loaders.motion.trajectory_file import Trajectories
from ..model.articulated import ArticulatedModel
from ..runs.data import RunData
from ..tracking.estimate import Status
from ..tracking.limbs.tree import length_scale
from . import metrics
from .motion.joint_motion import AUTO
from .truth.association import FEW_SETS, LAG_RANGE_IMAGES, OnAClock, doubts_of_truth, estimate_lag, image_period_ns, truth_at
from .truth.files import LIMBS, common_bones, common_joints, offset_links

OnOneClock = TypeVar("OnOneClock", bound=OnAClock)
ALIGNMENTS = ("auto", "first", "stamp")


@dataclass(frozen=True)
class EvaluationOptions:
    """How a run is compared with truth.

    Parameters
    ----------
    name : prefix of the metrics' keys.
    lag_images : constant lag of the images behind the truth; None estimates it.
    align : ``stamp``: run and truth have one clock; ``first``: the truth's first row belongs to image 0; ``auto``: ``stamp``
        where both overlap in time, else ``first``. Of TRC, C3D, MOT and STO it is whichever leaves the least error: ``first``,
        ``stamp``, or the file's time 0 on image 0.
    image_sets : how many there should be; 0 takes what run and stamps say.
    cutoff_hz : of the filter of joint angles, or one of `motion.joint_motion.CUTOFFS`.

    Raises
    ------
    ValueError : a lag that is no number, or another way to align.
    """

    name: str = "run"
    lag_images: float | None = None
    align: str = "auto"
    image_sets: int = 0
    first_image: int = 0
    cutoff_hz: float | str = AUTO

    def __post_init__(self) -> None:
        lag = self.lag_images
        if lag is not None and not (isinstance(lag, Real) and np.isfinite(float(lag))):
            raise ValueError(f"lag_images: expected a number of images, or None to estimate it, got {lag!r}")
        if self.align not in ALIGNMENTS:
            raise ValueError(f"align: expected one of {', '.join(ALIGNMENTS)}, got {self.align!r}")


@dataclass(frozen=True, eq=False)
class ErrorSeries:
    """Errors (n, m) in meters where ``valid`` (n, m)."""

    errors_m: np.ndarray
    valid: np.ndarray

    @property
    def mean_mm(self) -> float:
        return 1e3 * metrics.mean_error(self.errors_m, self.valid)

    def per_joint_mm(self) -> np.ndarray:
        """(m,), NaN for a joint without truth."""
        return 1e3 * self._known.mean(axis=0).filled(np.nan)

    def per_set_mm(self) -> np.ndarray:
        """(n,), NaN for a set without truth."""
        return 1e3 * self._known.mean(axis=1).filled(np.nan)

    @property
    def _known(self) -> np.ma.MaskedArray:
        return np.ma.array(self.errors_m, mask=~self.valid)


@dataclass(frozen=True, eq=False)
class BoneLengths:
    """Mean and standard deviation over the run, (b,) millimeters each."""

    bones: tuple[tuple[str, str], ...]
    estimate_mean_mm: np.ndarray
    estimate_std_mm: np.ndarray
    truth_mean_mm: np.ndarray
    truth_std_mm: np.ndarray


@dataclass(frozen=True, eq=False)
class SilhouetteScores:
    """Agreement with reference masks: intersection over union per camera and image number."""

    kind: dict[str, str] = field(default_factory=dict)  # camera -> how its masks were made
    numbers: dict[str, list[int]] = field(default_factory=dict)
    ious: dict[str, list[float]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Result of `evaluate`; n image sets of the run, m joints."""

    name: str
    joints: tuple[str, ...]
    times_s: np.ndarray  # (n,) since the first set
    period_s: float
    lag_images: float
    lag_was_estimated: bool
    truth_start_s: float  # of its first row, by its own times
    shift_ns: int  # of the truth's own times, onto the clock of the run
    image_0_ns: int  # by that clock
    placements: int  # ways to match both clocks that errors chose among
    truth_doubts: tuple[str, ...]  # see `truth.doubts`
    image_sets: int  # that there should be
    raw: ErrorSeries  # lag taken out
    no_lag_correction: ErrorSeries
    offset_free: ErrorSeries  # offsets constant in the segment
    offset_free_world: ErrorSeries
    offsets_m: np.ndarray  # (m, 3) in the frame of the segment
    offset_frames: tuple[str, ...]  # (m,) the segments
    estimate_m: np.ndarray  # (n, m, 3) joints as tracked
    corrected_m: np.ndarray  # (n, m, 3) the same without the offsets of ``offset_free``
    truth_m: np.ndarray  # (n, m, 3) where ``raw.valid``
    bones: BoneLengths
    lost: np.ndarray  # (n,) bool
    lost_limbs: tuple[str, ...]
    length_scale: float  # of the distances at which sets and limbs are lost: 1 of people
    status: np.ndarray  # (n,)
    residual: np.ndarray
    residual_key: str
    iterations: np.ndarray  # (n,) NaN without a state
    cameras: tuple[str, ...]
    camera_residuals: np.ndarray  # (n, c), 0 where there is none
    silhouettes: SilhouetteScores = field(default_factory=SilhouetteScores)

    @property
    def missing_sets(self) -> int:
        """Image sets that the run says nothing of."""
        return self.image_sets - len(self.times_s)

    @property
    def doubts(self) -> list[str]:
        """Why truth may not be what it is taken for, or else is matched wrongly in time; a sentence each."""
        return list(self.truth_doubts) or self._time_doubts

    @property
    def _time_doubts(self) -> list[str]:
        doubts = []
        if self.placements > 1:
            image = (self.truth_start_s + (self.shift_ns - self.image_0_ns) * 1e-9) / self.period_s
            doubts.append(
                f"The truth's first row, {self.truth_start_s:.2f} s by its own times, is put on image {image:.1f}, where the"
                " errors are smallest (--align)."
            )
        if not self.lag_was_estimated:
            return doubts
        low, high = LAG_RANGE_IMAGES
        judged = int(self.raw.valid.any(axis=1).sum())
        if not low < self.lag_images < high:
            doubts.append(
                f"The estimated lag, {self.lag_images:+.2f} images, is at the end of the range that is searched:"
                " the true one may lie beyond it (--lag, --align, --first-image)."
            )
        if judged < FEW_SETS:
            doubts.append(f"The lag was estimated from {judged} image sets; below {FEW_SETS} it is a guess (--lag).")
        return doubts

    def metrics(self) -> dict[str, float | int]:
        """Metrics by key, in the order of the report."""
        found: dict[str, float | int] = {
            "image_sets": self.image_sets,
            "judged_sets": int(self.raw.valid.any(axis=1).sum()),
            "lost_sets": int(self.lost.sum()) + self.missing_sets,
            "lost_limbs": len(self.lost_limbs) if any(end in self.joints for end in LIMBS.values()) else float("nan"),
            "mpjpe_mm": self.raw.mean_mm,
            "mpjpe_offset_free_mm": self.offset_free.mean_mm,
            "mpjpe_offset_free_world_mm": self.offset_free_world.mean_mm,
            "mpjpe_no_lag_correction_mm": self.no_lag_correction.mean_mm,
            "lag_images": self.lag_images,
        }
        found.update({f"iou_{camera}": _mean(ious) for camera, ious in self.silhouettes.ious.items()})
        found[self.residual_key] = _mean(self.residual)
        for i, camera in enumerate(self.cameras):
            found[f"{self.residual_key}_{camera}"] = _mean(self.camera_residuals[self.camera_residuals[:, i] > 0, i])
        found["iterations"] = _mean(self.iterations)
        found["bone_length_std_mm"] = _mean(self.bones.estimate_std_mm)
        found["truth_bone_length_std_mm"] = _mean(self.bones.truth_std_mm)
        for joint, value in zip(self.joints, self.raw.per_joint_mm(), strict=True):
            found[f"landmark_mm.{joint}"] = float(value)
        return {f"{self.name}.{key}": value for key, value in found.items()}


def evaluate(
    run: RunData, model: ArticulatedModel, truth: Trajectories, options: EvaluationOptions, own_time: bool = False
) -> Evaluation:
    """Compare a run with true joints. Silhouettes are added by the caller, who has the images.

    Parameters
    ----------
    run : states over time.
    model : body of the run.
    truth : joints over time, of landmarks of the model or others.
    options : lag, alignment in time, and how many image sets there should be.
    own_time : the truth's stamps count from a start of its own.

    Returns
    -------
    All errors, joint by joint and set by set.

    Raises
    ------
    FileFormatError : run and truth have no joint, or no time, in common.
    """
    joints = common_joints(model.landmark_names, truth.names)
    if not joints:
        expected = f"some of the landmarks {', '.join(model.landmark_names)}"
        raise FileFormatError("truth", "names", expected, ", ".join(truth.names))
    period_ns = image_period_ns(run.stamps_ns if len(run) > 1 else truth.stamps_ns)
    image_0_ns = int(run.stamps_ns[0]) - round(options.first_image * period_ns)
    estimate, rotations, frames = _tracked_joints(run, model, joints)
    start_ns = int(truth.stamps_ns[0])
    tried = []
    for placed in placements(truth.select(joints), run.stamps_ns, image_0_ns, options.align, own_time):
        lag = options.lag_images
        if lag is None:
            lag = estimate_lag(estimate, placed, period_ns, rotations)
        tried.append((_misfit(estimate, truth_at(placed, run.stamps_ns, lag, period_ns), rotations), lag, placed))
    _, lag, truth = min(tried, key=lambda each: each[0])
    at_sets = truth_at(truth, run.stamps_ns, lag, period_ns)
    if not at_sets.valid.any():
        expected = f"times within those of the run, {_span(run.stamps_ns)}"
        raise FileFormatError("truth", "times", expected, _span(truth.stamps_ns))
    uncorrected = truth_at(truth, run.stamps_ns, 0.0, period_ns)
    difference, valid = estimate.positions_m - at_sets.positions_m, at_sets.valid & estimate.valid
    errors = metrics.joint_errors(estimate.positions_m, at_sets.positions_m)
    in_segment, offsets = metrics.offset_free_errors(difference, valid, rotations)
    in_world, _ = metrics.offset_free_errors(difference, valid)
    said_lost = run.status == Status.LOST
    scale = min(length_scale(model), 1.0)
    return Evaluation(
        name=options.name,
        joints=joints,
        times_s=(run.stamps_ns - run.stamps_ns[0]) * 1e-9,
        period_s=period_ns * 1e-9,
        lag_images=lag,
        lag_was_estimated=options.lag_images is None,
        truth_start_s=start_ns * 1e-9,
        shift_ns=int(truth.stamps_ns[0]) - start_ns,
        image_0_ns=image_0_ns,
        placements=len(tried),
        truth_doubts=tuple(doubts_of_truth(estimate, truth, image_0_ns, scale)),
        image_sets=expected_sets(run, period_ns, options.image_sets),
        raw=ErrorSeries(errors, valid),
        no_lag_correction=ErrorSeries(
            metrics.joint_errors(estimate.positions_m, uncorrected.positions_m), uncorrected.valid & estimate.valid
        ),
        offset_free=ErrorSeries(in_segment, valid),
        offset_free_world=ErrorSeries(in_world, valid),
        offsets_m=offsets,
        offset_frames=frames,
        estimate_m=estimate.positions_m,
        corrected_m=estimate.positions_m - np.einsum("nmij,mj->nmi", rotations, offsets),
        truth_m=at_sets.positions_m,
        bones=_bone_lengths(estimate, at_sets),
        lost=metrics.lost_sets(run.has_state, said_lost, errors / scale, valid),
        lost_limbs=_lost_limbs(joints, errors / scale, valid),
        length_scale=scale,
        status=run.status,
        residual=run.residual,
        residual_key=run.residual_key,
        iterations=np.where(run.has_state, run.iterations, np.nan),
        cameras=run.cameras,
        camera_residuals=run.camera_residuals,
    )


def placements(truth: OnOneClock, stamps_ns: np.ndarray, image_0_ns: int, align: str, own_time: bool) -> list[OnOneClock]:
    """Truth on the clock of the run's stamps, in each way that `EvaluationOptions` leave open.

    One that covers less than half of the sets that ``first`` covers is not among them: few sets fit anywhere.

    Parameters
    ----------
    truth : anything with stamps.
    stamps_ns : (n,) of the run.
    image_0_ns : stamp of image 0 of the run.
    align : one of `ALIGNMENTS`.
    own_time : the truth's stamps count from a start of its own.

    Returns
    -------
    One or more, shifted or as it is.
    """
    if align not in ALIGNMENTS:
        raise ValueError(f"expected an alignment of {ALIGNMENTS}, got {align!r}")
    start_ns, end_ns = int(truth.stamps_ns[0]), int(truth.stamps_ns[-1])
    first = image_0_ns - start_ns
    if align != "auto" or not own_time:
        overlap = start_ns <= stamps_ns[-1] and end_ns >= stamps_ns[0]
        return [truth.shifted(0 if align == "stamp" or (align == "auto" and overlap) else first)]

    def covered(shift_ns: int) -> int:
        return int(((stamps_ns >= start_ns + shift_ns) & (stamps_ns <= end_ns + shift_ns)).sum())

    others = [shift for shift in dict.fromkeys((image_0_ns, 0)) if shift != first and covered(shift) > 0.5 * covered(first)]
    return [truth.shifted(shift) for shift in (first, *others)]


def _misfit(estimate: Trajectories, truth: Trajectories, rotations: np.ndarray) -> float:
    """Mean error without constant offsets, of which the lag is told, too; infinite where nothing is in common."""
    both = estimate.valid & truth.valid
    errors, _ = metrics.offset_free_errors(estimate.positions_m - truth.positions_m, both, rotations)
    return metrics.mean_error(errors, both) if both.any() else float("inf")


def expected_sets(run: RunData, period_ns: float, stated: int = 0) -> int:
    """Number of image sets that there should be a state for.

    Parameters
    ----------
    run : its states, and in ``run.json`` how many sets it expected, which counts unless it was asked to stop early.
    period_ns : of the images; the periods between the first and the last stamp show gaps.
    stated : what the user says.

    Returns
    -------
    The largest of all these.
    """
    counted = run.info.get("expected_image_sets", 0)
    options = run.info.get("options")
    stopped_early = isinstance(options, dict) and options.get("max_sets") is not None
    counted = counted if isinstance(counted, int) and not stopped_early else 0
    spanned = round(float(run.stamps_ns[-1] - run.stamps_ns[0]) / period_ns) + 1
    return max(stated, counted, spanned, len(run))


def image_numbers(run: RunData, period_ns: float) -> np.ndarray:
    """Number of the image that every set shows.

    Parameters
    ----------
    run : its stamps.
    period_ns : of the images.

    Returns
    -------
    (n,) int, 0 for the first set.
    """
    return np.round((run.stamps_ns - run.stamps_ns[0]) / period_ns).astype(int)


def _tracked_joints(
    run: RunData, model: ArticulatedModel, joints: tuple[str, ...]
) -> tuple[Trajectories, np.ndarray, tuple[str, ...]]:
    """Joints over time, rotations (n, m, 3, 3) of the segments that their offsets are constant in, and those' names; NaN, and not
    valid, in sets without a state."""
    columns = [model.landmark_index(joint) for joint in joints]
    links = offset_links(model, joints)
    positions, rotations = np.full((len(run), len(joints), 3), np.nan), np.full((len(run), len(joints), 3, 3), np.nan)
    for i in np.flatnonzero(run.has_state):
        configuration = run.configuration(model, int(i))
        positions[i] = configuration.landmarks_world[columns]
        rotations[i] = configuration.Ts_world_link[links, :3, :3]
    estimate = Trajectories(joints, run.stamps_ns, positions, np.repeat(run.has_state[:, None], len(joints), axis=1))
    return estimate, rotations, tuple(model.chain.links[link] for link in links)


def _bone_lengths(estimate: Trajectories, truth: Trajectories) -> BoneLengths:
    bones = common_bones(estimate.names)
    start, end = (np.array([estimate.names.index(bone[i]) for bone in bones], dtype=int) for i in (0, 1))
    found = []
    for points in (estimate, truth):
        lengths = metrics.joint_errors(points.positions_m[:, start], points.positions_m[:, end])
        known = np.ma.array(lengths, mask=~(points.valid[:, start] & points.valid[:, end]))
        found += [1e3 * values.filled(np.nan) for values in (known.mean(axis=0), known.std(axis=0))]
    return BoneLengths(bones, *found)


def _lost_limbs(joints: tuple[str, ...], errors: np.ndarray, valid: np.ndarray) -> tuple[str, ...]:
    limbs = [(limb, joints.index(end)) for limb, end in LIMBS.items() if end in joints]
    columns = [column for _, column in limbs]
    lost = metrics.lost_limbs(errors[:, columns], valid[:, columns])
    return tuple(limb for (limb, _), is_lost in zip(limbs, lost, strict=True) if is_lost)


def _mean(values) -> float:
    values = np.asarray(values, dtype=np.float64)
    values = values[np.isfinite(values)]
    return float(values.mean()) if len(values) else float("nan")


def _span(stamps_ns: np.ndarray) -> str:
    return f"{stamps_ns[0]} to {stamps_ns[-1]} ns"
