"""The only place where messages of ROS become arrays and objects, and back.

What a message says is written in `runs.messages`, once for bags and graphs; here it gets into the classes of ROS, and out of
them. Begin with `messages`.
"""

from ...loaders.bag.message_types import stamp_ns_of
from .images import (
    ImageBuffer,
    bgr_of_compressed,
    camera_image_of,
    camera_info_message,
    decode_raw_image,
    image_message,
    jpeg_message,
    raw_stamp_ns,
)
from .messages import fill, message_class, message_of, stamp_message, transform_of_pose, values_with_changes

__all__ = [
    "ImageBuffer",
    "bgr_of_compressed",
    "camera_image_of",
    "camera_info_message",
    "decode_raw_image",
    "fill",
    "image_message",
    "jpeg_message",
    "message_class",
    "message_of",
    "raw_stamp_ns",
    "stamp_message",
    "stamp_ns_of",
    "transform_of_pose",
    "values_with_changes",
]
