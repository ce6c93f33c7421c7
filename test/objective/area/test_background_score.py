"""The share of an image that a body explains, against plain numpy on the ray-caster's labels."""

import cv2
import numpy as np
import pytest

from helpers.cameras.render_scenes import look_at, single_shape
from helpers.studio.small_studio import SCENE
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import ModelError
from tracker_node.geometry import se3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State, from_variables, to_variables
from tracker_node.model.humans.human import human_model
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box, TruncatedCone
from tracker_node.objective.area.background_score import _UNKNOWN_COST, BackgroundObjective
from tracker_node.optimize.score_objective import PartialObjective
from tracker_node.optimize.stepping import SteppingOptions, schedule, step_downhill
from tracker_node.parallel import Workers
from tracker_node.render.raycast.raycaster import render_view
from tracker_node.synthesis.scenes.scene import make_rig

MODEL, RIG = human_model(), make_rig(SCENE)
STATE = State.neutral(MODEL, se3.exp([0.05, -0.1, 0.95, 0.0, 0.0, 0.4]))
COLORS = np.random.default_rng(5).integers(30, 226, (len(RIG), len(MODEL.shapes), 3)).astype(np.float64)


def backgrounds() -> list[np.ndarray]:
    """Clutter, BGR."""
    rng, made = np.random.default_rng(8), []
    for camera in RIG:
        coarse = rng.integers(0, 256, (15, 20, 3)).astype(np.uint8)
        made.append(cv2.resize(coarse, (camera.model.width, camera.model.height), interpolation=cv2.INTER_LINEAR))
    return made


def images(state: State = STATE) -> list[np.ndarray]:
    """The body in its colors over the plates, with noise; BGR."""
    rng, made = np.random.default_rng(9), []
    for i, (camera, background) in enumerate(zip(RIG, backgrounds(), strict=True)):
        labels, image = render_view(Configuration(MODEL, state), camera).labels, background.astype(np.float64)
        image[labels > 0] = COLORS[i][labels[labels > 0] - 1][:, ::-1]
        made.append(np.clip(image + rng.normal(0.0, 3.0, image.shape), 0, 255).astype(np.uint8))
    return made


def objective(given: list) -> BackgroundObjective:
    made = BackgroundObjective(MODEL, RIG, COLORS, backgrounds())
    made.set_images(given)
    return made


def cost(one: np.ndarray, other: np.ndarray, raw_scale: float = 40.0, hue_scale: float = 20.0) -> np.ndarray:
    """Of colors (..., 3), as the docstrings say."""
    raw = np.sum((one - other) ** 2, axis=-1)
    hues = [255.0 * c / (c.sum(axis=-1, keepdims=True) + 30.0) for c in (one, other)]
    hue = np.sum((hues[0] - hues[1]) ** 2, axis=-1)
    return raw / (raw + 3.0 * raw_scale**2) + hue / (hue + 3.0 * hue_scale**2)


def plain(state: State, given: list) -> np.ndarray:
    """Unexplained share of each camera."""
    shares = []
    for i, (camera, image, background) in enumerate(zip(RIG, given, backgrounds(), strict=True)):
        rgb, empty = image[:, :, ::-1].astype(np.float64), background[:, :, ::-1].astype(np.float64)
        labels = render_view(Configuration(MODEL, state), camera).labels
        scene, inside = cost(rgb, empty), labels > 0
        explained = scene[inside] - cost(rgb[inside], COLORS[i][labels[inside] - 1])
        shares.append(1.0 - explained.sum() / scene.sum())
    return np.array(shares)


def moved(scale: float, seed: int) -> State:
    return STATE.retract(scale * np.random.default_rng(seed).normal(size=MODEL.n_dof))


@pytest.mark.parametrize("seed", range(3))
def test_shares_are_those_of_plain_numpy(seed):
    given, state = images(), moved(0.1, seed)
    np.testing.assert_allclose(objective(given).evaluate(state).camera_scores, plain(state, given), atol=2e-3)


def test_a_camera_within_the_body_is_scored_by_the_ray_caster_and_leaves_nothing_behind():
    """What vector instructions cannot draw: shapes around the camera's own center."""
    made, given = objective(images()), images()
    before = made.evaluate(STATE)
    around = State(STATE.T_world_root.copy(), STATE.joint_positions)
    around.T_world_root[:3, 3] = RIG.cameras[0].center + np.array([-0.22, 0.12, 0.04])
    within = made.evaluate(around)
    shares = plain(around, given)
    np.testing.assert_allclose(within.camera_scores, shares, atol=5e-3)
    assert within.camera_pixels[0] > 1000
    after = made.evaluate(STATE)
    np.testing.assert_array_equal(after.camera_scores, before.camera_scores)


def test_a_camera_close_to_the_axis_of_a_cone_scores_the_same_whatever_came_before():
    """Seen from within the wedge of a cone the closed form of the fast kernel does not hold."""
    model = single_shape(TruncatedCone(0.3, 0.3, 0.4, 0.0, 0.5)).model
    lens = CameraModel(160, 120, np.array([[100.0, 0.0, 80.0], [0.0, 100.0, 60.0], [0.0, 0.0, 1.0]]))
    camera = look_at((0.0, 0.01, 3.0), (0.0, 0.0, 0.0), lens)
    rng, color, unknown = np.random.default_rng(0), np.array([[[200.0, 40.0, 90.0]]]), _UNKNOWN_COST
    image = rng.integers(0, 255, (120, 160, 3), dtype=np.uint8)
    states = [State.neutral(model, se3.exp([x, 0.0, 0.0, 0.0, tilt, 0.0])) for x, tilt in ((0.5, 0.9), (0.0, 0.0), (-0.6, 1.2))]
    expected = []
    for state in states:
        inside = render_view(Configuration(model, state), camera).labels > 0
        assert inside.sum() > 100
        gain = unknown * inside.sum() - cost(image[:, :, ::-1][inside].astype(float), color[0, 0]).sum()
        expected.append(1.0 - gain / (unknown * inside.size))
    for threads in (1, 2):
        made = BackgroundObjective(model, CameraRig((camera,)), color, [None], workers=Workers(threads))
        made.set_images([image])
        np.testing.assert_allclose(made.scores(states), expected, atol=2e-3)
        np.testing.assert_array_equal(made.scores(states[::-1])[::-1], made.scores(states))


def test_the_truth_explains_nearly_all_and_nothing_near_it_more():
    made = objective(images())
    best = made.score(STATE)
    assert best < 0.3, "what is left is the noise of the background"
    assert made.scores([moved(0.05, seed) for seed in range(20)]).min() > best + 0.02


def test_a_body_elsewhere_explains_nothing():
    away = State(se3.exp([0.7, 0.5, 0.0, 0.0, 0.0, 0.0]) @ STATE.T_world_root, STATE.joint_positions)
    assert objective(images()).score(away) > 0.9


def test_scores_in_threads_are_those_one_by_one():
    made, states = objective(images()), [moved(0.05, seed) for seed in range(5)]
    np.testing.assert_allclose(made.scores(states), [made.score(state) for state in states], rtol=1e-12)


def test_fewer_rows_say_about_the_same():
    made, states = objective(images()), [moved(0.05, seed) for seed in range(4)]
    np.testing.assert_allclose(made.at_row_step(2).scores(states), made.scores(states), atol=0.03)
    assert made.at_row_step(2) is made.at_row_step(2)


def test_regions_scale_scores_and_keep_their_order():
    made, states = objective(images()), [moved(0.05, seed) for seed in range(6)]
    before = made.scores(states)
    made.restrict([(40, 20, 280, 230)] * len(RIG))
    after = made.scores(states)
    np.testing.assert_array_equal(np.argsort(before), np.argsort(after))
    np.testing.assert_allclose((1.0 - after) / (1.0 - after[0]), (1.0 - before) / (1.0 - before[0]), rtol=1e-6)


def test_cameras_without_images_have_no_part():
    given = images()
    given[1] = None
    evaluated = objective(given).evaluate(STATE)
    assert np.isnan(evaluated.camera_scores[1])
    assert evaluated.camera_pixels[1] == 0
    assert evaluated.score < 0.3
    assert objective([None] * len(RIG)).score(STATE) == np.inf


def test_only_smooth_shapes():
    brick = ArticulatedModel("brick", KinematicChain(("brick",), ()), (Shape("body", "brick", Box((0.1, 0.1, 0.1))),))
    with pytest.raises(ModelError, match="brick"):
        BackgroundObjective(brick, RIG, np.zeros((len(RIG), 1, 3)), backgrounds())


def test_parts_beside_others_that_stay_score_as_the_whole_body_does():
    """But for pixels in which surfaces lie in each other. At every row and every second one; the root moves everything."""
    rng, whole = np.random.default_rng(4), objective(images())
    elbow = next(i for i, joint in enumerate(MODEL.chain.joints) if joint.name.startswith("left_elbow"))
    first = 6 + sum(len(joint.axes) for joint in MODEL.chain.joints[:elbow])
    variables = [first]
    states = []
    for angle in rng.uniform(-1.0, 1.0, 5):
        values = to_variables(STATE)
        values[variables] += angle
        states.append(from_variables(values))
    beside = whole.beside(STATE, variables)
    assert isinstance(whole, PartialObjective) and beside is not whole
    for one, part in ((whole, beside), (whole.at_row_step(2), beside.at_row_step(2))):
        np.testing.assert_allclose(part.scores(states), one.scores(states), rtol=2e-6)
        assert part.score(states[2]) == pytest.approx(one.score(states[2]), rel=1e-3)
    assert np.ptp(whole.scores(states)) > 1e-3
    assert whole.beside(STATE, [0, first]) is whole


@pytest.mark.parametrize("threads", [1, 2])
def test_stepping_a_body_ends_as_low_as_stepping_on_the_whole_score_does(threads: int):
    class Whole:
        """The same score, which does not know what moves."""

        def __init__(self, score: BackgroundObjective):
            self.score, self.scores = score.score, score.scores

        def at_row_step(self, row_step: int) -> "Whole":
            return Whole(made.at_row_step(row_step))

    made = BackgroundObjective(MODEL, RIG, COLORS, backgrounds(), workers=Workers(threads))
    made.set_images(images())
    start = STATE.retract(0.02 * np.random.default_rng(1).normal(size=MODEL.n_dof))
    options = SteppingOptions(schedule((3, 1), (1, 0.5)))
    found, expected = (step_downhill(one, start, MODEL.chain, options) for one in (made, Whole(made)))
    assert found.score == pytest.approx(expected.score, rel=0.02)
    assert found.score == pytest.approx(made.score(found.state), rel=1e-3)
    assert found.score < 0.8 * made.score(start)
