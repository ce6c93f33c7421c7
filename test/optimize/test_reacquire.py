"""A plate that has moved too far to be followed is found by a search."""

import numpy as np
import pytest

from helpers.bodies.textured_plate import MODEL, TRUE, errors, film, moved, rig
from tracker_node.objective.points.texture import TextureObjective
from tracker_node.optimize.alignment import align
from tracker_node.optimize.robust_fit import ReacquireOptions, reacquire
from tracker_node.optimize.robust_start import RobustStartOptions

OPTIONS = ReacquireOptions(RobustStartOptions(0.3, 0.6, 2000, rounds=1, keep=24, row_step=8))


def objective(state=TRUE) -> TextureObjective:
    made = TextureObjective(MODEL, rig())
    made.set_images(film(state))
    return made


@pytest.mark.parametrize("seed", range(3))
def test_a_plate_far_off_is_found_where_alignment_alone_fails(seed):
    made, start = objective(), moved(TRUE, 0.18, 20.0, seed)
    alone = align(made, start, MODEL.chain)
    assert errors(alone.state)[0] > 20.0
    found = reacquire(made, start, MODEL.chain, OPTIONS)
    distance, angle = errors(found.state)
    assert distance < 1.0
    assert angle < 0.5
    assert found.evaluations > 2000


def test_the_same_seed_finds_the_same():
    made, start = objective(), moved(TRUE, 0.1, 10.0)
    few = ReacquireOptions(RobustStartOptions(0.2, 0.3, 40, rounds=2, row_step=8), candidates=2)
    one, two = (reacquire(made, start, MODEL.chain, few) for _ in range(2))
    np.testing.assert_array_equal(one.state.T_world_root, two.state.T_world_root)


def test_what_is_found_without_a_plate_scores_badly():
    made = objective(None)
    found = reacquire(made, TRUE, MODEL.chain, OPTIONS)
    assert made.score(found.state) > 0.75
    assert objective().score(TRUE) < 0.4


def test_nothing_is_found_without_images():
    made = TextureObjective(MODEL, rig())
    made.set_images([None, None, None])
    assert reacquire(made, TRUE, MODEL.chain, OPTIONS) is None
