"""Optimizers on the color score itself: a human of 18 ellipsoids in three views, found again from where it is not."""

import numpy as np
import pytest

from benchmark.color._fits import stepping_simplex
from tracker_node.experiments.somersault.scene import somersault_rig, somersault_states
from tracker_node.model.configuration import Configuration, from_variables, to_variables
from tracker_node.model.humans.segments18 import ellipsoid_human
from tracker_node.objective.color.score import ColorObjective
from tracker_node.optimize.simplex import search_simplex
from tracker_node.optimize.stepping import SEVEN_LOOPS, SteppingOptions, step_downhill
from tracker_node.parallel import Workers
from tracker_node.render.raycast.raycaster import render_color

ROOT = range(6)
FAR = {"x": 0.035, "y": -0.035, "z": 0.034}, {"somersault": 3.5, "tilt": -3.4, "twist": 3.5}  # 60 mm, 6 degrees

# Upright and upside down: x, y, z in meters; somersault, tilt, twist in degrees
POSES = {"upright": (0.1, -0.001, 1.584, 37.63, -1.44, -6.58), "inverted": (0.6, -0.010, 2.058, 219.18, -8.57, 76.64)}


class Scene:
    def __init__(self, pose: str):
        self.model, self.rig = ellipsoid_human(), somersault_rig()
        angles = {"left_hip_flexion": 30.0, "right_hip_flexion": 20.0, "left_elbow_flexion": 70.0, "right_elbow_flexion": 40.0}
        place, turn = np.split(np.array(POSES[pose]), 2)
        (self.truth,) = somersault_states(self.model, np.concatenate([place, np.radians(turn)])[None], angles)
        body = Configuration(self.model, self.truth)
        pictures = [render_color(body, camera, self.rig.lights).rgb[:, :, ::-1] for camera in self.rig]
        self.images = [np.clip(np.rint(picture), 0, 255).astype(np.uint8) for picture in pictures]
        self.score = ColorObjective(self.model, self.rig)
        self.score.set_images(self.images)

    def start(self, sign: float = 1.0):
        """The truth, 60 mm and about 6 degrees off."""
        variables = to_variables(self.truth)
        variables[:6] += sign * np.array([*FAR[0].values(), *np.radians(list(FAR[1].values()))])
        return from_variables(variables)

    def error(self, state):
        """mm and degrees of the root."""
        tangent = state.difference(self.truth)
        return 1e3 * np.linalg.norm(tangent[:3]), np.degrees(np.linalg.norm(tangent[3:6]))


@pytest.fixture(scope="module", params=POSES)
def scene(request):
    return Scene(request.param)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("optimize", "mm", "deg"), [(step_downhill, 12.0, 2.0), (search_simplex, 2.0, 0.4), (stepping_simplex, 2.0, 0.4)]
)
def test_a_body_60_mm_and_6_degrees_off_is_found(scene, optimize, mm, deg, sign):
    start = scene.start(sign)
    assert scene.error(start) == pytest.approx((60.0, 6.0), rel=0.1)
    found = optimize(scene.score, start, scene.model.chain, active=ROOT)
    error_mm, error_deg = scene.error(found.state)
    assert error_mm < mm and error_deg < deg
    assert found.score == pytest.approx(scene.score.score(found.state))
    assert found.score < 0.5 * scene.score.score(start)
    np.testing.assert_array_equal(found.state.joint_positions, scene.truth.joint_positions)


def test_finer_loops_come_nearer(scene):
    found = step_downhill(scene.score, scene.start(), scene.model.chain, SteppingOptions(SEVEN_LOOPS), ROOT)
    assert scene.error(found.state)[0] < 4.0
    assert (found.evaluations_per_variable[:6] > 15).all() and (found.evaluations_per_variable[6:] == 0).all()


def test_joint_angles_are_found_where_the_root_is_known(scene):
    """A hierarchy walks one limb's variables with the rest held."""
    names = [axis.name for axis in scene.model.chain.axes]
    elbow = 6 + names.index("left_elbow_flexion")
    variables = to_variables(scene.truth)
    variables[elbow] -= np.radians(12.0)
    found = step_downhill(scene.score, from_variables(variables), scene.model.chain, active=[elbow])
    assert abs(np.degrees(found.variables[elbow] - to_variables(scene.truth)[elbow])) < 1.5


def test_a_body_out_of_every_view_is_not_called_found(scene):
    variables = to_variables(scene.truth)
    variables[0] += 50.0
    found = step_downhill(scene.score, from_variables(variables), scene.model.chain, active=ROOT)
    assert not found.converged and found.score == np.inf


def test_two_threads_and_one_give_the_same(scene):
    alone = ColorObjective(scene.model, scene.rig, workers=Workers(1))
    for score in (alone, scene.score):  # which way an image lies goes by the first state that is scored after it has come
        score.set_images(scene.images)
    one, two = (step_downhill(score, scene.start(), scene.model.chain, active=ROOT) for score in (alone, scene.score))
    np.testing.assert_array_equal(one.variables, two.variables)
    assert one.score == two.score
