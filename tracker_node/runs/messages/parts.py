"""What many messages hold: times, headers, poses, transforms."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ...geometry import so3
from ...loaders.bag.message_types import time_of

Content = Mapping[str, Any]
"""A message as field -> value: numbers, text, arrays of numbers, a mapping for a message in it, lists of text or of mappings."""


def header(stamp_ns: int, frame_id: str) -> Content:
    """std_msgs/Header.

    Parameters
    ----------
    stamp_ns : integer nanoseconds.
    frame_id : name of the frame that the message is in.

    Returns
    -------
    content : fields of the Header.
    """
    return {"stamp": time_of(stamp_ns), "frame_id": frame_id}


def xyz(vector: np.ndarray) -> Content:
    """geometry_msgs/Point or Vector3 of three numbers."""
    x, y, z = vector.tolist()
    return {"x": x, "y": y, "z": z}


def xyzw(R: np.ndarray) -> Content:
    """geometry_msgs/Quaternion of a rotation (3, 3)."""
    x, y, z, w = so3.xyzw_from_matrix(R).tolist()
    return {"x": x, "y": y, "z": z, "w": w}


def pose_of(T_world_body: np.ndarray) -> Content:
    """geometry_msgs/Pose of a transform (4, 4)."""
    return {"position": xyz(T_world_body[:3, 3]), "orientation": xyzw(T_world_body[:3, :3])}


def transforms(stamp_ns: int, frames: Iterable[tuple[str, str, np.ndarray]]) -> list[Content]:
    """geometry_msgs/TransformStamped of transforms ``T_parent_child`` (4, 4) given as (parent, child, transform).

    Parameters
    ----------
    stamp_ns : integer nanoseconds.
    frames : (parent, child, (4, 4) transform ``T_parent_child`` in meters).

    Returns
    -------
    contents : one for each frame, in their order.
    """
    return [
        {
            "header": header(stamp_ns, parent),
            "child_frame_id": child,
            "transform": {"translation": xyz(T[:3, 3]), "rotation": xyzw(T[:3, :3])},
        }
        for parent, child, T in frames
    ]
