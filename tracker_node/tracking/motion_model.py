"""Filtered constant-velocity prediction on the manifold."""

from __future__ import annotations

import numpy as np

from ..model.configuration import State
from ..model.kinematic_chain import N_ROOT_DOF
from .config import MotionConfig


class MotionModel:
    """Keeps a filtered velocity (tangent per second) and predicts with it.

    Extrapolating raw differences diverges through angles that no contour sees (the roll of round limbs), so the velocity is
    filtered, and that of joint angles decays.
    """

    def __init__(self, n_dof: int, config: MotionConfig):
        self._config = config
        self.velocity = np.zeros(n_dof)
        self._last: tuple[int, State] | None = None

    def predict(self, stamp_ns: int) -> State | None:
        """State expected at ``stamp_ns``; None before the first update."""
        if self._last is None:
            return None
        last_ns, state = self._last
        step = self.velocity * ((stamp_ns - last_ns) * 1e-9)
        step[N_ROOT_DOF:] *= self._config.velocity_decay
        return state.retract(step)

    def update(self, stamp_ns: int, state: State) -> None:
        """Take in the estimate for ``stamp_ns``."""
        if self._last is not None:
            last_ns, last = self._last
            elapsed = (stamp_ns - last_ns) * 1e-9
            if elapsed > 0.0:
                measured = state.difference(last) / elapsed
                self.velocity = self.velocity + self._config.velocity_gain * (measured - self.velocity)
        self._last = (stamp_ns, state)

    def coast(self, stamp_ns: int, state: State) -> None:
        """Go on from ``state`` without believing how it moved; the velocity dies away, lest a lost body flies off."""
        self.velocity = self._config.velocity_decay * self.velocity
        self._last = (stamp_ns, state)

    def restart(self, stamp_ns: int, state: State) -> None:
        """Forget the velocity and go on from ``state``."""
        self.velocity = np.zeros_like(self.velocity)
        self._last = (stamp_ns, state)
