"""Errors of contours against what geometry says of an upright cylinder before a plain wall, whose image is two straight edges."""

import numpy as np
import pytest

from helpers.cameras.render_scenes import look_at
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import CameraRig
from tracker_node.experiments.contour.errors import (
    METHODS,
    PUBLISHED,
    TITLES,
    ContourError,
    by_method,
    direction_of,
    until_converged,
    valley,
)
from tracker_node.experiments.contour.figures import shoot
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import TruncatedCone
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.tracking.config import TrackerConfig

DISTANCE_M, RADIUS_M, FOCAL_PX = 4.0, 0.4, 200.0
HALF_WIDTH_PX = FOCAL_PX * RADIUS_M / np.sqrt(DISTANCE_M**2 - RADIUS_M**2)
PX_M = DISTANCE_M / FOCAL_PX
WALL, BODY = 60, 200


def cylinder(thickness=1.0):
    """So long that its ends are out of the image."""
    shape = Shape("part", "part", TruncatedCone(thickness * RADIUS_M, thickness * RADIUS_M, 0.0, -3.0, 3.0))
    return ArticulatedModel("cylinder", KinematicChain(("part",), ()), (shape,))


@pytest.fixture(scope="module")
def camera():
    lens = CameraModel(200, 120, np.array([[FOCAL_PX, 0.0, 100.0], [0.0, FOCAL_PX, 60.0], [0.0, 0.0, 1.0]]))
    return look_at((DISTANCE_M, 0.0, 0.0), (0.0, 0.0, 0.0), lens, "cam01")


@pytest.fixture(scope="module")
def image(camera):
    image = np.full((120, 200, 3), WALL, dtype=np.uint8)
    image[:, np.abs(np.arange(200) - 100.0) <= HALF_WIDTH_PX] = BODY
    return image


def errors(camera, image, distances, shifts_px, thickness=1.0):
    model = cylinder(thickness)
    state = State.neutral(model)
    error = ContourError(CameraRig((camera,)), model, {"cam01": np.full_like(image, WALL)}, distances)
    error.look(ImageSet(0, (CameraImage("cam01", 0, image),)), state)
    direction = np.zeros(6)
    direction[:3] = camera.T_world_cam[:3, 0] * PX_M
    return error.along(state, direction, np.asarray(shifts_px, dtype=float))


@pytest.mark.parametrize(
    ("distances", "per_px"),
    # One of the two lines is outside by the shift, the other one inside; both are off their edges by it.
    [("silhouette", np.sqrt(1 / 2)), ("edges", 1.0), ("sum", np.sqrt((2**2 + 1) / 2))],
)
def test_a_shifted_part_is_off_by_what_geometry_says(camera, image, distances, per_px):
    shifts = np.array([-12.0, -6.0, 0.0, 6.0, 12.0])
    found = errors(camera, image, distances, shifts)
    np.testing.assert_allclose(found, per_px * np.abs(shifts), atol=1.0)
    assert found.argmin() == 2


def test_silhouettes_alone_let_a_thin_model_slide(camera, image):
    shifts = np.arange(-12.0, 12.5, 0.5)
    play = 0.2 * HALF_WIDTH_PX  # to either side, of a model a fifth thinner
    found = {key: errors(camera, image, key, shifts, 0.8) for key in PUBLISHED}
    inside = np.abs(shifts) <= play - 1.0
    assert np.abs(found["silhouette"][inside]).max() < 0.25
    np.testing.assert_allclose(found["edges"][inside], np.sqrt(play**2 + shifts[inside] ** 2), atol=0.8)
    assert valley(shifts, found["silhouette"]).flat == pytest.approx(2.0 * play, abs=2.0)
    for key in ("edges", "sum"):
        assert valley(shifts, found[key]).flat < 0.7 * valley(shifts, found["silhouette"]).flat
        assert abs(valley(shifts, found[key]).minimum) <= 1.0


def test_a_body_out_of_all_images_has_no_error(camera, image):
    assert np.isnan(errors(camera, image, "sum", [-500.0])).all()


def test_the_valley_of_a_known_curve():
    changes = np.arange(-5.0, 6.0)
    scores = np.array([4.0, 5.0, 3.0, 2.0, 1.2, 1.0, 1.1, 1.2, 3.0, 4.0, 5.0])
    found = valley(changes, scores)
    assert (found.minimum, found.flat, found.rising) == (0.0, 3.0, 4.0)


def test_a_picture_shows_what_was_seen(camera, image):
    body = Configuration(cylinder(), State.neutral(cylinder()))
    config = by_method(TrackerConfig(), "sum")
    shot = shoot(camera, image, body, body, np.full_like(image, WALL), config, 20)
    assert np.mean(shot.silhouette == (image[:, :, 0] == BODY)) > 0.98
    columns = np.flatnonzero(shot.edges[10:-10].any(axis=0))
    np.testing.assert_allclose(np.abs(columns - 100.0), HALF_WIDTH_PX, atol=1.6)
    row = shot.distance[60]
    assert np.isnan(row[0]) and np.nanmin(row) < 0.6
    assert row[100] == pytest.approx(min(HALF_WIDTH_PX, config.chamfer.edge_truncation_px), abs=1.6)
    behind = State.neutral(cylinder())
    behind.T_world_root[:3, 3] = (3.0 * DISTANCE_M, 0.0, 0.0)
    away = Configuration(cylinder(), behind)
    assert shoot(camera, image, away, body, np.full_like(image, WALL), config, 20) is None


def test_methods_are_what_they_are_called():
    assert set(METHODS) == set(TITLES)
    for method in METHODS:
        config = by_method(TrackerConfig(), method)
        assert config.modalities == (("region",) if method == "region" else ("chamfer",))
        assert not config.initialization.enabled
        if method in PUBLISHED:
            assert config.chamfer.distances == method
    ablated = until_converged(TrackerConfig(), False)
    assert not ablated.chamfer.sliding and ablated.chamfer.max_iterations > TrackerConfig().chamfer.max_iterations


def test_a_direction_moves_one_degree_of_freedom_only():
    np.testing.assert_array_equal(direction_of(cylinder(), "root_y"), [0, 1, 0, 0, 0, 0])
