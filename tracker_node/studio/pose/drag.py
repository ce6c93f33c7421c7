"""A body moved with the mouse: a point of it follows the pointer in one camera's image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...camera.rig import Camera
from ...geometry import se3, so3
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.constraints.prior import Prior
from ...objective.normal_equations import NormalEquations
from ...optimize.levenberg_marquardt import LevenbergMarquardtOptions, minimize
from ...tracking.limbs.tree import limbs_of

MODES = ("limb", "joint", "body", "turn")
_OPTIONS = LevenbergMarquardtOptions(max_iterations=30, damping=1e-2, tolerance=1e-6, step_tolerance=1e-5)
_DAMPING = 0.01  # of the joints, as a fraction of how far a radian moves the point in the image
_STILL_PX = 1.0  # a point that a radian moves less than this is not moved by a joint at all


@dataclass(frozen=True, eq=False)
class Grip:
    """A point fixed to a link, taken hold of in one camera: ``point`` (3,) meters in the link with this index."""

    link: int
    point: np.ndarray
    camera: Camera


class _PointAtPixel:
    """Squared distance of a projected point from a pixel, over some degrees of freedom, with a prior at where they began.

    The prior damps: of all poses that reach the pixel the nearest is taken, and a drag back leads back.
    """

    def __init__(self, model: ArticulatedModel, grip: Grip, pixel: np.ndarray, dofs: np.ndarray, start: State):
        self._model, self._grip, self._pixel, self._dofs = model, grip, pixel, dofs
        J = pixel_jacobian(Configuration(model, start), grip)[1][:, dofs]
        information = np.zeros(model.n_dof)
        information[dofs] = _DAMPING**2 * max(float((J**2).sum()) / max(J.shape[1], 1), 1.0)
        self._prior = Prior(start, information)

    def linearize(self, state: State) -> NormalEquations:
        pixel, J = pixel_jacobian(Configuration(self._model, state), self._grip)
        J = J * self._dofs
        residual = pixel - self._pixel
        H, g = J.T @ J, J.T @ residual
        cost = float(residual @ residual) + self._prior.add_to(H, g, state)
        return NormalEquations(H, g, cost, 2)


def pixel_jacobian(body: Configuration, grip: Grip) -> tuple[np.ndarray, np.ndarray]:
    """Pixel of a gripped point, and its derivative by the state; zeros behind the camera.

    Parameters
    ----------
    body : the posed body.
    grip : the point and the camera.

    Returns
    -------
    pixel : (2,).
    pixel_D_state : (2, n_dof), pixels per meter and radian.
    """
    T = body.Ts_world_link[grip.link]
    point = se3.apply(T, grip.point)
    T_cam_world = grip.camera.T_cam_world
    pixel, pixel_D_cam, _ = grip.camera.model.project_with_jacobian(se3.apply(T_cam_world, point))
    moved = body.twists[:, :3] + np.cross(body.twists[:, 3:], point)  # (n_dof, 3)
    moved = moved * body.model.chain.link_moved_by[grip.link][:, None]
    return pixel, pixel_D_cam @ T_cam_world[:3, :3] @ moved.T


def drag(model: ArticulatedModel, start: State, grip: Grip, pixel: np.ndarray, mode: str = "limb") -> State:
    """The state in which the gripped point shows at a pixel, or as near to it as can be.

    Parameters
    ----------
    model : the body.
    start : state in which the drag has begun; each is found from it, so a drag back leads back.
    grip : the point and the camera.
    pixel : (2,) u, v.
    mode : ``limb`` moves the joints of the limb that the point belongs to (damped least squares within the joints' limits),
        ``joint`` only those next to it; ``body`` shifts the whole body parallel to the image, as a point of the root always does;
        ``turn`` turns the body about the line of sight through its root.

    Returns
    -------
    With driven joints where their leaders put them.
    """
    if mode == "turn":
        return _turned(model, start, grip, pixel)
    dofs = np.zeros(model.n_dof, dtype=np.bool_) if mode == "body" else moving_dofs(model, start, grip, mode == "joint")
    if not dofs.any():
        return _shifted(model, start, grip, pixel)
    found = minimize(_PointAtPixel(model, grip, pixel, dofs, start), start, model.chain, _OPTIONS).state
    return State(found.T_world_root, model.chain.followed(found.joint_positions))


def moving_dofs(model: ArticulatedModel, state: State, grip: Grip, nearest: bool) -> np.ndarray:
    """Joints by which a gripped point is moved; none for a point of the root.

    Parameters
    ----------
    model : the body.
    state : its pose.
    grip : the point and the camera.
    nearest : only the last joint before the point that moves it in the image at all; else all of its limb.

    Returns
    -------
    (n_dof,) bool.
    """
    J = pixel_jacobian(Configuration(model, state), grip)[1]
    moves = np.linalg.norm(J, axis=0) > _STILL_PX
    moves[:N_ROOT_DOF] = False
    link, chain = grip.link, model.chain
    while link > 0 and not (moves & chain.dofs_of([link])).any():
        link = int(chain.parents[link])
    if link <= 0:
        return np.zeros(model.n_dof, dtype=np.bool_)
    own = chain.dofs_of([link])
    if nearest:
        return moves & own
    return moves & next(limb.dofs for limb in limbs_of(model) if (limb.dofs & own).any())


def _shifted(model: ArticulatedModel, start: State, grip: Grip, pixel: np.ndarray) -> State:
    """Moved parallel to the image plane, at the depth that the point has."""
    camera = grip.camera
    point = se3.apply(camera.T_cam_world, se3.apply(Configuration(model, start).Ts_world_link[grip.link], grip.point))
    ray, valid = camera.model.rays(np.asarray(pixel, dtype=np.float64))
    if not valid or point[2] <= 0.0:
        return start
    shift = camera.T_world_cam[:3, :3] @ (ray * point[2] / ray[2] - point)
    T = start.T_world_root.copy()
    T[:3, 3] += shift
    return State(T, start.joint_positions)


def _turned(model: ArticulatedModel, start: State, grip: Grip, pixel: np.ndarray) -> State:
    """Turned about the line of sight through the root such that the point shows in the direction of the pixel."""
    camera = grip.camera
    center, valid = camera.project(start.T_world_root[:3, 3])
    if not valid:
        return start
    before, after = pixel_jacobian(Configuration(model, start), grip)[0] - center, np.asarray(pixel) - center
    angle = np.arctan2(before[0] * after[1] - before[1] * after[0], before @ after)
    sight = start.T_world_root[:3, 3] - camera.center
    T = start.T_world_root.copy()
    T[:3, :3] = so3.exp(angle * sight / np.linalg.norm(sight)) @ T[:3, :3]
    return State(T, start.joint_positions)
