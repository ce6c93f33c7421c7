"""What fits to lines do not reach: which of them is kept, and when a start is taken as it is."""

import numpy as np
import pytest

from helpers.cameras.start_scenes import scene, standing
from tracker_node.model.configuration import Configuration
from tracker_node.parallel import Workers
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.engine import Engine
from tracker_node.tracking.engines import contour_engine
from tracker_node.tracking.estimate import Status

SCENE = scene(3)
TRUE = standing(SCENE.model, 0.05, -0.05, 0.4)


@pytest.fixture
def tracked() -> tuple[Engine, list]:
    """The body has been found and learned in one image set."""
    made, images = contour_engine(SCENE.rig, SCENE.model, from_dict({}), {}, Workers(1)), SCENE.images(TRUE)
    start = made.begin(images, TRUE)
    made.observe(images, start)
    fit = made.fit(start, first=True)
    assert made.assess(fit, SCENE.image_set(0, images)).status is not Status.LOST
    return made, images


def test_a_tracked_body_begins_where_it_is_said_to_be_and_keeps_what_it_has_taught(tracked):
    made, images = tracked
    near = standing(SCENE.model, 0.07, -0.05, 0.4)
    assert made.begin(images, near) is near
    made.reset()
    assert made.solver.tracked is None
    assert made.begin(images, near) is not near  # nothing is known: the body is fitted, and learned


def test_a_body_that_was_lost_is_learned_anew(tracked):
    made, images = tracked
    made.judge.limbs.probabilities[:] = 0.9
    near = standing(SCENE.model, 0.07, -0.05, 0.4)
    assert made.begin(images, near) is not near


def test_a_lost_body_is_found_where_it_was_last_tracked(tracked):
    """From a state that is far off; what was found so is marked, and its lines are drawn where it is."""
    made, images = tracked
    away = standing(SCENE.model, 0.8, 0.6, 0.4)
    made.judge.limbs.probabilities[:] = 0.9
    made.observe(images, away)
    fit = made.fit(away, first=False)
    off = Configuration(SCENE.model, fit.state).landmarks_world - Configuration(SCENE.model, TRUE).landmarks_world
    assert fit.jumped and np.linalg.norm(off, axis=1).mean() < 0.05
    alone = made.solver._fitting.fit(away, (4.0, 2.0, 1.0), None, fit.model_sigma_px)
    assert np.linalg.norm(alone.state.T_world_root[:3, 3] - TRUE.T_world_root[:3, 3]) > 0.3  # by lines alone it is not


def test_a_body_in_its_place_is_fitted_without_a_search(tracked):
    made, images = tracked
    made.observe(images, TRUE)
    assert not made.fit(TRUE, first=False).jumped
