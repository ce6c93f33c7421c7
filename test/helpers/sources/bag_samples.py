"""Small bags for tests."""

from pathlib import Path

import numpy as np

from tracker_node.loaders.bag.message_types import TRACKED_STATE, typestore
from tracker_node.loaders.bag.metadata import OfferedQos
from tracker_node.loaders.bag.writer import BagWriter

PERIOD_NS = 33_333_333
START_NS = 1_700_000_000_000_000_000


def header(stamp_ns: int, frame_id: str = "world"):
    types = typestore().types
    time = types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return types["std_msgs/msg/Header"](stamp=time, frame_id=frame_id)


def text(content: str):
    return typestore().types["std_msgs/msg/String"](data=content)


def image(stamp_ns: int, pixels: np.ndarray, encoding: str = "bgr8"):
    height, width = pixels.shape[:2]
    return typestore().types["sensor_msgs/msg/Image"](
        header=header(stamp_ns, "cam01_optical_frame"),
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=pixels.strides[0],
        data=np.ascontiguousarray(pixels).reshape(-1),
    )


def pose(stamp_ns: int):
    types = typestore().types
    with_covariance = types["geometry_msgs/msg/PoseWithCovariance"]
    return types["geometry_msgs/msg/PoseWithCovarianceStamped"](
        header=header(stamp_ns), pose=with_covariance(pose=tracked_state(stamp_ns).root_pose, covariance=np.zeros(36))
    )


def tracked_state(stamp_ns: int, residual: float = 1.5):
    types = typestore().types
    vector, quaternion = types["geometry_msgs/msg/Point"], types["geometry_msgs/msg/Quaternion"]
    return types[TRACKED_STATE](
        header=header(stamp_ns),
        status=1,
        status_reason="",
        model="stick",
        root_pose=types["geometry_msgs/msg/Pose"](
            position=vector(x=1.0, y=2.0, z=3.0), orientation=quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
        ),
        dof_names=["root_x"],
        values=np.array([1.0]),
        velocities=np.zeros(1),
        score=0.0,
        residual=residual,
        residual_unit="px",
        cameras=["cam01"],
        camera_stamps=[header(stamp_ns).stamp],
        camera_residuals=np.array([residual]),
        camera_samples=np.array([25], dtype=np.uint32),
        keypoint_cameras=[],
        keypoint_stamps=[],
        limbs=["trunk"],
        limb_status=np.array([1], dtype=np.uint8),
        limb_lost_probability=np.array([0.25]),
        limb_reasons=[""],
        iterations=5,
        evaluations=6,
        observe_ms=1.0,
        optimize_ms=2.0,
        total_ms=3.0,
    )


def fill(writer: BagWriter, n_instants: int = 30, seed: int = 5) -> None:
    """Per instant an image, a text and a state."""
    rng = np.random.default_rng(seed)
    writer.add_topic("/cam01/image_raw", "sensor_msgs/msg/Image", OfferedQos(depth=5))
    writer.add_topic("/chatter", "std_msgs/msg/String", OfferedQos("best_effort", "transient_local", depth=1))
    for i in range(n_instants):
        stamp_ns = START_NS + i * PERIOD_NS
        pixels = rng.integers(0, 256, (48, 64, 3), dtype=np.uint8)
        writer.write_message("/cam01/image_raw", stamp_ns, image(stamp_ns, pixels))
        writer.write_message("/chatter", stamp_ns + 10, text(f"instant {i}"))
        writer.write_message("/tracker/state", stamp_ns + 20, tracked_state(stamp_ns, residual=float(i)))


def write_bag(path: Path, n_instants: int = 30, **options) -> Path:
    with BagWriter(path, **options) as writer:
        fill(writer, n_instants)
    return path
