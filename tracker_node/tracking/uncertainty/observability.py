"""What the images do not tell: degrees of freedom, and directions of several, in which a body may move unseen.

One camera cannot see a cylinder turn about its axis, nor how far away something is that it sees only a part of. The information
of the images (the inverse covariance without any prior) has small eigenvalues there; here they are named, for people.
"""

from __future__ import annotations

import numpy as np

from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...render.shape_arrays import bounding_sphere

UNSEEN_M = 0.05
_ALONE = 0.98  # share of a degree of freedom that lies in the unseen directions, for it to be one of them by itself
_PURE = 0.9  # of a direction that is a translation, or a rotation, of the root
_NOTABLE = 0.3  # least part in a direction that is worth its name
_ROOT = ("root translation along", "root rotation about")


def levers(model: ArticulatedModel) -> np.ndarray:
    """(n_dof,) how far the farthest point of the neutral body goes per unit of each degree of freedom, m/m or m/rad."""
    neutral = Configuration(model, State.neutral(model))
    v, w = neutral.twists[:, None, :3], neutral.twists[:, None, 3:]
    centers = neutral.Ts_world_shape[:, :3, 3]
    speeds = np.linalg.norm(v + np.cross(w, centers[None]), axis=2)
    spheres = np.array([bounding_sphere(shape.primitive) for shape in model.shapes]).reshape(-1, 4)
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
    others = (f"{tangent[i] / tangent[order[0]]:+.2f} {names[i]}" for i in order[1:])
    return " ".join([names[order[0]], *others])
