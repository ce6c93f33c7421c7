"""Colors by their bins, which images of the past are kept, and what is known of an image without any."""

from types import SimpleNamespace

import numpy as np
import pytest

from tracker_node.tracking.initialization.evidence import StartEvidence, color_bins, color_density, scene_density

CAMERAS = [SimpleNamespace(name="a"), SimpleNamespace(name="b")]
GRAY = np.full((20, 30, 3), 120, np.uint8)


def evidence(backgrounds=()):
    return StartEvidence(CAMERAS, {name: [GRAY] for name in backgrounds})


def test_bins_are_sixteen_levels_wide_and_blue_counts_most():
    pixels = np.array([[[0, 0, 0], [15, 15, 15], [16, 0, 0], [0, 16, 0], [0, 0, 16], [255, 255, 255]]], np.uint8)
    assert color_bins(pixels).tolist() == [[0, 0, 256, 16, 1, 4095]]


def test_densities_are_shares_of_the_weight():
    image = GRAY.copy()
    image[:, 15:] = 200
    weights = np.zeros((20, 30))
    weights[:, 15:] = 0.5
    density, (gray, bright) = color_density(image, weights), color_bins(image)[0, [0, -1]]
    assert density.shape == (4096,) and density.sum() == pytest.approx(1.0) and np.argmax(density) == bright
    assert density[gray] < 1e-6 and not color_density(image, 0.0 * weights).any()


def test_a_scene_s_colors_are_mostly_those_nearby():
    image = GRAY.copy()
    image[:, 15:] = 200
    near = np.zeros((20, 30))
    near[:, 15:] = 1.0
    gray, bright = color_bins(image)[0, [0, -1]]
    found = scene_density(image, near)
    assert found[bright] / found[gray] == pytest.approx(7.0)  # 3/4 + 1/8 against 1/8
    few = np.zeros((20, 30))
    few[0, 29] = 1.0
    whole = scene_density(image, few)  # one pixel says nothing
    assert whole[bright] == pytest.approx(whole[gray])


def test_nine_images_are_kept_the_first_and_the_latest_among_them():
    found = evidence()
    for i in range(30):
        found.watch([np.full((2, 2, 3), i, np.uint8), None])
        assert len(found._past) <= 9 and found._past[0][0][0, 0, 0] == 0 and found.images[0][0, 0, 0] == i
    assert found.watched == 30
    found.reset()
    assert found.watched == 0 and found._past == []


def test_of_the_tenth_image_every_second_between_goes():
    found = evidence()
    for i in range(10):
        found.watch([np.full((2, 2, 3), i, np.uint8), None])
    assert [int(images[0][0, 0, 0]) for images in found._past] == [0, 2, 4, 6, 8, 9]


@pytest.mark.parametrize(
    ("backgrounds", "images", "known"),
    [("ab", (GRAY, GRAY), True), ("a", (GRAY, GRAY), False), ("a", (GRAY, None), True), ("", (None, None), True)],
)
def test_a_scene_is_known_where_every_image_has_its_picture(backgrounds, images, known):
    found = evidence(backgrounds)
    found.watch(images)
    assert found.scene_known is known


def test_what_differs_from_the_empty_scene_speaks_for_a_body():
    image = GRAY.copy()
    image[5:15, 10:20] = 30, 200, 240
    found = evidence("a")
    found.watch([image, image])
    body, nothing = found.maps()
    assert nothing is None  # neither a picture of its scene nor a past
    assert body[10, 15] > 0.0 and body[1, 1] < 0.0 and body.min() >= np.float32(-1.2) and body.dtype == np.float32
    sure, unsure = found.sure()
    assert sure[10, 15] and not sure[1, 1] and unsure is None


def test_what_moves_speaks_for_a_body():
    image = GRAY.copy()
    image[5:15, 10:20] = 30, 200, 240
    found = evidence()
    found.watch([GRAY, None])
    found.watch([image, None])
    moved, none = found.maps()
    assert none is None and moved[10, 15] > 0.0 and moved[1, 28] < 0.0


def test_colors_of_the_body_are_told_from_those_beside_it():
    image = GRAY.copy()
    image[5:15, 10:20] = 30, 200, 240
    inside = np.zeros((20, 30))
    inside[5:15, 10:20] = 1.0
    found = evidence()
    found.watch([image, None])
    found.learn([inside, inside], [1.0 - inside, inside])
    colors = found.colors[0]
    own, beside = color_bins(image)[10, 15], color_bins(image)[1, 1]
    assert colors[own] == 3.0 and colors[beside] < -2.9 and found.colors[1] is None
    found.forget_colors()
    assert found.colors == [None, None] == found.support
