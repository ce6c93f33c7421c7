"""What four phones film that are started one by one: a board, then a man, each with claps in the sound tracks.

The man and the places of the cameras are those of the sample, at half its size; the board is drawn into their views.
"""

from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np

from benchmark.calibration.synchronize import SOUND_HZ, write_video
from tracker_node.calibration import balancing
from tracker_node.calibration.board.board import Board
from tracker_node.calibration.clocks.sound import SPEED_OF_SOUND
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.geometry import se3, so3
from tracker_node.loaders.rig.rig_yaml import load_rig

from .board_scenes import face_of

PHONES = {"cam01": "right", "cam02": "front", "cam03": "left", "cam04": "back"}
BOARD, BOARD_HZ, BOARD_S = Board("charuco", 7, 5, 0.1), 15.0, 9.0
BOARD_LATE_S = {"right": 0.0, "front": 0.41, "left": 0.93, "back": 0.27}  # when each phone was started
BOARD_CLAPS_S = (1.45, 2.1, 3.7)
RATE_HZ, LATE_IMAGES = 60.0, {"right": 0, "front": 7, "left": 3, "back": 11}
CLAPS_S = (0.37, 0.7, 1.28)
PLACE = np.array([-0.92, 0.0, 1.2])  # of the claps: before the man's chest
_TEXELS = 40


def write_films(sample: Mapping[str, Path], folder: Path, work: Path) -> CameraRig:
    """``board/front.mp4``..., ``walk/front.mp4``..., and the rig that they should lead to, with the sample's world."""
    balancing.copy_files(sample, work)
    balancing.write_rigs(work)
    cameras = []
    for camera in load_rig(work / "rig_refined.yaml"):
        lens = camera.model.resized(camera.model.width // 2, camera.model.height // 2)
        cameras.append(Camera(PHONES[camera.name], lens, camera.T_world_cam, str(work / f"videos/{camera.name}.mp4")))
    rng = np.random.default_rng(4)
    n = np.arange(round(0.03 * SOUND_HZ))
    claps = [rng.normal(size=len(n)) * np.exp(-n / (0.004 * SOUND_HZ)) for _ in range(3)]
    for name in ("board", "walk"):
        (folder / name).mkdir(parents=True)
    for camera in cameras:
        size = camera.model.width, camera.model.height
        late_s = BOARD_LATE_S[camera.name]
        shown = (_board_seen(camera, late_s + i / BOARD_HZ) for i in range(round((BOARD_S - late_s) * BOARD_HZ)))
        sound = _sound(camera, BOARD_CLAPS_S, claps, late_s, BOARD_S - late_s, rng)
        write_video(folder / f"board/{camera.name}.mp4", shown, BOARD_HZ, sound, size)
        skipped = LATE_IMAGES[camera.name]
        sound = _sound(camera, CLAPS_S, claps, skipped / RATE_HZ, (100 - skipped) / RATE_HZ, rng)
        write_video(folder / f"walk/{camera.name}.mp4", _man_seen(camera, skipped, size), RATE_HZ, sound, size)
    return CameraRig(tuple(cameras))


def _man_seen(camera: Camera, first: int, size: tuple[int, int]):
    capture = cv2.VideoCapture(camera.source)
    for i in range(100):
        ok, image = capture.read()
        assert ok
        if i >= first:
            yield cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    capture.release()


def _pose(seconds: float) -> np.ndarray:
    """T_world_board of a board that is carried about before all phones, turned to one after the other, leaning back."""
    place = PLACE + np.array([0.9 * np.sin(1.1 * seconds), 0.7 * np.cos(0.9 * seconds), 0.45 * np.sin(2.1 * seconds)])
    turn = so3.exp([0.0, 0.0, 1.6 * seconds]) @ so3.exp([0.0, 0.8 + 0.35 * np.sin(1.7 * seconds), 0.0])
    return se3.from_rotation_translation(turn @ so3.exp([0.0, 0.0, 0.7 * np.sin(0.8 * seconds)]), place)


def _board_seen(camera: Camera, seconds: float) -> np.ndarray:
    """(h, w, 3): the board before gray, or gray where its back is seen; the sample's lenses distort less than 0.1 px."""
    lens, T = camera.model, camera.T_cam_world @ _pose(seconds)
    rng = np.random.default_rng(round(1000 * seconds))
    noise = rng.normal(0.0, 1.5, (lens.height, lens.width))
    image = np.full((lens.height, lens.width), 110, np.uint8)
    if T[:3, 2] @ T[:3, 3] < 0.0:
        drawn, edge = face_of(BOARD, _TEXELS / BOARD.square_m), BOARD.square_m / _TEXELS
        height, width = drawn.shape
        to_board = np.array([[edge, 0.0, -edge * (width - 1) / 2], [0.0, -edge, edge * (height - 1) / 2], [0.0, 0.0, 1.0]])
        warp = lens.K @ T[:3, [0, 1, 3]] @ to_board
        soft = cv2.GaussianBlur(drawn, (0, 0), 0.8 * 40 / max(lens.K[0, 0] * BOARD.square_m / T[2, 3], 1.0))
        image = cv2.warpPerspective(soft, warp, (lens.width, lens.height), borderValue=110)
    return cv2.cvtColor(np.clip(image + noise, 0, 255).astype(np.uint8), cv2.COLOR_GRAY2BGR)


def _sound(camera: Camera, at_s, claps, late_s: float, seconds: float, rng) -> np.ndarray:
    track = 0.004 * rng.normal(size=round(seconds * SOUND_HZ))
    way_s = float(np.linalg.norm(camera.center - PLACE)) / SPEED_OF_SOUND
    for clap, when_s in zip(claps, at_s, strict=True):
        first = round((when_s + way_s - late_s) * SOUND_HZ)
        track[first : first + len(clap)] += 0.3 * clap[: len(track) - first]
    return np.clip(track, -1.0, 1.0).astype(np.float32)
