"""Gaps of round cones against a search over both axes, and what pushes parts apart against numeric derivatives."""

import numpy as np
import pytest

from tracker_node.geometry import se3
from tracker_node.objective.constraints import collision as ck
from tracker_node.objective.constraints.collision import add_collisions, deepest, pair_gaps, place_capsules, round_cone_gap


def cone(start, r0, end, r1):
    return np.array([*start, r0, *end, r1], dtype=np.float64)


def searched_gap(one, other, n=201):
    s = np.linspace(0.0, 1.0, n)[:, None]
    a, b = one[:3] + s * (one[4:7] - one[:3]), other[:3] + s * (other[4:7] - other[:3])
    ra, rb = one[3] + s[:, 0] * (one[7] - one[3]), other[3] + s[:, 0] * (other[7] - other[3])
    return float((np.linalg.norm(a[:, None] - b[None], axis=2) - ra[:, None] - rb[None]).min())


def random_cone(rng):
    return cone(rng.normal(size=3), rng.uniform(0.05, 0.5), rng.normal(size=3), rng.uniform(0.05, 0.5))


def spheres_gap(one, other, s, t):
    center = one[:3] + s * (one[4:7] - one[:3]) - other[:3] - t * (other[4:7] - other[:3])
    return np.linalg.norm(center) - one[3] - s * (one[7] - one[3]) - other[3] - t * (other[7] - other[3])


@pytest.mark.parametrize("seed", range(40))
def test_the_least_gap_of_two_round_cones(seed):
    rng = np.random.default_rng(seed)
    one, other = random_cone(rng), random_cone(rng)
    gap, s, t = round_cone_gap(one, other)
    assert 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0
    assert gap == pytest.approx(spheres_gap(one, other, s, t), abs=1e-12)
    assert gap == pytest.approx(searched_gap(one, other), abs=6e-4) and gap <= searched_gap(one, other) + 1e-12
    assert ck._gap_at(one, other, 0.3, 0.8) == pytest.approx(spheres_gap(one, other, 0.3, 0.8), abs=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_cones_that_pass_each_other_in_the_middle(seed):
    """Long ones at right angles, growing: the nearest spheres are not at the feet of the common perpendicular."""
    rng = np.random.default_rng(seed)
    r = rng.uniform(0.05, 0.4, 4)
    one, other = cone((-1, 0, 0), r[0], (1, 0, 0), r[1]), cone((0, -1, 1), r[2], (0.3, 1, 1), r[3])
    s, t = ck._crossing(one, other)
    assert 0.0 < s < 1.0 and 0.0 < t < 1.0
    here = spheres_gap(one, other, s, t)
    for ds, dt in ((1e-3, 0.0), (-1e-3, 0.0), (0.0, 1e-3), (0.0, -1e-3)):
        assert spheres_gap(one, other, s + ds, t + dt) > here


def test_no_crossing():
    along = cone((0, 0, 0), 0.1, (1, 0, 0), 0.1)
    assert ck._crossing(along, cone((0, 1, 0), 0.1, (1, 1, 0), 0.1)) == (-1.0, -1.0)  # parallel
    steep = cone((0, 1, 0), 0.1, (0, 1, 0.2), 0.9)  # one sphere of it holds the others
    assert ck._crossing(along, steep) == (-1.0, -1.0)
    assert round_cone_gap(along, steep)[0] == pytest.approx(searched_gap(along, steep), abs=1e-3)


@pytest.mark.parametrize(
    ("one", "other", "gap"),
    [
        (cone((0, 0, 0), 0.1, (1, 0, 0), 0.1), cone((3, 0, 0), 0.2, (2, 0, 0), 0.3), 0.6),  # end to end
        (cone((1, 0, 0), 0.1, (0, 0, 0), 0.1), cone((2, 0, 0), 0.3, (3, 0, 0), 0.2), 0.6),
        (cone((0, 0, 0), 0.1, (1, 0, 0), 0.2), cone((0, 0, 2), 0.1, (0, 0, 2), 0.1), 2.0 * 0.99**0.5 - 0.2),  # a ball
        (cone((0, 0, 0), 0.1, (1, 0, 0), 0.1), cone((0.5, 0, 0.7), 0.2, (0.5, 0, 2), 0.2), 0.4),  # an end above a middle
        (cone((0.5, 0, 2), 0.2, (0.5, 0, 0.7), 0.2), cone((0, 0, 0), 0.1, (1, 0, 0), 0.1), 0.4),
    ],
)
def test_gaps_by_hand(one, other, gap):
    assert round_cone_gap(one, other)[0] == pytest.approx(gap, abs=2e-3)


def test_parts_are_placed_by_their_links():
    rng = np.random.default_rng(4)
    capsules, bounds = rng.uniform(size=(3, 8)), rng.uniform(size=(2, 4))
    Ts = np.stack([np.eye(4), se3.exp(rng.normal(size=6)), se3.exp(rng.normal(size=6))])
    parts, links = np.array([0, 1, 1]), np.array([2, 1])
    placed, spheres = np.zeros((3, 8)), np.zeros((2, 4))
    place_capsules(capsules, bounds, parts, links, Ts, placed, spheres)
    for i, link in enumerate((2, 1, 1)):
        for at in (0, 4):
            np.testing.assert_allclose(placed[i, at : at + 3], se3.apply(Ts[link], capsules[i : i + 1, at : at + 3])[0])
            assert placed[i, at + 3] == capsules[i, at + 3]
    for i, link in enumerate((2, 1)):
        np.testing.assert_allclose(spheres[i], [*se3.apply(Ts[link], bounds[i : i + 1, :3])[0], bounds[i, 3]])


# Two parts: the second of three balls, and a third far off
BALLS = np.array([cone((0, 0, 0), 0.5, (0, 0, 0), 0.5), cone((0, 9, 0), 0.1, (0, 9, 0), 0.1), cone((0, 0.8, 0), 0.4, (0, 0.8, 0), 0.4),  # noqa: E501
                  cone((0, 2, 0), 0.4, (0, 2, 0), 0.4), cone((50, 0, 0), 0.4, (50, 0, 0), 0.4)])  # fmt: skip
STARTS = np.array([0, 1, 4, 5])
BOUNDS = np.array([[0.0, 0, 0, 0.5], [0, 5, 0, 5], [50, 0, 0, 0.4]])


def test_the_deepest_of_all_pairs_of_two_parts():
    gap, i, j, _, _ = deepest(0, 1, BALLS, BOUNDS, STARTS)
    assert (gap, i, j) == (pytest.approx(-0.1), 0, 2)
    gap, i, j, _, _ = deepest(1, 0, BALLS, BOUNDS, STARTS)
    assert (gap, i, j) == (pytest.approx(-0.1), 2, 0)
    assert deepest(0, 2, BALLS, BOUNDS, STARTS)[:3] == (np.inf, -1, -1)  # not even looked at
    for axis in range(3):
        near = BOUNDS.copy()
        near[2, :3] = 0.0
        near[2, axis] = 0.89
        assert deepest(0, 2, BALLS, near, STARTS)[0] == pytest.approx(49.1)
        near[2, axis] = 0.91
        assert deepest(0, 2, BALLS, near, STARTS)[0] == np.inf
    out = np.zeros(2)
    pair_gaps(np.array([[1, 0], [0, 2]]), BALLS, BOUNDS, STARTS, out)
    np.testing.assert_allclose(out, [-0.1, np.inf])


@pytest.mark.parametrize("axis", range(3))
def test_a_way_out_where_axes_meet(axis):
    d, e = np.eye(3)[axis] + 0.1, np.eye(3)[(axis + 1) % 3] * 2.0
    u, one = np.zeros(3), cone((1, 2, 3), 0.1, np.array([1, 2, 3]) + d, 0.1)
    ck._across(one, cone((4, 5, 6), 0.1, np.array([4, 5, 6]) + e, 0.1), u)
    np.testing.assert_allclose(u, np.cross(d, e), atol=1e-12)
    ck._across(one, one + 0.0, u)  # parallel: across both
    assert abs(u @ d) < 1e-12 and np.linalg.norm(u) > 0.1
    ball = cone((1, 2, 3), 0.1, (1, 2, 3), 0.1)
    ck._across(ball, ball, u)
    assert np.linalg.norm(u) > 0.1


SIGMA = 0.02
CAPSULES = np.array([cone((0, 0, 0), 0.2, (1, 0.1, 0), 0.15), cone((0.3, -0.5, 0.25), 0.1, (0.5, 0.5, 0.3), 0.2),
                     cone((0.9, 0.1, 0.3), 0.2, (1.2, 0.1, 0.9), 0.1)])  # fmt: skip
LINKS = np.array([0, 1, 2])  # of parts
MOVED = np.array(
    [[True, False, True, False], [True, True, False, False], [True, True, False, True]]
)  # links by degrees of freedom
TWISTS = np.random.default_rng(8).normal(size=(4, 6))
PAIRS = np.array([[0, 1], [0, 2], [2, 1]])
ALLOWED = np.array([0.01, 0.0, 0.02])


AT_REST = np.zeros(4)


def collisions(x=AT_REST, capsules=CAPSULES, pairs=PAIRS, allowed=ALLOWED):
    """Cost, count, H and g after the links have moved by ``x``."""
    placed, spheres = np.zeros_like(capsules), np.zeros((3, 4))
    Ts = np.stack([se3.exp((x * MOVED[link]) @ TWISTS) for link in range(3)])
    place_capsules(capsules, np.array([[0.0, 0, 0, 9.0]] * 3), np.arange(3), LINKS, Ts, placed, spheres)
    H, g = np.full((4, 4), 2.0), np.full(4, 3.0)
    cost, count = add_collisions(pairs, allowed, placed, spheres, np.arange(4), LINKS, MOVED, TWISTS, SIGMA, H, g)
    return cost, count, H - 2.0, g - 3.0


def test_the_cost_is_that_of_what_is_deeper_than_allowed():
    gaps = np.array([searched_gap(CAPSULES[i], CAPSULES[j], 801) for i, j in PAIRS])
    depths = np.maximum(-gaps - ALLOWED, 0.0)
    assert (depths > 0.0).tolist() == [True, True, False]
    cost, count, _, _ = collisions()
    assert count == 2 and cost == pytest.approx(((depths / SIGMA) ** 2).sum(), rel=1e-3)
    assert collisions(allowed=np.full(3, 1.0))[:2] == (0.0, 0)


@pytest.mark.parametrize("pair", [0, 1])
def test_derivatives_of_a_collision(pair):
    only = {"pairs": PAIRS[pair : pair + 1], "allowed": ALLOWED[pair : pair + 1]}
    cost, count, H, g = collisions(**only)
    numeric = [(collisions(x, **only)[0] - collisions(-x, **only)[0]) / 2e-6 for x in 1e-6 * np.eye(4)]
    assert count == 1 and np.abs(numeric).max() > 1.0
    np.testing.assert_allclose(2.0 * g, numeric, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(H * cost, np.outer(g, g), rtol=1e-9)  # of one residual
    assert numeric[0] == pytest.approx(0.0, abs=1e-4)  # what moves both leaves them as they are


def test_pairs_add_up():
    both = collisions()
    first, second = (collisions(pairs=PAIRS[k : k + 1], allowed=ALLOWED[k : k + 1]) for k in range(2))
    for a, b, c in zip(both, first, second, strict=True):
        np.testing.assert_allclose(a, b + c, rtol=1e-9, atol=1e-12)


def test_axes_that_meet_are_pushed_across():
    """Two capsules whose axes cross: nothing but a move along z parts them, by as much as they are moved."""
    crossed = np.array(
        [cone((-1, 0, 0), 0.1, (1, 0, 0), 0.1), cone((0, -1, 0), 0.1, (0, 1, 0), 0.1), cone((9, 9, 9), 0.1, (9, 9, 9), 0.1)]
    )
    moved = np.array([[False] * 3, [True] * 3, [False] * 3])
    H, g = np.zeros((3, 3)), np.zeros(3)
    cost, count = add_collisions(
        PAIRS[:1], np.zeros(1), crossed, np.array([[0.0, 0, 0, 2.0]] * 3), np.arange(4), LINKS, moved, np.eye(3, 6), 0.1, H, g
    )
    assert count == 1 and cost == pytest.approx((0.2 / 0.1) ** 2)
    np.testing.assert_allclose(np.abs(g), [0.0, 0.0, 2.0 / 0.1], atol=1e-9)
