"""Contours to a fraction of a pixel: edges whose mixed pixels are known exactly."""

import numpy as np
import pytest

from tracker_node.objective.lines.refinement import refine_lines
from tracker_node.objective.lines.table import (
    LINE_NU,
    LINE_NV,
    LINE_U,
    LINE_V,
    MEAN,
    N_LINE_COLUMNS,
    N_PLAN_COLUMNS,
    PRECISION,
    SHARP,
    WIDTH,
)

BODY, SCENE = np.array([40.0, 90.0, 200.0]), np.array([140.0, 40.0, 180.0])
CONTRAST = float(np.sum((BODY - SCENE) ** 2))
SIZE = 48


def covered(edge):
    """(SIZE,) share of each pixel that lies before an edge; pixel k reaches from k - 1/2 to k + 1/2."""
    return np.clip(edge - (np.arange(SIZE) - 0.5), 0.0, 1.0)


def image(edge, body=BODY, scene=SCENE, start=None):
    """Columns of the body up to ``edge`` (from ``start`` on), the scene beyond; colors (3,) or (SIZE, 3) by column."""
    share = covered(edge) - (0.0 if start is None else covered(start))
    return np.tile((share[:, None] * body + (1.0 - share[:, None]) * scene)[None], (SIZE, 1, 1))


def refined(bgr, u=24.0, v=20.0, normal=(1.0, 0.0), mean=0.0, precision=1.0, width=40, scale=1.0):
    lines, plan = np.zeros((1, N_LINE_COLUMNS)), np.zeros((1, N_PLAN_COLUMNS), dtype=np.int32)
    lines[0, [LINE_U, LINE_V, LINE_NU, LINE_NV, MEAN, PRECISION]] = u, v, *normal, mean, precision
    plan[0, WIDTH] = width
    refine_lines(np.ascontiguousarray(bgr), plan, 1, scale, lines)
    return lines[0, MEAN], lines[0, PRECISION]


@pytest.mark.parametrize(
    ("u", "off"), [*((24.0, off) for off in (-1.4, -0.7, -0.25, 0.0, 0.4, 1.0, 1.4)), *((23.6, off) for off in (-0.7, 0.0, 0.7))]
)
def test_the_edge_is_found_exactly(u, off):
    mean, precision = refined(image(u + off), u)
    assert mean == pytest.approx(off, abs=1e-6)
    assert precision == pytest.approx(1.0 / (0.01 + 48.0 * 4.0 / CONTRAST))


def test_in_all_four_directions():
    bgr, flipped = image(24.3), image(24.3)[:, ::-1]
    assert refined(bgr)[0] == pytest.approx(0.3)
    assert refined(flipped, SIZE - 1 - 24.0, normal=(-1.0, 0.0))[0] == pytest.approx(0.3)
    down, up = np.swapaxes(bgr, 0, 1), np.swapaxes(flipped, 0, 1)
    assert refined(down, 20.0, 24.0, (0.0, 1.0))[0] == pytest.approx(0.3)
    assert refined(up, 20.0, SIZE - 1 - 24.0, (0.0, -1.0))[0] == pytest.approx(0.3)


def test_it_begins_where_the_line_has_its_mean():
    assert refined(image(26.5), 22.0, mean=4.0)[0] == pytest.approx(4.5)


@pytest.mark.parametrize("width", [4, 5, 6, 8])
def test_a_narrow_part_is_not_looked_across(width):
    """The colors inside are those of its width only, as precise as of a wide one."""
    mean, precision = refined(image(24.0, start=24.0 - width), width=width)
    assert mean == pytest.approx(0.0, abs=1e-6)
    assert precision == pytest.approx(1.0 / (0.01 + 48.0 * 4.0 / CONTRAST))
    half = refined(image(24.0, start=24.0 - width), width=2 * width, scale=0.5)  # places are half a pixel apart
    assert half == pytest.approx((mean, precision))


@pytest.mark.parametrize("slope", [-3.0, 3.0])
def test_a_color_that_changes_towards_the_edge_is_followed_to_it(slope):
    columns = (np.arange(SIZE) - 24.0)[:, None]
    body = BODY + slope * columns * np.sign(SCENE - BODY)
    assert refined(image(24.0, body))[0] == pytest.approx(0.0, abs=0.1)


def test_what_varies_inside_makes_it_less_sure():
    """Colors off by 8 gray levels, up and down in turn: 4.8 of 4 such squares in each channel."""
    d, body = 8.0, np.tile(BODY, (SIZE, 1))
    body[18:23] += d * np.array([1, -1, 1, -1, 1])[:, None]
    _, precision = refined(image(24.0, body))
    contrast = np.sum((BODY + d / 5.0 - SCENE) ** 2)
    assert precision == pytest.approx(1.0 / (0.01 + (1.2 * d * d + 48.0) * 4.0 / contrast))


def test_what_varies_beyond_makes_it_less_sure():
    d, scene = 8.0, np.tile(SCENE, (SIZE, 1))
    scene[26:29] += d * np.array([1, -1, 1])[:, None]
    _, precision = refined(image(24.0, scene=scene))
    contrast = np.sum((BODY - SCENE - d / 3.0) ** 2)
    spread = 3.0 * (3.0 - 1.0 / 3.0) * d * d / 2.0
    assert precision == pytest.approx(1.0 / (0.01 + (spread / 3.0 + 48.0) * 4.0 / contrast))


@pytest.mark.parametrize(
    "line",
    [
        {"precision": SHARP},  # not sharp
        {"precision": 1e3},  # surer before
        {"u": 22.4},  # farther than 1.5 pixels
        {"u": 26.0},
    ],
)
def test_lines_that_stay(line):
    assert refined(image(24.0), **line) == (0.0, line.get("precision", 1.0))


@pytest.mark.parametrize(("difference", "moves"), [((10.0, 10.0, 10.0), True), ((10.0, 10.0, 9.9), False)])
def test_colors_that_hardly_differ_tell_nothing(difference, moves):
    bgr = image(24.4, BODY, BODY + np.array(difference))
    assert (refined(bgr, precision=0.4)[0] != 0.0) == moves


@pytest.mark.parametrize(("u", "moves"), [(6.2, True), (5.8, False), (SIZE - 1 - 4.2, True), (SIZE - 1 - 3.8, False)])
def test_a_line_that_leaves_the_image_stays(u, moves):
    """Five colors inside and three beyond, the farthest 6 and 4 pixels off."""
    assert (refined(image(u + 0.3), u)[0] != 0.0) == moves


def test_only_so_many_lines_are_looked_at():
    lines, plan = np.zeros((2, N_LINE_COLUMNS)), np.full((2, N_PLAN_COLUMNS), 40, dtype=np.int32)
    lines[:, [LINE_U, LINE_V, LINE_NU, LINE_NV, MEAN, PRECISION]] = 24.0, 20.0, 1.0, 0.0, 0.0, 1.0
    refine_lines(image(24.4), plan, 1, 1.0, lines)
    assert lines[0, MEAN] == pytest.approx(0.4)
    assert lines[1, MEAN] == 0.0
