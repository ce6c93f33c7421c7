"""Fields of interlaced images: there and back, what is interpolated, and what is refused."""

import cv2
import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.errors import SourceError
from tracker_node.observation import deinterlace as di

RNG = np.random.default_rng(4)
ORDERS = pytest.mark.parametrize("order", di.FIELD_ORDERS)


def clutter(height=144, width=192) -> np.ndarray:
    coarse = np.random.default_rng(8).integers(0, 256, (12, 16, 3), dtype=np.uint8)
    image = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    image[20:100:9, 30:150] = 220  # thin horizontal lines, which look most like a comb
    return image


def instants(n: int, velocity=(5.0, 3.0), noise=3.0, background=None) -> list[np.ndarray]:
    """A bright textured disc that moves (pixels per field) before clutter."""
    background, rng = clutter() if background is None else background, np.random.default_rng(6)
    rows, columns = np.mgrid[: background.shape[0], : background.shape[1]]
    result = []
    for k in range(n):
        u, v = 50.0 + velocity[0] * k, 60.0 + velocity[1] * k
        cover = np.clip(26.0 - np.hypot(columns - u, rows - v), 0.0, 1.0)[:, :, None]
        disc = np.array([20.0, 200.0, 240.0]) + 10.0 * np.sin(0.3 * (columns - u))[:, :, None]
        image = (1.0 - cover) * background + cover * disc + noise * rng.standard_normal(background.shape)
        result.append(np.clip(image, 0, 255).astype(np.uint8))
    return result


def woven(fields: list[np.ndarray], order="top_first") -> list[np.ndarray]:
    images = []
    for earlier, later in zip(fields[::2], fields[1::2], strict=True):
        images.append(di.weave_fields(earlier[di.first_line(0, order) :: 2], later[di.first_line(1, order) :: 2], order))
    return images


@ORDERS
def test_separating_undoes_weaving(order):
    fields = [RNG.integers(0, 256, (6, 5, 3), dtype=np.uint8) for _ in range(2)]
    image = di.weave_fields(*fields, order)
    for got, expected in zip(di.separate_fields(image, order), fields, strict=True):
        np.testing.assert_array_equal(got, expected)
    assert (image[0] == fields[0 if order == "top_first" else 1][0]).all()


@ORDERS
def test_lines_of_the_field_stay_and_a_vertical_ramp_is_restored(order):
    """What is linear from top to bottom is interpolated exactly, so the result must not be shifted by a line or half of one."""
    image = np.broadcast_to(4 * np.arange(20, dtype=np.uint8)[:, None, None], (20, 7, 3))
    for k, restored in enumerate(di.deinterlace(image, order)):
        line = di.first_line(k, order)
        np.testing.assert_array_equal(restored[line::2], image[line::2])
        np.testing.assert_array_equal(restored[1:-1], image[1:-1])
        np.testing.assert_array_equal(restored[0 if line else -1], image[1 if line else -2])


def test_the_mean_of_lines_does_not_overflow_and_is_rounded():
    field = np.array([[[255]], [[254]]], dtype=np.uint8)
    assert di.interpolate_lines(field, 0).ravel().tolist() == [255, 255, 254, 254]
    assert di.interpolate_lines(field, 1).ravel().tolist() == [255, 255, 255, 254]


def test_each_field_shows_its_own_instant():
    background = np.full((144, 192, 3), 40, np.uint8)
    fields = instants(2, noise=0.0, background=background)
    for restored, true in zip(di.deinterlace(woven(fields)[0]), fields, strict=True):
        inside = true[:, :, 2] > 200
        assert (restored[inside][:, 2] > 120).mean() > 0.99


@pytest.mark.parametrize("line", [0, 1])
def test_the_lens_of_a_field_sees_points_in_the_fields_own_lines(line):
    camera = circle_rig().cameras[0]
    points = RNG.uniform([-0.5, -0.5, 0.5], [0.5, 0.5, 1.5], (30, 3))
    full, _ = camera.project(points)
    field, _ = di.field_camera(camera, line).project(points)
    np.testing.assert_allclose(field[:, 0], full[:, 0])
    np.testing.assert_allclose(2.0 * field[:, 1] + line, full[:, 1])
    assert di.field_camera(camera, line).model.height == camera.model.height // 2


@pytest.mark.parametrize("velocity", [(5.0, 3.0), (3.0, 0.0), (0.0, 5.0), (-9.0, 6.0)])
@pytest.mark.parametrize("noise", [0.0, 4.0])
def test_comb_tells_interlaced_from_progressive(velocity, noise):
    fields = instants(8, velocity, noise)
    interlaced, progressive = di.comb_ratio(woven(fields)), di.comb_ratio(fields[::2])
    assert progressive < 0.98 < 1.2 < interlaced


def test_progressive_video_marked_as_interlaced_is_refused_by_name():
    with pytest.raises(SourceError, match=r"'cam01.mp4': marked as interlaced, .*no comb .*progressive"):
        di.check_interlaced(instants(4), "cam01.mp4")
    di.check_interlaced(woven(instants(8)), "cam01.mp4")


def test_video_that_was_interpolated_already_is_refused_too():
    fields = [interpolated for image in woven(instants(8)) for interpolated in di.deinterlace(image)]
    with pytest.raises(SourceError):
        di.check_interlaced(fields[::2], "cam01.mp4")


def test_a_scene_without_motion_cannot_tell_and_passes():
    still = instants(6, velocity=(0.0, 0.0))
    assert di.comb_ratio(still) is None
    di.check_interlaced(still, "cam01.mp4")


def test_misuse_says_what_was_expected():
    with pytest.raises(ValueError, match="even number of lines, got 5"):
        di.separate_fields(np.zeros((5, 4, 3), np.uint8))
    with pytest.raises(ValueError, match="field order"):
        di.first_line(0, "upper")
