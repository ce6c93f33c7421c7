"""A bag as version 0.1 left it: other names of fields and topics, covariances in the states."""

from pathlib import Path

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tracker_node.loaders.bag.message_types import TRACKED_STATE, MessageType, message_of
from tracker_node.loaders.bag.writer import BagWriter
from tracker_node.runs.messages import COMPRESSED_IMAGE, compressed_image

_FIELDS = """uint8 INITIALISING=0
std_msgs/Header header
uint8 status
string status_reason
string model
geometry_msgs/Pose root_pose
string[] dof_names
float64[] values
float64[] velocities
float64[] covariance
float64[] velocity_covariance
float64 score
float64 residual_px
string[] cameras
builtin_interfaces/Time[] camera_stamps
float64[] camera_residuals_px
uint32[] camera_samples
uint8 LIMB_UNSEEN=0
string[] limbs
uint8[] limb_status
float64[] limb_lost_probability
string[] limb_reasons
uint32 iterations
uint32 evaluations
float64 observe_ms
float64 optimize_ms
float64 total_ms
"""


def write_old_bag(path: Path, dof_names: tuple[str, ...], stamps_ns: list[int]) -> Path:
    """A state of every stamp on ``/tracker/state``, with covariances i * 1 and 2 i * 1, and a picture of the model."""
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(_FIELDS, TRACKED_STATE))
    text, _ = store.generate_msgdef(TRACKED_STATE, ros_version=2)
    definition = MessageType(TRACKED_STATE, text, store.hash_rihs01(TRACKED_STATE))
    n = len(dof_names)
    with BagWriter(path, custom={"model": "stick"}) as writer:
        writer.add_topic("/tracker/state", TRACKED_STATE, definition=definition)
        for i, stamp_ns in enumerate(stamps_ns):
            types = store.types
            time = types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9))
            pose = types["geometry_msgs/msg/Pose"](
                types["geometry_msgs/msg/Point"](1.0, 2.0, 3.0), types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
            )
            state = types[TRACKED_STATE](
                types["std_msgs/msg/Header"](time, "world"), 0 if i == 0 else 1, "", "stick", pose, list(dof_names),
                np.full(n, 0.1 * i), np.zeros(n), i * np.eye(n).ravel(), 2.0 * i * np.eye(n).ravel(), 7.0, 1.5 + i,
                ["cam01"], [time], np.array([2.5 + i]), np.array([30], np.uint32), ["trunk", "hand", "foot"],
                np.array([1, 0, 3], np.uint8), np.array([0.0, 0.5, 0.9]), ["", "hidden", "not found"], 4, 5, 1.0, 2.0, 3.0,
            )  # fmt: skip
            writer.write("/tracker/state", stamp_ns, bytes(store.serialize_cdr(state, TRACKED_STATE)), stamp_ns + 3)
            picture = message_of(COMPRESSED_IMAGE, compressed_image(stamp_ns, "cam01", b"jpeg"))
            for name in ("overlay", "target_through_mask"):
                writer.write_message(f"/tracker/cam01/{name}", stamp_ns, picture)
    return path
