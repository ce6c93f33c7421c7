"""Where a detector should look, in messages: squares in images, there and back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from ...observation.keypoints.crop import Crop
from .parts import Content, header


def crops(stamp_ns: int, frame_id: str, cameras: Sequence[str], squares: Sequence[Crop | None]) -> Content:
    """tracker_msgs/Crops.

    Parameters
    ----------
    stamp_ns : of the image set.
    frame_id : name of the world frame.
    cameras : names.
    squares : one a camera; None: the whole image.

    Returns
    -------
    content : the message as field -> value.
    """
    whole = Crop((0.0, 0.0), 0.0)
    found = [whole if square is None else square for square in squares]
    return {
        "header": header(stamp_ns, frame_id),
        "cameras": list(cameras),
        "u": [square.center[0] for square in found],
        "v": [square.center[1] for square in found],
        "size": [square.size for square in found],
        "angle": [square.angle for square in found],
    }


def crops_in(message: Any) -> dict[str, Crop]:
    """The squares of a tracker_msgs/Crops by camera; those that are no square are left out."""
    rows = zip(message.cameras, message.u, message.v, message.size, message.angle, strict=False)
    return {
        str(camera): Crop((float(u), float(v)), float(size), float(angle))
        for camera, u, v, size, angle in rows
        if all(map(math.isfinite, (u, v, size, angle))) and size > 0.0
    }
