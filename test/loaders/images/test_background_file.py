"""Plates of a rig."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.cameras.small_clip import CAMERAS
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import CalibrationError, SourceError
from tracker_node.loaders.images.background_file import load_plates, resized_plates

LENS = CameraModel(40, 30, np.array([[40.0, 0.0, 19.5], [0.0, 40.0, 14.5], [0.0, 0.0, 1.0]]))


def rig_with_plate(path: Path | None) -> CameraRig:
    first, second = list(CAMERAS)[:2]
    plated = Camera(first, LENS, np.eye(4), background=None if path is None else str(path))
    return CameraRig((plated, Camera(second, LENS, np.eye(4))))


def test_only_cameras_with_a_plate_have_one(tmp_path: Path) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (30, 40, 3), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "plate.png"), pixels)
    plates = load_plates(rig_with_plate(tmp_path / "plate.png"))
    assert list(plates) == ["cam01"]
    assert (plates["cam01"] == pixels).all()
    assert load_plates(rig_with_plate(None)) == {}


def test_plates_follow_the_size_of_the_images(tmp_path: Path) -> None:
    rig = rig_with_plate(tmp_path / "plate.png")
    cv2.imwrite(str(tmp_path / "plate.png"), np.full((30, 40, 3), 7, np.uint8))
    smaller = CameraRig(tuple(replace(camera, model=camera.model.resized(20, 15)) for camera in rig))
    plates = load_plates(rig)
    assert resized_plates(plates, smaller)["cam01"].shape == (15, 20, 3)
    assert resized_plates(plates, rig)["cam01"] is plates["cam01"]


def test_unusable_plates_are_named(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"gone\.png.*cam01"):
        load_plates(rig_with_plate(tmp_path / "gone.png"))
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((3, 4, 3), np.uint8))
    with pytest.raises(CalibrationError, match=r"cam01.*expected 40x30, got 4x3"):
        load_plates(rig_with_plate(tmp_path / "small.png"))
