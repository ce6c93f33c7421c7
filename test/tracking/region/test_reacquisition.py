"""What fits to lines do not reach: which of them is kept, and when a start is taken as it is."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.cameras.start_scenes import scene, standing
from tracker_node.model.configuration import Configuration, State
from tracker_node.parallel import Workers
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.engine import Engine
from tracker_node.tracking.engines import contour_engine
from tracker_node.tracking.estimate import Status

SCENE = scene(4)


def at(x: float, y: float) -> State:
    """With arms off the trunk, so that no limb is in doubt."""
    return standing(SCENE.model, x, y, 0.0, left_shoulder_elevation_front=25, right_shoulder_elevation_front=-30)


TRUE = at(0.05, -0.05)
AWAY_M = 0.25  # 17 pixels of 210 a meter, at three meters


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
    near = at(0.07, -0.05)
    assert made.begin(images, near) is near
    made.reset()
    assert made.solver.tracked is None
    assert made.begin(images, near) is not near  # nothing is known: the body is fitted, and learned


def test_a_body_that_was_lost_is_learned_anew(tracked):
    made, images = tracked
    made.judge.limbs.probabilities[:] = 0.9
    near = at(0.07, -0.05)
    assert made.begin(images, near) is not near


def test_a_lost_body_is_found_where_it_was_last_tracked(tracked):
    """From a state that is far off; what was found so is marked, and its lines are drawn where it is."""
    made, images = tracked
    away = at(0.8, 0.6)
    made.judge.limbs.probabilities[:] = 0.9
    made.observe(images, away)
    fit = made.fit(away, first=False)
    off = Configuration(SCENE.model, fit.state).landmarks_world - Configuration(SCENE.model, TRUE).landmarks_world
    assert fit.jumped and np.linalg.norm(off, axis=1).mean() < 0.05
    alone = made.solver._fitting.fit(away, (4.0, 2.0, 1.0), None, fit.model_sigma_px)
    assert np.linalg.norm(alone.state.T_world_root[:3, 3] - TRUE.T_world_root[:3, 3]) > 0.3  # by lines alone it is not


def test_a_lost_body_is_not_farther_from_there_than_it_is_long(tracked, monkeypatch):
    """Lines of a body that has left can make anything of its depth."""
    made, images = tracked
    away, farther = at(0.8, 0.6), at(4.0, 0.0)
    made.judge.limbs.probabilities[:] = 0.9
    first = made.solver.first
    monkeypatch.setattr(made.solver, "first", lambda start, *more: replace(first(start, *more), state=farther))
    monkeypatch.setattr(made.solver, "_close_share", lambda fit: float(fit.state is farther))
    made.observe(images, away)
    assert np.linalg.norm(made.fit(away, first=False).state.T_world_root[:3, 3]) < 2.0


def test_what_was_learned_while_a_body_was_tracked_speaks_for_where_it_is(tracked):
    made, images = tracked
    here, there = (made.support(images, at(x, y)) for x, y in ((0.05, -0.05), (0.8, 0.6)))
    assert here > 0.0 and here > 2.0 * there
    made.reset()
    assert made.support(images, TRUE) is None


def test_a_body_in_its_place_is_fitted_without_a_search(tracked):
    made, images = tracked
    made.observe(images, TRUE)
    assert not made.fit(TRUE, first=False).jumped


def scales_tried(made: Engine, monkeypatch, start) -> list[tuple[float, ...]]:
    """Scales of the lines of all fits of the whole body in the next image set, and that the last of them is near the truth."""
    fitting, tried = made.solver._fitting, []
    fit = fitting.fit

    def noted(state, scales, *rest):
        tried.append(tuple(scales))
        return fit(state, scales, *rest)

    monkeypatch.setattr(fitting, "fit", noted)
    state = made.fit(start, first=False).state
    off = Configuration(SCENE.model, state).landmarks_world - Configuration(SCENE.model, TRUE).landmarks_world
    assert np.linalg.norm(off, axis=1).mean() < 0.03
    return tried


def test_the_coarsest_lines_are_left_out_while_no_limb_is_in_doubt(tracked, monkeypatch):
    """On narrow limbs they find any stripe of the background that has the limb's color."""
    made, images = tracked
    made.observe(images, TRUE)
    assert scales_tried(made, monkeypatch, TRUE) == [(2.0, 1.0)]


def test_the_coarsest_lines_reach_a_body_that_has_moved_farther_than_fine_ones_do(tracked, monkeypatch):
    made, images = tracked
    away = at(0.05 + AWAY_M, -0.05)
    made.observe(images, away)
    fine = made.solver._fitting.fit(away, (2.0, 1.0), None, 2.0).state
    assert np.linalg.norm(fine.T_world_root[:3, 3] - TRUE.T_world_root[:3, 3]) > 0.05
    assert scales_tried(made, monkeypatch, away)[:2] == [(2.0, 1.0), (6.0, 2.0, 1.0)]


@pytest.mark.parametrize("options", [{"limb_search.poses": 0}, {"region.scales": "4 1"}])
def test_all_lines_are_drawn_where_limbs_are_not_searched_or_there_are_two_scales(options):
    made = contour_engine(SCENE.rig, SCENE.model, from_dict(options), {}, Workers(1))
    assert made.solver._scales == made.solver._all_scales
