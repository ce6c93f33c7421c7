"""Pictures for plates: their size, their colors, their borders, and where a plate lies about its root."""

import numpy as np
import pytest

from tracker_node.calibration.texture import BLACK, GRAY, WHITE, charuco_texture, framed, plate_model

BOARD = (5, 4, 0.02, 0.75, "DICT_4X4_50")


def test_a_board_is_as_large_as_its_squares_and_has_two_grey_levels():
    picture = charuco_texture(*BOARD, False)
    assert picture.shape == (80, 100, 3) and picture.dtype == np.uint8
    assert np.unique(picture).tolist() == [20, 200] == [BLACK, WHITE] and BLACK < GRAY < WHITE
    assert charuco_texture(*BOARD, False, texels_per_m=2000.0).shape == (160, 200, 3)


def test_a_board_begins_with_a_black_square_and_its_inverse_with_a_white_one():
    picture, inverted = charuco_texture(*BOARD, False), charuco_texture(*BOARD, True)
    assert (picture[1:19, 1:19] == 20).all() and (picture[1:2, 21:39] == 200).all()  # the margin beside a marker
    assert np.array_equal(picture.astype(int) + inverted, np.full(picture.shape, 220))


def test_a_marker_has_its_share_of_a_square():
    black = charuco_texture(*BOARD, False)[:20, 20:40, 0] == 20  # a white square with its marker: 15 of 20 texels
    rows, columns = np.flatnonzero(black[:, 2:18].any(axis=1)), np.flatnonzero(black[2:18].any(axis=0))
    assert 14 <= np.ptp(rows) + 1 <= 16 and 14 <= np.ptp(columns) + 1 <= 16


def test_borders_go_from_the_innermost_outward():
    picture = framed(np.full((1, 1, 3), 7, np.uint8), [(1, 2, 3, 4, 50), (1, 0, 0, 0, 90)])
    assert picture.shape == (8, 5, 3)
    assert (picture[:, 0] == 90).all() and (picture[3, 2] == 7).all()
    assert (np.delete(picture[:, 1:].reshape(-1, 3), 3 * 4 + 1, axis=0) == 50).all()


def test_no_borders_change_nothing():
    picture = np.full((2, 3, 3), 7, np.uint8)
    assert framed(picture, []) is picture


def test_a_plate_lies_about_its_root_with_its_face_at_height_zero():
    picture = np.full((20, 40, 3), 7, np.uint8)
    model = plate_model("plate", picture, 100.0, (10.0, 5.0), 0.02)
    (shape,) = model.shapes
    assert shape.primitive.size == pytest.approx((0.4, 0.2, 0.02))
    # The middle is 10 columns to the right of the root, and 5 rows below it
    assert np.allclose(shape.T_link_shape, [[1, 0, 0, 0.1], [0, 1, 0, -0.05], [0, 0, 1, -0.01], [0, 0, 0, 1]])
    assert shape.color_rgb == (20, 20, 20) and model.chain.links == ("plate",) == (shape.link,)
    assert [texture is None for texture in shape.primitive.textures] == [True] * 4 + [False, True]
    assert plate_model("p", picture, 100.0, (0.0, 0.0), 0.02, rim=90).shapes[0].color_rgb == (90, 90, 90)
