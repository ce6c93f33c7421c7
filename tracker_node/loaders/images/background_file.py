"""Images of the empty scene."""

from __future__ import annotations

import cv2
import numpy as np

from ...camera.rig import CameraRig
from ...errors import CalibrationError, SourceError


def load_plates(rig: CameraRig) -> dict[str, np.ndarray]:
    """Camera name -> BGR plate (height, width, 3) for the cameras that name one.

    Raises
    ------
    SourceError : a plate that is missing or cannot be read.
    CalibrationError : a plate that does not have the size of the camera's images.
    """
    plates = {}
    for camera in rig:
        if not camera.background:
            continue
        plate = cv2.imread(camera.background, cv2.IMREAD_COLOR)
        if plate is None:
            raise SourceError(camera.background, f"cannot be read as the plate of camera '{camera.name}'")
        expected, got = (camera.model.width, camera.model.height), (plate.shape[1], plate.shape[0])
        if expected != got:
            problem = f"plate has another size than the calibration: expected {expected[0]}x{expected[1]}, got {got[0]}x{got[1]}"
            raise CalibrationError(camera.name, f"{problem} in {camera.background}")
        plates[camera.name] = plate
    return plates


def resized_plates(plates: dict[str, np.ndarray], rig: CameraRig) -> dict[str, np.ndarray]:
    """The plates in the size of the images of ``rig``, for cameras whose images are published resampled."""
    result = {}
    for name, plate in plates.items():
        size = (rig[name].model.width, rig[name].model.height)
        same = plate.shape[1::-1] == size
        result[name] = plate if same else cv2.resize(plate, size, interpolation=cv2.INTER_AREA)
    return result
