"""Pixels along a line, one by one: densities against closed forms, log-ratios against a plain loop."""

import math

import numpy as np
import pytest

from tracker_node.objective.lines import colors as lc
from tracker_node.objective.lines.table import BEFORE, BEHIND, LONGEST, N_LINE_COLUMNS, N_PLAN_COLUMNS, OWN
from tracker_node.render.occluders import NO_NEIGHBORS, SAYS_NOTHING

f32, u32 = np.float32, np.uint32


def bgr_word(b, g, r, code=0):
    return u32(b | g << 8 | r << 16 | code << 24)


@pytest.mark.parametrize("x", [0.0, 0.1, 0.5, 0.69, 0.7, 1.0, 3.3, 12.0, 40.0, 79.9])
def test_exponential(x):
    assert lc.exp_negative(f32(x)) == pytest.approx(math.exp(-float(f32(x))), rel=2e-5)


def normal_density(offsets, variance):
    return float(np.prod([math.exp(-0.5 * d * d / variance) / math.sqrt(2.0 * math.pi * variance) for d in offsets]))


BIN = 16.0**3  # colors in a bin


@pytest.mark.parametrize("steps", [0, 1, 30])
def test_a_pixel_as_the_empty_room_has_it(steps):
    """A normal density about the room's color, of the least variance times 1.03 a step, besides one color in twenty."""
    variance = 20.0 * 1.03**steps
    most = f32(0.5 / 20.0)
    found = lc.other_density(bgr_word(103, 48, 210), bgr_word(100, 50, 205, 1 + steps), f32(0.3), most, f32(0.4))
    assert found == pytest.approx(0.05 * 0.3 + BIN * normal_density((3, 2, 5), variance), rel=1e-3)


def test_a_pixel_of_a_room_that_is_not_known():
    found = lc.other_density(bgr_word(100, 50, 200), bgr_word(100, 50, 200, 0), f32(0.3), f32(0.025), f32(0.4))
    assert found == pytest.approx(0.3)


def shadow(color, darkest=0.4):
    return lc.other_density(bgr_word(*color), bgr_word(100, 150, 200, 1), f32(0.3), f32(0.025), f32(darkest))


def test_a_pixel_in_shadow():
    """Six tenths as bright, but for what is across: a normal density in the plane across the room's color."""
    assert 0.025 * (40**2 + 60**2 + 80**2) > 12.0
    across = np.array([63.0, 88.0, 120.0])
    mean = np.array([100.0, 150.0, 200.0])
    off = across - (across @ mean) / (mean @ mean) * mean
    plane = math.exp(-0.025 * off @ off) * 0.025 / math.pi
    assert shadow((63, 88, 120)) == pytest.approx(0.015 + BIN * plane * 0.2 / 75.0, rel=1e-3)


@pytest.mark.parametrize("color", [(38, 57, 76), (130, 195, 255), (60, 90, 250), (60, 220, 120), (190, 90, 120)])
def test_what_is_neither_lit_nor_in_shadow(color):
    """Too dark, brighter than the room, or of another hue."""
    assert shadow(color) == pytest.approx(0.015, rel=1e-3)


def test_how_dark_a_shadow_may_be():
    assert shadow((38, 57, 76), darkest=0.3) > 0.02


@pytest.mark.parametrize(
    ("x", "y", "du", "dv"),
    [(2.5, 2.5, 1.0, 0.0), (-2.5, 2.5, 1.0, 0.0), (5.5, 3.5, 1.0, 0.5), (9.0, 7.0, -1.0, -1.0), (3.0, -1.5, 0.0, 1.0),
     (3.0, 9.0, 0.5, -1.0), (-20.0, 2.0, 1.0, 0.0), (2.0, -20.0, 0.0, 1.0), (0.0, 0.0, 1.0, 0.0), (4.0, 5.0, 0.0, 1.0),
     (9.0, 5.0, 1.0, 0.0), (10.0, 5.0, -1.0, 0.0), (4.0, 8.0, 0.0, -1.0), (3.0, 9.0, 1.0, 0.0), (30.0, 2.0, 1.0, 0.0),
     (2.0, -0.5, 1.0, 0.0), (9.5, 2.5, -1.0, 0.0)],
)  # fmt: skip
def test_the_part_of_a_line_on_the_image(x, y, du, dv):
    width, height, count = 10, 8, 9
    inside = [k for k in range(count) if 0.0 <= x + k * du < width and 0.0 <= y + k * dv < height]
    expected = (inside[0], inside[-1] + 1) if inside else (0, 0)
    assert tuple(lc._inside(x, y, du, dv, width, height, count)) == expected


def test_bilinear_colors():
    rows, columns = np.indices((5, 7))
    bgr = np.stack([10 * columns, 20 * rows, 5 * columns * rows], axis=-1).astype(np.uint8)
    for u, v in ((0.0, 0.0), (2.3, 1.6), (5.9, 3.9), (5.0, 3.0)):
        inside, b, g, r = lc.color_at(bgr, u, v)
        assert inside and (b, g, r) == pytest.approx((10.0 * u, 20.0 * v, 5.0 * u * v))
    for u, v in ((-0.1, 1.0), (1.0, -0.1), (6.0, 1.0), (1.0, 4.0)):
        assert not lc.color_at(bgr, u, v)[0]


RNG = np.random.default_rng(5)
IMAGE = RNG.integers(0, 256, (24, 40, 3), dtype=np.uint8)
BODY, SCENE = RNG.uniform(0.1, 2.0, (2, 4096)).astype(f32), RNG.uniform(0.1, 2.0, 4096).astype(f32)
NO_ROOM = np.zeros((0, 0), dtype=u32)
NO_SHAPE = np.zeros((0, 0), dtype=np.uint8), np.ones(256, dtype=f32)


def read(u, v, nu, nv, plan, scale=1.0, half=3, room=NO_ROOM, clamp=3.0, silhouette=NO_SHAPE, neighbors=NO_NEIGHBORS):
    """Log-odds of one line that is the second of two, the first being left alone."""
    lines, plans = np.zeros((2, N_LINE_COLUMNS)), np.full((2, N_PLAN_COLUMNS), -1, dtype=np.int32)
    lines[1, 3:7], plans[1, [OWN, BEHIND, BEFORE]] = (u, v, nu, nv), plan
    odds = np.full((2, LONGEST), 99.0, dtype=f32)
    room = room, 20.0
    lc.read_lines(IMAGE, BODY, SCENE, room, silhouette, neighbors, f32(0.4), f32(clamp), scale, half, lines, plans, 2, odds)
    assert np.all(odds[0] == 99.0)
    return odds[1, : plan[2] + 2 * half]


def naive(u, v, nu, nv, plan, scale=1.0, half=3, room=NO_ROOM, clamp=3.0, silhouette=NO_SHAPE, neighbors=NO_NEIGHBORS):
    """The same by its words: 2 half pixels about the sample, and those before them, each the nearest to its place."""
    own, behind, before = plan
    found = []
    for k in range(before + 2 * half):
        off = scale * (k - before - half + 0.5)
        j, i = math.floor(u + off * nu + 0.5), math.floor(v + off * nv + 0.5)
        if not (0 <= i < IMAGE.shape[0] and 0 <= j < IMAGE.shape[1]):
            found.append(0.0)
            continue
        b, g, r = (int(c) for c in IMAGE[i, j])
        kind = b // 16 * 256 + g // 16 * 16 + r // 16
        other, label = float(SCENE[kind]), int(neighbors[0][i, j]) if neighbors[0].size else 0
        if label == SAYS_NOTHING:
            found.append(0.0)
            continue
        if label:
            other = float(neighbors[1][label - 1, kind])
        elif room.size:
            other = float(lc.other_density(bgr_word(b, g, r), room[i, j], SCENE[kind], f32(0.025), f32(0.4)))
        if silhouette[0].size:
            other *= float(silhouette[1][silhouette[0][i, j]])
        if behind >= 0:
            other = 0.5 * (other + float(BODY[behind, kind]))
        found.append(min(max(math.log(float(BODY[own, kind]) / other), -clamp), clamp))
    return found


@pytest.mark.parametrize("plan", [(0, -1, 0), (1, -1, 2), (0, 1, 0), (1, 0, 3)])
@pytest.mark.parametrize(
    ("u", "v", "nu", "nv", "scale"),
    [(20.2, 10.3, 1.0, 0.0, 1.0), (20.2, 10.3, 0.0, -1.0, 1.0), (20.2, 10.3, 0.6, 0.8, 2.0), (1.2, 10.3, 1.0, 0.0, 1.0),
     (38.3, 21.4, 0.6, 0.8, 1.0), (-30.0, 5.0, 1.0, 0.0, 1.0)],
)  # fmt: skip
def test_log_odds_of_each_pixel(plan, u, v, nu, nv, scale):
    np.testing.assert_allclose(read(u, v, nu, nv, plan, scale), naive(u, v, nu, nv, plan, scale), atol=1e-4)


@pytest.mark.parametrize("plan", [(0, -1, 0), (0, 1, 0)])
def test_a_silhouette_changes_the_odds_of_the_scene_alone(plan):
    shown, against = RNG.integers(0, 256, IMAGE.shape[:2], dtype=np.uint8), np.linspace(4.0, 0.25, 256).astype(f32)
    at = (20.2, 10.3, 0.6, 0.8, plan)
    found = read(*at, silhouette=(shown, against))
    np.testing.assert_allclose(found, naive(*at, silhouette=(shown, against)), atol=1e-4)
    assert np.abs(found - read(*at)).max() > 0.2


@pytest.mark.parametrize("plan", [(0, -1, 0), (0, 1, 0)])
def test_another_body_stands_in_the_place_of_the_scene(plan):
    """Whatever is known of the background behind it; one that stands before this body leaves nothing to be told."""
    who = RNG.integers(0, 3, IMAGE.shape[:2], dtype=np.uint8)
    who[RNG.uniform(size=who.shape) < 0.3] = SAYS_NOTHING
    known = (IMAGE.astype(u32) * np.array([1, 256, 65536], dtype=u32)).sum(axis=2, dtype=u32) | u32(5 << 24)
    given = {"neighbors": (who, RNG.uniform(0.1, 2.0, (2, 4096)).astype(f32)), "room": known, "half": 12}
    at = (20.2, 10.3, 0.6, 0.8, plan)
    found = read(*at, **given)
    np.testing.assert_allclose(found, naive(*at, **given), atol=2e-4)
    assert (found == 0.0).any() and np.abs(found).max() > 0.2


def test_log_odds_are_clamped_on_both_sides():
    found = read(20.2, 10.3, 1.0, 0.0, (0, -1, 8), half=8, clamp=0.5)
    np.testing.assert_allclose(found, naive(20.2, 10.3, 1.0, 0.0, (0, -1, 8), half=8, clamp=0.5), atol=1e-4)
    assert found.min() == -0.5 and found.max() == 0.5


def test_a_room_that_is_known_explains_its_colors():
    known = (IMAGE.astype(u32) * np.array([1, 256, 65536], dtype=u32)).sum(axis=2, dtype=u32) | u32(5 << 24)
    known[:, 20:] = 0  # there it is not
    for plan in ((0, -1, 2), (1, 0, 0)):
        found = read(20.2, 10.3, 1.0, 0.0, plan, half=6, room=known, clamp=9.0)
        np.testing.assert_allclose(found, naive(20.2, 10.3, 1.0, 0.0, plan, half=6, room=known, clamp=9.0), atol=2e-4)


def test_long_lines_are_read_to_their_end():
    plan = (0, -1, 16)
    np.testing.assert_allclose(read(20.2, 10.3, 0.3, 0.1, plan, half=40), naive(20.2, 10.3, 0.3, 0.1, plan, half=40), atol=1e-4)
