"""How bodies move, as a stochastic process on the manifold, and the two steps of the Kalman filter for it.

Each degree of freedom is an integrated Ornstein-Uhlenbeck process: its velocity v dies away within a memory tau and is driven by
white acceleration w of spectral density s^2,

    dq = v dt,    dv = -v / tau dt + s dw,

discretized exactly for any time step, so that no parameter depends on the image rate. tau to infinity is constant velocity with
white acceleration (Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, 6.2.2).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...compiled.kernels import compiled
from ...geometry import so3
from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF, KinematicChain
from ...objective.constraints.prior import Prior
from ..config import MotionConfig

_ROTATION = slice(3, 6)
_LIMIT_SIGMAS = 2.0  # standard deviations of a joint's velocity that its limit is
_STILL, _FORGETS_S = 1.0, 1e-3  # m or rad per s^1.5, and seconds: a millimeter in a second, so that early errors fade


@dataclass(frozen=True, eq=False)
class Belief:
    """A Gaussian of state and velocity.

    Attributes
    ----------
    state, velocity : its mean; velocity (n_dof,) is a tangent per second.
    covariance : (2 n_dof, 2 n_dof) of (tangent at ``state``, velocity).
    """

    state: State
    velocity: np.ndarray
    covariance: np.ndarray

    @property
    def state_covariance(self) -> np.ndarray:
        """(n_dof, n_dof)."""
        return self.covariance[: self.velocity.size, : self.velocity.size]

    @property
    def velocity_covariance(self) -> np.ndarray:
        """(n_dof, n_dof), per second squared."""
        return self.covariance[self.velocity.size :, self.velocity.size :]

    def prior(self) -> Prior:
        """Prior of the state, in units of information."""
        information = np.linalg.inv(self.state_covariance)
        return Prior(self.state, 0.5 * (information + information.T), self.state_covariance)

    @cached_property
    def velocity_by_state(self) -> np.ndarray:
        """(n_dof, n_dof): what being off the mean by a tangent says of the velocity (its regression on the state), 1/s."""
        n = self.velocity.size
        return np.linalg.solve(self.state_covariance, self.covariance[:n, n:]).T


@dataclass(frozen=True, eq=False)
class Dynamics:
    """Process noise and memory per degree of freedom, each (n_dof,): m or rad per s^1.5, and seconds."""

    noise: np.ndarray
    memory_s: np.ndarray

    @classmethod
    def of(cls, config: MotionConfig, chain: KinematicChain, share: float = 1.0) -> Dynamics:
        """As configured for the root's translation (and joints that slide), its rotation, and the joints that turn.

        No joint has more noise than suits the limit of its velocity.

        Parameters
        ----------
        config, chain : noise and time constants, and the axes.
        share : factor of the noise.

        Returns
        -------
        With noise and time constant of each degree of freedom.
        """
        slides = [axis.prismatic for axis in chain.axes]
        noise, memory_s = np.empty(chain.n_dof), np.empty(chain.n_dof)
        noise[:3], memory_s[:3] = config.root_position_noise, config.root_position_time_constant_s
        noise[3:6], memory_s[3:6] = config.root_angle_noise, config.root_angle_time_constant_s
        noise[N_ROOT_DOF:] = np.where(slides, config.root_position_noise, config.joint_noise)
        memory_s[N_ROOT_DOF:] = config.joint_time_constant_s
        limits = np.array([axis.velocity_limit for axis in chain.axes])
        noise[N_ROOT_DOF:] = np.minimum(noise[N_ROOT_DOF:], limits / (_LIMIT_SIGMAS * np.sqrt(0.5 * memory_s[N_ROOT_DOF:])))
        if config.base == "fixed":
            noise[:N_ROOT_DOF], memory_s[:N_ROOT_DOF] = _STILL, _FORGETS_S
        return cls(share * noise, memory_s)

    def unmoved(self, state: State, sigmas: np.ndarray) -> Belief:
        """A body at rest, as far as is known, whose place is known without its images.

        Parameters
        ----------
        state, sigmas : where it is, and (n_dof,) standard deviations of that.

        Returns
        -------
        Its belief.
        """
        return self.start(state, np.zeros((sigmas.size, sigmas.size)), sigmas)

    def start(self, state: State, information: np.ndarray, spread: float | np.ndarray = 1.0) -> Belief:
        """A body at rest, as far as is known: velocities are spread as the process spreads them in the long run.

        Parameters
        ----------
        state, information : the state, and (n_dof, n_dof) of what has been measured.
        spread : the state's standard deviation before, in meters and radians, or (n_dof,) of each degree of freedom.

        Returns
        -------
        Its belief.
        """
        n = self.noise.size
        covariance = np.zeros((2 * n, 2 * n))
        covariance[:n, :n] = _symmetric(np.linalg.inv(information + np.eye(n) / np.square(spread)))
        covariance[n:, n:] = np.diag(0.5 * self.noise**2 * self.memory_s)
        return Belief(state, np.zeros(n), covariance)

    def propagate(self, belief: Belief, elapsed_s: float) -> Belief:
        """Predict.

        Parameters
        ----------
        belief, elapsed_s : the belief, and how much later.

        Returns
        -------
        The belief then.
        """
        kept = self._kept(elapsed_s)
        reach = self.memory_s * (1.0 - kept)
        step = reach * belief.velocity
        covariance = _propagated(belief.covariance, step, reach, kept, *self._noises(elapsed_s))
        return Belief(belief.state.retract(step), kept * belief.velocity, covariance)

    def transition(self, belief: Belief, elapsed_s: float) -> np.ndarray:
        """Derivative of `propagate`'s mean by that of a belief.

        Parameters
        ----------
        belief, elapsed_s : see `propagate`.

        Returns
        -------
        (2 n_dof, 2 n_dof).
        """
        kept = self._kept(elapsed_s)
        reach = self.memory_s * (1.0 - kept)
        return _moved(np.eye(2 * kept.size), reach * belief.velocity, reach, kept)

    def _kept(self, elapsed_s: float) -> np.ndarray:
        return np.exp(-elapsed_s / self.memory_s)

    def _noises(self, elapsed_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Variances of state, state with velocity, and velocity that the noise adds, (n_dof,) each."""
        tau, density = self.memory_s, self.noise**2
        x = elapsed_s / tau
        e = -np.expm1(-x)
        # x - 2 (1 - exp -x) + (1 - exp -2x) / 2 cancels to x^3 / 3 for short steps
        series = x**3 * (1.0 / 3.0 - x * (0.25 - x * (7.0 / 60.0)))
        qq = density * tau**3 * np.where(x < 1e-2, series, x - 2.0 * e - 0.5 * np.expm1(-2.0 * x))
        qv = density * tau**2 * 0.5 * e * e
        vv = density * tau * -0.5 * np.expm1(-2.0 * x)
        return qq, qv, vv


@compiled
def _moved(rows, step, reach, kept):
    """Errors (2 n_dof, m) of state and velocity, some time later.

    The rotation goes from R to exp(w) R, w the turn; a small turn d before it is exp(w) d after it, and a change of w comes
    in through the left Jacobian of SO(3).
    """
    n = step.size
    turn, by_change = so3.exp_kernel(step[3:6]), so3.left_jacobian_kernel(step[3:6])
    later = np.empty_like(rows)
    for i in range(n):
        for k in range(rows.shape[1]):
            later[i, k] = rows[i, k] + reach[i] * rows[n + i, k]
            later[n + i, k] = kept[i] * rows[n + i, k]
    for a in range(3):
        later[3 + a] = 0.0
        for b in range(3):
            for k in range(rows.shape[1]):
                later[3 + a, k] += turn[a, b] * rows[3 + b, k] + by_change[a, b] * reach[3 + b] * rows[n + 3 + b, k]
    return later


@compiled
def _propagated(covariance, step, reach, kept, of_state, of_both, of_velocity):
    """(2 n_dof, 2 n_dof) some time later, with what the noise adds to it."""
    n = step.size
    half = _moved(covariance, step, reach, kept)
    later = _moved(np.ascontiguousarray(half.T), step, reach, kept)
    for i in range(n):
        later[i, i] += of_state[i]
        later[i, n + i] += of_both[i]
        later[n + i, i] += of_both[i]
        later[n + i, n + i] += of_velocity[i]
    return 0.5 * (later + later.T)


def with_positions(belief: Belief, positions: np.ndarray, sigmas: np.ndarray) -> Belief:
    """A belief after joints have been measured by themselves (a linear Kalman update).

    Parameters
    ----------
    belief : before it.
    positions : (n_axes,) radians or meters; NaN of axes that were not measured.
    sigmas : (n_axes,) standard deviations.

    Returns
    -------
    The belief, its mean in accordance with the measurement.
    """
    measured = np.flatnonzero(np.isfinite(positions))
    rows, n = N_ROOT_DOF + measured, belief.velocity.size
    innovation = positions[measured] - belief.state.joint_positions[measured]
    covariance = belief.covariance
    gain = np.linalg.solve(covariance[np.ix_(rows, rows)] + np.diag(sigmas[measured] ** 2), covariance[rows]).T
    shift = gain @ innovation
    kept = np.eye(2 * n)
    kept[:, rows] -= gain
    noise = (gain * sigmas[measured] ** 2) @ gain.T  # Joseph's form: stays positive for measurements that are nearly exact
    return Belief(belief.state.retract(shift[:n]), belief.velocity + shift[n:], _symmetric(kept @ covariance @ kept.T + noise))


def correct(belief: Belief, state: State, information: np.ndarray) -> Belief:
    """A belief after a measurement of the state alone.

    Parameters
    ----------
    belief : before it.
    state : the maximum of prior times likelihood, found by whatever means: an iterated Kalman filter is Gauss-Newton on the
        posterior (Bell and Cathey, 1993), so what is left to do here is the velocity, and the covariance.
    information : (n_dof, n_dof) of the measurement alone in the tangent at ``state``; may be singular.

    Returns
    -------
    The belief at ``state``.
    """
    n = belief.velocity.size
    offset = state.difference(belief.state)
    gain = belief.velocity_by_state
    turned = np.eye(n)
    turned[_ROTATION, _ROTATION] = so3.left_jacobian(offset[_ROTATION])  # from the tangent at the old mean to that at the new
    # P+ = L (1 + L^T H L)^-1 L^T needs no inverse of H, nor of P.
    L = np.linalg.cholesky(belief.state_covariance)
    moved = turned @ L
    qq = L @ np.linalg.solve(np.eye(n) + moved.T @ information @ moved, L.T)  # in the old tangent
    covariance = np.empty_like(belief.covariance)
    covariance[:n, :n] = turned @ qq @ turned.T
    covariance[n:, :n] = gain @ qq @ turned.T
    covariance[:n, n:] = covariance[n:, :n].T
    covariance[n:, n:] = belief.velocity_covariance - gain @ (belief.state_covariance - qq) @ gain.T
    return Belief(state, belief.velocity + gain @ offset, _symmetric(covariance))


def _symmetric(matrix: np.ndarray) -> np.ndarray:
    return 0.5 * (matrix + matrix.T)
