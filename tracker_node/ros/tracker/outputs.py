"""What the tracker tells the graph about each image set. Called from the tracking thread."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import TransformStamped
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher

from ...camera.rig import CameraRig
from ...loaders.bag.message_types import BODIES
from ...loaders.model.urdf_writer import urdf_of
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...observation.image_set import ImageSet
from ...runs import messages
from ...runs.outputs import BODY_OUTPUTS, CAMERA_OUTPUTS, DESCRIPTION, MARKER_ARRAY, MARKERS, STRING, Output, Tracked
from ...tracking.estimate import TrackEstimate
from ..conversions import fill, message_class, message_of
from ..diagnostics import QosMismatches
from ..qos import LATCHED, RESULT, overridable

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # not among the ROS packages on PyPI
    TFMessage = None


class _Channel:
    """A topic's publisher, and the one message that is filled anew for each image set."""

    def __init__(self, publisher: Publisher, message: Any):
        self.publisher, self._message = publisher, message

    @property
    def listened_to(self) -> bool:
        return bool(self.publisher.get_subscription_count())

    def publish(self, content: Mapping[str, Any] | None) -> None:
        """Send the message with these fields; None: nothing."""
        if content is not None:
            self.publisher.publish(fill(self._message, content))


class TrackerOutputs:
    """Publishers of a tracker node, by the lists of `runs.outputs`.

    Parameters
    ----------
    mismatches : is informed when a subscriber asks for what we do not offer.
    frame_prefix : before the name of the root link on /tf, for several bodies in one graph.
    body : of several bodies of this node, the name before its topics; "": there is one.
    """

    def __init__(
        self, node: Node, rig: CameraRig, model: ArticulatedModel, mismatches: QosMismatches, frame_prefix: str = "",
        body: str = "",
    ):  # fmt: skip
        self._node, self._mismatches, self._model = node, mismatches, model
        self._prefix, frame_prefix = (f"{body}/", f"{frame_prefix}{body}/") if body else ("", frame_prefix)
        self._world, self._root = rig.world_frame, frame_prefix + model.chain.links[0]
        self._publishers: list[Publisher] = []
        self._of_body = [(output, self._channel(output)) for output in BODY_OUTPUTS]
        self._of_cameras = {
            camera.name: [(output, self._channel(output, f"{camera.name}/")) for output in CAMERA_OUTPUTS] for camera in rig
        }
        marker_array = message_class(MARKER_ARRAY)
        self._markers = _Channel(self._publisher(marker_array, f"~/{self._prefix}{MARKERS}"), None)
        Configuration(model, State.neutral(model))  # compiled code is loaded now, not at the first image set
        self._description = self._created(message_class(STRING), f"{self._prefix}{DESCRIPTION}", qos_profile=LATCHED)
        self._describe()
        self._tf: Publisher | None = None
        if TFMessage is not None:
            self._tf = self._created(TFMessage, "/tf", qos_profile=RESULT)
            frames = [(self._world, camera.frame_id, camera.T_world_cam) for camera in rig]
            self._created(TFMessage, "/tf_static", qos_profile=LATCHED).publish(_tf_message(0, frames))

    def _describe(self) -> None:
        self._markers = _Channel(self._markers.publisher, message_of(message_class(MARKER_ARRAY), messages.markers(self._model)))
        self._description.publish(message_of(message_class(STRING), {"data": urdf_of(self._model)}))

    def use(self, model: ArticulatedModel) -> None:
        """From the next image set on the body is this one: somebody has joined, who has lengths of his own."""
        if model is not self._model:
            self._model = model
            self._describe()

    def _channel(self, output: Output, prefix: str = "") -> _Channel:
        class_ = message_class(output.type_name)
        return _Channel(self._publisher(class_, f"~/{self._prefix}{prefix}{output.topic}"), class_())

    def _publisher(self, message_type, topic: str) -> Publisher:
        self._mismatches.of_publisher(topic, topic)
        return self._created(message_type, topic, **overridable(RESULT))

    def _created(self, message_type, topic: str, **options) -> Publisher:
        self._publishers.append(self._node.create_publisher(message_type, topic, **options))
        return self._publishers[-1]

    def close(self) -> None:
        """The topics are offered no more."""
        while self._publishers:
            self._node.destroy_publisher(self._publishers.pop())

    def publish(self, estimate: TrackEstimate, image_set: ImageSet, rig: CameraRig) -> None:
        """Everything about one estimate.

        Parameters
        ----------
        estimate : what the tracker says of one image set.
        image_set : the images that it was made from.
        rig : the cameras in use, with the lenses of the images.
        """
        tracked = Tracked(estimate, image_set, rig, Configuration(self._model, estimate.state))
        for camera in rig:
            for output, channel in self._of_cameras[camera.name]:
                if not output.on_request or channel.listened_to:
                    channel.publish(output.content(tracked, camera))
        if estimate.status.has_state and self._markers.listened_to:
            self._markers.publish(messages.changed_markers(estimate, tracked.configuration, self._world))
        if self._tf is not None and estimate.status.known:
            root = (self._world, self._root, estimate.state.T_world_root)
            self._tf.publish(_tf_message(estimate.stamp_ns, [root]))
        for output, channel in self._of_body:
            if not output.on_request or channel.listened_to:
                channel.publish(output.content(tracked))

    def _publishers_of(self, name: str) -> list[Publisher]:
        """Those of an output, of all cameras where each has it."""
        if name == MARKERS:
            return [self._markers.publisher]
        lists = [self._of_body, *self._of_cameras.values()]
        return [channel.publisher for channels in lists for output, channel in channels if output.name == name]

    def subscriber_count(self, name: str) -> int:
        """Subscribers of an output; where each camera has it, the fewest that any camera's has."""
        return min(publisher.get_subscription_count() for publisher in self._publishers_of(name))

    def wait_until_delivered(self, timeout_s: float = 5.0) -> None:
        """Until every subscriber has said that it has everything; that alone can take the writer's heartbeat of 3 s."""
        until_s = time.monotonic() + timeout_s
        for channels in (self._of_body, *self._of_cameras.values()):
            for _, channel in channels:
                channel.publisher.wait_for_all_acked(Duration(seconds=max(0.0, until_s - time.monotonic())))


class BodiesOutput:
    """Publisher of ``~/bodies``, for a node that follows several.

    Parameters
    ----------
    node, models : the node; by the name of the body.
    mismatches : is informed when a subscriber asks for what we do not offer.
    """

    def __init__(self, node: Node, models: Mapping[str, ArticulatedModel], mismatches: QosMismatches):
        self._node, self._models, class_ = node, models, message_class(BODIES)
        mismatches.of_publisher("bodies", "~/bodies")
        publisher = node.create_publisher(class_, "~/bodies", **overridable(RESULT))
        self._channel = _Channel(publisher, class_())

    def publish(self, estimates: Mapping[str, TrackEstimate], frame_id: str) -> None:
        """What is known of all bodies.

        Parameters
        ----------
        estimates : of one image set, by the name of the body.
        frame_id : name of the world frame.
        """
        self._channel.publish(messages.bodies(estimates, self._models, frame_id))

    def close(self) -> None:
        """The topic is offered no more."""
        self._node.destroy_publisher(self._channel.publisher)


def _tf_message(stamp_ns: int, frames: Sequence[tuple[str, str, np.ndarray]]):
    """tf2_msgs/TFMessage of transforms ``T_parent_child`` (4, 4) given as (parent, child, transform)."""
    contents = messages.transforms(stamp_ns, frames)
    return TFMessage(transforms=[message_of(TransformStamped, content) for content in contents])
