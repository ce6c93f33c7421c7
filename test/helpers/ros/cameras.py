"""A recording of the small arm, sent to a tracker from a test's own node; its tracker in this process to compare with."""

from pathlib import Path

import cv2
from sensor_msgs.msg import CameraInfo, Image

from helpers.ros.graph import Probe
from tracker_node.camera.rig import CameraRig
from tracker_node.loaders.images.source import load_backgrounds
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.ros.conversions import image_message
from tracker_node.ros.qos import images_published
from tracker_node.ros.tracker.image_inbox import InboxOptions
from tracker_node.ros.tracker.setup import TrackerOptions
from tracker_node.tracking.tracker import Tracker

N = 12
PERIOD_NS = round(1e9 / 30.0)


def options_of(recording: Path, **changes) -> TrackerOptions:
    rig, model = load_rig(recording / "rig.yaml"), load_model(recording / "model.yaml")
    state = load_state(recording / "state.yaml", model)
    return TrackerOptions(rig, model, initial_state=state, inbox=InboxOptions(lossless=True), **changes)


def image_set_of(recording: Path, i: int) -> ImageSet:
    rig = load_rig(recording / "rig.yaml")
    stamp_ns = round(i * 1e9 / 30.0)
    read = {name: cv2.imread(str(recording / name / f"{i:04}.png")) for name in rig.names}
    return ImageSet(stamp_ns, tuple(CameraImage(name, stamp_ns, bgr) for name, bgr in read.items()))


class Cameras:
    """Publishes the recording's images from the probe."""

    def __init__(self, probe: Probe, recording: Path, rig: CameraRig):
        self._recording, self._rig = recording, rig
        create = probe.node.create_publisher
        self.images = {name: create(Image, f"{name}/image_raw", images_published(50)) for name in rig.names}
        self.infos = {name: create(CameraInfo, f"{name}/camera_info", images_published(50)) for name in rig.names}
        publishers = [*self.images.values(), *self.infos.values()]
        probe.spin_until(lambda: all(p.get_subscription_count() for p in publishers), "subscriptions of the tracker")
        probe.until_known("tracker")

    def send(self, i: int, cameras: tuple[str, ...] | None = None, stamp_ns: int | None = None) -> int:
        image_set = image_set_of(self._recording, i)
        stamp_ns = image_set.stamp_ns if stamp_ns is None else stamp_ns
        for image in image_set.images:
            if cameras is None or image.camera in cameras:
                frame_id = self._rig[image.camera].frame_id
                self.images[image.camera].publish(image_message(stamp_ns, frame_id, image.pixels))
        return stamp_ns


def files_of(recording: Path) -> list:
    """Options that a tracker needs."""
    return ["--rig", recording / "rig.yaml", "--model", recording / "model.yaml", "--initial-state", recording / "state.yaml"]


def tracker_of(recording: Path) -> Tracker:
    """The tracker that the node has, without the node."""
    options = options_of(recording)
    return Tracker(options.rig, options.model, options.config, load_backgrounds(options.rig), options.initial_state)
