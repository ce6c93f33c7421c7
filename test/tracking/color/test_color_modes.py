"""Rigid things of one color, or that few cameras see: what they cover, the poses beside the fit, and what is said of them."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from benchmark.contour.box import displaced, image_sets, rig_around
from tracker_node.camera.rig import CameraRig
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box
from tracker_node.objective.color.score import ColorCoverage, ColorObjective, ColorOptions
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.estimate import Status, TrackEstimate
from tracker_node.tracking.tracker import Tracker
from tracker_node.tracking.uncertainty.modes import Modes, point_sigma

COLORS = from_dict({"modalities": ["color"], "color.search_states": 0, "threads": 1})
TURN = so3.exp(np.array([0.4, -0.3, 0.5]))


def rigid(*sizes: tuple[float, float, float], color=(190, 60, 45)) -> ArticulatedModel:
    shapes = tuple(Shape(f"s{i}", "a", Box(size), np.eye(4), color) for i, size in enumerate(sizes))
    return ArticulatedModel("m", KinematicChain(("a",), ()), shapes)


BOX = rigid((0.2, 0.12, 0.08))
CROSS = rigid((0.22, 0.03, 0.03), (0.03, 0.22, 0.03), (0.03, 0.03, 0.22))


def resting(model: ArticulatedModel) -> State:
    return State.neutral(model, se3.from_rotation_translation(TURN, np.zeros(3)))


def small_rig(*directions_deg: tuple[float, float]) -> CameraRig:
    return rig_around(directions_deg or [(0.0, 30.0)])


def tracked(rig: CameraRig, model: ArticulatedModel, start: State, n: int, known: CameraRig | None = None) -> list[TrackEstimate]:
    """``known``: what the tracker knows of the cameras and lights; None: all."""
    tracker = Tracker(known or rig, model, COLORS, None, start)
    return [tracker.step(one) for one in image_sets(rig, model, [resting(model)] * n)]


def degrees_off(estimate: TrackEstimate, truth: State) -> float:
    return float(np.degrees(np.linalg.norm(truth.difference(estimate.state)[3:6])))


@pytest.fixture(scope="module")
def seen_by_one() -> tuple[CameraRig, list[np.ndarray]]:
    rig = small_rig()
    (one,) = image_sets(rig, BOX, [resting(BOX)])
    return rig, [image.pixels for image in one.images]


def test_a_body_wins_nothing_by_hiding_within_its_own_color(seen_by_one):
    rig, images = seen_by_one
    mean = ColorObjective(BOX, rig, ColorOptions("normalized"))
    capped = ColorObjective(BOX, rig, ColorOptions("normalized", cap=10.0))
    for objective in (mean, capped):
        objective.set_images(images)
    behind = resting(BOX).retract(np.concatenate([-0.5 * rig.cameras[0].center, np.zeros(3)]))
    there, away = mean.scores([resting(BOX), behind])
    assert away < 1.1 * there
    coverage = ColorCoverage(capped, 3.0 * 12.0**2)
    there, away = coverage.scores([resting(BOX), behind])
    assert there < 1.5 * away < 0.0
    assert capped.options.cap == pytest.approx(12.0 * np.sqrt(2.0))
    assert coverage.at_row_step(2).score(resting(BOX)) == pytest.approx(there, rel=0.1)


def test_one_camera_does_not_lose_a_box_of_one_color_and_says_how_little_it_knows():
    truth = resting(BOX)
    estimates = tracked(small_rig(), BOX, displaced(truth, 3, 0.003, np.radians(1.0)), 4)
    for estimate in estimates:
        error = truth.difference(estimate.state)
        assert np.linalg.norm(error[:3]) < 0.05  # of 1.1 m; by the mean over the mask alone it is 0.1 to 1.3 m off
        assert estimate.status is Status.DEGRADED and "is known to" in estimate.status_reason
        assert error @ np.linalg.solve(estimate.covariance, error) < 30.0
        assert np.linalg.eigvalsh(estimate.second_order)[-1] > 0.005**2


def test_two_cameras_find_a_box_of_one_color_that_starts_turned():
    truth, rig = resting(BOX), small_rig((0.0, 30.0), (75.0, 30.0))
    estimate = tracked(rig, BOX, displaced(truth, 5, 0.01, np.radians(18.0)), 2)[-1]
    assert estimate.status is Status.TRACKING and degrees_off(estimate, truth) < 3.0


def test_many_cameras_know_a_box_of_one_color_less_well_than_one_of_several():
    rig = small_rig((0.0, 30.0), (75.0, 30.0), (150.0, 30.0))
    colors = (190, 60, 45), (60, 160, 70), (50, 70, 190), (200, 190, 60), (150, 50, 160), (60, 170, 180)
    several = replace(BOX, shapes=(replace(BOX.shapes[0], primitive=replace(BOX.shapes[0].primitive, face_colors_rgb=colors)),))
    one, many = (tracked(rig, model, resting(model), 1)[0] for model in (BOX, several))
    assert one.second_order is not None and many.second_order is None
    assert np.trace(one.covariance[3:6, 3:6]) > 2.0 * np.trace(many.covariance[3:6, 3:6])


def test_before_walls_of_its_own_hue_a_gray_box_is_not_compared_by_that():
    gray, rig = rigid((0.2, 0.12, 0.08), color=(120, 120, 120)), small_rig()
    (one,) = image_sets(rig, gray, [resting(gray)])
    walls = np.repeat(one.images[0].pixels.mean(axis=2, keepdims=True), 3, axis=2).astype(np.uint8)
    tracker = Tracker(rig, gray, COLORS, None, resting(gray))
    estimate = tracker.step(replace(one, images=(replace(one.images[0], pixels=walls),)))
    assert estimate.second_order is None


@pytest.mark.parametrize("place", ["looks away", "is before"])
def test_a_camera_that_does_not_see_the_body_changes_nothing(place):
    """It looks away from the body, or has it behind itself."""
    rig = small_rig()
    camera = rig.cameras[0]
    T = camera.T_world_cam.copy()
    T[:3, :3] = T[:3, :3] @ so3.exp(np.array([0.0, np.radians(120.0 if place == "looks away" else 180.0), 0.0]))
    both = replace(rig, cameras=(camera, replace(camera, name="other", T_world_cam=T)))
    start = displaced(resting(BOX), 3, 0.003, np.radians(1.0))
    (alone,), (beside,) = (tracked(cameras, BOX, start, 1) for cameras in (rig, both))
    assert np.isfinite(beside.covariance).all()
    assert np.linalg.norm(beside.state.T_world_root[:3, 3] - alone.state.T_world_root[:3, 3]) < 0.02


@dataclass(frozen=True)
class Found:
    state: State


def test_turns_that_no_image_tells_are_no_modes():
    modes = Modes(small_rig(), CROSS, 0.25, by_texture=True)
    state = resting(CROSS)
    axes = TURN[:, 2] * np.pi / 2, (0.0, 0.4, 0.0)
    turned, tilted = (Found(state.retract(np.array([0.0, 0.0, 0.0, *axis]))) for axis in axes)
    found = modes.beside(Found(state), [(turned, 0.0), (tilted, -1.0)])
    assert [mode.fit for mode in found] == [tilted]
    tangents = modes.follow(state, found)
    assert tangents[:, 0] == pytest.approx(found[0].tangent * np.sqrt(np.exp(-1.0) / (1.0 + np.exp(-1.0))))
    assert np.allclose(modes.followed(state)[0].T_world_root, tilted.state.T_world_root)
    assert modes.beside(Found(state), [(tilted, -7.0)]) == []
    assert len(modes.starts(state)) == 18
    beside = Found(turned.state.retract(np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])))
    assert [mode.fit for mode in modes.beside(Found(state), [(beside, 0.0)])] == [beside]  # where nothing maps it to


def test_points_are_known_as_well_as_the_middle_and_the_turn():
    state, covariance = resting(BOX), np.diag([1e-6, 4e-6, 1e-6, 0.0, 1e-4, 0.0])
    assert point_sigma(BOX, 0.2, state, covariance) == pytest.approx(np.sqrt(4e-6 + 0.01 * 1e-4))
