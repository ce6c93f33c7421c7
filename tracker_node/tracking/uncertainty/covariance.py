"""From the normal equations of a fit to a covariance that errors bear out.

The fit weighs every image by what it takes its errors for. What they really are is the covariance S of the gradient that they
cause, and H^-1 S H^-1 that of the state (the sandwich of Huber, 1967); priors and constraints are taken at their word.

To first order, that is. A direction that is hardly known, such as the turn of a collar bone that the arm makes up for, leads
along an arc: whoever goes along its tangent for e leaves the arc by e^2/2 times its curvature, where other directions seem to be
known exactly. Two such directions bend each other: the arm's own turn decides where its elbow's leads. So much is added, and as
much again for what is beyond the second order.

What the images do not tell: degrees of freedom, and directions of several, in which a body may move unseen.

One camera cannot see a cylinder turn about its axis, nor how far away something is that it sees only a part of. The information
of the images (the inverse covariance without any prior) has small eigenvalues there; here they are named, for people.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...compiled.kernels import compiled
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...model.kinematic_chain import N_ROOT_DOF, KinematicChain
from ...render.shape_arrays import bounding_spheres

# Times second-order terms: on training clips, squared errors across them are then 1.1 times what is said, 1.3 without it
BEYOND_SECOND_ORDER = 2.0
_LEAST = 1e-9  # of the largest entry of the information's diagonal: what nothing is known of keeps a variance that can be written
_WELL_KNOWN = np.radians(1.0) ** 2  # variance of a direction that is straight for as far as it goes
_FARTHEST = np.radians(30.0) ** 2  # variance beyond which an arc is not followed


@dataclass(frozen=True, eq=False)
class ImageEvidence:
    """What the images of one set have added to a fit, at its end.

    Attributes
    ----------
    information : (n_dof, n_dof) their part of H, in the tangent of the state.
    scatter : (n_dof, n_dof) covariance of their gradient.
    normal : (n_links, 6, 6) their information on the spatial twist of each link.
    gradient : (n_dof,) of what they cost the state, half of it, as in the normal equations; None where the fit went by other
        evidence, too.
    modes : (n_dof, n_modes) tangents to other states that they allow, each times the root of its probability; None: there are
        none.
    """

    information: np.ndarray
    scatter: np.ndarray
    normal: np.ndarray
    gradient: np.ndarray | None = None
    modes: np.ndarray | None = None

    def measurement(self, weights: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray | None]:
        """What these images alone say of the state: the inverse covariance M = H S^-1 H (n_dof, n_dof), less sure by the modes,
        and that times the tangent to where they have it, (n_dof,), None where there is no gradient.

        ``weights`` (n_dof,): see `weighted`. What counts less is less certain, not elsewhere.
        """
        scale = np.sqrt(np.diag(self.information))
        scale = 1.0 / np.maximum(scale, 1e-3 * max(float(scale.max()), 1.0))
        scatter = self.scatter * np.outer(scale, scale)
        np.einsum("ii->i", scatter)[:] += _LEAST
        gradient = np.zeros(len(scale)) if self.gradient is None else self.gradient
        columns = np.column_stack([self.information, -gradient])
        half = np.linalg.solve(np.linalg.cholesky(scatter), scale[:, None] * columns)
        M, innovation = half[:, :-1].T @ half[:, :-1], half[:, :-1].T @ half[:, -1]
        if self.modes is not None:  # (M^-1 + D D^T)^-1, which pulls to the same place
            told = M @ self.modes
            less = told @ np.linalg.inv(np.eye(told.shape[1]) + self.modes.T @ told)
            M, innovation = M - less @ told.T, innovation - less @ (self.modes.T @ innovation)
        if weights is not None and (weights != 1.0).any():
            scale = 1.0 / np.sqrt(np.maximum(np.diag(M), 1e-6 * max(float(np.diag(M).max()), 1.0)))
            tangent = scale * np.linalg.solve(M * np.outer(scale, scale) + 1e-6 * np.eye(len(M)), scale * innovation)
            M = np.outer(weights, weights) * M
            innovation = M @ tangent
        return M, None if self.gradient is None else innovation

    def without(self, direction: np.ndarray) -> ImageEvidence:
        """The same without what seems to be told of a direction (n_dof,) that no image tells."""
        P = _off(self.information, direction)
        gradient = None if self.gradient is None else P.T @ self.gradient
        return ImageEvidence(P.T @ self.information @ P, P.T @ self.scatter @ P, self.normal, gradient, self.modes)

    def weighted(self, weights: np.ndarray, moved_by: np.ndarray) -> ImageEvidence:
        """The same with some degrees of freedom counting less.

        Parameters
        ----------
        weights : (n_dof,) factors of the information's square root.
        moved_by : (n_links, n_dof) mask of what moves each link.

        Returns
        -------
        Without a gradient.
        """
        both = np.outer(weights, weights)
        links = np.where(moved_by, weights, 1.0).min(axis=1) ** 2
        return replace(
            self, information=both * self.information, scatter=both * self.scatter, normal=links[:, None, None] * self.normal,
            gradient=None,
        )  # fmt: skip


def _off(H: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """(n_dof, n_dof) P, so that P^T H P knows nothing of a direction, and the most of all others."""
    told = H @ direction
    whole = float(direction @ told)
    return np.eye(len(H)) - (np.outer(direction, told) / whole if whole > 0.0 else 0.0)


def without_direction(H: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Information on a state without that on one direction.

    Parameters
    ----------
    H : (n_dof, n_dof).
    direction : (n_dof,) in the tangent.

    Returns
    -------
    (n_dof, n_dof).
    """
    P = _off(H, direction)
    return P.T @ H @ P


def limits_information(chain: KinematicChain, shares: np.ndarray) -> np.ndarray:
    """(n_dof,) diagonal of what the limits of joints say: within them any angle is as probable.

    Parameters
    ----------
    chain : with the limits.
    shares : (n_dof,) of how far a degree of freedom rests on them.

    Returns
    -------
    0 for the root.
    """
    ranges = chain.upper - chain.lower
    return shares * np.concatenate([np.zeros(N_ROOT_DOF), 12.0 / ranges**2])


def fit_covariance(H: np.ndarray, images: ImageEvidence | None, body: Configuration) -> tuple[np.ndarray, np.ndarray]:
    """Covariance of a fitted state in its tangent.

    Parameters
    ----------
    H : (n_dof, n_dof) information of all that was fitted to.
    images : what of it came from images; None: nothing, and the covariance is the inverse of H.
    body : the model in that state.

    Returns
    -------
    (n_dof, n_dof), and what of it is beyond a normal distribution about the state: second-order terms and modes, (n_dof, n_dof).
    """
    total = H.copy()
    np.einsum("ii->i", total)[:] += _LEAST * max(float(np.diag(H).max()), 1.0)
    inverse = np.linalg.inv(total)
    if images is None:
        return 0.5 * (inverse + inverse.T), np.zeros_like(inverse)
    covariance = inverse @ (total - images.information + images.scatter) @ inverse
    covariance = 0.5 * (covariance + covariance.T)
    second_order = _hardly_known(covariance, inverse, images, body)
    second_order = 0.5 * (second_order + second_order.T)
    if images.modes is not None:
        second_order += images.modes @ images.modes.T
    return covariance + second_order, second_order


def _hardly_known(covariance: np.ndarray, inverse: np.ndarray, images: ImageEvidence, body: Configuration) -> np.ndarray:
    """Second-order terms of directions that are hardly known."""
    variance, directions = np.linalg.eigh(covariance)
    bent = variance * variance[-1] > _WELL_KNOWN**2  # with the least known, if not alone
    return BEYOND_SECOND_ORDER * _second_moment(
        np.minimum(variance[bent], _FARTHEST), directions[:, bent], inverse, images, body
    )


def _second_moment(
    variance: np.ndarray, directions: np.ndarray, inverse: np.ndarray, images: ImageEvidence, body: Configuration
) -> np.ndarray:
    """Second moment (n_dof, n_dof) of what makes up for the bends of ``directions`` (n_dof, k) of ``variance`` (k,).

    Errors e along them move the links by sum e_i e_j b_ij / 2 beside the tangent. Of Gaussian errors that has the mean
    m = sum v_i b_ii / 2 and the covariance sum v_i v_j b_ij b_ij^T / 2.
    """
    product = np.triu(np.outer(variance, variance))
    first, second = np.nonzero(product > _WELL_KNOWN**2)
    gradients = _pulls(images.normal, link_bends(body, directions, (first, second)), *_chain_of(body))
    bends, alone = inverse @ gradients.T, first == second
    mean = 0.5 * bends[:, alone] @ variance[first[alone]]
    return (bends * (np.where(alone, 0.5, 1.0) * product[first, second])) @ bends.T + np.outer(mean, mean)


def link_bends(body: Configuration, directions: np.ndarray, pairs: tuple[np.ndarray, np.ndarray] | None = None) -> np.ndarray:
    """Second derivative of every link's place along pairs of directions.

    The twist of an axis moves with all that carries it: its derivative is the Lie bracket with the twist of those.

    Parameters
    ----------
    body : the model in a state.
    directions : (n_dof, k).
    pairs : which of them, (n_pairs,) each; None: each with itself.

    Returns
    -------
    (n_pairs, n_links, 6) spatial twists.
    """
    first, second = (np.arange(directions.shape[1]),) * 2 if pairs is None else pairs
    pairs = np.ascontiguousarray(first), np.ascontiguousarray(second)  # or there is machine code of either kind
    return _link_bends(np.ascontiguousarray(directions), *pairs, *_chain_of(body))


def _chain_of(body: Configuration) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Parent and axes of every link, and the twists, as the kernels take them."""
    chain = body.model.chain
    return chain.parents, chain.axis_start, chain.axis_count, body.twists


@compiled
def _link_bends(directions, first, second, parents, axis_start, axis_count, twists):
    """`link_bends` of pairs of directions."""
    n_links, k = parents.size, directions.shape[1]
    speeds, turned = np.empty((n_links, 6)), np.zeros((k, twists.shape[0], 6))  # Lie brackets with what carries each twist
    for d in range(k):
        for link in range(n_links):
            speed = speeds[link]
            if parents[link] < 0:
                speed[:] = 0.0
                for i in range(N_ROOT_DOF):
                    speed += directions[i, d] * twists[i]
            else:
                speed[:] = speeds[parents[link]]
            begin = N_ROOT_DOF + axis_start[link]
            for i in range(begin, begin + axis_count[link]):
                t = twists[i]
                for a in range(3):
                    b, c = (a + 1) % 3, (a + 2) % 3
                    turned[d, i, a] = (
                        speed[3 + b] * t[c] - speed[3 + c] * t[b] - (t[3 + b] * speed[c] - t[3 + c] * speed[b])
                    )  # fmt: skip
                    turned[d, i, 3 + a] = speed[3 + b] * t[3 + c] - speed[3 + c] * t[3 + b]
                for a in range(6):
                    speed[a] += directions[i, d] * t[a]
    bends = np.zeros((first.size, n_links, 6))
    for pair in range(first.size):
        one, other = first[pair], second[pair]
        for link in range(n_links):
            bend = bends[pair, link]
            if parents[link] >= 0:
                bend[:] = bends[pair, parents[link]]
            begin = N_ROOT_DOF + axis_start[link]
            for i in range(begin, begin + axis_count[link]):
                for a in range(6):
                    bend[a] += 0.5 * (directions[i, one] * turned[other, i, a] + directions[i, other] * turned[one, i, a])
    return bends


@compiled
def _pulls(normal, bends, parents, axis_start, axis_count, twists):
    """(n_pairs, n_dof): gradients by the information (n_links, 6, 6) on links that are off by ``bends`` (n_pairs, n_links, 6)."""
    n_links = parents.size
    pulls, forces = np.empty((len(bends), twists.shape[0])), np.empty((n_links, 6))
    for pair in range(len(bends)):
        for link in range(n_links):
            for a in range(6):
                forces[link, a] = 0.0
                for b in range(6):
                    forces[link, a] += normal[link, a, b] * bends[pair, link, b]
        for link in range(n_links - 1, -1, -1):  # what a link carries pulls at it, too
            begin, n, force = N_ROOT_DOF + axis_start[link], axis_count[link], forces[link]
            if parents[link] < 0:
                begin, n = 0, N_ROOT_DOF
            for i in range(begin, begin + n):
                pulls[pair, i] = 0.0
                for a in range(6):
                    pulls[pair, i] += force[a] * twists[i, a]
            if parents[link] >= 0:
                for a in range(6):
                    forces[parents[link], a] += force[a]
    return pulls


UNSEEN_M = 0.05
_ALONE = 0.98  # fraction of a degree of freedom that lies in the unseen directions, for it to be one of them by itself
_PURE = 0.9  # of a direction that is a translation, or a rotation, of the root
_NOTABLE = 0.3  # least part in a direction that is worth its name
_ROOT = ("root translation along", "root rotation about")


def levers(model: ArticulatedModel) -> np.ndarray:
    """(n_dof,) how far the farthest point of the neutral body goes per unit of each degree of freedom, m/m or m/rad."""
    neutral = Configuration(model, State.neutral(model))
    v, w = neutral.twists[:, None, :3], neutral.twists[:, None, 3:]
    centers = neutral.Ts_world_shape[:, :3, 3]
    speeds = np.linalg.norm(v + np.cross(w, centers[None]), axis=2)
    spheres = bounding_spheres(model)
    sizes = np.linalg.norm(spheres[:, :3], axis=1) + spheres[:, 3]
    speeds = speeds + np.linalg.norm(w, axis=2) * sizes
    speeds *= model.chain.link_moved_by[model.shape_links].T
    return np.maximum(speeds.max(axis=1, initial=0.0), 1e-3)


def unobservable(information: np.ndarray, model: ArticulatedModel, unseen_m: float = UNSEEN_M) -> list[str]:
    """Names of the degrees of freedom and directions that ``information`` says too little of; empty: all are seen.

    Parameters
    ----------
    information : (n_dof, n_dof) inverse covariance of the tangent by the images alone (`TrackEstimate.information`).
    model : the body.
    unseen_m : a direction is unseen when its standard deviation moves the farthest point of the body by more than this.

    Returns
    -------
    Names of degrees of freedom that are unseen by themselves; then directions of several, such as
    ``root rotation about (0.00, 0.71, 0.71)`` (world axes) or ``left_elbow_pronation -0.80 left_shoulder_internal_rotation``
    (what moves together, with the sizes of the others relative to the first).
    """
    lever = levers(model)
    scaled = 0.5 * (information + information.T) / np.outer(lever, lever)
    values, vectors = np.linalg.eigh(scaled)
    unseen = vectors[:, values < 1.0 / unseen_m**2]
    names = model.chain.dof_names
    alone = np.einsum("ij,ij->i", unseen, unseen) > _ALONE
    result = [names[i] for i in np.flatnonzero(alone)]
    rest = unseen.copy()
    rest[alone] = 0.0
    left, sizes, _ = np.linalg.svd(rest, full_matrices=False)
    return result + [_direction(left[:, i] / lever, lever, names) for i in np.flatnonzero(sizes > 0.5)]


def _direction(tangent: np.ndarray, lever: np.ndarray, names: tuple[str, ...]) -> str:
    """A direction in words; ``tangent`` (n_dof,)."""
    moved = np.abs(tangent * lever)
    moved /= np.linalg.norm(moved)
    for i, what in enumerate(_ROOT):
        part = slice(3 * i, 3 * i + 3)
        if np.linalg.norm(moved[part]) > _PURE:
            axis = tangent[part] / np.linalg.norm(tangent[part])
            axis *= np.sign(axis[np.argmax(np.abs(axis))])
            return f"{what} ({', '.join(f'{value + 0.0:.2f}' for value in axis)})"
    falling = np.argsort(-moved, kind="stable")
    order = [falling[0], *(i for i in falling[1:] if moved[i] > _NOTABLE)]  # of many small ones the largest is named
    others = [f"{tangent[i] / tangent[order[0]]:+.2f} {names[i]}" for i in order[1:]]
    if not others and moved[order[0]] < _PURE:  # made up for by many, each a little
        others = ["with others"]
    return " ".join([names[order[0]], *others])
