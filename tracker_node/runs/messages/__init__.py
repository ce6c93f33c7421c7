"""What the messages of a run say, as plain mappings of field -> value; and lenses of messages that were read.

No message class of anybody here: `ros.conversions` writes such a mapping into the classes of ROS, `loaders.bag.message_types`
into those of bags, so the live node and the offline run say the same. Begin with `body`.
"""

from .body import bodies, changed_markers, joint_state, markers, pose, state_covariance, tracked_state, twist
from .cameras import CAMERA_INFO, COMPRESSED_IMAGE, IMAGE, camera_info, compressed_image, image, jpeg_of, lens_of
from .parts import Content, header, pose_of, transforms
from .people import crops, crops_in, keypoints, people_of

__all__ = [
    "CAMERA_INFO",
    "COMPRESSED_IMAGE",
    "IMAGE",
    "Content",
    "bodies",
    "camera_info",
    "changed_markers",
    "compressed_image",
    "crops",
    "crops_in",
    "header",
    "image",
    "joint_state",
    "jpeg_of",
    "keypoints",
    "lens_of",
    "markers",
    "people_of",
    "pose",
    "pose_of",
    "state_covariance",
    "tracked_state",
    "transforms",
    "twist",
]
