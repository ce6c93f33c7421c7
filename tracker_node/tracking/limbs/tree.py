"""Limbs: the trunk and the branches of the kinematic tree, which are assessed and searched one by one; other groups of joints.

Links that are welded to each other count as one. A branch begins where it leaves a link that has others, or the root, and ends at
a leaf, whose name it has: for the human ``left_hand`` is the arm from the clavicle on. Branches too small to be judged, such as
the fingers of a gripper, are no limbs: they belong to the branch that ends in them, or to the trunk.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...model.humans.keypoints import is_person
from ...model.kinematic_chain import N_ROOT_DOF, KinematicChain
from ...render.contour.generators import world_spheres
from ...render.shape_arrays import bounding_spheres

_LEAST_SIZE = 0.1  # of the whole body, that a limb has
_PERSON_M = 2.05  # `thing_size` of a person


@dataclass(frozen=True, eq=False)
class Limb:
    """``dofs`` (n_dof,), ``links`` (n_links,) and ``shapes`` (n_shapes,) are masks of what is the limb's own; ``tip`` (3,) meters
    in the link ``end`` (index) is the point by which its place is judged."""

    name: str
    dofs: np.ndarray
    links: np.ndarray
    shapes: np.ndarray
    end: int
    tip: np.ndarray


def limbs_of(model: ArticulatedModel) -> tuple[Limb, ...]:
    """The trunk, with the root's six degrees of freedom, first; then the limbs that have shapes, in the order of their ends."""
    chain = model.chain
    branches = _branches(model)
    trunk = np.ones(len(chain.links), dtype=np.bool_)
    result = []
    for links in branches:
        mask = np.zeros(len(chain.links), dtype=np.bool_)
        mask[links] = True
        shapes = mask[model.shape_links]
        if shapes.any():
            trunk &= ~mask
            result.append(_limb(model, chain.links[links[-1]], mask, chain.dofs_of(links)))
    dofs = chain.dofs_of(np.flatnonzero(trunk).tolist())
    dofs[:N_ROOT_DOF] = True
    return (_limb(model, chain.links[0], trunk, dofs), *result)


def joint_groups(chain: KinematicChain) -> list[np.ndarray]:
    """Indices of the joint angles along each stretch of the tree without a branch, from the root on.

    A person's are the trunk, the head, two arms and two legs.
    """
    groups = [np.flatnonzero(chain.dofs_of(stretch.links)[N_ROOT_DOF:]) for stretch in _stretches(chain)]
    return [group for group in groups if len(group)]


def _branches(model: ArticulatedModel) -> list[list[int]]:
    """Indices of the links of each branch with degrees of freedom of its own, in the order of their ends."""
    chain, stretches = model.chain, _stretches(model.chain)
    small = _small(model, stretches)
    ends = [(s.bodies[-1], s.jointed) for i, s in enumerate(stretches) if s.is_end and s.jointed and i not in small]
    for i, stretch in enumerate(stretches):
        on_it = [k for k, other in enumerate(stretches) if k > i and chain.parents[other.bodies[0]] in stretch.links]
        if on_it and small.issuperset(on_it) and 0 not in stretch.bodies:
            ends.append((stretch.bodies[-1], sorted(stretch.links + [link for k in on_it for link in stretches[k].links])))
    return [links for _, links in sorted(ends)]


def neutral_spheres(model: ArticulatedModel) -> np.ndarray:
    """(n_shapes, 4) bounding spheres of the shapes of the neutral body, world: middle and radius, meters."""
    bounds = bounding_spheres(model)
    spheres = np.empty_like(bounds)
    world_spheres(Configuration(model, State.neutral(model)).Ts_world_shape, bounds, spheres)
    return spheres


def thing_size(model: ArticulatedModel) -> float:
    """Twice how far a body of one link reaches from the middle of its shapes, meters."""
    spheres = neutral_spheres(model)
    middle = spheres[:, :3].mean(axis=0)
    return 2.0 * float((np.linalg.norm(spheres[:, :3] - middle, axis=1) + spheres[:, 3]).max())


def length_scale(model: ArticulatedModel) -> float:
    """Factor of lengths that are given for people: 1 of people, whatever their size; else the body's size in that of a person."""
    return 1.0 if is_person(model) else thing_size(model) / _PERSON_M


def _small(model: ArticulatedModel, stretches: list[_Stretch]) -> set[int]:
    """Indices of the ends whose shapes are, together, less than a tenth as large as those of the whole neutral body."""
    spheres = neutral_spheres(model)

    def size(some: np.ndarray) -> float:
        low, high = spheres[some, :3] - spheres[some, 3:], spheres[some, :3] + spheres[some, 3:]
        return float((high.max(axis=0) - low.min(axis=0)).max())

    found = set()
    for i, stretch in enumerate(stretches):
        own = np.isin(model.shape_links, stretch.jointed)
        if stretch.is_end and own.any() and size(own) < _LEAST_SIZE * size(np.ones_like(own)):
            found.add(i)
    return found


@dataclass(frozen=True)
class _Stretch:
    """A part of the tree without a branch: its rigid bodies (by their first links), its links, those that are not the root's."""

    bodies: list[int]
    links: list[int]
    jointed: list[int]
    is_end: bool


def _stretches(chain: KinematicChain) -> list[_Stretch]:
    """From the root on, each before those that hang on it."""
    n = len(chain.links)
    body = list(range(n))  # first link of the rigid body that each link belongs to
    for link in range(1, n):
        if not chain.axis_count[link]:
            body[link] = body[chain.parents[link]]
    children = {b: [c for c in sorted(set(body)) if c and body[chain.parents[c]] == b] for b in body}
    result: list[_Stretch] = []

    def follow(first: int) -> None:
        bodies = [first]
        while len(children[bodies[-1]]) == 1:
            bodies += children[bodies[-1]]
        links = [link for link in range(n) if body[link] in bodies]
        beyond = children[bodies[-1]]
        result.append(_Stretch(bodies, links, [link for link in links if body[link]], not beyond))
        for child in beyond:
            follow(child)

    follow(0)
    return result


def _limb(model: ArticulatedModel, name: str, links: np.ndarray, dofs: np.ndarray) -> Limb:
    """Its tip is the landmark of its own that is the farthest down the tree, and from the origin of its link."""
    own = [i for i, link in enumerate(model.landmark_links) if links[link]]
    shapes = links[model.shape_links]
    if own:
        depth = model.chain.link_moved_by[model.landmark_links].sum(axis=1)
        reach = np.linalg.norm(model.landmark_positions, axis=1)
        best = max(own, key=lambda i: (depth[i], reach[i]))
        return Limb(name, dofs, links, shapes, int(model.landmark_links[best]), model.landmark_positions[best])
    if shapes.any():
        last = int(np.flatnonzero(shapes)[-1])
        return Limb(name, dofs, links, shapes, int(model.shape_links[last]), model.Ts_link_shape[last, :3, 3])
    return Limb(name, dofs, links, shapes, int(np.flatnonzero(links)[0]), np.zeros(3))


@dataclass(frozen=True, eq=False)
class JointGroup:
    """Degrees of freedom that move together: ``dofs`` (n_dof,) is their mask, ``links`` (n_links,) that of what they move."""

    name: str
    dofs: np.ndarray
    links: np.ndarray

    @property
    def variables(self) -> list[int]:
        """Indices of ``dofs``; those of `model.configuration.to_variables` are the same."""
        return np.flatnonzero(self.dofs).tolist()


def stages_of(chain: KinematicChain) -> tuple[JointGroup, ...]:
    """The root, then from proximal to distal all joints that are equally many joints away from it."""
    depth = np.zeros(len(chain.links), dtype=np.int64)  # joints with axes between each link and the root
    for link in range(1, len(chain.links)):
        depth[link] = depth[chain.parents[link]] + (chain.axis_count[link] > 0)
    result = [_group(chain, "root", np.arange(chain.n_dof) < N_ROOT_DOF)]
    for level in range(1, int(depth.max(initial=0)) + 1):
        links = [link for link in range(len(chain.links)) if depth[link] == level and chain.axis_count[link]]
        if links:
            result.append(_group(chain, ", ".join(chain.links[link] for link in links), chain.dofs_of(links)))
    return tuple(result)


def _group(chain: KinematicChain, name: str, dofs: np.ndarray) -> JointGroup:
    return JointGroup(name, dofs, (chain.link_moved_by & dofs).any(axis=1))
