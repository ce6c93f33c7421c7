"""Parts of a body that may not pass through each other, as a least-squares objective."""

from __future__ import annotations

import numpy as np

from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...model.kinematic_chain import KinematicChain
from ...model.shapes.round_cones import END, END_RADIUS, N_CAPSULE, START, START_RADIUS
from ..normal_equations import NormalEquations
from .collision_kernels import add_collisions, pair_gaps, place_capsules


class CollisionObjective:
    """Cost (depth / sigma)^2 of every pair of parts that have run into each other; none where they have not.

    A part is a shape, seen as the round cones within it (`capsules`). Two parts are left out if they are rigidly joined, if
    no third part is between them along the chain, or if one is and they overlap in the neutral pose (upper arm and trunk, both
    thighs). Others that overlap there (hand and thigh of hanging arms) may do so that far anywhere.

    Parameters
    ----------
    sigma_m : how deep parts may get into each other, as a standard deviation: flesh gives way, and models are not exact.
    """

    def __init__(self, model: ArticulatedModel, sigma_m: float = 0.02):
        if not sigma_m > 0.0:
            raise ValueError(f"expected a positive sigma_m, got {sigma_m}")
        self.model, self.sigma_m = model, sigma_m
        steps = _steps_between(model)
        nothing = (np.zeros((0, N_CAPSULE)),) * len(model.shapes)
        rows = model.capsules if (steps > 1).any() else nothing  # those of a mesh take a moment, and a rigid body needs none
        self._starts = np.concatenate([[0], np.cumsum([len(r) for r in rows])]).astype(np.int64)
        self._capsules = np.concatenate([np.zeros((0, N_CAPSULE)), *rows])
        self._parts = np.repeat(np.arange(len(rows)), np.diff(self._starts))
        self._bounds = np.array([_bounding_sphere(r) for r in rows]).reshape(-1, 4)
        self._world_capsules, self._world_bounds = np.empty_like(self._capsules), np.empty_like(self._bounds)
        pairs = [(i, j) for i in range(len(rows)) for j in range(i) if steps[i, j] > 1 and len(rows[i]) and len(rows[j])]
        self.pairs = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        self._allowed = np.zeros(len(pairs))
        overlaps = np.maximum(-self.gaps(State.neutral(model)), 0.0)
        watched = (overlaps == 0.0) | (steps[self.pairs[:, 0], self.pairs[:, 1]] > 2)
        self.pairs, self._allowed = self.pairs[watched], overlaps[watched]

    @property
    def pair_names(self) -> tuple[tuple[str, str], ...]:
        """The pairs of parts that are watched."""
        return tuple((self.model.shapes[i].name, self.model.shapes[j].name) for i, j in self.pairs)

    def gaps(self, state: State) -> np.ndarray:
        """(n_pairs,) distance of each pair, meters; negative where they overlap more than allowed, +inf where they are plainly
        far apart."""
        self._place(Configuration(self.model, state))
        gaps = np.empty(len(self.pairs))
        pair_gaps(self.pairs, self._world_capsules, self._world_bounds, self._starts, gaps)
        return gaps + self._allowed

    def linearize(self, state: State) -> NormalEquations:
        """Normal equations at ``state``; ``count`` is the number of colliding pairs."""
        configuration, chain = Configuration(self.model, state), self.model.chain
        self._place(configuration)
        H, g = np.zeros((chain.n_dof, chain.n_dof)), np.zeros(chain.n_dof)
        cost, count = add_collisions(
            self.pairs, self._allowed, self._world_capsules, self._world_bounds, self._starts, self.model.shape_links,
            chain.link_moved_by, configuration.twists, self.sigma_m, H, g,
        )  # fmt: skip
        return NormalEquations(H, g, cost, count)

    def _place(self, configuration: Configuration) -> None:
        place_capsules(
            self._capsules, self._bounds, self._parts, self.model.shape_links, configuration.Ts_world_link,
            self._world_capsules, self._world_bounds,
        )  # fmt: skip


def _bounding_sphere(capsules: np.ndarray) -> np.ndarray:
    """Center and radius of a sphere about all round cones of a part, (4,)."""
    if not len(capsules):
        return np.zeros(4)
    centers = np.concatenate([capsules[:, START : START + 3], capsules[:, END : END + 3]])
    radii = np.concatenate([capsules[:, START_RADIUS], capsules[:, END_RADIUS]])
    center = 0.5 * (centers.min(axis=0) + centers.max(axis=0))
    return np.append(center, (np.linalg.norm(centers - center, axis=1) + radii).max())


def _steps_between(model: ArticulatedModel) -> np.ndarray:
    """(n_shapes, n_shapes) steps from part to part along the chain: 0 rigidly joined, 1 with only joints (and links without
    parts) between them, 2 with a third part between them ..."""
    chain = model.chain
    rigid = _rigid_groups(chain)
    groups = rigid[model.shape_links]
    full = set(groups.tolist())
    trails: dict[int, list[int]] = {}  # from a group up to the root, without the empty ones
    for group in range(len(chain.links)):
        if rigid[group] == group:
            above = [] if group == 0 else trails[int(rigid[chain.parents[group]])]
            trails[group] = [group, *above] if group in full else above
    n = len(groups)
    steps = np.zeros((n, n), dtype=np.int64)
    for i, j in np.ndindex(n, n):
        one, other = trails[int(groups[i])], trails[int(groups[j])]
        shared = len(set(one) & set(other))
        if groups[i] != groups[j]:  # where nothing is shared they meet in an empty root
            steps[i, j] = len(one) + len(other) - 2 * shared - (0 if shared else 1)
    return steps


def _rigid_groups(chain: KinematicChain) -> np.ndarray:
    """(n_links,) the first link of those that are welded together."""
    groups = np.arange(len(chain.links))
    for link in range(1, len(chain.links)):
        if chain.axis_count[link] == 0:
            groups[link] = groups[chain.parents[link]]
    return groups
