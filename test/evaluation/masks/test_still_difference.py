"""Silhouettes by difference to a still: a body that is drawn, and each thing that must not count as one."""

import numpy as np
import pytest

from tracker_node.evaluation.masks import reference as module
from tracker_node.evaluation.masks.reference import StillDifference, channel_gains, still_difference_mask

T = StillDifference()


def scene(level=120, height=240, width=320):
    return np.full((height, width, 3), level, np.uint8)


def with_box(still, rows, columns, color=(230, 60, 60)):
    image = still.copy()
    image[slice(*rows), slice(*columns)] = color
    return image


def share(mask, rows, columns):
    """Of the box that is in the mask."""
    return (mask[slice(*rows), slice(*columns)] > 0).mean()


def test_a_body_is_found_to_a_few_pixels_and_nothing_else():
    mask = still_difference_mask(with_box(scene(), (60, 160), (100, 180)), scene())
    assert mask.shape == (240, 320) and mask.dtype == np.uint8 and set(np.unique(mask)) == {0, 255}
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    edges = [rows[0], rows[-1] + 1, columns[0], columns[-1] + 1]
    assert edges == pytest.approx([60, 160, 100, 180], abs=2)
    assert share(mask, (66, 154), (106, 174)) == 1.0


def test_what_comes_off_the_outline_is_asked_for():
    image = with_box(scene(), (60, 160), (100, 180))
    widths = []
    for trimmed in (0, 2, 6):
        mask = still_difference_mask(image, scene(), StillDifference(trimmed_px=trimmed))
        widths.append(int((mask[110] > 0).sum()))
    assert widths[0] - widths[1] == 4 and widths[1] - widths[2] == 8


def test_an_empty_scene_has_no_body_and_other_shapes_are_refused():
    assert not still_difference_mask(scene(), scene()).any()
    with pytest.raises(ValueError, match=r"expected images of one shape, got \(240, 320, 3\) and \(120, 320, 3\)"):
        still_difference_mask(scene(), scene(height=120))


def test_what_lies_along_the_border_is_not_the_body():
    image = with_box(with_box(scene(), (0, 240), (0, 40)), (90, 150), (150, 200))
    mask = still_difference_mask(image, scene())
    assert share(mask, (0, 240), (0, 45)) == 0.0 and share(mask, (95, 145), (155, 195)) == 1.0
    # A hand may reach the border: along it for less than ``border_px``.
    mask = still_difference_mask(with_box(scene(), (90, 150), (0, 120)), scene())
    assert share(mask, (95, 145), (5, 115)) == 1.0


def test_the_largest_of_two_bodies_counts_and_pieces_nearby_are_of_it():
    image = with_box(with_box(scene(), (40, 200), (30, 80)), (100, 140), (230, 270))
    mask = still_difference_mask(image, scene())
    assert share(mask, (45, 195), (35, 75)) == 1.0 and share(mask, (90, 150), (220, 280)) == 0.0
    near = with_box(with_box(scene(), (40, 110), (100, 150)), (128, 180), (100, 150))
    mask = still_difference_mask(near, scene())
    assert share(mask, (45, 105), (105, 145)) == 1.0 and share(mask, (133, 175), (105, 145)) == 1.0
    assert share(mask, (115, 123), (105, 145)) == 0.0  # the space between them stays out


def test_a_light_that_has_changed_is_no_difference():
    dimmer = scene(100)
    assert channel_gains(scene(100), scene(120)) == pytest.approx([100 / 120] * 3)
    mask = still_difference_mask(with_box(dimmer, (60, 160), (100, 180)), scene(120))
    assert share(mask, (66, 154), (106, 174)) == 1.0
    assert share(mask, (0, 50), (0, 320)) == 0.0


def test_gains_are_those_of_each_channel_where_nothing_is_dark_or_burnt_out():
    still, image = scene(100), scene()
    image[..., 0], image[..., 1], image[..., 2] = 50, 100, 150
    gains = channel_gains(image, still)
    assert gains.dtype == np.float32 and gains.tolist() == [0.5, 1.0, 1.5]
    still[:, :200], image[:, :200] = 20, 80  # too dark to tell, and most of the image
    assert channel_gains(image, still).tolist() == [0.5, 1.0, 1.5]
    still[:, :200], image[:, :200] = 235, 100
    assert channel_gains(image, still).tolist() == [0.5, 1.0, 1.5]
    still[:, :200], image[:, :200] = 100, 235
    assert channel_gains(image, still).tolist() == [0.5, 1.0, 1.5]
    still[:, :200], image[:, :200] = (100, 100, 20), 90  # one channel is enough
    assert channel_gains(image, still).tolist() == [0.5, 1.0, 1.5]
    still[:, :200], image[:, :200] = 21, 42
    assert channel_gains(image, still).tolist() == [2.0, 2.0, 2.0]
    assert channel_gains(image, scene(10)).tolist() == [1.0, 1.0, 1.0]


@pytest.mark.parametrize(
    ("level", "found"),
    [
        ((120, 120, 120), False),
        ((95, 95, 95), False),  # darker in the same color: a shadow
        ((65, 65, 65), True),  # deeper than a shadow
        ((190, 190, 190), True),  # brighter is no shadow
        ((60, 100, 100), True),  # of another color
        ((140, 140, 140), False),  # above the threshold, but nowhere above the one that a body needs
    ],
)
def test_what_counts_as_a_body(level, found):
    mask = still_difference_mask(with_box(scene(), (60, 160), (100, 180), level), scene())
    assert bool(share(mask, (66, 154), (106, 174)) == 1.0) == found == bool(mask.any())


def pixel(value):
    return np.full((1, 1, 3), value, np.float32)


def test_a_shadow_is_a_little_darker_in_the_same_color():
    still = pixel(110)
    assert module._is_shadow(pixel(80), still, T)[0, 0]
    assert not module._is_shadow(pixel(65), still, T)[0, 0]  # 45 levels are too deep
    assert module._is_shadow(pixel(66), still, T)[0, 0]
    assert not module._is_shadow(pixel(110), still, T)[0, 0]
    assert not module._is_shadow(pixel((80, 80, 110)), still, T)[0, 0]
    assert not module._is_shadow(pixel((80, 80, 97)), still, T)[0, 0]  # ratios 90/120 and 107/120
    assert module._is_shadow(pixel((80, 80, 96)), still, T)[0, 0]
    assert not module._is_shadow(pixel(4), pixel(30), T)[0, 0]  # 14 of 40 is below 0.4
    assert module._is_shadow(pixel(7), pixel(30), T)[0, 0]


def test_the_threshold_rises_with_the_brightness_of_the_still():
    found = module._Difference(scene(150), scene(100), np.ones(3, np.float32), T)
    assert found.absolute[50, 50] == pytest.approx(50) and found.brightness[50, 50] == pytest.approx(150)
    assert found.relative[50, 50] == pytest.approx(50 / 16)
    found = module._Difference(scene(150), scene(100), np.array([1.0, 1.0, 2.0], np.float32), T)
    assert found.absolute[50, 50] == pytest.approx(50) and found.relative[50, 50] == pytest.approx(50 / 22)


def test_parts_with_a_seed_stay_whole():
    mask = np.zeros((9, 9), np.uint8)
    mask[1:3, 1:8] = mask[6:8, 1:8] = 1
    seeds = np.zeros((9, 9), bool)
    seeds[1, 1] = seeds[4, 4] = True
    kept = module._parts_with(mask, seeds)
    assert (kept[1:3, 1:8] == 255).all() and kept.sum() == 255 * 14


def test_the_box_has_its_margin_within_the_image():
    mask = np.zeros((100, 200), np.uint8)
    mask[50:60, 5:30] = 255
    assert module._box(mask, 10) == (slice(40, 70), slice(0, 40))
    assert module._box(mask, 60) == (slice(0, 120), slice(0, 90))


@pytest.mark.parametrize("side", ["top", "bottom", "left", "right"])
def test_every_side_of_the_image_is_border(side):
    mask = np.zeros((40, 40), np.uint8)
    strip = {"top": np.s_[:3, 5:35], "bottom": np.s_[-3:, 5:35], "left": np.s_[5:35, :3], "right": np.s_[5:35, -3:]}[side]
    mask[strip] = 1
    mask[18:21, 18:21] = 1
    assert module._largest_inner_part(mask, 29, 1).sum() == 255 * 9
    kept = module._largest_inner_part(mask, 31, 1)
    assert (kept[strip] == 255).all() and kept.sum() == 255 * 90
    assert not module._largest_inner_part(np.zeros((9, 9), np.uint8), 3, 1).any()


def test_what_is_enclosed_cannot_be_reached_from_beyond_the_image():
    mask = np.zeros((12, 12), np.uint8)
    mask[2:10, 2:10] = 255
    mask[4:6, 4:6] = 0
    mask[7, 7:12] = 0
    inside = module._enclosed(mask)
    assert inside.sum() == 4 and inside[4:6, 4:6].all()


def with_hole(level, image_level=None):
    """A body with a hole of 40 x 40 px in which the image is as dark as the still, or nearly."""
    still = scene(120)
    still[90:130, 120:160] = level
    image = with_box(still, (60, 160), (90, 190))
    image[90:130, 120:160] = level if image_level is None else image_level
    return still_difference_mask(image, still), np.s_[95:125, 125:155]


def test_holes_are_filled_where_they_are_black_or_small():
    mask, hole = with_hole(120)
    assert not mask[hole].any()
    mask, hole = with_hole(20, 12)  # black before black: 8 levels of a threshold of 11.2
    assert (mask[hole] == 255).all()
    mask, hole = with_hole(20, 18)
    assert not mask[hole].any()
    still = scene()
    image = with_box(still, (60, 160), (90, 190))
    image[100:120, 130:150] = 120
    assert (still_difference_mask(image, still)[62:158, 92:188] == 255).all()  # 20 x 20 px is no hole
