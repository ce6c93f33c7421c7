"""States, their variables in the words of biomechanics, and a model in a state.

A `State` is a point of the manifold SE(3) x R^n. Its tangent, in the order of ``KinematicChain.dof_names``, is (root
translation in world axes; small rotation of the root about world axes through its origin; joint angles): the axes in which
geometry_msgs/PoseWithCovariance states a covariance.

The variables are position, somersault, tilt, twist and joint angles. Trewartha et al. describe orientation by successive
rotations of the pelvis about a lateral horizontal, a frontal and a longitudinal axis: with x forward, y to the left and z up,
R = Ry(somersault) Rx(tilt) Rz(twist). Stepping and simplex walk them one by one; they are ambiguous only at a tilt of 90 degrees.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from ..compiled.kernels import compiled
from ..errors import ModelError
from ..geometry import se3, so3
from .articulated import ArticulatedModel
from .kinematic_chain import N_ROOT_DOF, forward_kinematics


@dataclass(frozen=True, eq=False)
class State:
    """Root pose and joint angles (radians); nothing of it changes."""

    T_world_root: np.ndarray
    joint_positions: np.ndarray

    @classmethod
    def neutral(cls, model: ArticulatedModel, T_world_root: np.ndarray | None = None) -> State:
        """State with every joint at its neutral angle, and driven joints where their leaders put them.

        Parameters
        ----------
        model : body.
        T_world_root : (4, 4); None for the world's origin.

        Returns
        -------
        State of ``model``.
        """
        return cls(np.eye(4) if T_world_root is None else T_world_root, model.chain.neutral.copy())

    def retract(self, tangent: np.ndarray) -> State:
        """The state reached from here along ``tangent`` (n_dof,)."""
        own = np.ascontiguousarray(self.T_world_root), np.ascontiguousarray(self.joint_positions)
        return State(*retracted(*own, np.ascontiguousarray(tangent)))

    def difference(self, origin: State) -> np.ndarray:
        """Tangent (n_dof,) with ``origin.retract(tangent) == self``."""
        arrays = self.T_world_root, self.joint_positions, origin.T_world_root, origin.joint_positions
        return tangent_between(*map(np.ascontiguousarray, arrays))

    def to_values(self) -> np.ndarray:
        """(n_dof,) numbers for files and messages: root xyz (m), root rotation vector (rad), joint angles (rad)."""
        return np.concatenate([self.T_world_root[:3, 3], so3.log(self.T_world_root[:3, :3]), self.joint_positions])

    @classmethod
    def from_values(cls, values: np.ndarray) -> State:
        """Inverse of `to_values`."""
        values = np.asarray(values, dtype=np.float64)
        return cls(se3.from_rotation_translation(so3.exp(values[3:6]), values[:3]), values[N_ROOT_DOF:].copy())


@compiled
def retracted(T, joints, tangent):
    """`State.retract`, for kernels.

    Parameters
    ----------
    T, joints : (4, 4) pose of the root, and (n_axes,) joint angles.
    tangent : (n_dof,).

    Returns
    -------
    Pose and joint angles.
    """
    turn, moved = so3.exp_kernel(tangent[3:6]), np.zeros((4, 4))
    for i in range(3):
        for j in range(3):
            moved[i, j] = turn[i, 0] * T[0, j] + turn[i, 1] * T[1, j] + turn[i, 2] * T[2, j]
        moved[i, 3] = T[i, 3] + tangent[i]
    moved[3, 3] = 1.0
    return moved, joints + tangent[N_ROOT_DOF:]


@compiled
def tangent_between(T, joints, origin_T, origin_joints):
    """`State.difference`, for kernels.

    Parameters
    ----------
    T, joints : (4, 4) pose of the root, and (n_axes,) joint angles.
    origin_T, origin_joints : the same of the origin.

    Returns
    -------
    (n_dof,)
    """
    turn, tangent = np.empty((3, 3)), np.empty(N_ROOT_DOF + joints.size)
    for i in range(3):
        for j in range(3):
            turn[i, j] = T[i, 0] * origin_T[j, 0] + T[i, 1] * origin_T[j, 1] + T[i, 2] * origin_T[j, 2]
        tangent[i] = T[i, 3] - origin_T[i, 3]
    tangent[3:6] = so3.log_kernel(turn)
    for k in range(joints.size):
        tangent[N_ROOT_DOF + k] = joints[k] - origin_joints[k]
    return tangent


MOST_M = 1e4  # of a root's coordinate, or of a joint that slides
MOST_RAD = 8.0 * np.pi  # of an angle


def refuse_implausible(model: ArticulatedModel, values: np.ndarray) -> None:
    """Refuse a state from outside that no body in a room can have.

    Parameters
    ----------
    model, values : body; (n_dof,) as `State.to_values`, meters and radians.

    Raises
    ------
    ModelError : naming the degree of freedom, what is expected and what came.
    """
    lengths = [True, True, True, False, False, False, *(axis.prismatic for axis in model.chain.axes)]
    for name, value, length in zip(model.chain.dof_names, values, lengths, strict=True):
        most, unit = (MOST_M, "m") if length else (MOST_RAD, "rad")
        if not abs(value) <= most:
            raise ModelError(f"{name}: expected at most {most:.5g} {unit} either way, got {float(value):g}")


class Configuration:
    """A model with a state whose forward kinematics has run (having one *means* that it has).

    Attributes
    ----------
    Ts_world_link : (n_links, 4, 4).
    twists : (n_dof, 6) spatial twist (v, omega) at the world origin of every degree of freedom.
    """

    def __init__(self, model: ArticulatedModel, state: State):
        chain = model.chain
        if state.joint_positions.shape != (chain.n_axes,):
            raise ValueError(f"expected {chain.n_axes} joint positions, got {state.joint_positions.shape}")
        self.model, self.state = model, state
        self.Ts_world_link = np.empty((len(chain.links), 4, 4))
        self.twists = np.empty((chain.n_dof, 6))
        forward_kinematics(
            chain.parents, chain.offsets, chain.axis_start, chain.axis_count, chain.directions,
            np.ascontiguousarray(state.T_world_root), np.ascontiguousarray(state.joint_positions),
            self.Ts_world_link, self.twists,
        )  # fmt: skip

    @cached_property
    def Ts_world_shape(self) -> np.ndarray:
        """(n_shapes, 4, 4)."""
        return self.Ts_world_link[self.model.shape_links] @ self.model.Ts_link_shape

    @property
    def landmarks_world(self) -> np.ndarray:
        """(n_landmarks, 3) meters, in the order of ``model.landmark_names``."""
        T = self.Ts_world_link[self.model.landmark_links]
        return np.einsum("nij,nj->ni", T[:, :3, :3], self.model.landmark_positions) + T[:, :3, 3]

    def landmark_jacobian(self) -> np.ndarray:
        """landmarks_D_state (n_landmarks, 3, n_dof)."""
        return self.point_jacobian(self.landmarks_world, self.model.landmark_links)

    def point_jacobian(self, points: np.ndarray, links: np.ndarray) -> np.ndarray:
        """Derivative of points on links by the tangent of the state.

        Parameters
        ----------
        points : (n, 3) meters, world.
        links : (n,) indices of the links that carry them.

        Returns
        -------
        (n, 3, n_dof).
        """
        v, w = self.twists[:, :3], self.twists[:, 3:]
        columns = v[None] + np.cross(w[None], points[:, None, :])  # (n, n_dof, 3)
        columns *= self.model.chain.link_moved_by[links][:, :, None]
        return np.swapaxes(columns, 1, 2)


@lru_cache(maxsize=16)
def configured(model: ArticulatedModel, state: State) -> Configuration:
    """The model in a state, kept for those that ask for the same one shortly after.

    Parameters
    ----------
    model, state : the body.

    Returns
    -------
    Not to be written into.
    """
    return Configuration(model, state)


ROTATION_NAMES = ("somersault", "tilt", "twist")
ROOT_NAMES = ("x", "y", "z", *ROTATION_NAMES)
N_ROOT = len(ROOT_NAMES)


def angles_of(rotation: np.ndarray, near: np.ndarray | None = None) -> np.ndarray:
    """Somersault, tilt and twist of a rotation.

    Parameters
    ----------
    rotation : R_world_root (3, 3).
    near : (3,) angles to stay close to: full turns are added, and the other of the two solutions taken, so that a somersault may
        count beyond 180 degrees. Without it the tilt lies within +-90 degrees.

    Returns
    -------
    (3,) radians.
    """
    first = np.array(so3.to_somersault_tilt_twist(rotation))
    if near is None:
        return first
    other = first * [1.0, -1.0, 1.0] + math.pi
    turns = [angles + 2.0 * math.pi * np.round((near - angles) / (2.0 * math.pi)) for angles in (first, other)]
    return min(turns, key=lambda angles: float(np.abs(angles - near).sum()))


def variable_names(model: ArticulatedModel) -> tuple[str, ...]:
    """Names of the variables, in order."""
    return (*ROOT_NAMES, *(axis.name for axis in model.chain.axes))


def to_variables(state: State, near: np.ndarray | None = None) -> np.ndarray:
    """Variables of a state.

    Parameters
    ----------
    state : of any model.
    near : (6 + n_axes,) variables that settle full turns, see `angles_of`.

    Returns
    -------
    (6 + n_axes,): position in meters, then angles in radians (meters where an axis slides).
    """
    angles = angles_of(state.T_world_root[:3, :3], None if near is None else near[3:6])
    return np.concatenate([state.T_world_root[:3, 3], angles, state.joint_positions])


def from_variables(variables: np.ndarray) -> State:
    """Inverse of `to_variables`."""
    variables = np.asarray(variables, dtype=np.float64)
    rotation = so3.from_somersault_tilt_twist(variables[3], variables[4], variables[5])
    return State(se3.from_rotation_translation(rotation, variables[:3]), variables[N_ROOT:].copy())


@dataclass(frozen=True, eq=False)
class Neighbor:
    """Another body in the images of a set.

    Attributes
    ----------
    body : where it is expected.
    classes : (n_shapes,) color class of every shape.
    colors : per camera of the rig (n_classes, n_colors) float32, densities of the colors of every class; None where they are not
        known.
    """

    body: Configuration
    classes: np.ndarray
    colors: Sequence[np.ndarray | None]
