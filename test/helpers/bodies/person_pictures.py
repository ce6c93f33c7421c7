"""A person in several poses before four cameras, drawn with OpenGL over a colored background: for calibration from images."""

from dataclasses import dataclass, replace
from functools import cache

import cv2
import numpy as np

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.experiments.target_images import TargetStudio
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.shape_parameters import ShapeSpace
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.synthesis.scenes.scene import looking_at
from tracker_node.synthesis.subjects.cones import waves
from tracker_node.tracking.config import TrackerConfig

GROUPS = ("length", "girth")
RATE_HZ = 30.0
EVERY = 12  # images between two image sets: poses should differ
LATE_CAMERA = 2
_DEFAULT = TrackerConfig()
CONFIG = replace(  # fewer samples: quicker
    _DEFAULT,
    chamfer=replace(_DEFAULT.chamfer, samples_per_line=14),
    region=replace(_DEFAULT.region, samples_per_line=14),
)


@dataclass(frozen=True, eq=False)
class Pictures:
    """``person`` is ``given`` with the shape parameters ``s`` of `ShapeSpace(given, groups=GROUPS)`; ``late`` has the sets as
    they are when the camera `LATE_CAMERA` shows the image before; ``velocities`` tangents a second."""

    rig: CameraRig
    given: ArticulatedModel
    person: ArticulatedModel
    s: np.ndarray
    states: tuple[State, ...]
    velocities: tuple[np.ndarray, ...]
    sets: tuple[ImageSet, ...]
    late: tuple[ImageSet, ...]
    backgrounds: dict[str, np.ndarray]


@cache
def pictures(n_sets: int = 5) -> Pictures:
    """Made once per test process; treat it as constant."""
    lens = CameraModel(480, 360, np.array([[480.0, 0.0, 239.5], [0.0, 480.0, 179.5], [0.0, 0.0, 1.0]]))
    cameras = []
    for i in range(4):
        angle = 0.5 * np.pi * i + 0.3
        place = looking_at(np.array([3.6 * np.cos(angle), 3.6 * np.sin(angle), 1.2 + 0.3 * i]), np.array([0.0, 0.0, 0.95]))
        cameras.append(Camera(f"cam{i + 1:02d}", lens, place))
    rig, given = CameraRig(tuple(cameras)), human_model()
    space, rng = ShapeSpace(given, groups=GROUPS), np.random.default_rng(5)
    s = 0.8 * space.sigmas * rng.choice([-1.0, 1.0], len(space))
    person = space.body(s)
    track = waves(person, RATE_HZ, EVERY * n_sets, amplitude_rad=0.6)
    rows = [EVERY * k + EVERY // 2 for k in range(n_sets)]
    backgrounds = {c.name: cv2.GaussianBlur(rng.uniform(0, 255, (360, 480, 3)), (0, 0), 8) for c in rig}
    backgrounds = {name: np.clip(128 + 8 * (b - 128), 0, 255).astype(np.uint8) for name, b in backgrounds.items()}
    sets, late = [], []
    with TargetStudio(rig, noise_levels=2.0) as studio:
        for row in rows:
            shown, before = (
                studio.images(Configuration(person, track[i]), [backgrounds[c.name] for c in rig], i) for i in (row, row - 1)
            )
            sets.append(_set(rig, row, shown))
            late.append(
                _set(rig, row, [b if i == LATE_CAMERA else a for i, (a, b) in enumerate(zip(shown, before, strict=True))])
            )
    velocities = tuple(0.5 * RATE_HZ * track[i + 1].difference(track[i - 1]) for i in rows)
    return Pictures(rig, given, person, s, tuple(track[i] for i in rows), velocities, tuple(sets), tuple(late), backgrounds)


def _set(rig: CameraRig, number: int, images) -> ImageSet:
    stamp_ns = round(1e9 * number / RATE_HZ)
    return ImageSet(stamp_ns, tuple(CameraImage(c.name, stamp_ns, image) for c, image in zip(rig, images, strict=True)))
