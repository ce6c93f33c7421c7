"""The only place where messages become arrays and objects, and back.

Message fields are not type-checked by default: an int in a float64 field arrives as garbage, and so does a numpy scalar.
So everything passes through ``float()``, ``int()`` and ``array.array`` here, and nowhere else.
"""

from ...loaders.model.urdf_writer import urdf_of
from .bodies import MarkerBuffer, joint_state_message, marker_array_message, tf_message
from .cameras import camera_info_message, camera_model_of
from .estimates import (
    estimate_of,
    pose_message,
    pose_of,
    state_of_pose,
    tracked_state_message,
    transform_of_pose,
    twist_message,
    values_with_changes,
)
from .images import (
    ImageBuffer,
    bgr_of_compressed,
    camera_image_of,
    compressed_message,
    decode_raw_image,
    image_message,
    jpeg_message,
)
from .stamps import stamp_message, stamp_ns_of

__all__ = [
    "ImageBuffer",
    "MarkerBuffer",
    "bgr_of_compressed",
    "camera_image_of",
    "camera_info_message",
    "camera_model_of",
    "compressed_message",
    "decode_raw_image",
    "estimate_of",
    "image_message",
    "joint_state_message",
    "jpeg_message",
    "marker_array_message",
    "pose_message",
    "pose_of",
    "stamp_message",
    "stamp_ns_of",
    "state_of_pose",
    "tf_message",
    "tracked_state_message",
    "transform_of_pose",
    "twist_message",
    "urdf_of",
    "values_with_changes",
]
