"""Where the body is expected next, and how surely: an iterated Kalman filter whose correction is the tracker's own fit.

`MotionModel.predict` gives the prior of the fit, the fit gives the most probable state, and `MotionModel.update` takes it in with
the information that the images had. What no contour sees (the roll of round limbs, a hidden arm) keeps its prediction, whose
variance grows; what is seen is hardly held back by it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF, KinematicChain
from ...objective.constraints.prior import Prior
from ..config import MotionConfig
from .dynamics import Belief, Dynamics, correct, with_positions


@dataclass(frozen=True, eq=False)
class Prediction:
    """The state expected at a time, before its images are used.

    ``belief`` is None after updates without information: then there is no covariance, and no prior, and the velocity follows the
    state with ``gain``, 1/s.
    """

    state: State
    velocity: np.ndarray
    belief: Belief | None = None
    gain: float = 0.0

    @property
    def covariance(self) -> np.ndarray | None:
        """(n_dof, n_dof) in the tangent at ``state``."""
        return None if self.belief is None else self.belief.state_covariance

    def prior(self) -> Prior | None:
        """Prior of the expected state, in units of information."""
        return None if self.belief is None else self.belief.prior()

    def velocity_at(self, state: State) -> np.ndarray:
        """(n_dof,): the velocity to be expected if ``state`` is where the body is now."""
        if self.belief is None:
            return self.velocity + self.gain * state.difference(self.state)
        return self.velocity + self.belief.velocity_by_state @ state.difference(self.belief.state)


@dataclass(frozen=True, eq=False)
class ExposureDelays:
    """How a body moves while the cameras of one image set expose: ``delays_s`` (n_cameras,) after the set's stamp."""

    delays_s: Sequence[float]
    prediction: Prediction

    def offsets(self, state: State) -> list[np.ndarray | None]:
        """Per camera the tangent (n_dof,) from ``state`` to where the body is when that camera exposes; None: where it is."""
        if not any(self.delays_s):
            return [None] * len(self.delays_s)
        velocity = self.prediction.velocity_at(state)
        return [delay * velocity if delay else None for delay in self.delays_s]


class MotionModel:
    """Keeps state and velocity (tangent per second) with their covariance, and predicts with them.

    Engines that do not speak of information get a filter of fixed gains: the velocity follows the measured one, and that of
    joint angles decays.
    """

    def __init__(self, chain: KinematicChain, config: MotionConfig):
        self._config, self._dynamics = config, Dynamics.of(config, chain)
        slides = [axis.prismatic for axis in chain.axes]
        self._joint_sigmas = np.where(slides, config.joint_state_sigma_m, np.radians(config.joint_state_sigma_deg))
        self._endless = np.array([axis.endless for axis in chain.axes], dtype=np.bool_)
        self.velocity = np.zeros(chain.n_dof)
        self._last: tuple[int, State] | None = None
        self._belief: Belief | None = None
        self._expected: tuple[int, Belief] | None = None  # what follows from it for the stamp last asked for

    @property
    def velocity_covariance(self) -> np.ndarray | None:
        """(n_dof, n_dof) of the velocity, per second squared; None where nothing is known of it."""
        return None if self._belief is None else self._belief.velocity_covariance

    def predict(self, stamp_ns: int) -> Prediction | None:
        """What is expected at ``stamp_ns``; None before the first update, if nothing was said of that time."""
        if self._expected is None or self._expected[0] != stamp_ns:
            self._expected = None
            if self._last is None:
                return None
            last_ns, state = self._last
            elapsed_s = (stamp_ns - last_ns) * 1e-9
            if self._belief is not None:
                self._expected = stamp_ns, self._dynamics.propagate(self._belief, max(elapsed_s, 0.0))
        if self._expected is not None:
            belief = self._expected[1]
            return Prediction(belief.state, belief.velocity, belief)
        step = self.velocity * elapsed_s
        step[N_ROOT_DOF:] *= self._config.velocity_decay
        gain = self._config.velocity_gain / elapsed_s if elapsed_s > 0.0 else 0.0
        return Prediction(state.retract(step), self.velocity, gain=gain)

    def expect(self, stamp_ns: int, state: State, sigmas: np.ndarray) -> None:
        """Say where a body is of which nothing is known yet.

        Parameters
        ----------
        stamp_ns, state : of its first image set.
        sigmas : (n_dof,) standard deviations, m and rad.
        """
        self._expected = stamp_ns, self._dynamics.unmoved(state, sigmas)

    def read_joints(self, stamp_ns: int, positions: np.ndarray) -> None:
        """Take in what a robot says of its joints, before the image set of that time is fitted.

        Parameters
        ----------
        stamp_ns, positions : of the image set; (n_axes,) radians or meters, NaN where nothing is said.
        """
        predicted = self.predict(stamp_ns)
        if predicted is not None:
            belief = predicted.belief or self._dynamics.unmoved(predicted.state, np.ones_like(self.velocity))
            turns = np.round((belief.state.joint_positions - positions) / math.tau)  # a robot may begin anew after each
            positions = np.where(self._endless, positions + math.tau * turns, positions)
            self._expected = stamp_ns, with_positions(belief, positions, self._joint_sigmas)

    def update(self, stamp_ns: int, state: State, information: np.ndarray | None = None) -> None:
        """Take in the estimate for an image set.

        Parameters
        ----------
        stamp_ns : of the image set.
        state : the most probable one by prediction and images together.
        information : (n_dof, n_dof) of the images alone at it (H of their normal equations, in units of inverse variance); None
            where the engine has none.
        """
        predicted = self.predict(stamp_ns)
        if information is None:
            self._belief = self._expected = None
            self._follow(stamp_ns, state)
        elif predicted is None or predicted.belief is None:
            self._set(stamp_ns, replace(self._dynamics.start(state, information), velocity=self.velocity))
        else:
            self._set(stamp_ns, correct(predicted.belief, state, information))

    def coast(self, stamp_ns: int, state: State) -> None:
        """Go on from a state that says nothing of the motion; the velocity decays, lest a lost body flies off.

        Parameters
        ----------
        stamp_ns, state : of the image set.
        """
        predicted = self.predict(stamp_ns)
        if predicted is not None and predicted.belief is not None:
            self._set(stamp_ns, replace(predicted.belief, state=state))
        else:
            self.velocity, self._last = self._config.velocity_decay * self.velocity, (stamp_ns, state)
            self._expected = None

    def take_over(self, other: MotionModel) -> None:
        """Know what ``other`` knows of a body with the same joints."""
        self.velocity, self._last, self._belief, self._expected = other.velocity, other._last, other._belief, None

    def restart(self, stamp_ns: int, state: State) -> None:
        """Forget the velocity.

        Parameters
        ----------
        stamp_ns, state : where and when the body is from now on.
        """
        self.velocity = np.zeros_like(self.velocity)
        self._last, self._belief, self._expected = (stamp_ns, state), None, None

    def _set(self, stamp_ns: int, belief: Belief) -> None:
        self._belief, self.velocity, self._last = belief, belief.velocity, (stamp_ns, belief.state)
        self._expected = None

    def _follow(self, stamp_ns: int, state: State) -> None:
        if self._last is not None:
            last_ns, last = self._last
            elapsed = (stamp_ns - last_ns) * 1e-9
            if elapsed > 0.0:
                measured = state.difference(last) / elapsed
                self.velocity = self.velocity + self._config.velocity_gain * (measured - self.velocity)
        self._last = (stamp_ns, state)
