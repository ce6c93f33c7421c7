#!/usr/bin/env python3
"""How long the pixel work of one camera takes: rendering the body, and turning an image into evidence.

The image is 640x480 and shows a person on a fifth of it; evidence is computed in that region only. Every figure is in
milliseconds on one thread (median and 95th percentile), as a multiple of the fixed reference kernel, and with the speed-up
that two threads give which do the same thing at once. OpenCV's distance transforms stand beside ours for comparison.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.observation.appearance import ColorModel, SceneModel, body_log_odds
from tracker_node.observation.chamfer.boundary import edge_distance
from tracker_node.observation.chamfer.distance_transform import distance_to, signed_distance
from tracker_node.observation.chamfer.observer import Observer
from tracker_node.observation.image_set import CameraImage
from tracker_node.observation.synchronizer import ImageSynchronizer
from tracker_node.render.overlay import draw_overlay
from tracker_node.render.raycast.raycaster import render_mask, render_view
from tracker_node.report.metrics_file import report_metrics
from tracker_node.tracking.config import BackgroundConfig, ChamferConfig

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the repository

from benchmark._arguments import parser_of
from benchmark._reference import reference_ms

MARGIN_PX = 24
WARM_UP = 3


@dataclass(frozen=True, eq=False)
class Scene:
    """A person in front of a plate, as one camera sees it."""

    configuration: Configuration
    camera: Camera
    plate: np.ndarray
    image: np.ndarray
    region: tuple[int, int, int, int]
    mask: np.ndarray  # of the whole image


def make_camera(width: int, height: int, focal_px: float) -> Camera:
    """A camera 3 m in front of the origin, at the height of the hips, with a little distortion."""
    K = np.array([[focal_px, 0.0, 0.5 * width], [0.0, focal_px, 0.5 * height], [0.0, 0.0, 1.0]])
    lens = CameraModel(width, height, K, "plumb_bob", np.array([-0.1, 0.02, 0.0, 0.0, 0.0]))
    T_world_cam = np.eye(4)
    T_world_cam[:3, :3] = [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    T_world_cam[:3, 3] = 3.0, 0.0, 0.0
    return Camera("camera", lens, T_world_cam)


def make_scene(seed: int = 0) -> Scene:
    """The human with spread limbs before a smooth random plate; the body is a texture of its own."""
    rng = np.random.default_rng(seed)
    model = human_model()
    state = State.neutral(model)
    angles = state.joint_positions + rng.uniform(-0.35, 0.35, len(state.joint_positions))
    limits = model.chain.lower, model.chain.upper
    configuration = Configuration(model, State(state.T_world_root, np.clip(angles, *limits)))
    camera = make_camera(640, 480, 600.0)
    mask = render_mask(configuration, camera)
    plate, body = (_texture(rng, mask.shape, sigma) for sigma in (9.0, 4.0))
    noise = rng.normal(0.0, 3.0, plate.shape)
    image = np.clip(np.where(mask[..., None] > 0, body, plate) + noise, 0, 255).astype(np.uint8)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    u0, v0 = max(0, columns[0] - MARGIN_PX), max(0, rows[0] - MARGIN_PX)
    u1, v1 = min(640, columns[-1] + 1 + MARGIN_PX), min(480, rows[-1] + 1 + MARGIN_PX)
    return Scene(configuration, camera, plate, image, (int(u0), int(v0), int(u1), int(v1)), mask)


def _texture(rng: np.random.Generator, shape: tuple[int, int], sigma: float) -> np.ndarray:
    smooth = cv2.GaussianBlur(rng.normal(size=(*shape, 3)), (0, 0), sigma)
    return cv2.normalize(smooth, None, 20, 235, cv2.NORM_MINMAX).astype(np.uint8)


def make_cases(scene: Scene) -> dict[str, Callable[[], object]]:
    """Name -> the work to be timed."""
    configuration, camera, image, region = scene.configuration, scene.camera, scene.image, scene.region
    u0, v0, u1, v1 = region
    part = slice(v0, v1), slice(u0, u1)
    portrait = make_camera(1080, 1920, 2000.0)
    background, chamfer = BackgroundConfig(), ChamferConfig()
    observer = Observer("camera", (camera.model.width, camera.model.height), chamfer, background, scene.plate)
    labels = np.minimum(scene.mask[part], 1)
    observer.begin(image, region, labels, 12)
    observation = observer.observe(image, region, labels)
    silhouette, edges = observation.silhouette, observation.edges
    gray = cv2.cvtColor(image[part], cv2.COLOR_BGR2GRAY)
    colors, model = ColorModel(), SceneModel.from_images([scene.plate])
    colors.learn(image[part], np.minimum(scene.mask[part], 1), scene.mask[part] == 0, 1.0)
    near = cv2.dilate(scene.mask[part], np.ones((25, 25), np.uint8))

    return {
        "render_mask": lambda: render_mask(configuration, camera),
        "render_mask_1080x1920": lambda: render_mask(configuration, portrait),
        "render_view": lambda: render_view(configuration, camera),
        "draw_overlay": lambda: draw_overlay(image, configuration, camera),
        "appearance_log_odds": lambda: body_log_odds(image, region, model, colors),
        "appearance_update_scene": lambda: model.update(image, near, 0.05, region),
        "appearance_learn_colors": lambda: colors.learn(image[part], scene.mask[part] // 255, near == 0, 0.05),
        "edge_distance": lambda: edge_distance(gray, silhouette, chamfer.canny_low, chamfer.canny_high, chamfer.truncation_px),
        "distance_to_16px": lambda: distance_to(edges, 16.0),
        "distance_to_40px": lambda: distance_to(edges, 40.0),
        "distance_to_cv2_exact": lambda: cv2.distanceTransform(255 - edges, cv2.DIST_L2, cv2.DIST_MASK_PRECISE),
        "distance_to_cv2_approximate": lambda: cv2.distanceTransform(255 - edges, cv2.DIST_L2, 5),
        "signed_distance_16px": lambda: signed_distance(silhouette, 16.0),
        "signed_distance_40px": lambda: signed_distance(silhouette, 40.0),
        "observe": lambda: observer.observe(image, region, labels),
        "learn": lambda: observer.learn(image, region, labels),
        "synchronize_six_images": synchronizing(),
    }


def synchronizing(n_cameras: int = 6, period_ns: int = 33_333_333) -> Callable[[], object]:
    """Putting one image of each camera into a synchronizer, again and again."""
    names = tuple(f"cam{i}" for i in range(n_cameras))
    synchronizer = ImageSynchronizer(names, image_period_s=period_ns * 1e-9, tolerance=0.4, queue_s=1.0)
    pixels = np.zeros((2, 2, 3), dtype=np.uint8)
    instant = iter(range(10**12))

    def add_all():
        stamp = next(instant) * period_ns
        for name in names:
            synchronizer.add(CameraImage(name, stamp, pixels))

    return add_all


def times_ms(work: Callable[[], object], seconds: float) -> np.ndarray:
    """Duration of every call, for about so many seconds, ten calls at least."""
    times: list[float] = []
    end = time.perf_counter() + seconds
    while len(times) < 10 or time.perf_counter() < end:
        start = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - start))
    return np.array(times)


def two_thread_speedup(work: Callable[[], object], pool: ThreadPoolExecutor, count: int) -> float:
    """How much sooner 2 x ``count`` calls are done by two threads than by one; 2 is perfect."""

    def repeat(times: int) -> None:
        for _ in range(times):
            work()

    start = time.perf_counter()
    repeat(2 * count)
    middle = time.perf_counter()
    for done in [pool.submit(repeat, count) for _ in range(2)]:
        done.result()
    return (middle - start) / (time.perf_counter() - middle)


def measure(seconds: float, threads: bool = True) -> dict[str, float]:
    """All figures."""
    cv2.setNumThreads(1)  # threads are ours: one a camera
    scene = make_scene()
    u0, v0, u1, v1 = scene.region
    reference = reference_ms()
    metrics = {
        "kernels.reference_ms": reference,
        "kernels.region_share": (u1 - u0) * (v1 - v0) / scene.mask.size,
        "kernels.body_share": float((scene.mask > 0).mean()),
    }
    with ThreadPoolExecutor(2) as pool:
        for name, work in make_cases(scene).items():
            for _ in range(WARM_UP):
                work()
            times = times_ms(work, seconds)
            key = f"kernels.{name}"
            metrics[f"{key}.ms_p50"], metrics[f"{key}.ms_p95"] = np.percentile(times, [50, 95]).tolist()
            metrics[f"{key}.per_reference"] = metrics[f"{key}.ms_p50"] / reference
            if threads and name != "synchronize_six_images":  # one synchronizer is for one thread
                metrics[f"{key}.two_thread_speedup"] = two_thread_speedup(work, pool, len(times))
    return metrics


def main(arguments: list[str] | None = None) -> int:
    parser = parser_of(
        __doc__,
        "python benchmark/kernels.py --quick --json out/kernels.json",
        "a tenth of a second for each figure instead of one",
    )
    args = parser.parse_args(arguments)
    metrics = measure(0.1 if args.quick else 1.0)
    report_metrics(metrics, args.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
