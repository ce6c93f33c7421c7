"""A small body for tests of the ROS edge (a ball joint, a weld, one of each shape), and recordings of it."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.geometry import se3, so3
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.loaders.model.state_yaml import dump_state
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file
from tracker_node.model.articulated import ArticulatedModel, Landmark, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid, Mesh, TruncatedCone
from tracker_node.render.raycast.raycaster import render_view
from tracker_node.synthesis.scenes.scene import looking_at
from tracker_node.tracking.estimate import CameraReport, LimbReport, LimbStatus, Status, Timings, TrackEstimate


def placed(x: float, y: float, z: float, rotation_vector=(0.0, 0.0, 0.0)) -> np.ndarray:
    return se3.from_rotation_translation(so3.exp(np.array(rotation_vector)), np.array([x, y, z]))


def arm() -> ArticulatedModel:
    axes = (
        Axis("shoulder_x", (1.0, 0.0, 0.0), -1.0, 2.0),
        Axis("shoulder_y", (0.0, 1.0, 0.0)),
        Axis("shoulder_z", (0.0, 0.0, 1.0)),
    )
    joints = (
        Joint("shoulder", "trunk", "upper", placed(0.1, 0.2, 0.3, (0.2, -0.4, 0.6)), axes),
        Joint("elbow", "upper", "fore", placed(0.0, 0.0, 0.3), (Axis("elbow_flexion", (0.0, 1.0, 0.0), 0.0, 2.5),)),
        Joint("wrist", "fore", "hand", placed(0.0, 0.0, 0.25, (0.0, 0.3, 0.0))),
    )
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    shapes = (
        Shape("trunk", "trunk", Box((0.3, 0.2, 0.5))),
        Shape("upper", "upper", TruncatedCone(0.05, 0.04, -0.5, 0.0, 0.3), color_rgb=(200, 100, 50)),
        Shape("fore", "fore", Ellipsoid((0.04, 0.03, 0.12)), placed(0.0, 0.0, 0.12, (0.1, 0.2, 0.3))),
        Shape("hand", "hand", Mesh(corners, faces)),
    )
    chain = KinematicChain(("trunk", "upper", "fore", "hand"), joints)
    return ArticulatedModel("arm", chain, shapes, (Landmark("fingertip", "hand", (0.1, 0.0, 0.0)),))


def tracked_arm() -> ArticulatedModel:
    """The same with shapes whose contours can be fitted."""
    model = arm()
    trunk, upper, fore, hand = model.shapes
    trunk = replace(trunk, primitive=TruncatedCone(0.16, 0.1, 0.3, -0.25, 0.25), color_rgb=(40, 60, 160))
    hand = replace(hand, primitive=Ellipsoid((0.05, 0.03, 0.08)), color_rgb=(230, 230, 60))
    return replace(model, shapes=(trunk, upper, fore, hand))


def some_state(model: ArticulatedModel) -> State:
    angles = np.linspace(-0.5, 0.7, model.chain.n_axes)
    return State(placed(0.4, -1.2, 0.9, (0.5, -0.2, 1.1)), angles)


def some_estimate(model: ArticulatedModel, stamp_ns: int = 1_234_567_890_123) -> TrackEstimate:
    n = model.n_dof
    random = np.random.default_rng(3)
    root = random.normal(size=(n, n))
    return TrackEstimate(
        stamp_ns=stamp_ns,
        status=Status.DEGRADED,
        status_reason="few samples",
        state=some_state(model),
        velocity=random.normal(size=n),
        covariance=root @ root.T,
        score=12.5,
        residual=1.75,
        cameras=(CameraReport("left", stamp_ns, 1.5, 310), CameraReport("right", 0, 0.0, 0)),
        iterations=4,
        evaluations=6,
        timings=Timings(1.25, 2.5, 4.0),
        limbs=(
            LimbReport("trunk", LimbStatus.TRACKING, "", 0.03125),
            LimbReport("left_hand", LimbStatus.LOST, "not found", 0.96875),
            LimbReport("left_foot", LimbStatus.UNSEEN, "hidden", 0.5),
        ),
        velocity_covariance=4.0 * root.T @ root,
    )


def small_rig(folder: Path, n_cameras: int = 3, width: int = 160, height: int = 120) -> CameraRig:
    """Cameras around the world's origin; sources and plates are files of ``folder``."""
    K = np.array([[1.1 * width, 0.0, (width - 1) / 2], [0.0, 1.1 * width, (height - 1) / 2], [0.0, 0.0, 1.0]])
    cameras = []
    for i in range(n_cameras):
        angle = 2.0 * np.pi * i / n_cameras
        T = looking_at(np.array([2.2 * np.cos(angle), 2.2 * np.sin(angle), 0.8]), np.array([0.1, 0.1, 0.3]))
        name = f"cam{i + 1}"
        source, plate = str(folder / name), str(folder / f"{name}_plate.png")
        cameras.append(Camera(name, CameraModel(width, height, K), T, source=source, background=plate))
    return CameraRig(tuple(cameras))


def moving_state(model: ArticulatedModel, i: int) -> State:
    """Where the body of `write_recording` is in image ``i``."""
    phase = 0.08 * i
    angles = np.zeros(model.chain.n_axes)
    angles[:4] = 0.3 * np.sin(phase), 0.2 * np.cos(phase), 0.1 * phase, 0.6 + 0.3 * np.sin(2.0 * phase)
    return State(placed(0.05 * np.sin(phase), 0.0, 0.2, (0.0, 0.0, 0.1 * phase)), angles)


def write_recording(folder: Path, n_images: int, n_cameras: int = 3) -> CameraRig:
    """A moving `tracked_arm` in front of a plain wall, as image folders with rig.yaml, model.yaml and state.yaml."""
    model, random = tracked_arm(), np.random.default_rng(0)
    rig = small_rig(folder, n_cameras)
    folder.mkdir(parents=True, exist_ok=True)
    colors = np.array([(90, 110, 100), *(shape.color_rgb[::-1] for shape in model.shapes)], np.uint8)
    for camera in rig:
        Path(str(camera.source)).mkdir()
        empty = np.full((camera.model.height, camera.model.width), 0, np.uint8)
        cv2.imwrite(str(camera.background), _noisy(colors[empty], random))
        for i in range(n_images):
            labels = render_view(Configuration(model, moving_state(model, i)), camera).labels
            cv2.imwrite(f"{camera.source}/{i:04}.png", _noisy(colors[labels], random))
    write_rig_file(rig_file_of(rig), folder / "rig.yaml")
    dump_model(model, folder / "model.yaml")
    dump_state(moving_state(model, 0), model, folder / "state.yaml")
    return rig


def _noisy(bgr: np.ndarray, random: np.random.Generator) -> np.ndarray:
    return np.clip(bgr + random.normal(0.0, 2.0, bgr.shape), 0, 255).astype(np.uint8)
