"""Boards before cameras without distortion, warped by OpenCV: films of them as files, and images of one that lies still."""

from pathlib import Path

import cv2
import numpy as np

from helpers.cameras.board_scenes import face_of
from tracker_node.calibration.board.board import Board
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.geometry import se3, so3
from tracker_node.synthesis.scenes.scene import looking_at

CARRIED, HELD, LYING = Board("charuco", 7, 5, 0.08), Board("chessboard", 9, 6, 0.03), Board("charuco", 4, 5, 0.054)
WIDTH, HEIGHT, RATE_HZ = 480, 300, 10.0
_TEXELS = 40  # of a square's edge


def rig() -> CameraRig:
    """Three cameras side by side that look at a place one meter before them."""
    lens = CameraModel(WIDTH, HEIGHT, np.array([[340.0, 0.0, 240.0], [0.0, 340.0, 149.0], [0.0, 0.0, 1.0]]))
    centers = np.array([[-0.35, 0.0, 0.0], [0.0, -0.05, 0.15], [0.35, 0.0, -0.05]])
    return CameraRig(
        tuple(Camera(f"cam{i:02}", lens, looking_at(center, np.array([0.0, 0.9, 0.0]))) for i, center in enumerate(centers, 1))
    )


def pose(seconds: float, distance_m: float = 0.9) -> np.ndarray:
    """T_world_board of a board that is carried about before the cameras, and turned; it looks back at them."""
    place = [0.2 * np.sin(1.3 * seconds), 1.0 + 0.2 * np.sin(0.9 * seconds), 0.11 * np.cos(1.7 * seconds)]
    facing = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    lean = so3.exp([0.5 * np.sin(1.9 * seconds), 0.5 * np.cos(1.1 * seconds), 0.4 * np.sin(0.7 * seconds)])
    return se3.from_rotation_translation(facing @ lean, distance_m * np.array(place))


def image_of(camera: Camera, board: Board, T_world_board: np.ndarray, seed: int = 0) -> np.ndarray:
    """(h, w) uint8: the board, with a white border of one square, before gray."""
    drawn = face_of(board, _TEXELS / board.square_m)
    height, width = drawn.shape
    edge = board.square_m / _TEXELS
    # The middle of the face is the board's origin; its rows go down
    texel_to_board = np.array([[edge, 0.0, -edge * (width - 1) / 2], [0.0, -edge, edge * (height - 1) / 2], [0.0, 0.0, 1.0]])
    T = camera.T_cam_world @ T_world_board
    texel_to_pixel = camera.model.K @ T[:3, [0, 1, 3]] @ texel_to_board
    image = cv2.warpPerspective(cv2.GaussianBlur(drawn, (0, 0), 0.8), texel_to_pixel, (WIDTH, HEIGHT), borderValue=110)
    return np.clip(image + np.random.default_rng(seed).normal(0.0, 1.5, image.shape), 0, 255).astype(np.uint8)


def write_film(path: Path, camera: Camera, board: Board, poses: list[np.ndarray]) -> None:
    """A video of the board in these poses."""
    path.parent.mkdir(parents=True, exist_ok=True)
    film = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), RATE_HZ, (WIDTH, HEIGHT))
    for i, T_world_board in enumerate(poses):
        film.write(cv2.cvtColor(image_of(camera, board, T_world_board, i), cv2.COLOR_GRAY2BGR))
    film.release()


def write_films(folder: Path, n_images: int = 30) -> None:
    """``calib/cam01.mp4``...: a board carried before all cameras; ``lens/cam01.mp4``...: another, held near each of them."""
    seconds = np.arange(n_images) / RATE_HZ
    for camera in rig():
        write_film(folder / "calib" / f"{camera.name}.mp4", camera, CARRIED, [pose(t) for t in seconds])
        near = [camera.T_world_cam @ _before_camera() @ pose(t, 0.42) for t in 2.0 * seconds]
        write_film(folder / "lens" / f"{camera.name}.mp4", camera, HELD, near)


def _before_camera() -> np.ndarray:
    """T_cam_world of a camera in the world's origin that looks along y."""
    return se3.inverse(se3.from_rotation_translation(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]), np.zeros(3)))
