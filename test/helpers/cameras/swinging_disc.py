"""Two cameras side by side before a disc that swings; the second is late by its own clock."""

from pathlib import Path

import cv2
import numpy as np

RATE_HZ, LATE_S = 60.0, 0.0533
SIZE = (160, 120)


def write_swinging_disc(folder: Path, n_images: int = 80) -> Path:
    """``left.avi``, ``right.avi`` and their ``rig.yaml``, which is returned."""
    lines = ["cameras:"]
    for name, x, late_s in (("left", -0.5, 0.0), ("right", 0.5, LATE_S)):
        video = cv2.VideoWriter(str(folder / f"{name}.avi"), cv2.VideoWriter.fourcc(*"MJPG"), RATE_HZ, SIZE)
        for i in range(n_images):
            t = i / RATE_HZ + late_s
            place = np.array([0.3 * np.sin(5.0 * t) - x, 0.5 * np.sin(9.0 * t + 1.0) * np.sin(2.3 * t), 3.0])
            u, v = 150.0 * place[:2] / place[2] + [80.0, 60.0]
            image = np.full((SIZE[1], SIZE[0], 3), 60, np.uint8)
            cv2.circle(image, (round(16 * float(u)), round(16 * float(v))), 16 * 9, (60, 220, 120), -1, cv2.LINE_AA, shift=4)
            video.write(image)
        video.release()
        pose = f"[[1, 0, 0, {x}], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]"
        lens = "image_size: [160, 120], K: [[150, 0, 80], [0, 150, 60], [0, 0, 1]]"
        lines.append(f"  {name}: {{{lens}, T_world_cam: {pose}, source: {name}.avi, time_offset_s: 0.01}}")
    path = folder / "rig.yaml"
    path.write_text("\n".join(lines) + "\n")
    return path
