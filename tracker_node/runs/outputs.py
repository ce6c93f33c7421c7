"""What is said of every tracked image set: the topics of a tracker and their messages.

A live node publishes by these lists, and an offline run writes its bag by them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..camera.rig import Camera, CameraRig
from ..loaders.bag.message_types import CROPS, STATE_COVARIANCE, TRACKED_STATE
from ..model.articulated import ArticulatedModel
from ..model.clothes import with_surfaces
from ..model.configuration import Configuration
from ..observation.image_set import ImageSet
from ..render.raycast.raycaster import render_mask
from ..tracking.estimate import TrackEstimate
from ..tracking.keypoints.crops import crops_of
from . import messages
from .messages import CAMERA_INFO, COMPRESSED_IMAGE, IMAGE, Content

ALWAYS, ON_REQUEST, NEVER = "always", "on request", "never"
DESCRIPTION, STRING = "robot_description", "std_msgs/msg/String"  # latched: the body's URDF
MARKERS, MARKER_ARRAY = "markers", "visualization_msgs/msg/MarkerArray"  # for a live view alone


@dataclass(frozen=True, eq=False)
class Tracked:
    """One image set and what the tracker says of it: everything that messages are made of.

    Parameters
    ----------
    rig : the cameras in use, with the lenses of the images.
    configuration : the model in the state of the estimate.
    """

    estimate: TrackEstimate
    image_set: ImageSet
    rig: CameraRig
    configuration: Configuration

    @property
    def model(self) -> ArticulatedModel:
        return self.configuration.model

    @cached_property
    def drawn(self) -> Configuration:
        """The body as it is seen in images, with its clothes."""
        surfaces = self.estimate.surfaces
        return self.configuration if surfaces is None else Configuration(with_surfaces(self.model, surfaces), self.estimate.state)

    @property
    def frame_id(self) -> str:
        """Of the world."""
        return self.rig.world_frame

    def stamp_ns(self, camera: Camera) -> int:
        """Of the camera's image; that of the set where it gave none."""
        image = self.image_set.get(camera.name)
        return self.estimate.stamp_ns if image is None else image.stamp_ns


@dataclass(frozen=True)
class Output:
    """One topic.

    Parameters
    ----------
    name : for people and options.
    content : what a message says, of a `Tracked` and, of an output of each camera, a `Camera`; None: nothing this time.
    on_request : made only while somebody listens.
    in_bag : ALWAYS, ON_REQUEST (where a run is asked to record it), or NEVER.
    """

    name: str
    type_name: str
    content: Callable[..., Content | None]
    on_request: bool = False
    in_bag: str = ALWAYS

    @property
    def topic(self) -> str:
        """Name of the topic after the tracker's, or the camera's; of JPEGs with the suffix that image_transport expects."""
        return f"{self.name}/compressed" if self.type_name == COMPRESSED_IMAGE else self.name


def _pose(tracked: Tracked) -> Content | None:
    return messages.pose(tracked.estimate, tracked.frame_id) if tracked.estimate.status.known else None


def _twist(tracked: Tracked) -> Content | None:
    return messages.twist(tracked.estimate, tracked.frame_id) if tracked.estimate.status.known else None


def _joint_states(tracked: Tracked) -> Content | None:
    known = tracked.estimate.status.known
    return messages.joint_state(tracked.estimate, tracked.model, tracked.frame_id) if known else None


def _state(tracked: Tracked) -> Content:
    return messages.tracked_state(tracked.estimate, tracked.model, tracked.frame_id, tracked.image_set)


def _crops(tracked: Tracked) -> Content:
    """Where a detector should look in the next images; in all of them while the body is not known."""
    rig, estimate = tracked.rig, tracked.estimate
    known = estimate.status.known
    squares = crops_of(tracked.model, rig, estimate.state) if known else [None] * len(rig)
    return messages.crops(estimate.stamp_ns, tracked.frame_id, rig.names, squares)


def _state_covariance(tracked: Tracked) -> Content:
    return messages.state_covariance(tracked.estimate, tracked.model, tracked.frame_id)


def _camera_info(tracked: Tracked, camera: Camera) -> Content:
    """The lens of mask and overlay, beside them, where viewers look for it."""
    return messages.camera_info(tracked.stamp_ns(camera), camera.frame_id, camera.model)


def _mask(tracked: Tracked, camera: Camera) -> Content:
    """The silhouette; empty before a state is found."""
    empty = np.zeros((camera.model.height, camera.model.width), np.uint8)
    pixels = render_mask(tracked.drawn, camera) if tracked.estimate.status.has_state else empty
    return messages.image(tracked.stamp_ns(camera), camera.frame_id, pixels, "mono8")


def _overlay(tracked: Tracked, camera: Camera) -> Content | None:
    from ..render.overlay import draw_overlay

    return _drawn(draw_overlay, tracked, camera)


def _masked_image(tracked: Tracked, camera: Camera) -> Content | None:
    from ..render.overlay import masked_image

    return _drawn(masked_image, tracked, camera)


def _drawn(draw: Callable[..., np.ndarray], tracked: Tracked, camera: Camera) -> Content | None:
    """A JPEG of what is drawn into the camera's image; None without an image, or a state."""
    image = tracked.image_set.get(camera.name)
    if image is None or not tracked.estimate.status.has_state:
        return None
    jpeg = messages.jpeg_of(draw(image.bgr, tracked.drawn, camera))
    return messages.compressed_image(image.stamp_ns, camera.frame_id, jpeg)


BODY_OUTPUTS = (
    Output("twist", "geometry_msgs/msg/TwistWithCovarianceStamped", _twist, on_request=True, in_bag=NEVER),
    Output("pose", "geometry_msgs/msg/PoseWithCovarianceStamped", _pose),
    Output("joint_states", "sensor_msgs/msg/JointState", _joint_states),
    Output("crops", CROPS, _crops, on_request=True, in_bag=NEVER),
    Output("state_covariance", STATE_COVARIANCE, _state_covariance, on_request=True),
    Output("state", TRACKED_STATE, _state),
)
"""Of the body. Pose, twist and joints cannot say that they are wrong: there are none while the body is not known.

The state is the last: whoever has seen it may rely on the rest being on its way.
"""

CAMERA_OUTPUTS = (
    Output("camera_info", CAMERA_INFO, _camera_info, on_request=True, in_bag=NEVER),
    Output("mask", IMAGE, _mask, on_request=True, in_bag=ON_REQUEST),
    Output("overlay", COMPRESSED_IMAGE, _overlay, on_request=True, in_bag=ON_REQUEST),
    Output("masked_image", COMPRESSED_IMAGE, _masked_image, on_request=True, in_bag=ON_REQUEST),
)
"""Of each camera."""


def recorded(outputs: Sequence[Output], requested: Collection[str]) -> list[Output]:
    """Those that the bag of a run holds.

    Parameters
    ----------
    outputs : one of the lists of this module.
    requested : names of outputs that are recorded besides those that every bag holds.

    Returns
    -------
    outputs : in the order of the list.
    """
    return [o for o in outputs if o.in_bag == ALWAYS or (o.in_bag == ON_REQUEST and o.name in requested)]
