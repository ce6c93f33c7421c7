"""Balls that fly about a volume, drawn by OpenCV before a cluttered background: what a doctor of rigs is shown in tests."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.geometry import se3
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file

SIZE = (320, 240)
N_IMAGES, RATE_HZ = 40, 30.0


def balls_rig(n_cameras: int = 4) -> CameraRig:
    """Cameras about the origin, none across from another, at different heights."""
    cameras = []
    for i in range(n_cameras):
        angle = np.radians(20.0 + 75.0 * i)
        center = np.array([3.5 * np.cos(angle), 3.5 * np.sin(angle), 0.3 + 0.9 * (i % 2)])
        z = -center / np.linalg.norm(center)
        x = np.cross(z, [0.0, 0.0, 1.0])
        x /= np.linalg.norm(x)
        rotation = np.stack([x, np.cross(z, x), z], axis=1)
        K = np.array([[300.0, 0.0, 159.5], [0.0, 300.0, 119.5], [0.0, 0.0, 1.0]])
        lens = CameraModel(*SIZE, K, "plumb_bob", np.array([-0.05, 0.01, 0.0, 0.0]))
        cameras.append(Camera(f"cam{i + 1}", lens, se3.from_rotation_translation(rotation, center)))
    return CameraRig(tuple(cameras))


def ball_images(rig: CameraRig, n: int = N_IMAGES, seed: int = 0) -> dict[str, list[np.ndarray]]:
    """Camera -> BGR images of five balls, projected by ``cv2.projectPoints``, with sensor noise."""
    rng = np.random.default_rng(seed)
    frequencies, phases = rng.uniform(1.5, 4.0, (5, 3)), rng.uniform(0.0, 2.0 * np.pi, (5, 3))
    radii, colors = rng.uniform(0.1, 0.16, 5), rng.integers(0, 255, (5, 3))
    images: dict[str, list[np.ndarray]] = {}
    for camera in rig:
        width, height = camera.model.width, camera.model.height
        clutter = rng.integers(40, 200, (height // 6 + 1, width // 6 + 1, 3)).astype(np.uint8)
        background = cv2.resize(clutter, (width, height), interpolation=cv2.INTER_CUBIC)
        rotation, translation = camera.T_cam_world[:3, :3], camera.T_cam_world[:3, 3]
        images[camera.name] = []
        for i in range(n):
            places = 0.8 * np.sin(frequencies * i / RATE_HZ + phases)
            depths = (places @ rotation.T + translation)[:, 2]
            lens = camera.model
            pixels, _ = cv2.projectPoints(places, cv2.Rodrigues(rotation)[0], translation, lens.K, lens.distortion)
            image = background.copy()
            for k in np.argsort(-depths):
                center = tuple(np.round(pixels[k, 0] * 16).astype(int).tolist())
                radius = round(16 * radii[k] * lens.K[0, 0] / depths[k])
                cv2.circle(image, center, radius, colors[k].tolist(), -1, cv2.LINE_AA, 4)
            noisy = image + rng.normal(0.0, 1.5, image.shape)
            images[camera.name].append(np.clip(np.rint(noisy), 0, 255).astype(np.uint8))
    return images


def write_balls(folder: Path, n_cameras: int = 3, n_images: int = 16) -> None:
    """``rig.yaml`` with folders of images beside it."""
    rig = balls_rig(n_cameras)
    for name, images in ball_images(rig, n_images).items():
        (folder / name).mkdir(parents=True)
        for i, image in enumerate(images):
            cv2.imwrite(str(folder / name / f"{i:03}.png"), image)
    write_rig_file(rig_file_of(rig).with_cameras({name: {"source": name} for name in rig.names}), folder / "rig.yaml")
