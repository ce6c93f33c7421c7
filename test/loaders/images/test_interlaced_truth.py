"""Fields against a known motion: a disc on a known path through a calibrated camera, filmed line by line as interlaced video is.

The pictures are drawn here, by area coverage, from where the camera projects the disc's middle at the instant of each field.
"""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.errors import SourceError
from tracker_node.loaders.images.source import SourceOptions, open_camera_source
from tracker_node.observation.deinterlace import field_camera, first_line, separate_fields

WIDTH, HEIGHT, N, FIELD_HZ = 128, 96, 6, 50.0
RADIUS_PX, FINE = 9.0, 8


def rig_camera(source: Path | None = None, order: str = "top_first") -> Camera:
    K = np.array([[150.0, 0.0, 62.3], [0.0, 146.0, 49.1], [0.0, 0.0, 1.0]])
    lens = CameraModel(WIDTH, HEIGHT, K, "plumb_bob", np.array([-0.12, 0.03, 0.001, -0.002]))
    return Camera("cam1", lens, np.eye(4), source=str(source), interlaced=order)


def middle_px(camera: Camera, seconds: float) -> np.ndarray:
    """Where the disc's middle is in the image; it goes right and down."""
    point = np.array([-0.45 + 3.4 * seconds, -0.3 + 2.3 * seconds, 2.0])
    return camera.project(point)[0]


def drawn(center: np.ndarray) -> np.ndarray:
    """A bright disc on gray; each pixel the mean of FINE x FINE samples."""
    v, u = np.mgrid[0 : HEIGHT * FINE, 0 : WIDTH * FINE]
    u, v = (u + 0.5) / FINE - 0.5, (v + 0.5) / FINE - 0.5
    inside = (u - center[0]) ** 2 + (v - center[1]) ** 2 < RADIUS_PX**2
    share = inside.reshape(HEIGHT, FINE, WIDTH, FINE).mean(axis=(1, 3))
    return np.repeat((40.0 + 180.0 * share).round().astype(np.uint8)[:, :, None], 3, axis=2)


def centroid(image: np.ndarray) -> np.ndarray:
    weight = image[:, :, 0].astype(float) - 40.0
    weight[np.abs(weight) < 8.0] = 0.0
    v, u = np.mgrid[0 : image.shape[0], 0 : image.shape[1]]
    return np.array([(u * weight).sum(), (v * weight).sum()]) / weight.sum()


@pytest.fixture(params=["top_first", "bottom_first"])
def order(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def folder(tmp_path: Path, order: str) -> Path:
    """Each image has the lines of two instants; written without the code under test."""
    path = tmp_path / "woven"
    path.mkdir()
    first = 0 if order == "top_first" else 1
    for i in range(N):
        image = np.empty((HEIGHT, WIDTH, 3), np.uint8)
        for k in range(2):
            lines = slice((first + k) % 2, None, 2)
            image[lines] = drawn(middle_px(rig_camera(), (2 * i + k) / FIELD_HZ))[lines]
        cv2.imwrite(str(path / f"{i:02}.png"), image)
    return path


@pytest.mark.parametrize("shrink", [1, 2])
def test_every_field_shows_the_disc_where_the_camera_projects_it(folder: Path, order: str, shrink: int):
    """Half a line too high or too low would be 0.5 px, a wrong order 2 px or more."""
    camera = rig_camera(folder, order)
    source = open_camera_source(camera, SourceOptions(rate_hz=FIELD_HZ, shrink=shrink))
    lens = camera.model.resized(source.width, source.height)
    errors = []
    for stamp_ns, image in source:
        point = np.array([-0.45 + 3.4 * stamp_ns * 1e-9, -0.3 + 2.3 * stamp_ns * 1e-9, 2.0])
        errors.append(shrink * (centroid(image) - lens.project(point)[0]))
    assert len(errors) == 2 * N
    assert np.abs(errors).max() < 0.12
    assert np.abs(np.mean(errors, axis=0)).max() < 0.03  # no field is off by a part of a line


def test_the_camera_of_a_field_has_the_offset_of_its_lines(folder: Path, order: str):
    """At half height, nothing interpolated: lines of the second field lie half a line of the field lower."""
    camera = rig_camera(folder, order)
    for i, file in enumerate(sorted(folder.iterdir())):
        for k, field in enumerate(separate_fields(cv2.imread(str(file)), order)):
            seconds = (2 * i + k) / FIELD_HZ
            line = first_line(k, order)
            expected = middle_px(field_camera(camera, line), seconds)
            assert np.abs(centroid(field) - expected).max() < 0.08
            wrong = middle_px(field_camera(camera, 1 - line), seconds)
            assert abs(centroid(field) - wrong)[1] > 0.4


def test_the_other_order_is_refused_by_what_moves(folder: Path, order: str):
    other = {"top_first": "bottom_first", "bottom_first": "top_first"}[order]
    with pytest.raises(SourceError, match=f"marked as {other}, .* back and forth: it is {order}"):
        open_camera_source(rig_camera(folder, other))
