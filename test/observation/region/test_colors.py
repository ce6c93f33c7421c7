"""What a camera learns of a body's colors, on small images whose pixels are counted by hand."""

import numpy as np
import pytest

from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Ellipsoid
from tracker_node.observation.region.colors import (
    RegionColors,
    color_classes,
    distinctness,
    stated_densities,
    trust_stated_colors,
)

N = 4096  # colors that are told apart: 16 a channel
LITTLE = 0.02 / N  # of every color, that is expected anyway
KEPT = 0.98 / 8.0  # of a color's share: the rest goes to its neighbors, and to all others
GRAY, WHITE, RED_BGR = (120, 120, 120), (248, 248, 248), (24, 24, 200)


def place(bgr) -> int:
    b, g, r = (value // 16 for value in bgr)
    return (b * 16 + g) * 16 + r


def model(*shapes: tuple) -> ArticulatedModel:
    ball = Ellipsoid((0.1, 0.1, 0.1))
    made = [Shape(name, "base", ball, color_rgb=rgb) if rgb else Shape(name, "base", ball) for name, rgb in shapes]
    return ArticulatedModel("test", KinematicChain(("base",), ()), tuple(made))


def learner(n: int = 1) -> RegionColors:
    return RegionColors(np.arange(n, dtype=np.int32), np.zeros((n, N), np.float32), 0.2)


def test_a_color_that_shows_around_as_often_as_on_the_part_tells_nothing():
    part, scene, mixed = np.zeros(N, np.float32), np.zeros(N, np.float32), np.zeros(N, np.float32)
    part[place(RED_BGR)] = scene[place(GRAY)] = 1.0
    mixed[place(RED_BGR)], mixed[place(GRAY)] = 0.25, 0.75
    assert distinctness(part, scene) == pytest.approx(2.0) and distinctness(part, part) == pytest.approx(0.0, abs=1e-6)
    assert distinctness(part, mixed) == pytest.approx(np.log(4.0), abs=1e-6)
    assert distinctness(mixed, part) == pytest.approx(0.75 * 2.0 - 0.25 * np.log(4.0), abs=1e-5)
    assert distinctness(0.0 * part, scene) == 0.0


def test_left_and_right_of_one_color_are_one_class():
    names = ["left_arm", "trunk", "Right_Arm", "arm_l", "arm_r", "leg_left_2", "leg_right_2", "lefty", "righty"]
    assert color_classes(model(*((name, (9, 8, 7)) for name in names))).tolist() == [0, 1, 0, 2, 2, 3, 3, 4, 5]
    assert color_classes(model(("l_arm", (9, 8, 7)), ("r_arm", (9, 8, 6)))).tolist() == [0, 1]
    assert color_classes(model(("l_arm", (9, 8, 7)))).dtype == np.int32


def test_a_stated_color_is_expected_in_light_and_shade():
    """Brightness of 0.45 to 1.15 in 15 steps of 0.05: mean 0.8, variance 0.05^2 (15^2 - 1) / 12."""
    body = model(("a", (150, 120, 180)), ("b", None), ("left_c", (200, 10, 10)), ("right_c", (200, 10, 10)))
    table = stated_densities(body, color_classes(body))
    assert table.shape == (3, N) and table.dtype == np.float32
    assert table.sum(axis=1) == pytest.approx([1.0, 0.0, 1.0], abs=1e-5)
    cube, levels = table[0].reshape(16, 16, 16).astype(float), 16.0 * np.arange(16) + 8.0
    for axis, value in ((0, 180.0), (1, 120.0), (2, 150.0)):  # blue, green, red
        along = cube.sum(axis=tuple({0, 1, 2} - {axis}))
        mean = along @ levels
        assert mean == pytest.approx(0.8 * value, abs=0.2)
        assert along @ (levels - mean) ** 2 == pytest.approx(14.0**2 + 0.0466667 * value**2, rel=0.01)
    assert stated_densities(model(), np.zeros(0, np.int32)).shape == (0, N)


def test_shades_are_not_brighter_than_white():
    body = model(("a", (255, 255, 255)))
    cube = stated_densities(body, color_classes(body))[0].reshape(16, 16, 16)
    # Four of the shades are clipped to white, where one and a half would be as near to any other gray
    assert cube[15, 15, 15] > 2.0 * cube[12, 12, 12]


def test_what_is_learnt_where():
    """A body of 10 x 8 pixels, two pixels of guard, surroundings up to five pixels away: 20 * 18 - 14 * 12 = 192 of them."""
    far, near, guard, rim, inner = (0, 0, 0), (40, 200, 40), (200, 40, 40), (40, 40, 200), (200, 200, 40)
    first_u, last_u, first_v, last_v = (200, 40, 200), (40, 200, 200), (200, 200, 200), (120, 120, 120)
    image = np.zeros((55, 60, 3), np.uint8)
    image[15:33, 15:35] = near
    image[20:28, [17, 32]], image[20:28, [15, 34]] = first_u, last_u
    image[[17, 30], 20:30], image[[15, 32], 20:30] = first_v, last_v
    image[18:30, 18:32], image[20:28, 20:30], image[21:27, 21:29] = guard, rim, inner
    labels = np.zeros((35, 45), np.uint8)
    labels[10:18, 15:25] = 1
    colors = learner()
    assert not colors.knows and colors.body == pytest.approx(1 / N) and colors.scene == pytest.approx(1 / N)
    colors.learn(image, (5, 10, 50, 45), labels, 0.5, 2, 5)
    assert colors.knows
    for color, count in ((near, 120), (first_u, 16), (last_u, 16), (first_v, 20), (last_v, 20), (guard, 0), (far, 0)):
        assert colors.scene[place(color)] == pytest.approx(KEPT * count / 192 + LITTLE, rel=1e-4), color
    assert colors.scene[place(inner)] == pytest.approx(LITTLE, rel=1e-4)
    assert colors.body[0, place(inner)] == pytest.approx(KEPT + LITTLE, rel=1e-4)
    for color in (near, guard, rim, far):
        assert colors.body[0, place(color)] == pytest.approx(LITTLE, rel=1e-4)


def test_colors_as_likely_of_a_part_as_of_the_surroundings():
    first, second, around, new = (40, 200, 40), (200, 40, 40), (200, 200, 200), (90, 90, 90)
    image = np.full((30, 30, 3), 200, np.uint8)
    image[5:15, 5:15], image[15:25, 5:15] = first, second
    labels = np.zeros((30, 30), np.uint8)
    labels[5:15, 5:15] = 1
    colors = learner(2)  # the second part is not seen, and where it is drawn, there is something else
    colors.learn(image, (0, 0, 30, 30), labels, 1.0, 0, 12)
    found = colors.as_likely_of(np.arange(2) == 0)
    assert found[[place(first), place(new)]].all()
    assert not found[[place(second), place(around)]].any()


def test_a_thing_may_cast_shadows_upon_what_surrounds_it():
    image, labels = np.full((60, 60, 3), (200, 140, 100), np.uint8), np.zeros((60, 60), np.uint8)
    labels[25:35, 25:35] = 1
    limb, thing = learner(), learner()
    limb.learn(image, (0, 0, 60, 60), labels, 1.0, 4, 12)
    thing.learn(image, (0, 0, 60, 60), labels, 1.0, 4, 12, sure_px=2)
    shaded = place((100, 70, 50))
    assert limb.scene[shaded] == pytest.approx(LITTLE)
    assert thing.scene[shaded] > 0.005
    assert 0.6 * limb.scene.max() < thing.scene.max() < 0.9 * limb.scene.max()


def test_colors_of_a_large_image_with_one_label_for_many_pixels_are_those_of_a_small_one():
    densities = []
    for scale in (1, 6):
        cells = scale // 3 or 1
        image, labels = np.full((300 * scale, 300 * scale, 3), GRAY, np.uint8), np.zeros((300 * scale, 300 * scale), np.uint8)
        inside = slice(100 * scale, 200 * scale)
        labels[inside, inside], image[inside, inside] = 1, RED_BGR
        image[: 90 * scale, :] = WHITE
        colors = learner()
        few = np.ascontiguousarray(labels[::cells, ::cells])
        colors.learn(image, (0, 0, 300 * scale, 300 * scale), few, 1.0, 4 * scale, 40 * scale, every=cells)
        densities.append((colors.body, colors.scene))
    np.testing.assert_allclose(densities[0][0], densities[1][0], atol=1e-3)
    np.testing.assert_allclose(densities[0][1], densities[1][1], atol=5e-3)


def test_new_colors_are_mixed_in_at_the_rate():
    colors, labels = learner(), np.ones((20, 20), np.uint8)
    for bgr in (GRAY, RED_BGR):
        colors.learn(np.full((20, 20, 3), bgr, np.uint8), (0, 0, 20, 20), labels, 0.25, 1, 2)
    assert colors.body[0, place(GRAY)] == pytest.approx(0.75 * KEPT + LITTLE, rel=1e-4)
    assert colors.body[0, place(RED_BGR)] == pytest.approx(0.25 * KEPT + LITTLE, rel=1e-4)


def test_labels_become_classes_and_what_is_not_sound_is_not_learnt():
    image = np.full((40, 20, 3), GRAY, np.uint8)
    image[20:] = RED_BGR
    labels = np.ones((40, 20), np.uint8)
    labels[20:] = 2
    colors = RegionColors(np.array([1, 0], np.int32), np.zeros((2, N), np.float32), 0.2)
    colors.learn(image, (0, 0, 20, 40), labels, 0.5, 1, 2)
    assert colors.body[1, place(GRAY)] == pytest.approx(KEPT + LITTLE, rel=1e-4)
    assert colors.body[0, place(RED_BGR)] == pytest.approx(KEPT + LITTLE, rel=1e-4)
    doubting = RegionColors(np.array([1, 0], np.int32), np.zeros((2, N), np.float32), 0.2)
    doubting.learn(image, (0, 0, 20, 40), labels, 0.5, 1, 2, reliable=np.array([True, False]))
    assert doubting.body[1, place(GRAY)] == pytest.approx(KEPT + LITTLE, rel=1e-4)
    assert doubting.body[0] == pytest.approx(1 / N)


STATED_RGB = ((200, 24, 24), (24, 200, 24), (24, 24, 200))


def seen(*shares: float, prior: float = 0.2, rate: float = 0.5) -> RegionColors:
    """What is learnt of three parts, of which so large a share has the stated color, and the rest is white."""
    body = model(*((name, rgb) for name, rgb in zip("abc", STATED_RGB, strict=True)))
    classes = color_classes(body)
    colors = RegionColors(classes, stated_densities(body, classes), prior)
    image, labels = np.full((60, 50, 3), WHITE, np.uint8), np.zeros((60, 50), np.uint8)
    for i, share in enumerate(shares):
        labels[20 * i : 20 * i + 20] = i + 1
        image[20 * i : 20 * i + 20, : round(50 * share)] = STATED_RGB[i][::-1]
    colors.learn(image, (0, 0, 50, 60), labels, rate, 1, 2)
    return colors


def expected(colors: RegionColors, part: int) -> bool:
    """Whether a darker shade of the stated color is, that nothing in the image has."""
    shade = tuple(int(0.65 * value) for value in STATED_RGB[part][::-1])
    return bool(colors.body[part, place(shade)] > 3 * LITTLE)


def test_a_stated_color_counts_where_a_tenth_of_the_part_has_it():
    colors = seen(0.12, 0.08, 0.5)
    assert [expected(colors, i) for i in range(3)] == [True, False, True]
    none = seen(0.12, 0.08, 0.5, prior=0.0)
    assert not any(expected(none, i) for i in range(3))


def test_what_most_parts_bear_out_is_believed_of_all():
    one, other = seen(0.9, 0.8, 0.0), seen(0.9, 0.6, 0.0)
    assert not expected(one, 2)
    trust_stated_colors([other])  # median 0.6 is too little: clothes and shades have as much by chance
    assert not expected(other, 2)
    trust_stated_colors([one])
    assert expected(one, 2)
    together = [seen(0.9, 0.8, 0.0), seen(0.9, 0.66, 0.0)]  # means 0.9, 0.73, 0
    trust_stated_colors(together)
    assert expected(together[0], 2) and expected(together[1], 2)
    trust_stated_colors([one, seen(0.0, 0.0, 0.0)])  # means 0.45, 0.4, 0: no more
    assert not expected(one, 2)


def test_cameras_that_have_learnt_nothing_do_not_tell():
    body = model(*((name, rgb) for name, rgb in zip("abc", STATED_RGB, strict=True)))
    new = RegionColors(color_classes(body), stated_densities(body, color_classes(body)), 0.2)
    trust_stated_colors([new])
    assert not new.knows and new.body == pytest.approx(1 / N)
    known, unwilling = seen(0.8, 0.8, 0.0), seen(0.8, 0.8, 0.0, prior=0.0)
    trust_stated_colors([new, known, unwilling])
    assert expected(known, 2) and not expected(unwilling, 2) and not new.knows


def test_a_part_that_is_elsewhere_is_expected_in_the_shade_that_is_seen():
    """Its stated color shows beside the body, in one shade, and what lies at its place is something else."""
    body = model(("a", STATED_RGB[0]), ("b", STATED_RGB[1]))
    stated = stated_densities(body, color_classes(body))
    shade, sound = (19, 160, 19), np.array([True, False])
    labels = np.zeros((40, 40), np.uint8)
    labels[:20], labels[20:30] = 1, 2

    def learnt(everywhere: bool) -> RegionColors:
        image = np.full((120, 120, 3), WHITE, np.uint8)
        if everywhere:
            image[:] = shade
        image[:20, :40], image[20:30, :40], image[30:40, :40] = STATED_RGB[0][::-1], WHITE, shade
        colors = RegionColors(color_classes(body), stated, 0.2)
        colors.learn(image, (0, 0, 40, 40), labels, 0.5, 1, 12, reliable=sound)
        return colors

    colors = learnt(False)
    assert colors.body[1] == pytest.approx(1 / N)  # not yet believed
    trust_stated_colors([colors])
    share = 0.98 * (0.8 / 8.0 + 0.2 * stated[1, place(shade)]) + LITTLE
    assert colors.body[1, place(shade)] == pytest.approx(share, rel=1e-3)
    assert colors.body[1, place(WHITE)] == pytest.approx(LITTLE, rel=1e-3)
    common = learnt(True)  # a color that is everywhere tells nothing: what is stated counts alone
    trust_stated_colors([common])
    assert common.body[1, place(shade)] == pytest.approx(0.98 * stated[1, place(shade)] + LITTLE, rel=1e-3)
