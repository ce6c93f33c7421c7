"""Every estimate of a recording in the light of the later ones: the smoother of Rauch, Tung and Striebel on the manifold.

A first pass forward is a Kalman filter like the tracker's own with less noise, fed with where the images alone had the body and
how surely (or with the tracker's states, where an engine does not tell them apart). The pass backward corrects each belief by
what the next one has come to know (Rauch, Tung and Striebel, 1965). Tangents are taken at the filtered and predicted means, and
covariances carried from one tangent space to the other.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...geometry import so3
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.constraints.prior import Prior
from ..estimate import TrackEstimate
from .dynamics import Belief, Dynamics, correct

_ROTATION = slice(3, 6)


@dataclass(frozen=True, eq=False)
class Measurement:
    """The measurement of one image set.

    ``information`` (n_dof, n_dof): inverse covariance that its images alone give of ``state``; None where neither they nor
    the state count. ``innovation`` (n_dof,): that times the tangent from ``state`` to where they alone have the body; None:
    the state is what the smoother's own prediction and the images make most probable.
    """

    stamp_ns: int
    state: State
    information: np.ndarray | None
    innovation: np.ndarray | None = None

    @classmethod
    def of(cls, estimate: TrackEstimate, rest: Prior) -> Measurement:
        """What an estimate rests on but its prediction: images, and the prior of the neutral pose.

        Parameters
        ----------
        estimate : of the tracker.
        rest : of `constraints.resting`.

        Returns
        -------
        Without information where the estimate has none.
        """
        if estimate.information is None:
            return cls(estimate.stamp_ns, estimate.state, None)
        H, gradient = np.zeros_like(estimate.information), np.zeros(len(estimate.information))
        rest.add_to(H, gradient, estimate.state)
        innovation = None if estimate.innovation is None else estimate.innovation - gradient
        return cls(estimate.stamp_ns, estimate.state, estimate.information + H, innovation)


@dataclass(frozen=True, eq=False)
class _Link:
    """From one filtered belief to the next: ``predicted`` from ``before`` over ``elapsed_s``."""

    dynamics: Dynamics
    before: Belief
    elapsed_s: float

    @cached_property
    def predicted(self) -> Belief:
        return self.dynamics.propagate(self.before, self.elapsed_s)

    @cached_property
    def gain(self) -> np.ndarray:
        """(2 n_dof, 2 n_dof): what a change after means for before."""
        F = self.dynamics.transition(self.before, self.elapsed_s)
        P = self.predicted.covariance
        scale = 1.0 / np.sqrt(np.diag(P))  # meters, radians and their velocities are of different sizes
        return (scale[:, None] * np.linalg.solve(P * np.outer(scale, scale), scale[:, None] * (F @ self.before.covariance))).T

    def smoothed(self, after: Belief) -> Belief:
        """``before``, once ``after`` is known to be what the prediction has led to."""
        predicted, n = self.predicted, self.before.velocity.size
        change = np.concatenate([after.state.difference(predicted.state), after.velocity - predicted.velocity])
        known = _carried(after.covariance, so3.left_jacobian_inverse(change[_ROTATION]))
        step = self.gain @ change
        covariance = self.before.covariance + self.gain @ (known - predicted.covariance) @ self.gain.T
        covariance = _carried(covariance, so3.left_jacobian(step[_ROTATION]))
        return Belief(self.before.state.retract(step[:n]), self.before.velocity + step[n:], 0.5 * (covariance + covariance.T))


def _carried(covariance: np.ndarray, turned: np.ndarray) -> np.ndarray:
    """A covariance of which the root's rotation is stated in another tangent space, ``turned`` (3, 3) being the change."""
    result = covariance.copy()
    result[_ROTATION] = turned @ result[_ROTATION]
    result[:, _ROTATION] = result[:, _ROTATION] @ turned.T
    return result


def _most_probable(predicted: Belief, measurement: Measurement) -> State:
    """By ``predicted`` and what was seen, which is Gaussian about its state.

    The tracker's own state is that by its prediction, which expects more of a body than the smoother does.
    """
    if measurement.innovation is None or measurement.information is None:
        return measurement.state
    H, gradient = measurement.information.copy(), -measurement.innovation
    predicted.prior().add_to(H, gradient, measurement.state)
    return measurement.state.retract(-np.linalg.solve(H, gradient))


def smoothed_covariance(belief: Belief, estimate: TrackEstimate) -> np.ndarray:
    """Covariance of a smoothed state, with the second-order terms of the estimate.

    Second-order terms grow with the square of the variances of hardly known directions, which the smoothed state knows better.

    Parameters
    ----------
    belief, estimate : the smoothed one, and the filtered one of the same time.

    Returns
    -------
    (n_dof, n_dof).
    """
    if estimate.second_order is None:
        return belief.state_covariance
    straight = (estimate.covariance - estimate.second_order)[N_ROOT_DOF:, N_ROOT_DOF:]
    of_all = float((straight * straight).sum())
    share = float((belief.state_covariance[N_ROOT_DOF:, N_ROOT_DOF:] * straight).sum()) / of_all if of_all > 0.0 else 1.0
    return belief.state_covariance + min(share, 1.0) ** 2 * estimate.second_order


class Smoother:
    """Smooths as measurements come; each is answered once it is ``lag_s`` old, or at the end.

    Parameters
    ----------
    dynamics : of the body.
    lag_s : seconds of what comes after a time that are used for it; infinite: the whole of the recording.
    """

    def __init__(self, dynamics: Dynamics, lag_s: float = math.inf):
        if not lag_s > 0.0:
            raise ValueError(f"expected a lag of more than 0 s, got {lag_s}")
        self._dynamics, self._lag_s = dynamics, lag_s
        self._stamps_ns: deque[int] = deque()
        self._filtered: deque[Belief | None] = deque()
        self._links: deque[_Link | None] = deque()  # from each measurement to the one after it

    def add(self, measurement: Measurement) -> list[Belief | None]:
        """Beliefs that are now old enough, in order of time; None for what comes before the first belief."""
        if self._stamps_ns and measurement.stamp_ns < self._stamps_ns[-1]:
            got = f"{measurement.stamp_ns} ns after {self._stamps_ns[-1]} ns"
            raise ValueError(f"expected measurements in order of time, got {got}")
        self._append(measurement)
        n_due = sum((measurement.stamp_ns - stamp_ns) * 1e-9 >= self._lag_s for stamp_ns in self._stamps_ns)
        return self._take(n_due)

    def finish(self) -> list[Belief | None]:
        """All that is left."""
        return self._take(len(self._stamps_ns))

    def _append(self, measurement: Measurement) -> None:
        before = self._filtered[-1] if self._filtered else None
        link = None
        if before is None:
            information = measurement.information
            belief = None if information is None else self._dynamics.start(measurement.state, information)
        else:
            link = _Link(self._dynamics, before, (measurement.stamp_ns - self._stamps_ns[-1]) * 1e-9)
            belief = link.predicted
            if measurement.information is not None:
                belief = correct(belief, _most_probable(belief, measurement), measurement.information)
        if self._filtered:
            self._links[-1] = link
        self._stamps_ns.append(measurement.stamp_ns)
        self._filtered.append(belief)
        self._links.append(None)

    def _take(self, count: int) -> list[Belief | None]:
        """The oldest ``count``, smoothed by all that is kept."""
        if not count:
            return []
        belief, result = self._filtered[-1], [self._filtered[-1]]
        for i in range(len(self._filtered) - 2, -1, -1):
            link = self._links[i]
            belief = self._filtered[i] if link is None or belief is None else link.smoothed(belief)
            result.append(belief)
        result.reverse()
        for _ in range(count):
            for kept in (self._stamps_ns, self._filtered, self._links):
                kept.popleft()
        return result[:count]
