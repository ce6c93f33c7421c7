"""What stands before a body, against rays through a box."""

import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.geometry import se3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, Neighbor, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box
from tracker_node.render.contour.generators import N_COLUMNS, P, world_spheres
from tracker_node.render.contour.samples import (
    DEPTH,
    N_INFO_COLUMNS,
    N_PIXEL_COLUMNS,
    NU,
    U,
    collect_samples,
    most_samples,
)
from tracker_node.render.occluders import NO_NEIGHBORS, NOTHING, SAYS_NOTHING, Occluders, drop_covered
from tracker_node.render.raycast.raycaster import render_labels, render_view
from tracker_node.render.shape_arrays import ShapeArrays

RIG, HUMAN = circle_rig(), human_model()
BODY = Configuration(HUMAN, State(se3.exp(np.array([0.0, 0.0, 0.95, 0.0, 0.0, 0.0])), State.neutral(HUMAN).joint_positions))
SIZE, REACH_PX = np.array([0.5, 0.6, 0.9]), 3.0


def screen(distance: float) -> tuple[ArticulatedModel, np.ndarray]:
    """A box on the way from the first camera to the body, turned somehow."""
    place = se3.exp(np.array([0.0, 0.0, 0.0, 0.1, -0.2, 0.5]))
    place[:3, 3] = distance * RIG.cameras[0].center * [1.0, 1.0, 0.0] / np.linalg.norm(RIG.cameras[0].center[:2]) + [
        0.0,
        0.0,
        0.6,
    ]
    return ArticulatedModel("screen", KinematicChain(("room",), ()), (Shape("box", "room", Box(tuple(SIZE)), place),)), place


def entered(points: np.ndarray, center: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Share of the way from the camera to each point at which a line of sight enters the box; infinite where it does not."""
    T = se3.inverse(place)
    a, b = se3.apply(T, center), se3.apply(T, points)
    with np.errstate(divide="ignore"):
        ends = np.sort(np.stack([(-0.5 * SIZE - a) / (b - a), (0.5 * SIZE - a) / (b - a)]), axis=0)
    first, last = ends[0].max(axis=1), ends[1].min(axis=1)
    return np.where((first < last) & (last > 0.0), first, np.inf)


def samples(camera):
    arrays, n = ShapeArrays.from_model(HUMAN), most_samples(ShapeArrays.from_model(HUMAN).packed, 12)
    rows, pixels, info = np.empty((n, N_COLUMNS)), np.empty((n, N_PIXEL_COLUMNS)), np.empty((n, N_INFO_COLUMNS), np.int32)
    Ts, spheres = BODY.Ts_world_shape, np.empty((len(HUMAN.shapes), 4))
    world_spheres(Ts, arrays.bounds, spheres)
    T = camera.T_cam_world
    place = camera.model.params, np.ascontiguousarray(T[:3, :3]), np.ascontiguousarray(T[:3, 3]), camera.center
    n = collect_samples(arrays.packed, Ts, spheres, place, 12, REACH_PX, rows, pixels, info)
    return rows[:n], pixels[:n], info[:n]


def test_samples_behind_a_box_are_dropped():
    camera, (room, place) = RIG.cameras[0], screen(1.5)
    rows, pixels, info = samples(camera)
    points = rows[:, P : P + 3].copy()
    # The samples themselves, and what lies a few pixels to either side of them at the same depth
    hidden, unsure = np.zeros(len(points), dtype=bool), np.zeros(len(points), dtype=bool)
    for reach in (-REACH_PX - 1.5, -REACH_PX, -REACH_PX + 1.5, -1.5, 0.0, 1.5, REACH_PX - 1.5, REACH_PX, REACH_PX + 1.5):
        rays = camera.model.rays(pixels[:, U : U + 2] + reach * pixels[:, NU : NU + 2])[0]
        aside = se3.apply(camera.T_world_cam, rays / rays[:, 2:] * pixels[:, DEPTH : DEPTH + 1])
        covered = entered(aside, camera.center, place) < 1.0
        if reach in (-REACH_PX, 0.0, REACH_PX):
            hidden |= covered
        unsure |= covered
    unsure &= ~hidden
    depth = Occluders(room, RIG).depths[0]
    left = drop_covered(depth, rows, pixels, info, len(rows), REACH_PX)
    kept = {tuple(p) for p in rows[:left, P : P + 3]}
    found = np.array([tuple(p) not in kept for p in points])
    assert 0.2 < hidden.mean() < 0.8
    assert found[hidden].mean() > 0.97  # the rest lies within half a pixel of the border
    assert not found[~hidden & ~unsure].any()


def test_a_box_behind_the_body_hides_nothing():
    camera, (room, _) = RIG.cameras[0], screen(-1.5)
    rows, pixels, info = samples(camera)
    occluders = Occluders(room, RIG)
    assert np.isfinite(occluders.depths[0]).any()
    assert drop_covered(occluders.depths[0], rows, pixels, info, len(rows), REACH_PX) == len(rows)
    body = occluders.look(0, BODY, camera, 10)
    assert body.occlusion is None
    np.testing.assert_array_equal(body.labels, render_labels(BODY, camera, 10)[1])


def test_labels_end_where_the_box_begins():
    camera, (room, place) = RIG.cameras[0], screen(1.5)
    body = Occluders(room, RIG).look(0, BODY, camera, 10)
    region, labels = render_labels(BODY, camera, 10)
    assert body.region == region
    v, u = np.nonzero(labels)
    rays = camera.model.rays(np.stack([u + region[0], v + region[1]], axis=1).astype(float))[0]
    # The box is nearer than the body wherever a line of sight meets it
    hidden = np.isfinite(entered(se3.apply(camera.T_world_cam, rays), camera.center, place))
    assert 0.2 < hidden.mean() < 0.8
    np.testing.assert_array_equal(body.labels[v, u] == 0, hidden)
    np.testing.assert_array_equal(body.labels[v, u][~hidden], labels[v, u][~hidden])
    assert body.occlusion[v, u][hidden].all()
    assert body.occlusion[v, u][~hidden].mean() < 0.2  # only along the border


@pytest.mark.parametrize("room", [None, screen(1.5)[0]])
def test_every_fourth_pixel_has_the_label_that_it_has_among_all(room):
    camera = RIG.cameras[0]
    occluders = Occluders(room, RIG)
    whole, coarse = occluders.look(0, BODY, camera, 12), occluders.look(0, BODY, camera, 12, 4)
    assert (whole.every, coarse.every) == (1, 4)
    u0, v0, u1, v1 = coarse.region
    assert coarse.labels.shape == ((v1 - v0) // 4, (u1 - u0) // 4)
    full = np.zeros((camera.model.height, camera.model.width), np.uint8)
    full[whole.region[1] : whole.region[3], whole.region[0] : whole.region[2]] = whole.labels
    np.testing.assert_array_equal(coarse.labels, full[v0 + 2 : v1 : 4, u0 + 2 : u1 : 4])
    assert np.count_nonzero(coarse.labels) > 200


@pytest.mark.parametrize("room", [None, screen(-1.5)[0]])
def test_a_body_out_of_sight_is_not_looked_at(room):
    behind = State(se3.exp(np.append(3.0 * RIG.cameras[0].center, np.zeros(3))), BODY.state.joint_positions)
    assert Occluders(room, RIG).look(0, Configuration(HUMAN, behind), RIG.cameras[0], 10) is None


def beside(x: float, y: float) -> Configuration:
    """The body elsewhere."""
    return Configuration(HUMAN, State(se3.exp(np.array([x, y, 0.95, 0.0, 0.0, 0.0])), State.neutral(HUMAN).joint_positions))


def neighbor(body: Configuration, known: bool = True) -> Neighbor:
    n = len(HUMAN.shapes)
    colors = [np.full((n, 8), 1.0 + i, np.float32) if known else None for i in range(len(RIG))]
    return Neighbor(body, np.arange(n, dtype=np.int32), colors)


def test_another_body_is_before_this_one_or_behind_it():
    camera, toward = RIG.cameras[0], RIG.cameras[0].center[:2] / np.linalg.norm(RIG.cameras[0].center[:2])
    for sign, before in ((1.0, True), (-1.0, False)):
        other = beside(*(0.8 * sign * toward))
        occluders = Occluders(None, RIG)
        occluders.show([neighbor(other)], neighbor(BODY))
        view = render_view(other, camera)
        (labels, colors), depth = occluders.neighbors[0], occluders.depths[0]
        np.testing.assert_array_equal(depth, view.depth)
        if before:
            assert (labels[view.labels > 0] == SAYS_NOTHING).all()
        else:
            np.testing.assert_array_equal(labels, view.labels)
        assert not labels[view.labels == 0].any() and colors.shape == (len(HUMAN.shapes), 8)
        own = render_view(BODY, camera)
        seen = occluders.look(0, BODY, camera)
        u0, v0, u1, v1 = seen.region
        hidden = (own.labels > 0) & (view.depth < own.depth - 0.01)
        np.testing.assert_array_equal(seen.labels > 0, ((own.labels > 0) & ~hidden)[v0:v1, u0:u1])
        assert hidden.any() is np.bool_(before) and seen.others[(view.labels > 0)[v0:v1, u0:u1]].all()
        everybody = occluders.with_neighbors(0, seen)
        u0, v0, u1, v1 = everybody.region
        np.testing.assert_array_equal(everybody.labels > 0, ((view.labels > 0) | (own.labels > 0))[v0:v1, u0:u1])
        assert not (view.labels > 0)[:v0].any() and not (view.labels > 0)[:, u1:].any()


def test_colors_of_several_others_are_told_apart():
    occluders, a, b = Occluders(None, RIG), beside(0.0, -0.9), beside(0.0, 0.9)
    occluders.show([neighbor(a), neighbor(b)], neighbor(beside(0.0, 30.0)))
    for i, camera in enumerate(RIG):
        views = [render_view(body, camera) for body in (a, b)]
        labels, colors = occluders.neighbors[i]
        alone = (views[1].labels > 0) & (views[0].labels == 0) & (labels != SAYS_NOTHING)
        np.testing.assert_array_equal(labels[alone], views[1].labels[alone] + len(HUMAN.shapes))
        assert len(colors) == 2 * len(HUMAN.shapes)


def test_of_whom_nothing_is_known_nothing_is_told():
    occluders, other = Occluders(None, RIG), beside(0.0, 0.9)
    for given, own in ((neighbor(other, known=False), neighbor(BODY)), (neighbor(other), None)):
        occluders.show([given], own)
        for i, camera in enumerate(RIG):
            shown = render_view(other, camera).labels > 0
            np.testing.assert_array_equal(occluders.neighbors[i][0] == SAYS_NOTHING, shown)
    occluders.show([], neighbor(BODY))
    assert occluders.depths == [NOTHING] * len(RIG) and occluders.neighbors == [NO_NEIGHBORS] * len(RIG)


def test_fixed_things_hide_others_too():
    scene, _ = screen(0.6)
    fixed, occluders = Occluders(scene, RIG), Occluders(scene, RIG)
    occluders.show([neighbor(BODY)], neighbor(beside(0.0, 30.0)))
    behind = fixed.depths[0] < render_view(BODY, RIG.cameras[0]).depth
    assert not occluders.neighbors[0][0][behind].any() and occluders.neighbors[0][0].any()
    np.testing.assert_array_equal(occluders.depths[0], np.minimum(fixed.depths[0], render_view(BODY, RIG.cameras[0]).depth))
