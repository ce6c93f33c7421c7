"""Other tilts of a rigid body, and when to try them."""

import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box
from tracker_node.tracking.region.tilts import ANGLES, Misfit, tilted


def test_tilts_keep_the_middle_and_turn_about_axes_across_the_sight():
    T_shape = se3.from_rotation_translation(np.eye(3), np.array([0.3, 0.1, -0.2]))
    model = ArticulatedModel("m", KinematicChain(("a",), ()), (Shape("s", "a", Box((0.2, 0.1, 0.3)), T_shape),))
    state = State.neutral(model, se3.exp(np.array([0.2, -0.1, 1.0, 0.3, 0.5, -0.4])))
    rig = circle_rig(3)

    def middle(s):
        return Configuration(model, s).Ts_world_shape[0, :3, 3]

    nearest = min(rig, key=lambda camera: np.linalg.norm(camera.center - middle(state)))
    sight = middle(state) - nearest.center
    turns = []
    for other in tilted(model, rig, state):
        assert np.allclose(middle(other), middle(state), atol=1e-12)
        turn = so3.log(other.T_world_root[:3, :3] @ state.T_world_root[:3, :3].T)
        assert abs(turn @ sight) < 1e-9
        assert min(abs(np.linalg.norm(turn) - angle) for angle in ANGLES) < 1e-9
        turns.append(turn)
    assert np.linalg.norm(np.sum(turns, axis=0)) < 1e-9  # to all sides alike


def test_a_misfit_is_sudden_when_it_is_much_more_than_usual():
    misfit = Misfit()
    assert not any(misfit.is_sudden(value) for value in (0.1, 0.12, 0.09, 0.2, 0.11))
    assert misfit.is_sudden(0.5)
    assert misfit.is_sudden(0.5)  # and does not become usual at once
    assert not misfit.is_sudden(0.12)


def test_a_misfit_that_stays_becomes_usual():
    misfit = Misfit()
    assert not misfit.is_sudden(0.1)
    assert [misfit.is_sudden(0.5) for _ in range(6)] == [True] * Misfit.PATIENCE + [False] * 3
    assert misfit.is_sudden(2.0)


@pytest.mark.parametrize("growth", [1.03, 1.12])
def test_a_misfit_that_grows_slowly_is_not_sudden(growth):
    misfit = Misfit()
    values = 0.1 * growth ** np.arange(20)
    assert not any(misfit.is_sudden(float(value)) for value in values)
