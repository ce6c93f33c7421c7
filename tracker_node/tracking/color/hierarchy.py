"""An articulated body part by part: the root first, then from proximal to distal, re-scoring only what a part can change.

Each stage moves the joints at one distance from the root, with all that hangs on them; only points of those links count, since
the others stay where they are. After the last stage, all variables together are up to who calls.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ...model.configuration import State
from ...model.kinematic_chain import N_ROOT_DOF, KinematicChain
from ...objective.constraints.prior import Prior
from ...objective.normal_equations import NormalEquations


@dataclass(frozen=True, eq=False)
class Stage:
    """What moves at a time: ``dofs`` (n_dof,) mask of the tangent, ``links`` (n_links,) mask of what they move."""

    name: str
    dofs: np.ndarray
    links: np.ndarray

    @property
    def variables(self) -> list[int]:
        """Indices of ``dofs``; those of `model.configuration` are the same."""
        return np.flatnonzero(self.dofs).tolist()


def stages_of(chain: KinematicChain) -> tuple[Stage, ...]:
    """The root, then all joints that are equally many joints away from it."""
    depth = _depths(chain)
    result = [_stage(chain, "root", np.arange(chain.n_dof) < N_ROOT_DOF)]
    for level in range(1, int(depth.max(initial=0)) + 1):
        links = [link for link in range(len(chain.links)) if depth[link] == level and chain.axis_count[link]]
        if links:
            result.append(_stage(chain, ", ".join(chain.links[link] for link in links), _own_dofs(chain, links)))
    return tuple(result)


def limbs_of(chain: KinematicChain) -> tuple[Stage, ...]:
    """The branches of the tree, each from where it leaves a link with other branches (or the root) to its end."""
    parents = chain.parents.tolist()
    children = [parents.count(link) for link in range(len(chain.links))]
    result = []
    for leaf in range(1, len(chain.links)):
        if children[leaf]:
            continue
        limb = [leaf]
        while parents[limb[-1]] > 0 and children[parents[limb[-1]]] == 1:
            limb.append(parents[limb[-1]])
        dofs = _own_dofs(chain, limb)
        if dofs.any():
            result.append(_stage(chain, chain.links[limb[-1]], dofs))
    return tuple(result)


def _depths(chain: KinematicChain) -> np.ndarray:
    """(n_links,) joints with axes between each link and the root."""
    depth = np.zeros(len(chain.links), dtype=np.int64)
    for link in range(1, len(chain.links)):
        depth[link] = depth[chain.parents[link]] + (chain.axis_count[link] > 0)
    return depth


def _own_dofs(chain: KinematicChain, links: Sequence[int]) -> np.ndarray:
    dofs = np.zeros(chain.n_dof, dtype=np.bool_)
    for link in links:
        first = N_ROOT_DOF + chain.axis_start[link]
        dofs[first : first + chain.axis_count[link]] = True
    return dofs


def _stage(chain: KinematicChain, name: str, dofs: np.ndarray) -> Stage:
    return Stage(name, dofs, (chain.link_moved_by & dofs).any(axis=1))


class PartialObjective(Protocol):
    """Least squares that can leave out what rides on other links."""

    def linearize(self, state: State, links: np.ndarray | None = None) -> NormalEquations: ...


class Pulled:
    """A least-squares objective with priors, perhaps of one stage alone: the rest of the body then stays."""

    def __init__(self, objective: PartialObjective, priors: Sequence[Prior], stage: Stage | None = None):
        self._objective, self._priors, self._stage = objective, priors, stage

    def linearize(self, state: State) -> NormalEquations:
        """With rows and columns of what stays made those of a variable that nothing moves."""
        stage = self._stage
        found = self._objective.linearize(state, None if stage is None else stage.links)
        H, g, cost = found.H.copy(), found.g.copy(), found.cost
        for prior in self._priors:
            cost += prior.add_to(H, g, state)
        if stage is not None:
            stays = ~stage.dofs
            H[stays], H[:, stays], g[stays] = 0.0, 0.0, 0.0
            H[stays, stays] = 1.0
        return NormalEquations(H, g, cost, found.count)
