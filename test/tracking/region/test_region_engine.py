"""The engine of correspondence lines, part by part: sizes, cameras, colors, robustness."""

from types import SimpleNamespace

import numpy as np
import pytest

from helpers.cameras.start_scenes import scene, standing
from tracker_node.model.configuration import Configuration
from tracker_node.objective.lines.correspondences import LinesAt
from tracker_node.parallel import Workers
from tracker_node.tracking.config import RegionConfig, from_dict
from tracker_node.tracking.engine import Engine
from tracker_node.tracking.engines import contour_engine
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.region.modality import LineDetail, RegionModality

SCENE = scene(3)
TRUE = standing(SCENE.model, 0.05, -0.05, 0.4)
CONFIG = {"region.sigma_rate": 0.05, "region.learn_every": 2}


def engine(**options) -> Engine:
    return contour_engine(SCENE.rig, SCENE.model, from_dict(CONFIG | options), {}, Workers(1))


def region_of(made: Engine) -> RegionModality:
    (region,) = made.modalities
    return region


@pytest.fixture(scope="module")
def begun():
    """Begun and fitted at the true pose."""
    made, images = engine(), SCENE.images(TRUE)
    start = made.begin(images, TRUE)
    made.observe(images, start)
    return made, made.fit(start, first=True), images


def test_a_fit_from_the_truth_stays_there(begun):
    _, result, _ = begun
    off = Configuration(SCENE.model, result.state).landmarks_world - Configuration(SCENE.model, TRUE).landmarks_world
    assert np.linalg.norm(off, axis=1).mean() < 0.03
    assert result.converged


def test_the_size_is_that_of_the_body_and_of_the_median_camera(begun):
    made, _, _ = begun
    size_m, px_per_m = region_of(made).size(TRUE)
    places = Configuration(SCENE.model, TRUE).Ts_world_shape[:, :3, 3]
    middle = places.mean(axis=0)
    assert size_m == pytest.approx(2.0 * np.linalg.norm(places - middle, axis=1).max())
    depths = [(camera.T_cam_world[:3, :3] @ middle + camera.T_cam_world[:3, 3])[2] for camera in SCENE.rig]
    assert px_per_m == pytest.approx(210.0 / np.median(depths))


def test_a_camera_that_looks_elsewhere_has_no_say_in_the_size(begun):
    made, _, _ = begun
    behind = standing(SCENE.model, 9.0, 1.0, 0.0)  # behind the first camera, far before the third
    size_m, px_per_m = region_of(made).size(behind)
    middle = Configuration(SCENE.model, behind).Ts_world_shape[:, :3, 3].mean(axis=0)
    depths = [(camera.T_cam_world[:3, :3] @ middle + camera.T_cam_world[:3, 3])[2] for camera in SCENE.rig]
    assert px_per_m == pytest.approx(np.median([210.0 / depth for depth in depths if depth > 0.5 * size_m]))
    assert depths[0] < 0.0


def test_with_no_camera_the_body_has_its_usual_pixels():
    size_m, px_per_m = region_of(engine()).size(TRUE)
    assert size_m * px_per_m == pytest.approx(300.0)


def cameras_say(made, shares, expected=None, n_images=3):
    expected = [1000.0] * 3 if expected is None else expected
    evidence = SimpleNamespace(
        expected=np.array(expected)[:, None] * [0.5, 0.5],
        close=(np.array(expected) * shares)[:, None] * [0.25, 0.75],
    )
    image_set = SimpleNamespace(cameras=[camera.name for camera in SCENE.rig][:n_images])
    return made.judge._status_of_cameras(evidence, image_set, [0, 1, 2])


def test_a_camera_that_sees_half_of_what_is_usual_is_named(begun):
    made, _, _ = begun
    assert cameras_say(made, [0.8, 0.8, 0.41]) == (Status.TRACKING, "")
    status, reason = cameras_say(made, [0.8, 0.8, 0.39])
    assert status is Status.DEGRADED
    assert reason == "the body's outline is not found in cam2 (39 %)"
    _, reason = cameras_say(made, [0.1, 0.8, 0.8])
    assert "cam0 (10 %)" in reason


def test_cameras_without_an_image_are_counted(begun):
    made, _, _ = begun
    assert cameras_say(made, [0.8] * 3, n_images=2) == (Status.DEGRADED, "2 of 3 cameras")


def test_one_camera_alone_is_too_few(begun):
    made, _, _ = begun
    assert cameras_say(made, [0.8] * 3, [1000.0, 0.0, 0.0]) == (Status.DEGRADED, "only cam0 sees where the body is")
    assert cameras_say(made, [0.8] * 3, [0.0, 0.0, 0.0]) == (Status.DEGRADED, "only no camera sees where the body is")
    assert cameras_say(made, [0.8] * 3, [1000.0, 1000.0, 0.0]) == (Status.TRACKING, "")


def test_residuals_are_of_each_camera_and_of_all(begun):
    made, result, images = begun
    report = made.report(result, SCENE.image_set(3, images))
    assert [camera.camera for camera in report.cameras] == ["cam0", "cam1", "cam2"]
    assert {camera.stamp_ns for camera in report.cameras} == {100_000_000}
    each = np.array([camera.residual for camera in report.cameras])
    assert each.min() <= report.residual <= each.max()
    assert min(camera.samples for camera in report.cameras) > 20
    without = made.report(result, SCENE.image_set(3, [images[0], None, images[2]]))
    assert without.cameras[1].stamp_ns == 0


def test_the_spread_is_followed_by_its_rate(begun, monkeypatch):
    """From fit to fit, once many image sets have been learned from."""
    made, result, _ = begun
    region, fitting = RegionConfig(), made.solver._fitting
    monkeypatch.setattr(region_of(made), "n_learned", 10**6)

    def followed(spread_px, model_sigma_px):
        monkeypatch.setattr(LinesAt, "spread_px", spread_px)
        return fitting.fit(result.state, (1.0,), None, model_sigma_px).model_sigma_px

    expected = np.clip(np.sqrt(0.95 * 1.2**2 + 0.05 * 0.8**2), region.least_sigma_px, region.model_sigma_px)
    assert followed(0.8, 1.2) == pytest.approx(expected)
    assert followed(None, expected) == pytest.approx(expected)
    assert followed(1e3, expected) == region.model_sigma_px


def acquainted(made: Engine) -> Engine:
    """As if all cameras had learned the body's colors."""
    for colors in region_of(made).appearance._colors:
        colors.knows = True
    return made


def test_a_camera_that_joins_learns_at_once(monkeypatch):
    """Whole colors, whatever the turn and however slowly the others learn, and only once."""
    made = acquainted(engine(**{"region.color_rate": 0.0}))
    appearance = region_of(made).appearance
    appearance._colors[1].knows = False
    learnt = []
    monkeypatch.setattr(
        appearance, "learn", lambda images, state, offsets, rate, *_: learnt.append(([i is not None for i in images], rate))
    )
    made.learn(SCENE.images(TRUE), TRUE)
    assert learnt == [([False, True, False], 1.0)]
    monkeypatch.undo()
    made.learn(SCENE.images(TRUE), TRUE)
    assert appearance.known == [True] * 3
    monkeypatch.setattr(appearance, "learn", lambda *_: pytest.fail("learns again"))
    made.learn(SCENE.images(TRUE), TRUE)


def test_cameras_learn_in_turn(monkeypatch):
    made = acquainted(engine())
    learnt = []
    appearance = region_of(made).appearance
    monkeypatch.setattr(appearance, "learn", lambda images, *_: learnt.append([image is not None for image in images]))
    images = SCENE.images(TRUE)
    for _ in range(3):
        made.learn(images, TRUE)
    assert learnt == [[True, False, True], [False, True, False], [True, False, True]]
    made.learn([images[0], None, images[2]], TRUE)  # the turn of the camera that has none
    assert len(learnt) == 3


def test_beside_a_lost_limb_the_background_is_learned_but_for_its_colors():
    made, images = engine(), SCENE.images(TRUE)
    appearance = region_of(made).appearance
    shapes, nobody = len(SCENE.model.shapes), [None] * len(SCENE.rig)
    region_of(made).learn_first(images, TRUE, 4)
    appearance.learn(images, TRUE, nobody, 0.05, 4, np.zeros(shapes))
    assert not any(room.packed[0].size for room in appearance._rooms)  # nothing is where it is taken to be
    in_place = np.ones(shapes)
    in_place[-1] = 0.0
    appearance.learn(images, TRUE, nobody, 0.05, 4, in_place)
    for image, room, colors in zip(images, appearance._rooms, appearance._colors, strict=True):
        known, doubted = room.packed[0] > 0, colors.as_likely_of(in_place < 0.5)
        b, g, r = (image[..., channel] >> 4 for channel in range(3))
        alike = doubted[(b.astype(int) * 16 + g) * 16 + r]
        assert alike.any() and known.any()
        assert not known[alike].any()


def test_colors_that_do_not_change_are_not_learnt(monkeypatch):
    made = acquainted(engine(**{"region.color_rate": 0.0}))
    monkeypatch.setattr(region_of(made).appearance, "learn", lambda *_: pytest.fail("learns"))
    made.learn(SCENE.images(TRUE), TRUE)


def test_a_body_out_of_sight_is_lost(begun):
    made, images = engine(), begun[2]
    made.begin(images, TRUE)
    made.observe(images, TRUE)
    above = standing(SCENE.model, 0.0, 0.0, 0.0)
    above.T_world_root[2, 3] = 50.0
    result = made.fit(above, first=False)
    found = made.assess(result, SCENE.image_set(0, images))
    assert found.status is Status.LOST
    assert found.noise
    assert "no camera sees the body" in found.reason


def test_a_body_where_it_is_is_not_lost(begun):
    made, result, images = begun
    found = made.assess(result, SCENE.image_set(0, images))
    assert found.status is not Status.LOST
    assert not found.noise
    evidence = region_of(made).part_evidence(result.correspondences, result.state, RegionConfig().inlier_px)
    assert found.log_ratio == pytest.approx(float((evidence.log_ratio - 3.0 * evidence.expected).sum()))


def test_before_anything_is_known_nothing_is_drawn():
    made, images = engine(), SCENE.images(TRUE)

    def active():
        return region_of(made).correspond(TRUE, LineDetail(1.0, 0.5)).active

    made.observe(images, TRUE)
    assert active() == []
    made.begin(images, TRUE)
    made.observe([images[0], None, images[2]], TRUE)
    assert active() == [0, 2]
    made.observe(images, None)
    assert active() == []


def test_no_part_at_all_tells_nothing():
    region, shapes = region_of(engine()), np.zeros(len(SCENE.model.shapes), dtype=np.bool_)
    assert region.distinctness(shapes) == 0.0
    assert region.distinctness(~shapes) == 0.0  # no camera shows anything
