"""What the tracker tells the graph about each image set. Called from the tracking thread."""

from __future__ import annotations

import time

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistWithCovarianceStamped
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from sensor_msgs.msg import CompressedImage, Image, JointState
from std_msgs.msg import String
from tracker_msgs.msg import TrackedState
from visualization_msgs.msg import MarkerArray

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...observation.image_set import ImageSet
from ...render.raycast.raycaster import render_mask
from ...tracking.estimate import TrackEstimate
from ..conversions import (
    ImageBuffer,
    MarkerBuffer,
    compressed_message,
    joint_state_message,
    pose_message,
    tf_message,
    tracked_state_message,
    twist_message,
    urdf_of,
)
from ..qos import LATCHED, RESULT, overridable
from ..qos_mismatch import QosMismatches

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # not among the ROS packages on PyPI
    TFMessage = None


class TrackerOutputs:
    """Publishers of a tracker node. Images and markers are made only while somebody listens.

    The state is published last: whoever has seen it may rely on the rest being on its way.

    Parameters
    ----------
    mismatches : is told when a subscriber asks for what we do not offer.
    frame_prefix : before the name of the root link on /tf, for several bodies in one graph.
    """

    def __init__(self, node: Node, rig: CameraRig, model: ArticulatedModel, mismatches: QosMismatches, frame_prefix: str = ""):
        self._node, self._model, self._frame_id = node, model, rig.world_frame
        self._mismatches, self._root_frame = mismatches, frame_prefix + model.chain.links[0]
        self._publishers: list[Publisher] = []
        self._pose = self._publisher(PoseWithCovarianceStamped, "~/pose")
        self._twist = self._publisher(TwistWithCovarianceStamped, "~/twist")
        self._joints = self._publisher(JointState, "~/joint_states")
        self._state = self._publisher(TrackedState, "~/state")
        self._markers = self._publisher(MarkerArray, "~/markers")
        self._masks = {camera.name: self._publisher(Image, f"~/{camera.name}/mask") for camera in rig}
        self._overlays = {camera.name: self._publisher(CompressedImage, f"~/{camera.name}/overlay") for camera in rig}
        self._seen = {camera.name: self._publisher(CompressedImage, f"~/{camera.name}/target_through_mask") for camera in rig}
        Configuration(model, State.neutral(model))  # compiled code is loaded now, not at the first image set
        self._marker_buffer = MarkerBuffer(model, self._frame_id)
        self._mask_buffers: dict[str, ImageBuffer] = {}
        self._description = self._created(String, "robot_description", qos_profile=LATCHED)
        self._description.publish(String(data=urdf_of(model)))
        self._tf: Publisher | None = None
        if TFMessage is not None:
            self._tf = self._created(TFMessage, "/tf", qos_profile=RESULT)
            self._tf_static = self._created(TFMessage, "/tf_static", qos_profile=LATCHED)
            frames = [(self._frame_id, camera.frame_id, camera.T_world_cam) for camera in rig]
            self._tf_static.publish(TFMessage(transforms=tf_message(0, frames)))

    def _publisher(self, message_type, topic: str) -> Publisher:
        events = self._mismatches.of_publisher(topic, topic)
        return self._created(message_type, topic, **overridable(RESULT), event_callbacks=events)

    def _created(self, message_type, topic: str, **options) -> Publisher:
        self._publishers.append(self._node.create_publisher(message_type, topic, **options))
        return self._publishers[-1]

    def close(self) -> None:
        """The topics are offered no more."""
        while self._publishers:
            self._node.destroy_publisher(self._publishers.pop())

    def publish(self, estimate: TrackEstimate, image_set: ImageSet, rig: CameraRig) -> None:
        """Everything about one estimate; ``rig`` has the lenses of the images.

        Poses, velocities, joints and transforms cannot say that they are wrong: there are none while the body is not known.
        """
        configuration = Configuration(self._model, estimate.state)
        for camera in rig:
            self._publish_images(estimate, image_set, configuration, rig, camera.name)
        if estimate.status.has_state and self._markers.get_subscription_count():
            self._markers.publish(self._marker_buffer.fill(estimate, configuration))
        if estimate.status.known:
            self._publish_state_of_others(estimate)
        self._state.publish(tracked_state_message(estimate, self._model, self._frame_id))

    def _publish_state_of_others(self, estimate: TrackEstimate) -> None:
        """In the messages that other programs know."""
        if self._tf is not None:
            root = (self._frame_id, self._root_frame, estimate.state.T_world_root)
            self._tf.publish(TFMessage(transforms=tf_message(estimate.stamp_ns, [root])))
        if self._twist.get_subscription_count():
            self._twist.publish(twist_message(estimate, self._frame_id))
        self._pose.publish(pose_message(estimate, self._frame_id))
        self._joints.publish(joint_state_message(estimate, self._model, self._frame_id))

    def _publish_images(
        self, estimate: TrackEstimate, image_set: ImageSet, configuration: Configuration, rig: CameraRig, name: str
    ) -> None:
        camera = rig[name]
        image = image_set.get(name)
        stamp_ns = estimate.stamp_ns if image is None else image.stamp_ns
        if self._masks[name].get_subscription_count():
            empty = np.zeros((camera.model.height, camera.model.width), np.uint8)
            mask = render_mask(configuration, camera) if estimate.status.has_state else empty
            if name not in self._mask_buffers:
                self._mask_buffers[name] = ImageBuffer(camera.frame_id, mask.shape[1], mask.shape[0], "mono8")
            self._masks[name].publish(self._mask_buffers[name].fill(stamp_ns, mask))
        if image is None or not estimate.status.has_state:
            return
        if self._overlays[name].get_subscription_count():
            from ...render.draw.overlay import draw_overlay

            drawn = draw_overlay(image.bgr, configuration, camera)
            self._overlays[name].publish(compressed_message(stamp_ns, camera.frame_id, drawn))
        if self._seen[name].get_subscription_count():
            from ...render.draw.masked_image import target_through_mask

            seen = target_through_mask(image.bgr, configuration, camera)
            self._seen[name].publish(compressed_message(stamp_ns, camera.frame_id, seen))

    def subscriber_count(self, output: str) -> int:
        """Subscribers of state, pose, joint_states, markers; of the images, the fewest that any camera's has."""
        publishers = {
            "state": [self._state],
            "pose": [self._pose],
            "joint_states": [self._joints],
            "markers": [self._markers],
            "mask": list(self._masks.values()),
            "overlay": list(self._overlays.values()),
            "target_through_mask": list(self._seen.values()),
        }
        return min(publisher.get_subscription_count() for publisher in publishers[output])

    def wait_until_delivered(self, timeout_s: float = 5.0) -> None:
        """Until every subscriber has said that it has everything; that alone can take the writer's heartbeat of 3 s."""
        until_s = time.monotonic() + timeout_s
        images = [publisher for by_camera in (self._masks, self._overlays, self._seen) for publisher in by_camera.values()]
        for publisher in (self._pose, self._joints, self._state, *images):
            publisher.wait_for_all_acked(Duration(seconds=max(0.0, until_s - time.monotonic())))
