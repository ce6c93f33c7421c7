"""The clips of the trust experiment tracked: what was said of every image set, beside what was true."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context

import numpy as np

from benchmark.trust._clips import Recorded, truth_of
from tracker_node.camera.rig import CameraRig
from tracker_node.evaluation.metrics import LOST_JOINT_M, LOST_LIMB_M
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import N_ROOT_DOF
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.constraints import resting
from tracker_node.tracking.estimate import LimbStatus, TrackEstimate
from tracker_node.tracking.limbs.judge import MEASURES
from tracker_node.tracking.limbs.tree import Limb, limbs_of
from tracker_node.tracking.motion.dynamics import Belief, Dynamics
from tracker_node.tracking.motion.smoother import Measurement, Smoother, smoothed_covariance
from tracker_node.tracking.tracker import Tracker


@dataclass(frozen=True, eq=False)
class Run:
    """One clip, tracked; arrays have the image set first.

    Attributes
    ----------
    joint_errors : (T, n_landmarks) meters. tip_errors : (T, n_limbs) meters, of the limbs' ends; of a thing, the largest.
    status : (T,). limb_status, limb_probability : (T, n_limbs).
    errors, covariances : (T, n_dof), (T, n_dof, n_dof), tangent from truth to estimate.
    shares : (T, n_limbs, n_measures) as the judge of the limbs saw them, see its `MEASURES`; nan where it saw none.
    landmark_errors, landmark_covariances : (T, n_landmarks, 3), (T, n_landmarks, 3, 3).
    smoothed_errors, smoothed_covariances : as ``errors`` and ``covariances``, in the light of all sets.
    """

    body: str
    name: str
    kind: str
    limb: int
    begins: int
    ends: int
    joint_errors: np.ndarray
    tip_errors: np.ndarray
    status: np.ndarray
    limb_status: np.ndarray
    limb_probability: np.ndarray
    errors: np.ndarray
    covariances: np.ndarray
    landmark_errors: np.ndarray
    landmark_covariances: np.ndarray
    shares: np.ndarray
    total_ms: np.ndarray
    smoothed_errors: np.ndarray
    smoothed_covariances: np.ndarray
    lost_m: float = LOST_JOINT_M

    @property
    def lost(self) -> np.ndarray:
        """(T,) sets in which a joint is farther off than ``lost_m``."""
        return (self.joint_errors > self.lost_m).any(axis=1)

    @property
    def lost_tip_m(self) -> float:
        """A limb is lost whose end is farther off."""
        return min(LOST_LIMB_M, self.lost_m)

    @property
    def on(self) -> np.ndarray:
        """(T,) sets in which something is wrong by design."""
        sets = np.arange(len(self.status))
        return (sets >= self.begins) & (sets < self.ends)


def config_of(modalities: Sequence[str]) -> TrackerConfig:
    """As the tracker is by default, but for its modalities; one thread, since clips run side by side."""
    config = TrackerConfig(threads=1)
    return replace(config, modalities=tuple(modalities), initialization=replace(config.initialization, enabled=False))


def track(recorded: Recorded, rig: CameraRig, config: TrackerConfig) -> Run:
    """Track one clip from its first true state, or the state that it hands over."""
    clip, model = recorded.clip, recorded.model
    limbs = limbs_of(model)
    handed_first = clip.handed if clip.begins == 0 else None
    tracker = Tracker(rig, model, config, {}, handed_first or clip.states[0])
    estimates, shares = [], []
    for i, image_set in enumerate(recorded.image_sets(rig)):
        if clip.handed is not None and i == clip.begins > 0:
            tracker.set_state(clip.handed)
        estimates.append(tracker.step(image_set))
        shares.append(_shares(tracker, len(limbs)))
    motion = config.motion
    measurements = [Measurement.of(e, resting(model, motion)) for e in estimates]
    smoother = Smoother(Dynamics.of(motion, model.chain, motion.smoother_noise))
    beliefs = [belief for measurement in measurements for belief in smoother.add(measurement)] + smoother.finish()
    truth = truth_of(recorded)
    found = np.array([Configuration(model, e.state).landmarks_world for e in estimates])
    joint_errors = np.linalg.norm(found - truth, axis=-1)
    tips = np.array([tip_errors(model, limbs, e.state, s) for e, s in zip(estimates, clip.states, strict=True)])
    names = [limb.name for limb in limbs]
    return Run(
        body=recorded.body, name=clip.name, kind=clip.kind, limb=names.index(clip.limb) if clip.limb else -1,
        begins=clip.begins, ends=clip.ends,
        joint_errors=joint_errors, tip_errors=tips if model.chain.n_axes else joint_errors.max(axis=1, keepdims=True),
        status=np.array([int(e.status) for e in estimates]),
        limb_status=np.array([_limb_status(e, len(limbs)) for e in estimates]),
        limb_probability=np.array([_limb_probability(e, len(limbs)) for e in estimates]),
        errors=np.array([e.state.difference(s) for e, s in zip(estimates, clip.states, strict=True)]),
        covariances=np.array([e.covariance for e in estimates]),
        landmark_errors=found - truth,
        landmark_covariances=np.array([e.landmark_covariances(model) for e in estimates]),
        shares=np.array(shares),
        total_ms=np.array([e.timings.total_ms for e in estimates]),
        smoothed_errors=np.array([_smoothed_error(b, s) for b, s in zip(beliefs, clip.states, strict=True)]),
        smoothed_covariances=np.array([_smoothed_covariance(b, e) for b, e in zip(beliefs, estimates, strict=True)]),
        lost_m=recorded.lost_m,
    )  # fmt: skip


def track_all(clips: Sequence[Recorded], rig: CameraRig, config: TrackerConfig, processes: int) -> list[Run]:
    """Every clip, in their order, side by side."""
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        return list(pool.map(track, clips, [rig] * len(clips), [config] * len(clips), chunksize=4))


def _smoothed_error(belief: Belief | None, truth: State) -> np.ndarray:
    n = N_ROOT_DOF + len(truth.joint_positions)
    return np.full(n, np.nan) if belief is None else belief.state.difference(truth)


def _smoothed_covariance(belief: Belief | None, estimate: TrackEstimate) -> np.ndarray:
    return np.full_like(estimate.covariance, np.nan) if belief is None else smoothed_covariance(belief, estimate)


def tip_errors(model: ArticulatedModel, limbs: Sequence[Limb], state: State, truth: State) -> list[float]:
    """How far the end of each limb is from the truth, meters."""
    found, true = Configuration(model, state).Ts_world_link, Configuration(model, truth).Ts_world_link
    return [float(np.linalg.norm((found[b.end] - true[b.end]) @ np.append(b.tip, 1.0))) for b in limbs]


def _shares(tracker: Tracker, n: int) -> np.ndarray:
    judge = getattr(tracker._track.engine.judge, "limbs", None)
    return np.full((n, len(MEASURES)), np.nan) if judge is None else judge.shares.copy()


def _limb_status(estimate: TrackEstimate, n: int) -> list[int]:
    """An engine that does not judge limbs says of each what it says of the body."""
    return [int(limb.status) for limb in estimate.limbs] or [int(max(estimate.status, LimbStatus.TRACKING))] * n


def _limb_probability(estimate: TrackEstimate, n: int) -> list[float]:
    return [limb.probability for limb in estimate.limbs] or [(int(estimate.status) - 1) / 2.0] * n
