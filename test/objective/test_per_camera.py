"""Cameras that expose at instants of their own: what they see, and its derivatives by the one state that is sought."""

import numpy as np
import pytest

from helpers.bodies.bodies import crane, random_state
from helpers.numeric.finite_difference import assert_jacobian
from tracker_node.model.configuration import Configuration
from tracker_node.objective.per_camera import bodies_seen, cameras_by_body, moved_configuration


@pytest.mark.parametrize("seed", range(3))
def test_landmarks_have_derivatives_by_the_unmoved_state(seed):
    rng = np.random.default_rng(seed)
    model = crane()
    state, offset = random_state(model, rng, 0.5), 0.4 * rng.normal(size=model.n_dof)
    body = moved_configuration(model, state, offset)
    np.testing.assert_array_equal(body.landmarks_world, Configuration(model, state.retract(offset)).landmarks_world)
    assert_jacobian(body.landmark_jacobian(), lambda d: moved_configuration(model, state.retract(d), offset).landmarks_world)


def test_cameras_of_one_instant_share_a_body():
    model = crane()
    state, offset = random_state(model, np.random.default_rng(0), 0.5), np.full(model.n_dof, 0.1)
    bodies = bodies_seen(model, state, [None, offset, None, 2.0 * offset])
    assert cameras_by_body([0, 1, 2, 3], bodies) == [[0, 2], [1], [3]]
    assert cameras_by_body([1, 2], bodies) == [[1], [2]]
