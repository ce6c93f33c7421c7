"""A clip for tests of whole programs: an arm with a trunk, three small cameras, image folders without loss."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from helpers.cameras.render_scenes import look_at
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.geometry import se3, so3
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.loaders.model.state_yaml import dump_state
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file
from tracker_node.model.articulated import ArticulatedModel, Landmark, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain
from tracker_node.model.shapes.primitives import TruncatedCone
from tracker_node.render.raycast.raycaster import render_view

RATE_HZ = 30.0
CAMERAS = {"cam01": (1.6, 0.3, 0.6), "cam02": (-0.4, 1.7, 0.5), "cam03": (-1.2, -1.3, 0.9)}


@dataclass(frozen=True)
class Clip:
    """Paths of the files, and what they hold."""

    folder: Path
    model: ArticulatedModel
    rig: CameraRig
    states: tuple[State, ...]

    @property
    def rig_file(self) -> Path:
        return self.folder / "rig.yaml"

    @property
    def model_file(self) -> Path:
        return self.folder / "model.yaml"

    @property
    def state_file(self) -> Path:
        return self.folder / "start.yaml"

    @property
    def config_file(self) -> Path:
        return self.folder / "config.yaml"

    def arguments(self) -> list[str]:
        """For commands that track."""
        files = {
            "--rig": self.rig_file, "--model": self.model_file, "--config": self.config_file, "--initial-state": self.state_file,
        }  # fmt: skip
        return [text for name, path in files.items() for text in (name, str(path))]


def body() -> ArticulatedModel:
    shoulder = (Axis("shoulder_x", (1.0, 0.0, 0.0), -1.5, 1.5), Axis("shoulder_y", (0.0, 1.0, 0.0), -2.0, 2.0))
    joints = (
        Joint("shoulder", "trunk", "upper", se3.from_rotation_translation(np.eye(3), np.array([0.0, 0.13, 0.2])), shoulder),
        Joint(
            "elbow", "upper", "fore", se3.from_rotation_translation(np.eye(3), np.array([0.0, 0.0, -0.26])),
            (Axis("elbow_flexion", (0.0, 1.0, 0.0), -2.5, 0.1),),
        ),
    )  # fmt: skip
    down = se3.from_rotation_translation(so3.exp(np.array([np.pi, 0.0, 0.0])), np.zeros(3))
    shapes = (
        Shape("trunk", "trunk", TruncatedCone(0.10, 0.07, 0.3, -0.25, 0.25), color_rgb=(40, 60, 160)),
        Shape("upper", "upper", TruncatedCone(0.05, 0.05, -0.3, 0.0, 0.26), down, (170, 60, 50)),
        Shape("fore", "fore", TruncatedCone(0.04, 0.04, -0.4, 0.0, 0.24), down, (60, 150, 70)),
    )
    landmarks = (
        Landmark("shoulder", "upper", (0.0, 0.0, 0.0)),
        Landmark("elbow", "fore", (0.0, 0.0, 0.0)),
        Landmark("wrist", "fore", (0.0, 0.0, -0.24)),
    )
    return ArticulatedModel("arm_and_trunk", KinematicChain(("trunk", "upper", "fore"), joints), shapes, landmarks)


def motion(n_images: int) -> tuple[State, ...]:
    states = []
    for i in range(n_images):
        t = i / RATE_HZ
        root = se3.from_rotation_translation(so3.exp(np.array([0.0, 0.0, 0.5 * t])), np.array([0.05 * t, 0.0, 0.4]))
        states.append(State(root, np.array([0.3 * np.sin(2 * t), -0.4 - 0.5 * t, -0.7 - 0.8 * t])))
    return tuple(states)


def swinging(n_images: int) -> tuple[State, ...]:
    """As `motion`, farther, on a trunk that stands still."""
    root = se3.from_rotation_translation(so3.exp(np.array([0.0, 0.0, 0.4])), np.array([0.02, 0.0, 0.4]))
    t = np.arange(n_images) / n_images
    return tuple(State(root, np.array([0.9 * np.sin(6 * a), -1.0 + np.cos(5 * a), -1.0 + 0.7 * np.sin(9 * a)])) for a in t)


def make_clip(
    folder: Path, n_images: int = 10, with_backgrounds: bool = True, states: tuple[State, ...] = ()
) -> Clip:  # fmt: skip
    """Render the clip into ``folder``: one folder of PNG files per camera, plates, and all the files that a run needs."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(8)
    lens = CameraModel(160, 120, np.array([[150.0, 0.0, 79.5], [0.0, 150.0, 59.5], [0.0, 0.0, 1.0]]))
    model, states = body(), states or motion(n_images)
    cameras = []
    for name, eye in CAMERAS.items():
        camera = look_at(eye, (0.0, 0.05, 0.4), lens, name)
        scene = cv2.GaussianBlur(rng.uniform(90, 230, (120, 160, 3)), (0, 0), 6).astype(np.float64)
        (folder / name).mkdir(exist_ok=True)
        for i, state in enumerate(states):
            picture = _noisy(_picture(Configuration(model, state), camera, scene), rng)
            cv2.imwrite(str(folder / name / f"{i:04d}.png"), picture)
        cv2.imwrite(str(folder / f"{name}_plate.png"), _noisy(scene, rng))
        plate = f"{name}_plate.png" if with_backgrounds else None
        cameras.append(Camera(name, lens, camera.T_world_cam, source=name, background=plate))
    write_rig_file(rig_file_of(CameraRig(tuple(cameras))), folder / "rig.yaml")
    dump_model(model, folder / "model.yaml")
    dump_state(states[0], model, folder / "start.yaml")
    (folder / "config.yaml").write_text("/**:\n  ros__parameters:\n    threads: 2\n")
    return Clip(folder, model, CameraRig(tuple(cameras)), states)


def _picture(configuration: Configuration, camera: Camera, scene: np.ndarray) -> np.ndarray:
    labels = render_view(configuration, camera).labels
    picture = scene.copy()
    for i, shape in enumerate(configuration.model.shapes):
        picture[labels == i + 1] = shape.color_rgb[::-1]
    return picture


def _noisy(picture: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.clip(picture + rng.normal(0.0, 2.0, picture.shape), 0, 255).astype(np.uint8)
