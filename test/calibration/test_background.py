"""The empty scene from a recording in which somebody walks and a still with somebody else in it."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.calibration.background import (
    build_background,
    build_backgrounds,
    spread_images,
    with_backgrounds,
    write_image,
)
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import CalibrationError, SourceError
from tracker_node.loaders.rig.rig_yaml import rig_file_of

H, W = 120, 200


def scene() -> np.ndarray:
    ramp = np.linspace(40, 200, W)[None, :, None] + np.linspace(0, 30, H)[:, None, None]
    return np.clip(ramp + np.array([0.0, 10.0, -20.0]), 0, 255).astype(np.uint8).repeat(1, axis=0)


def with_person(image: np.ndarray, u: int, color) -> np.ndarray:
    image = image.copy()
    cv2.ellipse(image, (u, 70), (12, 40), 0.0, 0.0, 360.0, color, cv2.FILLED)
    return image


def recording(n: int = 21) -> np.ndarray:
    """Somebody sways between columns 60 and 80."""
    rng = np.random.default_rng(0)
    images = []
    for i in range(n):
        image = with_person(scene(), int(70 + 10 * np.sin(i)), (20, 20, 230)).astype(float)
        images.append(np.clip(image + rng.normal(size=image.shape), 0, 255).astype(np.uint8))
    return np.array(images)


def test_persons_of_recording_and_still_are_both_gone():
    darker = 0.9 * with_person(scene(), 140, (230, 30, 20)) + 3.0
    plate = build_background(recording(), darker.astype(np.uint8))
    assert np.abs(plate.image.astype(int) - scene()).max() <= 6
    assert not plate.known[70, 70] and plate.known[70, 140]


def test_without_a_still_the_unknown_is_marked():
    plate = build_background(recording())
    assert np.abs(plate.image.astype(int) - scene())[plate.known].max() <= 6
    assert not plate.known[70, 57] and plate.known[70, 140]


def test_sizes_must_agree():
    with pytest.raises(ValueError, match="alone of shape"):
        build_background(recording(3), np.zeros((H, W + 8, 3), np.uint8))
    with pytest.raises(ValueError, match="expected images of shape"):
        build_background(np.zeros((0, H, W, 3), np.uint8))


def test_images_are_spread_over_the_recording(tmp_path):
    for i in range(10):
        write_image(tmp_path / "images" / f"{i:02d}.png", np.full((8, 8, 3), 20 * i, np.uint8))
    found = spread_images(tmp_path / "images", 5)
    assert found[:, 0, 0, 0].tolist() == [20, 60, 100, 140, 180]
    with pytest.raises(SourceError, match="cannot be written"):
        write_image(tmp_path / "images" / "00.png" / "x.png", found[0])


def test_each_camera_of_a_rig_has_its_own(tmp_path):
    cameras = [replace(c, source=str(tmp_path / f"{c.name}_recording")) for c in circle_rig(2)]
    for i, camera in enumerate(cameras):
        (tmp_path / f"{camera.name}_recording").mkdir()
        for k in range(3):
            cv2.imwrite(f"{camera.source}/{k}.png", np.full((6, 8, 3), 80 + 40 * i, np.uint8))
        cv2.imwrite(str(tmp_path / f"{camera.name}.png"), np.full((6, 8, 3), 90, np.uint8))
    rig = CameraRig(tuple(cameras))
    for folder in (None, tmp_path):
        found = dict(build_backgrounds(rig, 3, folder))
        assert [(name, int(each.image.mean())) for name, each in found.items()] == [("cam01", 80), ("cam02", 120)]
    written = with_backgrounds(rig_file_of(rig), {"cam02": Path("x/cam02.png")}).cameras
    assert written["cam01"].background is None and written["cam02"].background == str(Path("x/cam02.png").absolute())


def test_images_of_the_background_have_the_camera_s_name_and_size(tmp_path):
    (tmp_path / "recording").mkdir()
    cv2.imwrite(str(tmp_path / "recording/0.png"), np.zeros((6, 8, 3), np.uint8))
    rig = CameraRig((replace(circle_rig(1).cameras[0], source=str(tmp_path / "recording")),))
    with pytest.raises(SourceError, match="no image named cam01"):
        list(build_backgrounds(rig, 3, tmp_path))
    cv2.imwrite(str(tmp_path / "cam01.png"), np.zeros((5, 8, 3), np.uint8))
    with pytest.raises(CalibrationError, match="its image of the background is 8x5, its recording 8x6"):
        list(build_backgrounds(rig, 3, tmp_path))
    with pytest.raises(CalibrationError, match="no source"):
        list(build_backgrounds(CameraRig((replace(rig.cameras[0], source=None),))))
