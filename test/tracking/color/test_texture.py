"""A plate by its picture, through the tracker: followed, hidden, jumping away, and what the status says."""

import numpy as np
import pytest

from helpers.bodies.textured_plate import MODEL, TRUE, errors, film, image_set, moved, rig
from tracker_node.errors import ModelError
from tracker_node.model.humans.human import human_model
from tracker_node.objective.points.texture import TextureObjective
from tracker_node.observation.image_set import ImageSet
from tracker_node.tracking.color import texture
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.tracker import Tracker

CONFIG = from_dict({
    "modalities": ["texture"],
    "texture": {"search_states": 1000},
    "motion.velocity_gain": 1.0,
})  # fmt: skip
FEW = from_dict({"modalities": ["texture"], "texture": {"search_states": 20}})
PERIOD_NS = 10**8


def run(states) -> list:
    """Estimates of a film in which the plate goes through ``states``; None: it is not there, an empty list: no images."""
    tracker = Tracker(rig(), MODEL, CONFIG, initial_state=states[0])
    images = [[] if isinstance(state, list) else film(state, seed) for seed, state in enumerate(states)]
    return [tracker.step(image_set(n * PERIOD_NS, pictures)) for n, pictures in enumerate(images)]


def test_a_moving_plate_is_followed():
    step = np.array([0.02, 0.01, 0.0, 0.0, 0.05, 0.08])
    states = [TRUE.retract(n * step) for n in range(5)]
    estimates = run(states)
    assert [estimate.status for estimate in estimates] == [Status.TRACKING] * 5
    for estimate, state in zip(estimates, states, strict=True):
        distance, angle = errors(estimate.state, state)
        assert distance < 0.7
        assert angle < 0.3
    last = estimates[-1]
    np.testing.assert_allclose(last.velocity[:3], 1e9 / PERIOD_NS * step[:3], atol=0.02)
    assert 1e-5 < np.sqrt(last.covariance[0, 0]) < 2e-3
    assert all(camera.samples > 500 for camera in last.cameras)


def test_a_plate_that_vanishes_is_lost_and_found_again_elsewhere():
    away = moved(TRUE, 0.18, 20.0, seed=0)
    estimates = run([TRUE, None, away, away])
    assert estimates[1].status is Status.LOST
    assert "contrast" in estimates[1].status_reason
    assert errors(estimates[1].state)[0] < 20.0, "it stays where it was last"
    assert estimates[2].status is Status.DEGRADED
    assert "found again" in estimates[2].status_reason
    assert estimates[3].status is Status.TRACKING
    assert errors(estimates[3].state, away)[0] < 1.0


def test_a_plate_that_was_gone_for_long_is_looked_for_in_all_images_and_found():
    search = {"after_lost_sets": 2, "interval_sets": 0, "watch_sets": 4}
    config = from_dict({"modalities": ["texture"], "texture": {"search_states": 20}, "initialization": search})
    tracker, away = Tracker(rig(), MODEL, config, initial_state=TRUE), moved(TRUE, 0.18, 20.0)
    states = [*[None] * 3, *[TRUE] * 3, *[None] * 6, *[away] * 10]
    estimates = [tracker.step(image_set(n * PERIOD_NS, film(state))) for n, state in enumerate(states)]
    assert {estimate.status for estimate in estimates[6:12]} == {Status.LOST}
    assert estimates[-1].status is Status.TRACKING
    assert errors(estimates[-1].state, away)[0] < 1.0


def test_without_images_the_plate_is_lost():
    estimate = run([TRUE, []])[1]
    assert estimate.status is Status.LOST
    assert "no camera" in estimate.status_reason
    assert np.isfinite(estimate.covariance).all()


@pytest.fixture
def searches(monkeypatch) -> list:
    """One entry for every search."""
    made: list = []
    search = texture.reacquire
    monkeypatch.setattr(texture, "reacquire", lambda *arguments: made.append(1) or search(*arguments))
    return made


def test_it_waits_for_a_state_without_looking(searches):
    tracker = Tracker(rig(), MODEL, CONFIG)
    waiting = tracker.step(image_set(0, film(None)))
    assert waiting.status is Status.INITIALIZING
    assert not searches
    tracker.set_state(TRUE)
    assert tracker.step(image_set(PERIOD_NS, film())).status is Status.TRACKING


def test_the_search_can_be_switched_off(searches):
    config = from_dict({"modalities": ["texture"], "texture": {"search_states": 0}})
    tracker = Tracker(rig(), MODEL, config, initial_state=TRUE)
    estimate = tracker.step(image_set(0, film(None)))
    assert estimate.status is Status.LOST
    assert not searches
    np.testing.assert_array_equal(estimate.state.T_world_root, TRUE.T_world_root)
    Tracker(rig(), MODEL, FEW, initial_state=TRUE).step(image_set(0, film(None)))
    assert searches, "where it is not, a lost plate is looked for"


def test_a_lost_plate_is_reported_where_it_stays():
    tracker = Tracker(rig(), MODEL, FEW, initial_state=TRUE)
    estimate = tracker.step(image_set(0, film(None)))
    assert estimate.status is Status.LOST
    objective = TextureObjective(MODEL, rig())
    objective.set_images(film(None))
    there = objective.evaluate(estimate.state)
    assert [camera.samples for camera in estimate.cameras] == list(there.camera_points)
    np.testing.assert_allclose([camera.residual for camera in estimate.cameras], there.camera_rms)


def test_a_camera_that_shows_something_else_is_named():
    pictures = film()
    pictures[1] = film(None, seed=9)[1]
    tracker = Tracker(rig(), MODEL, CONFIG, initial_state=TRUE)
    estimate = tracker.step(image_set(0, pictures))
    assert estimate.status is Status.DEGRADED
    assert "cam1" in estimate.status_reason
    assert errors(estimate.state)[0] < 1.0


def test_a_body_without_pictures_is_refused():
    with pytest.raises(ModelError, match="textures"):
        Tracker(rig(), human_model(), CONFIG)


def test_a_search_in_vain_counts_too():
    none = from_dict({"modalities": ["texture"], "texture": {"search_states": 0}})
    counts = [
        Tracker(rig(), MODEL, config, initial_state=TRUE).step(image_set(0, film(None))).evaluations for config in (none, FEW)
    ]
    assert counts[1] >= counts[0] + 20


def test_a_camera_without_an_image_has_no_residual():
    pictures = film()
    found = image_set(0, pictures)
    without = ImageSet(found.stamp_ns, found.images[1:])
    estimate = Tracker(rig(), MODEL, CONFIG, initial_state=TRUE).step(without)
    first, *others = estimate.cameras
    assert (first.stamp_ns, first.residual, first.samples) == (0, 0.0, 0)
    assert all(other.residual > 0.0 for other in others)
    assert estimate.status is Status.DEGRADED
