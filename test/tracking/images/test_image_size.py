"""A body that is not quite the model's is tracked in large images as in small ones."""

from dataclasses import replace

import cv2
import numpy as np

from helpers.studio.small_studio import Recording, recording
from tracker_node.camera.rig import CameraRig
from tracker_node.model.configuration import State
from tracker_node.model.variants import LinkScale, scaled_by_link
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.tracker import Tracker

CONFIG = from_dict({"modalities": ["region"], "initialization.enabled": False})
FACTOR = 8  # the body then is a thousand pixels high


def enlarged(clip: Recording) -> tuple[CameraRig, list]:
    """Cameras of so many more pixels, and what they see: the same, interpolated."""
    cameras, sets = [], []
    for camera in clip.rig:
        lens = camera.model
        cameras.append(replace(camera, model=lens.resized(FACTOR * lens.width, FACTOR * lens.height)))
    for image_set in clip.sets[:3]:
        large = [cv2.resize(i.pixels, None, fx=FACTOR, fy=FACTOR, interpolation=cv2.INTER_CUBIC) for i in image_set.images]
        images = tuple(replace(image, pixels=pixels) for image, pixels in zip(image_set.images, large, strict=True))
        sets.append(replace(image_set, images=images))
    return CameraRig(tuple(cameras), clip.rig.world_frame, clip.rig.lights), sets


def test_large_images_are_as_good_as_small_ones():
    clip = recording()
    stouter = scaled_by_link(clip.model, dict.fromkeys(clip.model.chain.links, LinkScale(sizes=(1.2, 1.2, 1.0))))
    T = clip.states[0].T_world_root.copy()
    T[:3, 3] += [0.04, -0.03, 0.0]
    start, (rig, sets) = State(T, clip.states[0].joint_positions), enlarged(clip)
    tracker = Tracker(rig, stouter, CONFIG, None, start)
    estimates = [tracker.step(image_set) for image_set in sets]
    assert all(estimate.status is not Status.LOST for estimate in estimates)
    assert np.median(clip.errors_mm(estimates)[-1]) < 45.0  # a body a fifth too thick
