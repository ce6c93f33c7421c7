"""The fused color score against brute force, and against the images of the ray-caster."""

import math
from dataclasses import replace

import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from helpers.cameras.render_scenes import LENSES, LIGHTS, colored_scene, look_at
from helpers.numeric import naive
from tracker_node.camera.light import Light
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import CameraRig
from tracker_node.experiments.cross.throw import yellow_stick
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.segments18 import ellipsoid_human
from tracker_node.objective.color.score import ColorObjective, ColorOptions, Outcome
from tracker_node.parallel import Workers
from tracker_node.render.raycast.raycaster import render_color

SUN = (Light("ambient", (0.3, 0.3, 0.3)), Light("directional", (0.6, 0.6, 0.6), direction=(0.4, -0.5, -0.8)))


def expected_rms(views, images, options):
    """rms over the masks of ``views`` [(rgb, labels)], and the number of their pixels."""
    weights = {"raw": (1.0, 0.0), "normalized": (0.0, 1.0)}.get(
        options.representation, (1.0 - options.normalized_weight, options.normalized_weight)
    )
    squares, count = 0.0, 0
    for (rgb, labels), image in zip(views, images, strict=True):
        rows = slice(None, None, options.row_step)
        inside = labels[rows] > 0
        model, target = rgb[rows][inside].astype(float), image[rows, :, ::-1][inside].astype(float)
        normalized = [255.0 * c / np.maximum(c.sum(axis=1, keepdims=True), 1.0) for c in (model, target)]
        each = weights[0] * (model - target) ** 2 + weights[1] * (normalized[0] - normalized[1]) ** 2
        squares += np.minimum(each.sum(axis=1), 3.0 * options.cap**2).sum()
        count += len(model)
    return math.sqrt(squares / (3 * count)), count


def noise_images(rig, seed=0):
    rng = np.random.default_rng(seed)
    return [rng.integers(0, 255, (camera.model.height, camera.model.width, 3), dtype=np.uint8) for camera in rig]


def bent_state(model, seed=0):
    rng = np.random.default_rng(seed)
    neutral = State.neutral(model)
    angles = neutral.joint_positions + rng.uniform(-0.3, 0.3, model.chain.n_axes)
    pose = np.eye(4)
    pose[:3, 3] = 0.05, -0.03, 1.0
    return State(pose, np.clip(angles, model.chain.lower, model.chain.upper))


@pytest.mark.parametrize("names", [None, ("ellipsoid", "cone")])
@pytest.mark.parametrize("lens", ["plain", "radial"])
def test_score_is_that_of_brute_force(lens, names):
    configuration = colored_scene(3, names=names)
    rig = CameraRig((look_at((2.2, 0.5, 0.4), (0.0, 0.0, 0.0), LENSES[lens]),), lights=LIGHTS)
    images = noise_images(rig)
    objective = ColorObjective(configuration.model, rig, workers=Workers(1))
    objective.set_images(images)
    views = []
    for camera in rig:
        labels, _, rgb = naive.render_color(configuration, camera, LIGHTS)
        views.append((rgb, labels))
    rms, count = expected_rms(views, images, objective.options)
    found = objective.evaluate(configuration.state)
    assert found.camera_pixels.sum() == pytest.approx(count, rel=2e-3)
    assert found.rms == pytest.approx(rms, rel=2e-3)


@pytest.mark.parametrize("make_model", [ellipsoid_human, human_model, yellow_stick])
@pytest.mark.parametrize(
    "options",
    [
        ColorOptions(), ColorOptions("normalized"), ColorOptions("blend", normalized_weight=0.3, row_step=4),
        ColorOptions(cap=70.0), ColorOptions("blend", cap=50.0),
    ],
    ids=lambda o: f"{o.representation} {o.cap}",
)
def test_score_is_that_of_the_rendered_images(make_model, options):
    model = make_model()
    rig = replace(circle_rig(2), lights=SUN)
    images, state = noise_images(rig), bent_state(model)
    objective = ColorObjective(model, rig, options)
    objective.set_images(images)
    views = [(view.rgb, view.labels) for view in (render_color(Configuration(model, state), camera, SUN) for camera in rig)]
    rms, count = expected_rms(views, images, options)
    found = objective.evaluate(state)
    assert (found.outcome, int(found.camera_pixels.sum())) == (Outcome.SCORED, count)
    assert found.rms == pytest.approx(rms, rel=1e-5)
    assert objective.score(state) == found.rms
    squares = found.camera_rms**2 * found.camera_pixels
    assert math.sqrt(squares.sum() / count) == pytest.approx(found.rms, rel=1e-9)


def test_a_cap_of_colors_in_unknown_gains_is_refused():
    with pytest.raises(ValueError, match="no cap"):
        ColorOptions(gained=True, cap=60.0)


def test_gain_and_gamma_of_cameras_count():
    model = ellipsoid_human()
    cameras = tuple(replace(c, gain=(1.1, 0.9, 1.0), gamma=g) for c, g in zip(circle_rig(2), (1.0, 2.2), strict=True))
    rig = CameraRig(cameras, lights=SUN)
    images, state = noise_images(rig), bent_state(model)
    objective = ColorObjective(model, rig)
    objective.set_images(images)
    views = [(view.rgb, view.labels) for view in (render_color(Configuration(model, state), camera, SUN) for camera in rig)]
    assert objective.score(state) == pytest.approx(expected_rms(views, images, objective.options)[0], rel=1e-5)


def test_many_states_at_once_have_the_scores_of_each_whatever_the_threads():
    model, rig = ellipsoid_human(), replace(circle_rig(3), lights=SUN)
    states = [bent_state(model, seed) for seed in range(5)]
    results = []
    for threads in (1, 2, 3):
        objective = ColorObjective(model, rig, workers=Workers(threads))
        objective.set_images(noise_images(rig))
        results += [objective.scores(states), np.array([objective.score(state) for state in states])]
    assert all(np.array_equal(results[0], other) for other in results[1:])


def test_right_pose_has_the_best_score():
    model, rig = ellipsoid_human(), replace(circle_rig(3), lights=SUN)
    truth = bent_state(model)
    views = [render_color(Configuration(model, truth), camera, SUN) for camera in rig]
    objective = ColorObjective(model, rig)
    objective.set_images([np.ascontiguousarray(np.rint(view.rgb[:, :, ::-1]).astype(np.uint8)) for view in views])
    assert objective.score(truth) < 0.5  # rounding to whole gray levels
    for i in range(model.n_dof):
        for sign in (-1.0, 1.0):
            tangent = np.zeros(model.n_dof)
            tangent[i] = 0.05 * sign
            # Round limbs may turn about themselves unseen
            assert objective.score(truth.retract(tangent)) > (1.0 if i < 6 else objective.score(truth) - 0.01)


def test_colors_of_shapes_can_be_given_for_each_camera():
    model, rig = ellipsoid_human(), circle_rig(2)
    state, n = bent_state(model), len(ellipsoid_human().shapes)
    colors = np.random.default_rng(1).uniform(0.0, 255.0, (2, n, 3))
    images = []
    for i, camera in enumerate(rig):
        labels = render_color(Configuration(model, state), camera).labels
        flat = np.vstack([np.zeros(3), colors[i]])[labels]
        images.append(np.ascontiguousarray(np.rint(flat[:, :, ::-1]).astype(np.uint8)))
    objective = ColorObjective(model, rig, colors_rgb=colors)
    objective.set_images(images)
    assert objective.score(state) < 0.5
    assert objective.at_row_step(3).score(state) < 0.5
    objective.set_colors(None)
    assert objective.score(state) > 20.0
    assert objective.at_row_step(3).score(state) > 20.0
    with pytest.raises(ValueError, match=r"expected colors \(2, 18, 3\)"):
        ColorObjective(model, rig, colors_rgb=colors[0])


@pytest.mark.parametrize("make_model", [ellipsoid_human, yellow_stick])
def test_what_cannot_be_scored_is_infinitely_bad(make_model):
    model, rig = make_model(), circle_rig(2)
    objective = ColorObjective(model, rig)
    objective.set_images([np.full((480, 640, 3), 128, dtype=np.uint8)] * 2)
    aside, behind = State.neutral(model), State.neutral(model)
    aside.T_world_root[:3, 3] = 0.0, 0.0, 8.0
    behind.T_world_root[:3, 3] = rig.cameras[0].center - 4.0 * rig.cameras[0].T_world_cam[:3, 2]
    assert objective.evaluate(aside).outcome is Outcome.EMPTY_MASK
    assert objective.evaluate(behind).outcome is Outcome.BEHIND_CAMERA
    scores = objective.scores([aside, State.neutral(model, _raised(1.0)), behind])
    assert scores[0] == scores[2] == math.inf
    assert math.isfinite(scores[1])


def _raised(height):
    pose = np.eye(4)
    pose[2, 3] = height
    return pose


def test_cameras_without_an_image_have_no_part():
    model, rig = ellipsoid_human(), circle_rig(3)
    images, state = noise_images(rig), bent_state(model)
    whole, part = ColorObjective(model, rig), ColorObjective(model, rig.subset(["cam01", "cam03"]))
    whole.set_images([images[0], None, images[2]])
    part.set_images([images[0], images[2]])
    assert whole.score(state) == part.score(state)
    found = whole.evaluate(state)
    assert found.camera_pixels[1] == 0
    assert np.isnan(found.camera_rms[1])


def test_wrong_images_are_refused_by_name():
    rig = circle_rig(2)
    objective = ColorObjective(ellipsoid_human(), rig)
    with pytest.raises(ValueError, match="expected 2 images"):
        objective.set_images([None])
    with pytest.raises(ValueError, match=r"camera 'cam02': expected an image \(480, 640, 3\) uint8, got \(480, 640\)"):
        objective.set_images([None, np.zeros((480, 640), dtype=np.uint8)])
    with pytest.raises(ValueError, match="expected a representation"):
        ColorObjective(ellipsoid_human(), rig, ColorOptions("lab"))


def test_camera_close_to_the_axis_of_a_cone_falls_back():
    """Seen from within the wedge of a cone the closed form of the fast kernel does not hold."""
    from helpers.cameras.render_scenes import single_shape
    from tracker_node.model.shapes.primitives import TruncatedCone

    configuration = single_shape(TruncatedCone(0.3, 0.3, 0.4, 0.0, 0.5), color_rgb=(200, 40, 90))
    lens = CameraModel(160, 120, np.array([[100.0, 0.0, 80.0], [0.0, 100.0, 60.0], [0.0, 0.0, 1.0]]))
    rig = CameraRig((look_at((0.0, 0.01, 3.0), (0.0, 0.0, 0.0), lens),), lights=SUN)
    images = noise_images(rig)
    objective = ColorObjective(configuration.model, rig)
    objective.set_images(images)
    view = render_color(configuration, rig.cameras[0], SUN)
    rms, count = expected_rms([(view.rgb, view.labels)], images, objective.options)
    assert count > 100
    assert objective.score(configuration.state) == pytest.approx(rms, rel=1e-5)
