"""Joints of people in images, as OpenPose writes them."""

import json
from pathlib import Path

import numpy as np

from tracker_node.camera.rig import CameraRig


def write_points(folder: Path, rig: CameraRig, n_images: int = 12, n_joints: int = 10) -> None:
    """Joints at random in the middle of a circle of cameras, clicked on with 1 px of noise: ``cam01_json/``..."""
    rng = np.random.default_rng(1)
    for i in range(n_images):
        joints = rng.uniform([-0.5, -0.5, 0.2], [0.5, 0.5, 1.8], (n_joints, 3))
        for camera in rig:
            pixels, visible = camera.project(joints)
            values = np.column_stack([pixels + rng.normal(size=pixels.shape), 0.8 * visible])
            file = folder / f"{camera.name}_json" / f"{camera.name}.{i:04d}.json"
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(json.dumps({"people": [{"pose_keypoints_2d": values.ravel().tolist()}]}))
