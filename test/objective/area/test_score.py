"""The scores of poses against the masks that the ray-caster draws of them; the hull against a ball of known place."""

import cv2
import numpy as np
import pytest

from helpers.cameras.render_scenes import look_at
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid, Mesh
from tracker_node.objective.area.score import AreaScore
from tracker_node.objective.area.visual_hull import occupancy, places, seen_from, seen_volume
from tracker_node.observation.small_view import SmallView
from tracker_node.parallel import Workers
from tracker_node.render.raycast.raycaster import render_view

K = np.array([[70.0, 0.0, 44.5], [0.0, 70.0, 39.5], [0.0, 0.0, 1.0]])
LENS = CameraModel(90, 80, K)
EYES = ((3.0, 0.5, 1.4), (-0.6, 3.1, 1.8), (-2.8, -1.4, 0.9))
CAMERAS = [look_at(eye, (0.0, 0.0, 0.9), LENS, f"cam{i}") for i, eye in enumerate(EYES)]


def score_of(model, cameras=CAMERAS, threads=1) -> AreaScore:
    return AreaScore(model, cameras, Workers(threads))


@pytest.mark.parametrize("threads", [1, 3])
def test_scores_are_the_sums_under_the_masks_part_by_part(threads):
    model, rng = human_model(), np.random.default_rng(2)
    maps = [rng.normal(size=(2, 80, 90)).astype(np.float32) for _ in CAMERAS]
    of_shape = np.arange(len(model.shapes)) % 2
    score = score_of(model, threads=threads)
    score.set_maps(maps, of_shape)
    roots, joints = [], []
    for _ in range(40):  # more than one chunk
        turn = so3.exp(rng.normal(size=3) * [0.3, 0.3, 2.0])
        roots.append(se3.from_rotation_translation(turn, np.array([*rng.normal(size=2) * 0.6, 0.95])))
        joints.append(np.clip(rng.normal(size=model.chain.n_axes) * 0.5, model.chain.lower, model.chain.upper))
    totals = score.totals(np.array(roots), np.array(joints))
    for n in (0, 17, 39):
        configuration = Configuration(model, State(roots[n], joints[n]))
        for i, camera in enumerate(CAMERAS):
            labels = render_view(configuration, camera).labels
            covered = labels > 0
            expected = maps[i][of_shape[labels[covered] - 1], covered.nonzero()[0], covered.nonzero()[1]].sum()
            assert totals[n, i, 1] == covered.sum()
            assert totals[n, i, 0] == pytest.approx(expected, abs=1e-2)


def test_poses_leave_nothing_behind_for_those_that_follow():
    """Scored together, and by a score that has drawn little else: the whole body, and a part that hides and is hidden."""
    model, rng = human_model(), np.random.default_rng(5)
    maps, n = [rng.normal(size=(80, 90)).astype(np.float32) for _ in CAMERAS], 6
    joints = np.clip(rng.normal(size=(n, model.chain.n_axes)) * 0.5, model.chain.lower, model.chain.upper)
    roots = np.repeat(se3.from_rotation_translation(np.eye(3), np.array([0.1, 0.0, 0.95]))[None], n, axis=0)
    joints[1:, :3] = joints[0, :3]
    part = np.array(["arm" in shape.name or "hand" in shape.name for shape in model.shapes])
    assert part.any() and not part.all()
    for shapes in (None, part):
        score = score_of(model)
        score.set_maps(maps)
        together = score.totals(roots, joints, shapes)
        np.testing.assert_array_equal(score.totals(roots, joints, shapes), together)
        for i in range(n):
            alone = score_of(model)
            alone.set_maps(maps)
            pair = [0, i]  # the rest of the body is where the first has it
            np.testing.assert_array_equal(alone.totals(roots[pair], joints[pair], shapes)[1], together[i])


def test_cameras_without_maps_do_not_count_and_meshes_count_as_boxes():
    size = (0.4, 0.3, 0.9)
    low, high = -0.5 * np.array(size), 0.5 * np.array(size)
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    shift = np.array([0.0, 0.1, 0.8])
    mesh = Mesh(corners + shift, np.array([[0, 1, 2], [1, 3, 2], [4, 6, 5], [5, 6, 7], [0, 4, 1], [1, 4, 5]]))
    box = Shape("box", "body", Box(size), se3.from_rotation_translation(np.eye(3), shift))
    results = []
    for shape in (Shape("mesh", "body", mesh), box):
        score = score_of(ArticulatedModel("body", KinematicChain(("body",), ()), (shape,)))
        score.set_maps([np.ones((80, 90), np.float32), None, np.ones((80, 90), np.float32)])
        results.append(score.totals(np.eye(4)[None], np.zeros((1, 0)))[0])
    np.testing.assert_array_equal(results[0], results[1])
    assert results[0][0, 1] > 100 and results[0][1, 1] == 0


def ball_maps(middle, radius):
    model = ArticulatedModel("ball", KinematicChain(("ball",), ()), (Shape("ball", "ball", Ellipsoid((radius,) * 3)),))
    configuration = Configuration(model, State(se3.from_rotation_translation(np.eye(3), np.array(middle)), np.zeros(0)))
    return [np.where(render_view(configuration, camera).labels > 0, 3.0, -3.0).astype(np.float32) for camera in CAMERAS]


def test_a_ball_is_found_in_its_place_and_only_there():
    middle = np.array([0.3, -0.2, 1.0])
    maps = ball_maps(middle, 0.35)
    volume = seen_volume(CAMERAS, 0.7, 0.06)
    occupied = occupancy(volume, CAMERAS, maps, 2)
    found = places(volume, occupied, 0.7, 3)
    assert np.linalg.norm(found[0] - middle) < 0.05
    inside = np.linalg.norm(volume.points - middle, axis=1) < 0.25
    outside = np.linalg.norm(volume.points - middle, axis=1) > 0.6
    assert occupied.ravel()[inside].min() > 0.8 and occupied.ravel()[outside].max() < 0.6


def test_nothing_is_found_where_nothing_stands_out():
    volume = seen_volume(CAMERAS, 0.7, 0.1)
    empty = [np.full((80, 90), -3.0, np.float32) for _ in CAMERAS]
    assert places(volume, occupancy(volume, CAMERAS, empty, 2), 0.7, 3).shape == (0, 3)


def test_the_volume_is_about_where_the_axes_meet():
    points = seen_volume(CAMERAS, 1.7, 0.1).points
    np.testing.assert_allclose(0.5 * (points.min(axis=0) + points.max(axis=0)), [0.0, 0.0, 0.9], atol=0.15)


def test_the_volume_of_one_camera_is_as_far_as_a_body_fills_its_image():
    camera = CAMERAS[0]
    middle = seen_volume([camera], 1.0, 0.1).points.mean(axis=0)
    pixels, _ = camera.project(middle)
    np.testing.assert_allclose(pixels, K[:2, 2], atol=2.0)
    assert np.linalg.norm(middle - camera.center) == pytest.approx(1.5 * 70.0 / 80.0, rel=0.15)


def test_small_views_are_straight():
    bent = CameraModel(360, 320, K * [[4.0], [4.0], [1.0]], "plumb_bob", (-0.2, 0.05, 0.001, -0.001))
    camera = Camera("cam", bent, CAMERAS[0].T_world_cam)
    view = SmallView(camera, 0.25)
    points = np.array([[0.5, 0.6, 1.6], [-0.4, -0.5, 0.3], [0.0, 0.0, 1.0]])
    image = np.zeros((320, 360, 3), np.uint8)
    for u, v in camera.project(points)[0]:
        cv2.circle(image, (round(float(u)), round(float(v))), 6, (255, 255, 255), -1)
    small = view.shrink(image)[..., 0]
    expected, _ = view.camera.project(points)
    assert view.camera.model.distortion_model == "none" and small.shape == (80, 90)
    _, marks = cv2.threshold(small, 100, 255, cv2.THRESH_BINARY)
    _, _, _, centers = cv2.connectedComponentsWithStats(marks)
    for pixel in expected:
        assert np.linalg.norm(centers[1:] - pixel, axis=1).min() < 0.6


def test_a_pixel_sees_the_likeliest_point_before_it():
    middle = np.array([0.3, -0.2, 1.0])
    maps = ball_maps(middle, 0.35)
    volume = seen_volume(CAMERAS, 0.7, 0.05)
    seen = seen_from(CAMERAS[0], volume, occupancy(volume, CAMERAS, maps, 3))
    ball = cv2.erode((maps[0] > 0).astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    beside = cv2.dilate((maps[0] > 0).astype(np.uint8), np.ones((15, 15), np.uint8)) == 0
    assert seen.shape == (80, 90)
    assert seen[ball].min() > 0.8
    assert seen[beside].max() < 0.5
