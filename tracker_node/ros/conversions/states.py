"""States that others ask for, from what their messages say."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Pose

from ...errors import TrackerError, UnknownNameError
from ...geometry import quaternion, se3
from ...model.articulated import ArticulatedModel
from ...model.configuration import State


def transform_of_pose(pose: Pose) -> np.ndarray:
    """(4, 4) of a geometry_msgs/Pose.

    Raises
    ------
    TrackerError : a quaternion of length zero, or numbers that are not finite.
    """
    p, q = pose.position, pose.orientation
    numbers = np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w])
    if not np.all(np.isfinite(numbers)) or np.linalg.norm(numbers[3:]) < 1e-6:
        raise TrackerError(f"pose: expected finite numbers and a quaternion of length one, got {numbers.tolist()}")
    return se3.from_rotation_translation(quaternion.matrix_from_xyzw(numbers[3:]), numbers[:3])


def state_of_pose(pose: Pose, joint_positions: np.ndarray) -> State:
    """A state with this root pose.

    Parameters
    ----------
    pose : geometry_msgs/Pose of the root.
    joint_positions : (n_joint_dof,) angles in radians.

    Returns
    -------
    state : of the body.
    """
    return State(transform_of_pose(pose), np.array(joint_positions, dtype=np.float64))


def values_with_changes(
    model: ArticulatedModel, values: np.ndarray, names: Sequence[str], changes: Sequence[float]
) -> np.ndarray:
    """State values (n_dof,) with the named ones replaced.

    Parameters
    ----------
    model : the body.
    values : (n_dof,) as `model.configuration.State.to_values`.
    names : of degrees of freedom.
    changes : one value for each name, in meters or radians.

    Returns
    -------
    values : (n_dof,), a copy.

    Raises
    ------
    TrackerError : unknown or repeated names, not one value for each, or a value that is not finite.
    """
    if len(names) != len(changes):
        raise TrackerError(f"expected one value for each name, got {len(names)} names and {len(changes)} values")
    if len(set(names)) != len(names):
        raise TrackerError(f"expected each name once, got {list(names)}")
    if not np.all(np.isfinite(np.array(changes, dtype=np.float64))):
        raise TrackerError(f"expected finite values, got {list(changes)}")
    dof_names = model.chain.dof_names
    result = np.array(values, dtype=np.float64)
    for name, value in zip(names, changes, strict=True):
        if name not in dof_names:
            raise UnknownNameError("degree of freedom", name, dof_names)
        result[dof_names.index(name)] = float(value)
    return result
