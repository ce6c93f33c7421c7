"""A run in the light of what came later: the files of its smoothed states, in a folder beside those of the tracker."""

from __future__ import annotations

from collections import deque
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType

import numpy as np

from ..loaders.motion.motion_file import CovariancesWriter, VelocitiesWriter
from ..loaders.motion.trajectory_file import JointsWriter, PosesWriter, StateRow, StatesWriter
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration
from ..optimize.levenberg_marquardt import clip_to_limits
from ..tracking.config import MotionConfig
from ..tracking.constraints import resting
from ..tracking.estimate import TrackEstimate
from ..tracking.motion.dynamics import Belief, Dynamics
from ..tracking.motion.smoother import Sighting, Smoother, smoothed_covariance

FOLDER = "smoothed"
STATES, JOINTS, POSES, VELOCITIES, COVARIANCES = "states.csv", "joints.csv", "poses.csv", "velocities.csv", "covariances.csv"


def row_of(estimate: TrackEstimate, values: np.ndarray) -> StateRow:
    """Row of ``states.csv``: what the tracker says of an image set, and (n_dof,) values, NaN without a state.

    Parameters
    ----------
    estimate : what the tracker says of one image set.
    values : (n_dof,), NaN without a state.

    Returns
    -------
    row : of ``states.csv``.
    """
    return StateRow(
        stamp_ns=estimate.stamp_ns,
        status=estimate.status.name,
        reason=estimate.status_reason,
        values=values,
        score=estimate.score,
        residual=estimate.residual,
        iterations=estimate.iterations,
        evaluations=estimate.evaluations,
    )


class SmoothedWriter:
    """Takes the tracker's estimates as they come; use it in a ``with`` statement, which ends with all of them written.

    Parameters
    ----------
    output : folder of the run; the files come into ``smoothed`` in it.
    lag_s : seconds of what comes after an instant that are used for it; infinite: the whole of the recording, which is then
        written at its end.

    Status, reason, residual and score are those of the tracker. What comes before the body is first believed to be found has rows
    without a state.
    """

    def __init__(self, output: str | Path, model: ArticulatedModel, motion: MotionConfig, lag_s: float):
        self._model, self._lag_s = model, lag_s
        self._dynamics = Dynamics.of(motion, model.chain, motion.smoother_noise)
        self._rest = resting(model, motion)
        self._smoother = Smoother(self._dynamics, lag_s)
        self._waiting: deque[TrackEstimate] = deque()
        folder, names, units = Path(output) / FOLDER, model.chain.dof_names, model.chain.dof_units
        folder.mkdir(parents=True, exist_ok=True)
        with ExitStack() as stack:
            self._states = stack.enter_context(StatesWriter(folder / STATES, names, units))
            self._joints = stack.enter_context(JointsWriter(folder / JOINTS, model.landmark_names))
            self._poses = stack.enter_context(PosesWriter(folder / POSES))
            self._velocities = stack.enter_context(VelocitiesWriter(folder / VELOCITIES, names, units))
            self._covariances = stack.enter_context(CovariancesWriter(folder / COVARIANCES, names))
            self._stack = stack.pop_all()

    def append(self, estimate: TrackEstimate) -> None:
        """One estimate; a stamp that goes backward begins a new recording."""
        if self._waiting and estimate.stamp_ns < self._waiting[-1].stamp_ns:
            self._finish()
        self._waiting.append(estimate)
        self._write(self._smoother.add(Sighting.of(estimate, self._rest)))

    def close(self) -> None:
        """Write what is left, and finish every file."""
        with self._stack:
            self._finish()

    def _finish(self) -> None:
        self._write(self._smoother.finish())
        self._smoother = Smoother(self._dynamics, self._lag_s)

    def _write(self, beliefs: list[Belief | None]) -> None:
        for belief in beliefs:
            estimate = self._waiting.popleft()
            if belief is None:
                self._write_state(estimate, np.full(self._model.n_dof, np.nan))
            else:
                self._write_one(estimate, belief)

    def _write_state(self, estimate: TrackEstimate, values: np.ndarray) -> None:
        self._states.append(row_of(estimate, values))

    def _write_one(self, estimate: TrackEstimate, belief: Belief) -> None:
        stamp_ns, state = estimate.stamp_ns, clip_to_limits(belief.state, self._model.chain)
        self._write_state(estimate, state.to_values())
        self._joints.append(stamp_ns, Configuration(self._model, state).landmarks_world)
        self._poses.append(stamp_ns, state.T_world_root)
        self._velocities.append(stamp_ns, belief.velocity)
        self._covariances.append(stamp_ns, smoothed_covariance(belief, estimate), belief.velocity_covariance)

    def __enter__(self) -> SmoothedWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()
