"""A board moved about before a ring of cameras: its corners as they are projected, and pictures of it made by OpenCV."""

from collections.abc import Sequence

import cv2
import numpy as np

from tracker_node.calibration.board.board import Board, BoardView
from tracker_node.calibration.board.views import CameraViews
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.geometry import se3, so3
from tracker_node.synthesis.scenes.scene import looking_at

LENSES = {
    "plumb_bob": (-0.12, 0.06, 1e-3, -6e-4, 0.01),
    "rational_polynomial": (0.3, 0.05, 5e-4, -4e-4, 0.01, 0.45, 0.08, 0.01),
    "equidistant": (0.02, -0.01, 0.004, -0.001),
}
WIDTH, HEIGHT = 1280, 800
CHARUCO = Board("charuco", 9, 7, 0.09)
CHESSBOARD = Board("chessboard", 8, 5, 0.1)
PERIOD_S = 0.1


def ring(n: int = 6, models: Sequence[str] = tuple(LENSES)) -> CameraRig:
    """Cameras around a volume of three meters, lenses of several kinds."""
    cameras = []
    for i in range(n):
        angle = 2.0 * np.pi * i / n + 0.1
        center = np.array([3.2 * np.cos(angle), 3.2 * np.sin(angle), 1.2 + 0.25 * (i % 3)])
        kind = models[i % len(models)]
        K = np.array([[900.0 + 15 * i, 0.0, 636.0 + 3 * i], [0.0, 902.0 + 15 * i, 402.0 - 4 * i], [0.0, 0.0, 1.0]])
        model = CameraModel(WIDTH, HEIGHT, K, kind, np.array(LENSES.get(kind, ())))
        cameras.append(Camera(f"cam{i + 1}", model, looking_at(center, np.array([0.0, 0.0, 1.0]))))
    return CameraRig(tuple(cameras))


def board_pose(seconds: float) -> np.ndarray:
    """T_world_board of a board carried about and turned; it faces up and to all sides in turn."""
    place = [1.7 * np.sin(0.37 * seconds), 1.7 * np.cos(0.23 * seconds), 1.1 + 0.6 * np.sin(0.71 * seconds)]
    heading, lean = 0.8 * seconds, 0.75 + 0.35 * np.sin(1.1 * seconds)
    R = so3.exp([0.0, 0.0, heading]) @ so3.exp([0.0, lean, 0.0]) @ so3.exp([0.0, 0.0, 0.5 * np.sin(0.7 * seconds)])
    return se3.from_rotation_translation(R, np.array(place))


def view_of(camera: Camera, board: Board, seconds: float, stamp_ns: int, noise_px: float = 0.0, rng=None, image: int = 0):
    """The board's corners at a time, if at least twelve are in the image and their side is seen; else None."""
    T = camera.T_cam_world @ board_pose(seconds)
    if T[:3, 2] @ T[:3, 3] > -0.25 * np.linalg.norm(T[:3, 3]):  # seen from behind, or at a grazing angle
        return None
    pixels, valid = camera.model.project(se3.apply(T, board.corners))
    ids = np.flatnonzero(valid & camera.model.in_image(pixels))
    if len(ids) < 12:
        return None
    noise = noise_px * rng.standard_normal((len(ids), 2)) if rng is not None else 0.0
    return BoardView(stamp_ns, ids, pixels[ids] + noise, 2.0, image)


def corners_seen(
    rig: CameraRig, board: Board = CHARUCO, n: int = 120, noise_px: float = 0.3, seed: int = 0,
    late_s: Sequence[float] | None = None, jitter_s: float = 0.0, period_s: float = PERIOD_S,
) -> dict[str, CameraViews]:  # fmt: skip
    """What every camera sees in ``n`` images; stamps say ``i * period_s``, the images are ``late_s`` later, give or take."""
    rng, seen = np.random.default_rng(seed), {}
    for c, camera in enumerate(rig):
        views = []
        for i in range(n):
            true_s = i * period_s + (late_s[c] if late_s else 0.0) + jitter_s * rng.standard_normal()
            view = view_of(camera, board, true_s, round(1e9 * i * period_s), noise_px, rng, i)
            if view is not None:
                views.append(view)
        seen[camera.name] = CameraViews((camera.model.width, camera.model.height), tuple(views), n)
    return seen


def picture(camera: Camera, board: Board, T_world_board: np.ndarray, noise: float = 2.0, seed: int = 0) -> np.ndarray:
    """(h, w) uint8 of the board with a white border before gray, each pixel of four samples; rays are OpenCV's."""
    texels = 64.0 / board.square_m
    face = face_of(board, texels)
    model, fine = camera.model, 2
    u0, v0, u1, v1 = _region(camera, T_world_board, face.shape, texels)  # a ray of every pixel would take a second
    v, u = np.mgrid[v0 * fine : v1 * fine, u0 * fine : u1 * fine]
    pixels = (np.stack([u.ravel(), v.ravel()], axis=1) + 0.5) / fine - 0.5
    rays = np.column_stack([_normalized(model, pixels), np.ones(len(pixels))])
    T = se3.inverse(camera.T_cam_world @ T_world_board)
    directions, origin = rays @ T[:3, :3].T, T[:3, 3]
    depth = -origin[2] / directions[:, 2]
    at = origin[:2] + depth[:, None] * directions[:, :2]
    # The middle of the face is the board's origin; its rows go down
    x = (at[:, 0] * texels + face.shape[1] / 2.0 - 0.5).reshape(u.shape).astype(np.float32)
    y = (-at[:, 1] * texels + face.shape[0] / 2.0 - 0.5).reshape(u.shape).astype(np.float32)
    drawn = cv2.remap(cv2.GaussianBlur(face, (0, 0), 1.0), x, y, cv2.INTER_LINEAR, borderValue=110)
    drawn = np.where((depth > 0.0).reshape(u.shape), drawn, 110)
    image = np.full((model.height, model.width), 110, dtype=np.uint8)
    image[v0:v1, u0:u1] = cv2.resize(drawn.astype(np.uint8), (u1 - u0, v1 - v0), interpolation=cv2.INTER_AREA)
    dirt = np.random.default_rng(seed).normal(0.0, noise, image.shape)
    return np.clip(image + dirt, 0, 255).astype(np.uint8)


def face_of(board: Board, texels: float) -> np.ndarray:
    """Gray picture of the board with a white border of one square, so many texels a meter."""
    square = round(board.square_m * texels)
    if board.kind == "charuco":
        markers = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
        drawn = cv2.aruco.CharucoBoard((board.columns, board.rows), 1.0, board.marker_ratio, markers)
        face = drawn.generateImage((board.columns * square, board.rows * square))
    else:
        rows, columns = np.mgrid[0 : board.rows + 1, 0 : board.columns + 1]
        checks = np.where((rows + columns) % 2 == 0, 0, 255).astype(np.uint8)
        face = np.kron(checks, np.ones((square, square), dtype=np.uint8))
    face = np.where(face > 127, 220, 25).astype(np.uint8)
    face = cv2.copyMakeBorder(face, *(square,) * 4, cv2.BORDER_CONSTANT, value=220)
    return 245 - face if board.inverted else face


def _region(camera: Camera, T_world_board: np.ndarray, shape: tuple[int, int], texels: float) -> tuple[int, int, int, int]:
    """Pixels (u0, v0, u1, v1) that hold all of the face; the whole image where some of it cannot be projected."""
    y, x = (0.5 * length / texels + 0.01 for length in shape)
    along = np.linspace(-1.0, 1.0, 40)
    rim = [(a * x, b * y, 0.0) for t in along for a, b in ((t, -1.0), (t, 1.0), (-1.0, t), (1.0, t))]
    pixels, valid = camera.project(se3.apply(T_world_board, np.array(rim)))
    width, height = camera.model.width, camera.model.height
    if not valid.all():
        return 0, 0, width, height
    low, high = np.floor(pixels.min(axis=0)).astype(int) - 8, np.ceil(pixels.max(axis=0)).astype(int) + 9
    (u0, v0), (u1, v1) = np.clip(low, 0, (width - 1, height - 1)), np.clip(high, 1, (width, height))
    return int(u0), int(v0), int(u1), int(v1)


def _normalized(model: CameraModel, pixels: np.ndarray) -> np.ndarray:
    if model.distortion_model == "equidistant":
        return cv2.fisheye.undistortPoints(pixels[:, None], model.K, model.distortion)[:, 0]
    coefficients = model.distortion if model.distortion.size else None
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 20, 1e-8)
    return cv2.undistortPoints(pixels[:, None], model.K, coefficients, criteria=criteria)[:, 0]
