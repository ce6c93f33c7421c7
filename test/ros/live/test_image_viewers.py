"""Images of a graph for viewers that know only ROS: rqt_image_view, RViz's Image and Camera displays.

What they do by themselves is done here: topics are chosen by type and name, the profile is theirs, camera_info is sought beside
the image, and pixels are decoded as their transports do.
"""

import cv2
import numpy as np
import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from helpers.ros.graph import stamps
from tracker_node.loaders.rig.rig_yaml import load_rig

RVIZ = QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE)  # default of its displays
RQT = qos_profile_sensor_data  # of rqt_image_view, and of image_transport's subscribers in general: best effort
ENCODINGS = {"mono8": 1, "bgr8": 3, "rgb8": 3}  # that both show without being told a range


def listed(topics: dict[str, str]) -> dict[str, type]:
    """Images as viewers list them: raw topics, and compressed ones under the suffix of image_transport."""
    kinds = {"sensor_msgs/msg/Image": Image, "sensor_msgs/msg/CompressedImage": CompressedImage}
    shown = {name: kinds[kind] for name, kind in topics.items() if kind in kinds}
    return {name: kind for name, kind in shown.items() if kind is Image or name.endswith("/compressed")}


def info_beside(topic: str) -> str:
    """Where image_transport's camera subscribers, and RViz's Camera, look for the calibration of an image."""
    return f"{topic.removesuffix('/compressed').rpartition('/')[0]}/camera_info"


def pixels(message: Image | CompressedImage) -> np.ndarray:
    if isinstance(message, CompressedImage):
        assert message.format.startswith("jpeg") or "jpeg" in message.format
        return cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_UNCHANGED)
    channels = ENCODINGS[message.encoding]
    assert message.step == channels * message.width and len(message.data) == message.step * message.height
    return np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, -1).squeeze()


@pytest.mark.parametrize("profile", [RVIZ, RQT], ids=["rviz", "rqt"])
def test_viewers_find_every_image_and_its_calibration(profile, recording, probe, launch):
    rig = load_rig(recording / "rig.yaml")
    files = ["--rig", recording / "rig.yaml", "--model", recording / "model.yaml", "--initial-state", recording / "state.yaml"]
    launch("tracker", *files)
    launch("camera_ingest", "--rig", recording / "rig.yaml", "--loop")
    per_camera = [f"/{c}/image_raw" for c in rig.names]
    per_camera += [
        f"/tracker/{c}/{what}" for c in rig.names for what in ("mask", "overlay/compressed", "masked_image/compressed")
    ]

    def there() -> dict[str, str]:
        return {name: kinds[0] for name, kinds in probe.node.get_topic_names_and_types()}

    probe.spin_until(lambda: set(per_camera) <= listed(there()).keys(), "all images to be listed")
    images = {name: kind for name, kind in listed(there()).items() if name in per_camera}
    infos = {info_beside(name) for name in images}
    assert {there().get(name) for name in infos} == {"sensor_msgs/msg/CameraInfo"}
    came = {name: probe.listen(kind, name, profile) for name, kind in images.items()}
    came |= {name: probe.listen(CameraInfo, name, profile) for name in infos}
    probe.spin_until(lambda: all(len(messages) > 3 for messages in came.values()), "images and calibrations to come")
    for name in images:
        camera = next(camera for camera in rig if f"/{camera.name}/" in name)
        said = came[info_beside(name)]
        assert set(stamps(came[name])) & set(stamps(said)), name
        for message in came[name]:
            assert message.header.frame_id == said[0].header.frame_id == camera.frame_id
            assert pixels(message).shape[:2] == (said[0].height, said[0].width)
        np.testing.assert_allclose(np.reshape(said[0].k, (3, 3)), camera.model.K, rtol=1e-12)
    silhouette, overlay = pixels(came["/tracker/cam1/mask"][-1]), pixels(came["/tracker/cam1/overlay/compressed"][-1])
    assert set(np.unique(silhouette)) == {0, 255} and overlay.ndim == 3
