"""A small person in front of a few small cameras, drawn by the ray-caster over clutter, for the tests of starts."""

from dataclasses import dataclass

import cv2
import numpy as np

from helpers.cameras.render_scenes import look_at
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import CameraRig
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.render.raycast.raycaster import render_view

K = np.array([[210.0, 0.0, 119.5], [0.0, 210.0, 89.5], [0.0, 0.0, 1.0]])
LENS = CameraModel(240, 180, K, "plumb_bob", np.array([-0.1, 0.04, 0.0, 0.0]))
EYES = ((3.4, 0.4, 1.3), (0.3, 3.3, 1.9), (-3.2, -0.6, 1.2), (-0.4, -3.4, 2.0))


@dataclass(frozen=True, eq=False)
class Scene:
    """The rig, and what its cameras see of the empty room."""

    model: ArticulatedModel
    rig: CameraRig
    backgrounds: dict[str, np.ndarray]

    def images(self, state: State | None, seed: int = 0) -> list[np.ndarray]:
        """Noisy BGR images with the body in ``state``, or of the empty room."""
        rng = np.random.default_rng(seed)
        result = []
        for camera in self.rig:
            picture = self.backgrounds[camera.name].astype(np.float64)
            if state is not None:
                labels = render_view(Configuration(self.model, state), camera).labels
                for i, shape in enumerate(self.model.shapes):
                    picture[labels == i + 1] = shape.color_rgb[::-1]
            picture = cv2.GaussianBlur(picture, (0, 0), 0.6) + rng.normal(0.0, 3.0, picture.shape)
            result.append(np.clip(picture, 0, 255).astype(np.uint8))
        return result

    def image_set(self, number: int, images: list[np.ndarray | None]) -> ImageSet:
        stamp = round(number * 1e9 / 30)
        pairs = zip(self.rig, images, strict=True)
        return ImageSet(stamp, tuple(CameraImage(c.name, stamp, image) for c, image in pairs if image is not None))


def scene(n_cameras: int = 4) -> Scene:
    cameras = tuple(look_at(eye, (0.0, 0.0, 0.95), LENS, f"cam{i}") for i, eye in enumerate(EYES[:n_cameras]))
    rng = np.random.default_rng(5)
    backgrounds = {}
    for camera in cameras:
        patches = cv2.resize(rng.uniform(60, 200, (9, 12, 3)), (LENS.width, LENS.height), interpolation=cv2.INTER_NEAREST)
        backgrounds[camera.name] = cv2.GaussianBlur(patches, (0, 0), 2.0).astype(np.uint8)
    return Scene(human_model(), CameraRig(cameras), backgrounds)


def standing(model: ArticulatedModel, x: float, y: float, heading: float, **angles_deg: float) -> State:
    root = se3.from_rotation_translation(so3.exp(np.array([0.0, 0.0, heading])), np.array([x, y, 0.93]))
    state = State.neutral(model, root)
    for name, angle in angles_deg.items():
        state.joint_positions[model.chain.axis_index(name)] = np.radians(angle)
    return state


def largest_error_m(model: ArticulatedModel, found: State, true: State) -> float:
    off = Configuration(model, found).landmarks_world - Configuration(model, true).landmarks_world
    return float(np.linalg.norm(off, axis=1).max())
