"""Rigs that several tests use: cameras on a circle, and the same ones a little displaced."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.geometry import se3
from tracker_node.loaders.rig.rig_yaml import read_rig_file, write_rig_file
from tracker_node.synthesis.scenes.scene import looking_at


def circle_rig(n_cameras: int = 4, radius: float = 4.0, height: float = 1.5, distortion=(-0.1, 0.05, 1e-3, -5e-4)) -> CameraRig:
    """Cameras of 640 x 480 on a circle, looking at (0, 0, 1)."""
    K = np.array([[600.0, 0.0, 322.0], [0.0, 605.0, 238.0], [0.0, 0.0, 1.0]])
    cameras = []
    for i in range(n_cameras):
        angle = 2.0 * np.pi * i / n_cameras + 0.2
        center = np.array([radius * np.cos(angle), radius * np.sin(angle), height + 0.2 * i])
        model = CameraModel(640, 480, K, "plumb_bob", np.array(distortion))
        cameras.append(Camera(f"cam{i + 1:02d}", model, looking_at(center, np.array([0.0, 0.0, 1.0]))))
    return CameraRig(tuple(cameras))


def disturbed(rig: CameraRig, seed: int = 3, angle: float = 0.02, distance: float = 0.05) -> CameraRig:
    """The rig with all cameras but the first turned and moved."""
    rng = np.random.default_rng(seed)
    cameras = [rig.cameras[0]]
    for camera in rig.cameras[1:]:
        twist = np.concatenate([rng.normal(size=3) * distance / 1.7, rng.normal(size=3) * angle / 1.7])
        cameras.append(replace(camera, T_world_cam=camera.T_world_cam @ se3.exp(twist)))
    return CameraRig(tuple(cameras))


def in_millimetres(source: Path, target: Path) -> Path:
    """Write a rig file as it would be with its places in millimeters."""
    rig = read_rig_file(source)
    places = {name: np.array(entry.T_world_cam) for name, entry in rig.cameras.items()}
    for place in places.values():
        place[:3, 3] *= 1000.0
    write_rig_file(rig.with_extrinsics(places), target)
    return target
