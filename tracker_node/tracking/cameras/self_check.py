"""Which camera stands elsewhere than the calibration says, or is delayed: by what cameras disagree on while tracking.

Each camera's contours draw the body to where they fit. What all cameras agree on, the pose takes up; what only one camera asks
for remains as a residual. If that is the same turn about the camera's center in set after set, the camera has been
turned; if it is the body's own motion times a constant, the camera's images are late by that constant.

With the residuals of camera i linearized as r_i + J_i x + W_i F_i phi_i, x the tangent of the state and F_i phi_i the twist of
every link that makes up for a fault phi_i = (rotation (3) in camera axes, delay), the state is eliminated from the normal
equations of all cameras (Schur complement). This is leaving one out done right: how far a faulty camera has moved the pose,
and so hidden a part of its own fault, is accounted for. What remains is a quadratic function of the faults alone, and adds up
over image sets.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from ...camera.rig import CameraRig
from ...compiled.kernels import compiled
from ...geometry import so3
from ...model.articulated import ArticulatedModel
from ...model.configuration import State, configured
from ...objective.normal_equations import Comparison
from ..estimate import DELAYED, TURNED, CameraFault

_N = 4  # parameters of a camera's fault: rotation (3), delay
# Which of them a fault may have; the turn about the optical axis, hardly known where the body is small, is left out if it can be
_KINDS = ((0, 1), (0, 1, 2), (3,), (0, 1, 3), (0, 1, 2, 3))
_BLOCKS, _LEAST_BLOCKS = 8, 4
_PRICE = 6.0  # of a parameter, in the units of chi-squared: what noise gains by it, and some more
_ALIKE = 0.6  # fraction of what one camera explains from which on another might as well be the cause


@dataclass(frozen=True)
class SelfCheckOptions:
    """``window_s`` is how far back; a fault has to be larger than ``angle_rad`` or ``delay_s``, and than ``sigmas`` times its
    standard deviation."""

    window_s: float = 2.0
    angle_rad: float = np.radians(0.3)
    delay_s: float = 0.5 / 30.0
    sigmas: float = 5.0


@dataclass(eq=False)
class _Block:
    """Quadratic function of all faults, phi.L.phi + 2 e.phi, summed over the sets from ``begin_ns`` on."""

    begin_ns: int
    L: np.ndarray
    e: np.ndarray


@dataclass(frozen=True, eq=False)
class _Pending:
    """A set whose body's velocity is known once the next one is there."""

    stamp_ns: int
    fit: Comparison


@dataclass(frozen=True, eq=False)
class _Fit:
    """A camera's fault: ``values`` (k,) of the parameters ``chosen`` (k,) of all, and their ``covariance``.

    ``explained`` is by how much it lowers chi-squared over the latest ``n_blocks``, ``dispersion`` how much larger its variances
    are than errors that are independent of each other would make them.
    """

    camera: int
    chosen: tuple[int, ...]
    values: np.ndarray
    covariance: np.ndarray
    explained: float
    dispersion: float
    n_blocks: int


class SelfCheck:
    """Collects what cameras say over a sliding window of image sets; deterministic in what it is given."""

    def __init__(self, rig: CameraRig, model: ArticulatedModel, options: SelfCheckOptions | None = None):
        self._names, self._model, self._options = rig.names, model, options or SelfCheckOptions()
        self._turns = np.array([_turn_twists(camera.T_world_cam) for camera in rig])  # (c, 6, 3)
        self.reset()

    def reset(self) -> None:
        """Forget all sets."""
        self._blocks: deque[_Block] = deque(maxlen=_BLOCKS)
        self._pending: _Pending | None = None
        self._before: tuple[int, State] | None = None
        self._found: tuple[CameraFault, ...] = ()
        self._faults: tuple[CameraFault, ...] = ()

    @property
    def faults(self) -> tuple[CameraFault, ...]:
        """As the last complete block of sets has left it."""
        return self._faults

    def skip(self) -> None:
        """A set that is not used: no velocity is taken across it."""
        self._pending = self._before = None

    def add(self, stamp_ns: int, fit: Comparison) -> tuple[CameraFault, ...]:
        """Take in the fit of one image set. What a single camera sees contradicts nobody.

        Parameters
        ----------
        stamp_ns, fit : of the image set.

        Returns
        -------
        `faults`.
        """
        if sum(camera is not None for camera in fit.cameras) < 2:
            self.skip()
            return self._faults
        pending, before = self._pending, self._before
        if pending is not None and before is not None and before[0] < pending.stamp_ns < stamp_ns:
            velocity = fit.state.difference(before[1]) / (1e-9 * (stamp_ns - before[0]))
            self._add_to_block(pending.stamp_ns, *self._marginal(pending.fit, velocity))
        self._before = None if pending is None else (pending.stamp_ns, pending.fit.state)
        self._pending = _Pending(stamp_ns, fit)
        return self._faults

    def _add_to_block(self, stamp_ns: int, L: np.ndarray, e: np.ndarray) -> None:
        length_ns = 1e9 * self._options.window_s / _BLOCKS
        if self._blocks and stamp_ns - self._blocks[-1].begin_ns < length_ns:
            self._blocks[-1].L += L
            self._blocks[-1].e += e
            return
        if self._blocks:
            self._judge()
        self._blocks.append(_Block(stamp_ns, L, e))

    def _marginal(self, fit: Comparison, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(L, e) of all faults with the state eliminated, for one set; delays in seconds."""
        configuration = configured(self._model, fit.state)
        moved, twists = self._model.chain.link_moved_by, configuration.twists
        link_velocities = (moved * velocity) @ twists  # (l, 6)
        n_cameras = len(self._names)
        L, e = np.zeros((_N * n_cameras, _N * n_cameras)), np.zeros(_N * n_cameras)
        E = np.zeros((len(twists), _N * n_cameras))
        for i, camera in enumerate(fit.cameras):
            if camera is not None:
                own = slice(_N * i, _N * (i + 1))
                faults = self._turns[i], link_velocities
                _add_camera(camera.normal, camera.gradient, *faults, moved, twists, L[own, own], e[own], E[:, own])
        H = fit.equations.H + 1e-9 * np.trace(fit.equations.H) / len(E) * np.eye(len(E))
        solved = np.linalg.solve(H, np.column_stack([E, fit.equations.g]))
        return L - E.T @ solved[:, :-1], e - E.T @ solved[:, -1]

    def _judge(self) -> None:
        """Name cameras one by one, each given those named before, while one explains the residuals clearly.

        What is said must have been found in the block before too: a window that a fault begins in can mislead.
        """
        if len(self._blocks) < _LEAST_BLOCKS:
            return
        self._L, self._e = np.array([block.L for block in self._blocks]), np.array([block.e for block in self._blocks])
        named: list[_Fit] = []
        found: list[CameraFault] = []
        for _ in range(max((len(self._names) - 1) // 2, 1)):
            fits = self._explanations(named)
            best = self._of_simplest_kind(fits[0], named)
            rivals = tuple(self._names[fit.camera] for fit in fits[1:] if self._alike(fits[0], fit))
            faults = self._faults_of(best, rivals)
            if not faults:
                break
            found += faults
            named.append(best)
        kinds = {(fault.camera, fault.kind) for fault in self._found}
        self._faults = tuple(self._remembered(fault) for fault in found if (fault.camera, fault.kind) in kinds)
        self._found = tuple(found)

    def _explanations(self, named: list[_Fit]) -> list[_Fit]:
        """For every camera not yet named the turn and delay, together, that explain most; the best camera first.

        The best one also says since which block: a window that begins before the fault would dilute it.
        """
        others = [i for i in range(len(self._names)) if i not in [fit.camera for fit in named]]
        spans = [named[0].n_blocks] if named else range(_LEAST_BLOCKS, len(self._blocks) + 1)
        fits = [[self._fit(n, named, i, tuple(range(_N * i, _N * (i + 1)))) for i in others] for n in spans]
        return sorted(max(fits, key=lambda row: max(fit.explained for fit in row)), key=lambda fit: -fit.explained)

    def _of_simplest_kind(self, full: _Fit, named: list[_Fit]) -> _Fit:
        """Turn, delay or both, whatever suffices."""
        fits = [self._fit(full.n_blocks, named, full.camera, tuple(_N * full.camera + k for k in kind)) for kind in _KINDS]
        return max(fits, key=lambda fit: fit.explained / full.dispersion - _PRICE * len(fit.chosen))

    def _fit(self, n_blocks: int, named: list[_Fit], camera: int, chosen: tuple[int, ...]) -> _Fit:
        """Least squares over the latest blocks for the parameters ``chosen``, those of cameras named before being free too.

        The covariance adds what the scatter of the blocks gives (errors are common to neighboring samples and images) to that of
        independent errors.
        """
        given = [k for fit in named for k in fit.chosen]
        columns, own = np.array([*given, *chosen]), slice(len(given), None)
        Ls, es = self._L[-n_blocks:, columns[:, None], columns], self._e[-n_blocks:, columns]
        A, e = Ls.sum(axis=0), es.sum(axis=0)
        inverse = np.linalg.inv(_regular(A))
        values = -inverse @ e
        scores = (es + Ls @ values) @ inverse
        covariance = inverse + n_blocks / (n_blocks - 1) * scores.T @ scores
        dispersion = float((covariance.diagonal()[own] / inverse.diagonal()[own]).mean())
        explained = -float(e @ values)
        if given:
            explained -= float(e[: len(given)] @ np.linalg.solve(_regular(A[: len(given), : len(given)]), e[: len(given)]))
        return _Fit(camera, chosen, values[own], covariance[own, own], explained, dispersion, n_blocks)

    def _alike(self, best: _Fit, other: _Fit) -> bool:
        """Whether the other camera explains nearly as much, or by geometry would, were the best fit the truth.

        Two cameras that face each other see the body shifted sideways by the same amount, whichever of them has been turned.
        """
        a, b, fault = np.array(best.chosen), np.array(other.chosen), best.values
        L = self._L[-best.n_blocks :].sum(axis=0)
        across = L[np.ix_(b, a)] @ fault
        alike = float(across @ np.linalg.solve(_regular(L[np.ix_(b, b)]), across))
        return alike > _ALIKE * float(fault @ L[np.ix_(a, a)] @ fault) or other.explained > _ALIKE * best.explained

    def _faults_of(self, fit: _Fit, rivals: tuple[str, ...]) -> list[CameraFault]:
        """The parts of a fit that are beyond doubt and large enough to matter."""
        options, name = self._options, self._names[fit.camera]
        result = []
        n = len([k for k in fit.chosen if k % _N < 3])
        if n > 0:
            turn, covariance = fit.values[:n], fit.covariance[:n, :n]
            size = float(np.linalg.norm(turn))
            sigma = float(np.sqrt(turn @ covariance @ turn)) / max(size, 1e-12)
            if size > max(options.angle_rad, options.sigmas * sigma):
                result.append(CameraFault(name, TURNED, size, sigma, self._onset(fit), rivals))
        if n < len(fit.chosen):
            delay, sigma = float(fit.values[-1]), float(np.sqrt(fit.covariance[-1, -1]))
            if abs(delay) > max(options.delay_s, options.sigmas * sigma):
                result.append(CameraFault(name, DELAYED, delay, sigma, self._onset(fit), rivals))
        return result

    def _onset(self, fit: _Fit) -> int:
        """Beginning of the latest blocks in a row that are better explained with the fault than without."""
        since_ns, chosen = self._blocks[-1].begin_ns, np.array(fit.chosen)
        for block in reversed(self._blocks):
            L, e = block.L[np.ix_(chosen, chosen)], block.e[chosen]
            if float(fit.values @ L @ fit.values + 2.0 * e @ fit.values) > 0.0:
                break
            since_ns = block.begin_ns
        return since_ns

    def _remembered(self, fault: CameraFault) -> CameraFault:
        """A fault that was there before goes on since then."""
        for earlier in self._faults:
            if (earlier.camera, earlier.kind) == (fault.camera, fault.kind):
                return replace(fault, since_ns=min(earlier.since_ns, fault.since_ns))
        return fault


@compiled
def _add_camera(normal, gradient, turns, velocities, moved_by, twists, L, e, E):
    """Add what one camera says of its own faults: to ``L`` (4, 4) and ``e`` (4,), and to ``E`` (n_dof, 4) beside the state.

    ``turns`` (6, 3) are twists of all links for a turn of the camera; for a delay each goes back along its ``velocities``
    (n_links, 6).
    """
    n_links, n = moved_by.shape
    faults, told = np.empty((6, _N)), np.empty((6, _N))
    faults[:, :3] = turns
    for link in range(n_links):
        for a in range(6):
            faults[a, 3] = -velocities[link, a]
        for a in range(6):
            for k in range(_N):
                told[a, k] = 0.0
                for b in range(6):
                    told[a, k] += normal[link, a, b] * faults[b, k]
        for k in range(_N):
            for a in range(6):
                e[k] += faults[a, k] * gradient[link, a]
                for m in range(_N):
                    L[k, m] += faults[a, k] * told[a, m]
        for i in range(n):
            if moved_by[link, i]:
                for a in range(6):
                    for k in range(_N):
                        E[i, k] += twists[i, a] * told[a, k]


def _turn_twists(T_world_cam: np.ndarray) -> np.ndarray:
    """(6, 3) twists (v, omega) at the world origin of small turns about the axes of a camera, through its center."""
    R, center = T_world_cam[:3, :3], T_world_cam[:3, 3]
    return np.vstack([so3.hat(center) @ R, R])


def _regular(A: np.ndarray) -> np.ndarray:
    """Positive definite: a parameter may show in nothing, as a delay while nobody moves, or in less, where the state's equations
    know less than those of the cameras."""
    scale = np.sqrt(np.maximum(A.diagonal(), 1e-12))
    values, axes = np.linalg.eigh(A / np.outer(scale, scale))
    return (axes * np.maximum(values, 1e-9 * max(1.0, float(values[-1])))) @ axes.T * np.outer(scale, scale)
