"""A trunk that has moved otherwise than expected is looked for: the body moved, turned and bent as a whole.

What hangs on a trunk that is off cannot be found by itself, and lines reach only so far. The whole body is tried in places at
random about where it is taken to be and where it was expected, then closer about the best; what counts are the colors that it
covers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF, KinematicChain
from ...optimize.levenberg_marquardt import clip_to_limits
from ..limbs import Limb

_SPREAD_M, _SPREAD_RAD = 0.08, 0.2
_ROUNDS = (1.0, 0.5, 0.25)  # shares of that, round by round
_BEST = 4  # that are looked around


def best_trunk(
    trunk: Limb, starts: Sequence[State], chain: KinematicChain, gain: Callable[[list[State]], np.ndarray], tries: int,
    rng: np.random.Generator,
) -> State:  # fmt: skip
    """The state of the largest ``gain`` (n states -> (n,)) of about ``tries`` that differ from ``starts`` by their trunk."""
    spread = np.where(np.arange(chain.n_dof) < 3, _SPREAD_M, _SPREAD_RAD) * trunk.dofs
    spread[N_ROOT_DOF:] = np.minimum(spread[N_ROOT_DOF:], chain.upper - chain.lower)
    states = [clip_to_limits(start, chain) for start in starts]
    gains = gain(states)
    for share in _ROUNDS:
        best = [states[i] for i in np.argsort(-gains, kind="stable")[:_BEST]]
        n = max(round(tries / (len(_ROUNDS) * len(best))), 1)
        more = [clip_to_limits(s.retract(share * spread * rng.normal(size=chain.n_dof)), chain) for s in best for _ in range(n)]
        states, gains = states + more, np.append(gains, gain(more))
    return states[int(np.argmax(gains))]
