"""What a calibration from a board tells: tables in the digits of their units, and images of where corners were seen."""

import numpy as np
import pytest

from tracker_node.calibration.board.board import BoardView
from tracker_node.calibration.board.intrinsics import LensCalibration
from tracker_node.calibration.board.report import (
    coverage_image,
    lens_images,
    lens_table,
    outlier_table,
    write_images,
)
from tracker_node.calibration.board.views import CameraViews
from tracker_node.camera.model import CameraModel
from tracker_node.report.html import PageSection, text_table

LENS = CameraModel(
    1280, 960, np.array([[1000.126, 0.0, 639.5], [0.0, 1001.0, 479.5], [0.0, 0.0, 1.0]]), "plumb_bob",
    np.array([-0.123456, 0.05, 0.001, -0.002, 0.0]),
)  # fmt: skip


def seen(image=None, size=(1280, 960)):
    return CameraViews(size, (), 0, 0, image=image) if image is not None else CameraViews(size, (), 0, 0)


def test_lenses_have_two_digits_in_pixels_and_five_of_coefficients():
    table = lens_table("a", LENS, np.array([0.126, 0.2, 0.3, 0.4, 0.0012345, 1e-3, 1e-4, 1e-4, 0.0]))
    assert table.title == "Lens of a (plumb_bob)"
    rows = table.table[1:]
    assert rows[0] == ("fx", "1000.13", "0.13")
    assert rows[3] == ("cy", "479.50", "0.40")
    assert rows[4][1:] == ("-0.12346", "0.00123")
    assert len(rows) == 9


def test_views_left_out_are_told_by_camera_image_and_corners():
    view = BoardView(0, np.arange(3), np.zeros((3, 2)), 2.0, 17)
    assert outlier_table([("a", view)]).table[1:] == (("a", "17", "3"),)


def test_columns_of_a_table_are_aligned():
    table = PageSection("T", table=(("camera", "n"), ("a", "100"), ("long name", "2")))
    assert text_table(table.table).split("\n") == ["camera       n", "a          100", "long name    2"]


def test_corners_lie_where_they_were_seen_in_half_the_pixels():
    """The camera has 1280 columns, the image of coverage 640; pixel centers are whole numbers."""
    image = coverage_image(seen(), np.array([[100.5, 200.5], [1000.5, 800.5]]), np.array([[0.0, 0.0], [0.0, 3.0]]))
    assert image.shape == (480, 640, 3)
    assert image[100, 50].tolist() == [90, 220, 90]  # fits
    assert image[400, 500].tolist() == [60, 60, 255]  # off by a pixel or more
    assert image[10, 10].tolist() == [40, 40, 40]
    changed = np.argwhere((image != 40).any(axis=2))
    assert np.abs(changed - [100, 50]).max(axis=1).min() == 0
    assert (np.abs(changed - [100, 50]).max(axis=1) <= 3).sum() == (np.abs(changed - [400, 500]).max(axis=1) <= 3).sum()


def test_colors_are_between_by_the_size_of_the_residual():
    image = coverage_image(seen(), np.array([[100.5, 200.5]]), np.array([[0.3, 0.4]]))
    np.testing.assert_allclose(image[100, 50], [75, 140, 172.5], atol=1.0)


def test_the_image_is_darkened_beneath():
    image = coverage_image(seen(np.full((960, 1280, 3), 200, np.uint8)), np.zeros((0, 2)), np.zeros((0, 2)))
    assert image.shape == (480, 640, 3)
    assert np.all(image == 90)


def test_captions_count_corners_and_the_share_of_the_image(tmp_path):
    """Cells of 160 pixels: eight by six; two of them have corners."""
    views = tuple(BoardView(i, np.arange(2), np.array([[10.0, 10.0], [20.0, 20.0]]) + 500.0 * i, 2.0, i) for i in range(2))
    found = {"a": LensCalibration(LENS, np.zeros(9), views, (), (np.zeros((2, 2)),) * 2)}
    images = lens_images(found, {"a": seen()})
    assert images[0].text.startswith("a: 4 corners, 4 % of the image covered")
    (path,) = write_images(tmp_path / "new", ["a"], images)
    assert path == tmp_path / "new/coverage_a.png"
    assert path.exists()


@pytest.mark.parametrize("width", [320, 641])
def test_pictures_are_640_wide_whatever_the_image(width):
    assert coverage_image(seen(size=(width, 300)), np.zeros((0, 2)), np.zeros((0, 2))).shape == (
        round(640 / width * 300),
        640,
        3,
    )
