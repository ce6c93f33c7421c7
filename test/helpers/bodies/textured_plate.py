"""A plate with a picture on it, filmed by three cameras; OpenCV warps the picture by a homography, no renderer of ours."""

import cv2
import numpy as np

from tracker_node.calibration.texture import plate_model
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.geometry import se3, so3
from tracker_node.model.configuration import State
from tracker_node.observation.image_set import CameraImage, ImageSet

TEXELS_PER_M = 800.0
WIDTH, HEIGHT = 320, 240


def picture(seed: int = 3) -> np.ndarray:
    """(h, w, 3) RGB: patches of random colors, of two sizes."""
    rng = np.random.default_rng(seed)
    coarse = cv2.resize(rng.integers(0, 256, (6, 8, 3)).astype(np.uint8), (240, 180), interpolation=cv2.INTER_NEAREST)
    fine = cv2.resize(rng.integers(0, 256, (18, 24, 3)).astype(np.uint8), (240, 180), interpolation=cv2.INTER_NEAREST)
    return cv2.addWeighted(coarse, 0.6, fine, 0.4, 0.0)


PICTURE = picture()
MODEL = plate_model("plate", PICTURE, TEXELS_PER_M, (120.0, 90.0), 0.01)
TRUE = State(se3.exp([0.02, -0.03, 0.05, 0.2, -0.15, 0.3]), np.zeros(0))


def rig() -> CameraRig:
    """Three cameras above the plate that look at the origin."""
    cameras = []
    for i, place in enumerate(([0.3, -0.5, 0.7], [-0.5, 0.1, 0.7], [0.1, 0.5, 0.8])):
        z = -np.array(place) / np.linalg.norm(place)
        x = np.cross(z, [0.0, 0.0, 1.0])
        x /= np.linalg.norm(x)
        T = se3.from_rotation_translation(np.stack([x, np.cross(z, x), z], axis=1), np.array(place))
        K = np.array([[300.0, 0.0, 160.0], [0.0, 300.0, 120.0], [0.0, 0.0, 1.0]])
        cameras.append(Camera(f"cam{i}", CameraModel(WIDTH, HEIGHT, K), T))
    return CameraRig(tuple(cameras))


def film(state: State | None = TRUE, seed: int = 0, noise: float = 2.0) -> list[np.ndarray]:
    """BGR images over clutter, each camera with a brightness and contrast of its own; None: the plate is not there."""
    rng, images = np.random.default_rng(seed), []
    for camera in rig():
        clutter = cv2.resize(rng.integers(0, 256, (12, 16, 3)).astype(np.uint8), (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)
        image = clutter.astype(np.float64)
        if state is not None:
            T = camera.T_cam_world @ state.T_world_root
            # The center of texel (u, v) lies at ((u + 0.5 - 120) / s, (90 - v - 0.5) / s, 0)
            s = 1.0 / TEXELS_PER_M
            texel_to_plate = np.array([[s, 0.0, (0.5 - 120.0) * s], [0.0, -s, (90.0 - 0.5) * s], [0.0, 0.0, 1.0]])
            H = camera.model.K @ np.stack([T[:3, 0], T[:3, 1], T[:3, 3]], axis=1) @ texel_to_plate
            soft = cv2.GaussianBlur(PICTURE[:, :, ::-1], (0, 0), 1.2)
            warped = cv2.warpPerspective(soft, H, (WIDTH, HEIGHT), flags=cv2.INTER_LINEAR)
            inside = cv2.warpPerspective(np.ones(PICTURE.shape[:2], dtype=np.float32), H, (WIDTH, HEIGHT))[:, :, None]
            seen = warped * rng.uniform(0.4, 0.7, 3) + rng.uniform(5.0, 50.0, 3) * inside
            image = image * (1.0 - inside) + seen
        images.append(np.clip(image + rng.normal(0.0, noise, image.shape), 0, 255).astype(np.uint8))
    return images


def image_set(stamp_ns: int, images: list[np.ndarray]) -> ImageSet:
    """The images of one instant; fewer than there are cameras, or none, for cameras that are silent."""
    return ImageSet(stamp_ns, tuple(CameraImage(c.name, stamp_ns, image) for c, image in zip(rig(), images, strict=False)))


def moved(state: State, meters: float, degrees: float, seed: int = 0) -> State:
    """A state that is so far off in some direction."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(2, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return state.retract(np.concatenate([meters * directions[0], np.deg2rad(degrees) * directions[1]]))


def errors(state: State, truth: State = TRUE) -> tuple[float, float]:
    """Distance (mm) and angle (degrees)."""
    turn = so3.log(state.T_world_root[:3, :3] @ truth.T_world_root[:3, :3].T)
    offset = state.T_world_root[:3, 3] - truth.T_world_root[:3, 3]
    return 1e3 * float(np.linalg.norm(offset)), float(np.rad2deg(np.linalg.norm(turn)))
