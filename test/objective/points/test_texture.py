"""Pictures against images that OpenCV has warped, in brightnesses that the objective is not told."""

import cv2
import numpy as np
import pytest

from helpers.bodies.textured_plate import HEIGHT, MODEL, TRUE, WIDTH, errors, film, moved, rig
from tracker_node.errors import ModelError
from tracker_node.geometry import se3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box
from tracker_node.objective.points import texture
from tracker_node.objective.points.texture import TextureObjective, surface_points
from tracker_node.optimize.alignment import AlignmentOptions, align
from tracker_node.render.raycast.raycaster import render_color


def objective(images) -> TextureObjective:
    made = TextureObjective(MODEL, rig())
    made.set_images(images)
    return made


def aligned(made: TextureObjective, start: State) -> State:
    return align(made, start, MODEL.chain, AlignmentOptions(tolerance=1e-4)).state


@pytest.mark.parametrize("seed", range(4))
def test_alignment_finds_the_pose_in_any_brightness(seed):
    distance, angle = errors(aligned(objective(film(seed=seed)), moved(TRUE, 0.04, 8.0, seed)))
    assert distance < 0.5
    assert angle < 0.2


def test_something_in_front_of_the_picture_is_borne():
    images = film()
    for image in images:
        image[100:150, 120:160] = (90, 130, 200)
    distance, angle = errors(aligned(objective(images), moved(TRUE, 0.03, 5.0)))
    assert distance < 1.0
    assert angle < 0.4


def test_brightness_and_contrast_do_not_change_the_score():
    images = film(noise=0.0)
    darker = [np.round(0.5 * image.astype(float) + 40.0).astype(np.uint8) for image in images]
    assert objective(darker).score(TRUE) == pytest.approx(objective(images).score(TRUE), abs=0.02)
    negative = [255 - image for image in images]
    assert objective(negative).score(TRUE) > 0.95, "a negative is not the picture"


def test_gradient_matches_finite_differences(monkeypatch):
    images = [cv2.GaussianBlur(image, (0, 0), 6.0) for image in film(noise=0.0)]
    state = moved(TRUE, 0.01, 2.0)
    monkeypatch.setattr(texture, "_ROBUST_SCALE", 1e4)
    level, step = objective(images).at_level(0), 1e-6
    equations = level.linearize(state)

    def cost(tangent: np.ndarray) -> float:
        return level.linearize(state.retract(tangent)).cost

    numeric = [(cost(d) - cost(-d)) / (2.0 * step) for d in np.eye(6) * step]
    np.testing.assert_allclose(2.0 * equations.g, numeric, atol=0.02 * np.abs(numeric).max())
    assert np.linalg.eigvalsh(equations.H).min() > 0.0


def test_what_leaves_the_image_does_not_pay():
    """Seen points stay in the count, and those outside cost as much as on a flat image."""
    made = objective(film())
    level = made.at_level(1)
    first = level.linearize(TRUE)
    away = level.linearize(State(se3.exp([3.0, 0.0, 0.0, 0.0, 0.0, 0.0]) @ TRUE.T_world_root, np.zeros(0)))
    assert away.count == first.count
    assert away.cost > 2.0 * first.cost
    assert np.all(away.g == 0.0)


def test_the_same_state_costs_the_same_again_at_the_border_of_an_image_too():
    """A camera that shows but a few points is left out for good."""
    made, few = objective(film()), 0
    for shift in np.linspace(0.2, 0.6, 40):
        state = State(TRUE.T_world_root.copy(), TRUE.joint_positions)
        state.T_world_root[1, 3] += shift
        level = made.at_level(2)
        first, again = level.linearize(state), level.linearize(state)
        assert (again.cost, again.count) == (first.cost, first.count)
        few += first.count < 3 * 3 * len(made.at_level(2)._points.positions)
    assert few > 10, "the plate does leave images on its way"


def test_scores_in_threads_are_those_one_by_one_and_the_truth_is_best():
    made = objective(film())
    states = [TRUE, *(moved(TRUE, 0.02 + 0.01 * i, 4.0, i) for i in range(15))]
    scores = made.scores(states)
    np.testing.assert_array_equal(scores, [made.score(state) for state in states])
    assert scores.argmin() == 0
    coarse = made.at_row_step(4)
    np.testing.assert_array_equal(coarse.scores(states[:2]), [coarse.score(state) for state in states[:2]])


def test_states_that_no_camera_shows_cannot_be_scored():
    made = objective(film())
    behind = State(se3.exp([0.0, 0.0, 5.0, 0.0, 0.0, 0.0]), np.zeros(0))
    assert made.score(behind) == np.inf
    turned_away = State(se3.exp([0.0, 0.0, 0.0, np.pi, 0.0, 0.0]), np.zeros(0))
    assert made.score(turned_away) == np.inf
    assert objective([None, None, None]).score(TRUE) == np.inf
    one = objective([film()[0], None, None]).evaluate(TRUE)
    assert np.isfinite(one.score)
    np.testing.assert_array_equal(np.isfinite(one.camera_scores), [True, False, False])


def test_a_model_without_pictures_is_refused():
    plain = ArticulatedModel("brick", KinematicChain(("brick",), ()), (Shape("body", "brick", Box((0.1, 0.1, 0.1))),))
    with pytest.raises(ModelError, match=r"brick.*textures"):
        TextureObjective(plain, rig())


@pytest.mark.parametrize("face", range(6))
def test_points_have_the_colors_that_the_renderer_gives_their_places(face):
    """Six faces, each turned towards a camera, with a picture that has no symmetry."""
    texture = cv2.resize(np.random.default_rng(face).integers(0, 256, (3, 4, 3)).astype(np.uint8), (80, 60), interpolation=0)
    textures = [None] * 6
    textures[face] = texture
    T_link_shape = se3.exp([0.02, -0.01, 0.03, 0.1, -0.2, 0.15])
    shape = Shape("block", "block", Box((0.4, 0.3, 0.2), None, tuple(textures)), T_link_shape)
    model = ArticulatedModel("block", KinematicChain(("block",), ()), (shape,))
    points = surface_points(model, 0.01)
    camera = rig().cameras[0]
    normal = points.normals[0]
    # Turn the face's normal towards the camera, half way between the world's z and the line of sight
    toward = camera.center / np.linalg.norm(camera.center)
    axis = np.cross(normal, toward)
    turn = se3.exp(np.concatenate([np.zeros(3), axis / np.linalg.norm(axis) * np.arccos(normal @ toward) * 0.9]))
    state = State(turn, np.zeros(0))
    view = render_color(Configuration(model, state), camera)
    pixels, valid = camera.project(points.positions @ turn[:3, :3].T)
    assert valid.all()
    u0, v0 = view.region[:2]
    u, v = np.round(pixels).astype(int).T
    inside = (u > 0) & (v > 0) & (u < WIDTH - 1) & (v < HEIGHT - 1)
    assert inside.sum() > 100
    rendered = view.rgb[v[inside] - v0, u[inside] - u0]
    difference = np.abs(rendered - points.colors[inside]).max(axis=1)
    assert np.median(difference) < 6.0, "borders of patches apart, colors are the same"
