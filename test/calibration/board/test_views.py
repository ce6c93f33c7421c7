"""Views of a board brought together by their stamps, and chosen among."""

import numpy as np
import pytest

from tracker_node.calibration.board.board import BoardView
from tracker_node.calibration.board.views import (
    LEAST_COMMON,
    BoardTimeStep,
    chosen,
    group_views,
    spanning_tree,
    speeds,
    velocities,
    with_neighbors,
)
from tracker_node.geometry import se3

MS = 1_000_000
SQUARE = np.array([[0.0, 0.0], [40.0, 0.0], [0.0, 40.0], [40.0, 40.0]])


def view(ms, at=(0.0, 0.0), ids=(0, 1, 2, 3), image=0):
    return BoardView(round(ms * MS), np.array(ids), SQUARE[list(ids)] + at, 2.0, image)


def time_step(ms, *names, **other):
    return BoardTimeStep({name: view(ms, **other) for name in names or ("a",)})


def test_the_stamp_is_the_mean_of_the_views():
    assert BoardTimeStep({"a": view(10), "b": view(13), "c": view(16)}).stamp_ns == 13 * MS
    late = [BoardView(2**62 + i, np.arange(4), SQUARE) for i in (0, 10)]  # beyond what a double holds exactly
    assert BoardTimeStep(dict(zip("ab", late, strict=True))).stamp_ns == 2**62 + 5


def grouped(tolerance_s=0.01, **stamps):
    found = group_views({name: [view(ms) for ms in times] for name, times in stamps.items()}, tolerance_s)
    return [{name: one.stamp_ns / MS for name, one in group.views.items()} for group in found]


def test_views_within_the_tolerance_of_the_first_are_one_time_step():
    assert grouped(a=[0, 100], b=[10, 110]) == [{"a": 0, "b": 10}, {"a": 100, "b": 110}]
    assert grouped(a=[0, 100], b=[11, 110]) == [{"a": 0}, {"b": 11}, {"a": 100, "b": 110}]
    assert grouped(a=[0], b=[7], c=[14]) == [{"a": 0, "b": 7}, {"c": 14}]


def test_a_camera_has_one_view_in_a_time_step():
    assert grouped(a=[0, 4], b=[2, 6]) == [{"a": 0, "b": 2}, {"a": 4, "b": 6}]
    assert grouped(a=[]) == []


def test_the_speed_is_that_to_the_nearer_neighbor():
    """Ten pixels in 0.1 s, then thirty, then none for a while."""
    views = [view(0), view(100, (10, 0)), view(200, (10, 30)), view(900, (10, 30))]
    assert speeds(views)[:3] == pytest.approx([100.0, 100.0, 300.0])
    assert np.isnan(speeds(views)[3])
    assert speeds(views, 0.7)[3] == pytest.approx(0.0)


def test_the_speed_is_of_corners_that_both_see():
    """The common corner stays, whatever the others are."""
    assert speeds([view(0, ids=(0, 1)), view(100, ids=(1, 2))]) == pytest.approx([0.0, 0.0])
    assert np.isnan(speeds([view(0, ids=(0, 1)), view(100, ids=(2, 3))])).all()
    assert np.isnan(speeds([view(0), view(0, (5, 5))])).all()
    assert np.isnan(speeds([view(0)])).all()


def test_the_tree_is_of_the_pairs_that_share_most():
    common = np.array([[9, 5, 1, 0], [5, 9, 4, 0], [1, 4, 9, 2], [0, 0, 2, 9]])
    tree = spanning_tree(common)
    assert sorted(zip(*(index.tolist() for index in tree.nonzero()), strict=True)) == [(0, 1), (1, 2), (2, 3)]
    assert spanning_tree(np.diag([3, 3])).nnz == 0


def pose(x):
    T = np.eye(4)
    T[0, 3] = x
    return T


def test_velocities_are_from_the_poses_before_and_after():
    some = [time_step(ms) for ms in (0, 100, 200)]
    found = velocities(some, np.array([pose(0.0), pose(0.1), pose(0.4)]))
    assert found[:, 0] == pytest.approx([1.0, 2.0, 3.0])
    assert not found[:, 1:].any()
    order = [2, 0, 1]
    shuffled = velocities([some[k] for k in order], np.array([pose(0.4), pose(0.0), pose(0.1)]))
    assert shuffled[:, 0] == pytest.approx([3.0, 1.0, 2.0])


def test_velocities_are_in_the_board_s_own_frame():
    turned, twist = se3.exp(np.array([1.0, 2.0, 3.0, 0.5, 0.4, 0.3])), np.array([0.3, 0.2, 0.1, 0.6, 0.5, 0.4])
    found = velocities([time_step(0), time_step(100)], np.array([turned, turned @ se3.exp(0.1 * twist)]))
    assert found[0] == pytest.approx(twist)
    assert found[1] == pytest.approx(twist)


def test_nothing_is_said_over_long_gaps():
    found = velocities([time_step(0), time_step(301), time_step(601)], np.array([pose(0.0), pose(1.0), pose(1.3)]))
    assert found[0, 0] == 0.0
    assert found[1:, 0] == pytest.approx([1.0, 1.0])
    assert not velocities([time_step(0), time_step(0)], np.array([pose(0.0), pose(1.0)])).any()


def test_neighbors_within_reach_are_taken_too():
    time_steps = [time_step(ms) for ms in (0, 300, 600, 901, 1000)]
    assert with_neighbors([time_steps[1]], time_steps) == time_steps[:3]
    assert with_neighbors([time_steps[3]], time_steps) == time_steps[3:]
    assert with_neighbors([time_steps[0]], time_steps) == time_steps[:2]
    assert with_neighbors([], time_steps) == []


def test_few_time_steps_are_all_taken():
    time_steps = [time_step(ms) for ms in range(4)]
    assert chosen(time_steps, {}, 4) == time_steps
    assert len(chosen(time_steps, {}, 3)) == 3


def test_views_from_other_places_are_preferred():
    """Three at the same place and two elsewhere: one of each."""
    time_steps = [time_step(10 * i, at=(x, 0.0)) for i, x in enumerate((0.0, 0.0, 300.0, 0.0, 900.0))]
    taken = chosen(time_steps, {}, 3)
    assert time_steps[2] in taken
    assert time_steps[4] in taken
    assert taken == sorted(taken, key=lambda one: one.stamp_ns)


def test_still_boards_are_preferred():
    time_steps = [BoardTimeStep({"a": view(10 * i, (300.0 * (i // 2), 0.0), image=i)}) for i in range(6)]
    speed = {("a", i): (500.0 if i % 2 == 0 else 5.0) for i in range(6)}
    assert chosen(time_steps, speed, 3) == time_steps[1::2]


def test_time_steps_that_link_cameras_come_first():
    """Only two time steps link a and b; all others are of one camera, at many places."""
    alone = [BoardTimeStep({name: view(10 * i, (200.0 * i, 0.0))}) for i in range(8) for name in ("a", "b")]
    links = [BoardTimeStep({"a": view(500 + i, (60.0 * i, 0)), "b": view(500 + i, (60.0 * i, 0))}) for i in range(2)]
    assert chosen([*alone, *links], {}, 2) == links
    assert chosen([*alone, *links], {}, 1) == links  # even if these are more


def test_of_views_of_one_place_the_stiller_is_taken():
    """How still a board is counts against what is usual: a pace of the median halves what a view is worth."""
    time_steps = [BoardTimeStep({"a": view(10 * i, (x, 0.0), image=i)}) for i, x in enumerate((0.0, 300.0, 340.0, 900.0))]
    speed = {("a", i): 10.0 for i in range(4)}
    assert chosen(time_steps, speed | {("a", 1): 90.0}, 3) == [time_steps[0], time_steps[2], time_steps[3]]
    assert chosen(time_steps, speed | {("a", 2): 90.0}, 3) == [time_steps[0], time_steps[1], time_steps[3]]


def test_a_time_step_of_more_cameras_adds_more():
    """Each camera counts, and half a camera less: one of two cameras is worth six of one that is as far."""
    one = [BoardTimeStep({"a": view(10 * i, (400.0 * i, 0.0))}) for i in range(3)]
    two = [BoardTimeStep({"a": view(100 + i, (400.0 * i, 0.0)), "b": view(100 + i, (400.0 * i, 0.0))}) for i in range(3)]
    assert chosen([*one, *two], {}, 3) == two


def test_larger_and_tilted_boards_are_other_places():
    """At the same middle of the image: the same view again, one of twice the size, and one with its corners along a diagonal."""

    def seen(ms, corners):
        corners = np.asarray(corners, dtype=float)
        return BoardTimeStep({"a": BoardView(round(ms * MS), np.arange(4), corners - corners.mean(axis=0) + 100.0, 2.0, 0)})

    tilted = [[0.0, 0.0], [30.0, 20.0], [20.0, 30.0], [50.0, 50.0]]
    time_steps = [seen(0, SQUARE), seen(10, SQUARE), seen(20, 2.0 * SQUARE), seen(30, tilted), seen(40, SQUARE)]
    assert chosen(time_steps, {}, 3)[1:] == [time_steps[2], time_steps[3]]


def test_the_pairs_that_link_share_so_many_and_no_more():
    """Of ten time steps of both cameras at one place, `LEAST_COMMON`, and the rest of ``most`` by what they add."""
    both = [BoardTimeStep({"a": view(i, (i, 0.0)), "b": view(i, (i, 0.0))}) for i in range(LEAST_COMMON + 4)]
    far = [BoardTimeStep({"a": view(500 + i, (500.0 + 300.0 * i, 0.0))}) for i in range(4)]
    taken = chosen([*both, *far], {}, LEAST_COMMON)
    assert len(taken) == LEAST_COMMON
    assert all(len(one.views) == 2 for one in taken)
    assert len(chosen([*both, *far], {}, LEAST_COMMON + 2)) == LEAST_COMMON + 2
    assert chosen([*both, *far], {}, 1) == taken
