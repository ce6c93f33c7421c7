"""A V4L2 camera for tests on machines without one: the system calls of a process are answered by `v4l2_camera.c`.

So the kernel's own header and OpenCV's own V4L2 code are on the other side. What a real driver does beyond that is not tested.
"""

import shutil
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

WIDTH, HEIGHT = 64, 48


class V4l2Camera:
    """A camera at ``path``, as long as it is plugged in, for processes with the environment ``env``."""

    def __init__(self, folder: Path):
        compiler = shutil.which("cc")
        if compiler is None or not Path("/usr/include/linux/videodev2.h").exists():
            pytest.skip("needs a C compiler and linux/videodev2.h")
        library, jpeg = folder / "v4l2_camera.so", folder / "image.jpg"
        source = Path(__file__).with_suffix(".c")
        subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, source], check=True)
        cv2.imwrite(str(jpeg), np.full((HEIGHT, WIDTH, 3), 99, np.uint8))
        self.jpeg = jpeg.read_bytes()
        self.path, self._log = folder / "usb-Test_camera-video-index0", folder / "controls.txt"
        self.env = {
            "LD_PRELOAD": str(library),
            "V4L2_CAMERA": str(self.path),
            "V4L2_JPEG": str(jpeg),
            "V4L2_LOG": str(self._log),
        }
        self.plug()

    def plug(self) -> None:
        self.path.symlink_to("/dev/null")

    def unplug(self) -> None:
        self.path.unlink()

    def controls_set(self) -> list[tuple[int, int]]:
        """(number of the control, value) in the order in which they were set."""
        text = self._log.read_text() if self._log.exists() else ""
        return [(int(line.split()[0], 16), int(line.split()[1])) for line in text.splitlines()]
