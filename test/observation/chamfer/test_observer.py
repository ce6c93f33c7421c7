"""From image to evidence, and what an observer learns."""

from dataclasses import replace

import numpy as np
import pytest

from tracker_node.errors import CalibrationError
from tracker_node.observation.chamfer.observer import Observer
from tracker_node.tracking.config import BackgroundConfig, ChamferConfig

WIDTH, HEIGHT, REGION = 120, 90, (10, 5, 110, 85)
SIZE = (WIDTH, HEIGHT)
BODY = (slice(25, 70), slice(45, 70))


def empty(rng: np.random.Generator) -> np.ndarray:
    return np.clip(np.array([150, 140, 120]) + rng.normal(0, 3, (HEIGHT, WIDTH, 3)), 0, 255).astype(np.uint8)


def with_body(rng: np.random.Generator, shift: int = 0) -> np.ndarray:
    image = empty(rng)
    image[25:70, 45 + shift : 70 + shift] = (40, 50, 190)
    return image


def labels(shift: int = 0) -> np.ndarray:
    """Part labels on the region."""
    whole = np.zeros((HEIGHT, WIDTH), np.uint8)
    whole[25:70, 45 + shift : 70 + shift] = 1
    return whole[5:85, 10:110]


def iou(a: np.ndarray, b: np.ndarray) -> float:
    return float(((a > 0) & (b > 0)).sum() / ((a > 0) | (b > 0)).sum())


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(2)


@pytest.mark.parametrize(("kind", "has_background"), [("background", True), ("both", True), ("both", False)])
def test_the_body_is_found_where_it_has_moved_to(rng, kind, has_background):
    observer = Observer("c", SIZE, ChamferConfig(silhouette=kind), BackgroundConfig(), empty(rng) if has_background else None)
    observer.begin(with_body(rng), REGION, labels(), 12)
    seen = observer.observe(with_body(rng, 8), REGION, labels())
    assert (seen.camera, seen.region, seen.empty) == ("c", REGION, False)
    assert iou(seen.silhouette, labels(8)) > 0.93
    for map_ in (seen.silhouette_distance, seen.edge_distance):
        assert (map_.shape, map_.dtype) == ((80, 100), np.float32)
    inside = labels(8) > 0
    assert seen.silhouette_distance[inside].max() < 1.5 and seen.silhouette_distance[~inside].min() > -1.5
    u, v = seen.boundary[:, 0], seen.boundary[:, 1]
    outline = np.minimum.reduce([np.abs(u - 42.5), np.abs(u - 67.5), np.abs(v - 19.5), np.abs(v - 64.5)])
    assert len(seen.boundary) > 30 and np.median(outline) < 1.0


def test_an_empty_scene_is_said_to_be_empty(rng):
    observer = Observer("c", SIZE, ChamferConfig(), BackgroundConfig(), [empty(rng) for _ in range(4)])
    observer.begin(with_body(rng), REGION, labels(), 12)
    seen = observer.observe(empty(rng), REGION, labels())
    assert seen.empty and len(seen.boundary) == 0
    assert (seen.silhouette_distance >= ChamferConfig().truncation_px - 1e-3).all()


def test_what_is_beyond_the_reach_is_not_looked_at(rng):
    observer = Observer("c", SIZE, ChamferConfig(reach_px=8), BackgroundConfig(), empty(rng))
    observer.begin(with_body(rng), REGION, labels(), 12)
    image = with_body(rng)
    image[25:70, 95:105] = (40, 50, 190)  # somebody else in the same shirt
    seen = observer.observe(image, REGION, labels())
    assert seen.silhouette[:, 75:].sum() == 0
    assert iou(seen.silhouette, labels()) > 0.93
    cut = observer.observe(with_body(rng, 20), REGION, labels())
    right_end = cut.boundary[cut.boundary[:, 0] > 65.0]
    assert len(right_end) == 0  # where the reach cuts the silhouette there is no boundary


def test_the_refined_boundary_is_nearer_than_the_pixels_are(rng):
    """The body covers six tenths of a column of pixels."""
    background, image = empty(rng), empty(rng).astype(float)
    image[25:70, 45:70] = (40, 50, 190)
    image[25:70, 70] = 0.6 * np.array([40, 50, 190]) + 0.4 * image[25:70, 70]
    image = image.astype(np.uint8)
    zero = []
    for refine in (True, False):
        observer = Observer("c", SIZE, replace(ChamferConfig(), refine_boundary=refine), BackgroundConfig(), background)
        observer.begin(image, REGION, labels(), 12)
        row = observer.observe(image, REGION, labels()).silhouette_distance[30:50].mean(axis=0)
        right = int(np.flatnonzero(row[45:] > 0)[0]) + 45
        zero.append(right - row[right] / (row[right] - row[right - 1]))
    exact = 69.5 + 0.6 - 10.0
    assert abs(zero[0] - exact) < 0.15 < abs(zero[1] - exact)


def test_lessons_do_not_take_the_body_into_the_scene(rng):
    observer = Observer("c", SIZE, ChamferConfig(color_rate=0.3), BackgroundConfig(learning_rate=0.3), empty(rng))
    observer.begin(with_body(rng), REGION, labels(), 12)
    for _ in range(40):  # a body that stands still
        observer.learn(with_body(rng), REGION, labels())
    assert iou(observer.observe(with_body(rng), REGION, labels()).silhouette, labels()) > 0.97


def test_mistakes_are_named():
    with pytest.raises(CalibrationError, match="camera 'c': expected a background image of 120x90, got 60x45"):
        Observer("c", SIZE, ChamferConfig(), BackgroundConfig(), np.zeros((45, 60, 3), np.uint8))
    with pytest.raises(CalibrationError, match="needs an image of the empty scene"):
        Observer("c", SIZE, ChamferConfig(silhouette="background"), BackgroundConfig())
