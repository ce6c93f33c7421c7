"""Derivatives of the photometric alignment against differences of residuals computed another way, and what it finds."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from test.objective.color.test_score import SUN, bent_state
from tracker_node.camera.light import Light
from tracker_node.camera.rig import CameraRig
from tracker_node.experiments.cross.throw import yellow_stick
from tracker_node.experiments.target_images import TargetStudio
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.segments18 import ellipsoid_human
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.objective.color.alignment import PhotometricObjective, PhotometricOptions
from tracker_node.objective.color.score import ColorObjective, ColorOptions
from tracker_node.optimize.alignment import AlignmentOptions, align
from tracker_node.render.raycast.raycaster import render_color

# Three minutes of compiling: each number of lights and way to compare is a kernel of its own. test_on_colors aligns in make test.
pytestmark = pytest.mark.long

SPOT = (
    Light("ambient", (0.4, 0.4, 0.4)),
    Light("spot", (0.7, 0.7, 0.7), position=(4.0, 3.0, 4.0), direction=(-4.0, -3.0, -3.0), half_angle=0.7),
)


def smooth_images(rig, seed=0):
    """Images whose differences from pixel to pixel are nearly their derivatives."""
    rng = np.random.default_rng(seed)
    images = []
    for camera in rig:
        shape = (camera.model.height, camera.model.width)
        noise = cv2.GaussianBlur(rng.normal(size=(*shape, 3)), (0, 0), 12.0)
        images.append(cv2.normalize(noise, None, 60, 200, cv2.NORM_MINMAX).astype(np.uint8))
    return images


class MaterialPoints:
    """Points of a body's surface as one camera sees them in a state, and their residuals in another, in numpy alone."""

    def __init__(self, model, camera, lights, state, image, step=3):
        configuration = Configuration(model, state)
        view = render_color(configuration, camera, lights)
        v, u = np.nonzero(view.labels)
        keep = (
            (u % step == 0) & (v % step == 0) & (u > 1) & (v > 1) & (u < camera.model.width - 2) & (v < camera.model.height - 2)
        )
        u, v = u[keep], v[keep]
        rays, _ = camera.model.rays(np.column_stack([u, v]).astype(float))
        points = rays / rays[:, 2:] * view.depth[v, u][:, None]
        world = se3.apply(camera.T_world_cam, points)
        self.links = model.shape_links[view.labels[v, u].astype(int) - 1]
        self.local = np.array(
            [se3.apply(se3.inverse(configuration.Ts_world_link[i]), p) for i, p in zip(self.links, world, strict=True)]
        )
        self.colors = view.rgb[v, u]
        self.model, self.camera, self.image = model, camera, image

    def residuals(self, state):
        Ts = Configuration(self.model, state).Ts_world_link[self.links]
        world = np.einsum("nij,nj->ni", Ts[:, :3, :3], self.local) + Ts[:, :3, 3]
        pixels, _ = self.camera.project(world)
        at = pixels.astype(np.float32)
        image = cv2.remap(self.image.astype(np.float32), at[:, :1], at[:, 1:], cv2.INTER_LINEAR)
        return (self.colors - image.reshape(-1, 3)[:, ::-1]).ravel()


@pytest.mark.parametrize("make_model", [ellipsoid_human, yellow_stick])
@pytest.mark.parametrize("distortion", [(0.0, 0.0, 0.0, 0.0), (-0.1, 0.05, 1e-3, -5e-4)], ids=["pinhole", "distorted"])
def test_gradient_is_that_of_material_points(make_model, distortion):
    """Without lights with a direction the color of a point does not change: the residual is the image's alone."""
    model, rig = make_model(), circle_rig(2, distortion=distortion)
    state, images = bent_state(model), smooth_images(circle_rig(2))
    objective = PhotometricObjective(model, rig, PhotometricOptions(levels=1))
    objective.set_images(images)
    equations = objective.at_level(0).linearize(state)
    points = [MaterialPoints(model, camera, (), state, image) for camera, image in zip(rig, images, strict=True)]
    g, H, step = np.zeros(model.n_dof), np.zeros((model.n_dof, model.n_dof)), 1e-3
    for p in points:
        columns = []
        for i in range(model.n_dof):
            tangent = np.zeros(model.n_dof)
            tangent[i] = step
            columns.append((p.residuals(state.retract(tangent)) - p.residuals(state.retract(-tangent))) / (2 * step))
        J = np.array(columns).T
        g, H = g + J.T @ p.residuals(state), H + J.T @ J
    scale = equations.count / sum(3 * len(p.local) for p in points)  # they are but a sample
    assert np.corrcoef(equations.g, g)[0, 1] > 0.995
    assert np.linalg.norm(equations.g - scale * g) < 0.06 * np.linalg.norm(equations.g)
    assert np.linalg.norm(equations.H - scale * H) < 0.06 * np.linalg.norm(equations.H)


def test_shading_turns_with_the_surface():
    """Before an even image nothing but the light on the surface changes: as when the lights turn the other way."""
    model, rig = ellipsoid_human(), CameraRig(circle_rig(1, distortion=(0.0,) * 4).cameras, lights=SUN)
    state = bent_state(model)
    objective = PhotometricObjective(model, rig, PhotometricOptions(levels=1))
    objective.set_images([np.full((480, 640, 3), 30, dtype=np.uint8)])
    equations = objective.at_level(0).linearize(state)
    axis, step = np.array([0.0, 0.0, 1.0]), 1e-3

    def half_cost(angle):
        turned = tuple(
            light if light.direction is None else replace(light, direction=tuple(so3.exp(-angle * axis) @ light.direction))
            for light in SUN
        )
        view = render_color(Configuration(model, state), rig.cameras[0], turned)
        return 0.5 * float(((view.rgb[view.labels > 0] - 30.0) ** 2).sum())

    expected = (half_cost(step) - half_cost(-step)) / (2 * step)
    assert equations.g[5] == pytest.approx(expected, rel=0.02)


def test_cost_is_the_score():
    model, rig = ellipsoid_human(), replace(circle_rig(2), lights=SUN)
    state, images = bent_state(model), smooth_images(rig)
    for representation in ("raw", "normalized"):
        objective = PhotometricObjective(model, rig, PhotometricOptions(representation, levels=1))
        score = ColorObjective(model, rig, ColorOptions(representation))
        objective.set_images(images)
        score.set_images(images)
        equations = objective.at_level(0).linearize(state)
        assert math.sqrt(equations.cost / equations.count) == pytest.approx(score.score(state), rel=1e-4)


def test_no_mask_costs_infinity():
    model, rig = ellipsoid_human(), circle_rig(2)
    objective = PhotometricObjective(model, rig)
    objective.set_images(smooth_images(rig))
    away = State.neutral(model)
    away.T_world_root[2, 3] = 8.0
    assert objective.at_level(2).linearize(away).cost == math.inf


@pytest.mark.parametrize(
    "options",
    [PhotometricOptions(), PhotometricOptions("blend")],
    ids=["raw", "blend"],
)
@pytest.mark.parametrize("make_model", [ellipsoid_human, human_model])
def test_both_kernels_agree(make_model, options):
    """That of smooth shapes, sixteen pixels at a time, and that of any shapes; with colors at their limit, and a tinted spot."""
    model = make_model()
    lights = (Light("ambient", (0.8, 0.7, 0.6)), replace(SPOT[1], intensity=(0.9, 0.5, 0.3)))
    rig = replace(circle_rig(2), lights=lights)
    state, images, results = bent_state(model), smooth_images(rig), []
    for vectorized in (True, False):
        objective = PhotometricObjective(model, rig, replace(options, levels=1))
        objective.set_images(images)
        assert objective._levels[0].constants.vectorized
        objective._levels[0].constants.vectorized = vectorized
        results.append(objective.at_level(0).linearize(state))
    fast, slow = results
    assert fast.cost == pytest.approx(slow.cost, rel=1e-4)
    assert np.linalg.norm(fast.g - slow.g) < 0.01 * np.linalg.norm(slow.g)
    assert np.linalg.norm(fast.H - slow.H) < 0.01 * np.linalg.norm(slow.H)


@pytest.mark.parametrize(
    ("lights", "options", "tolerance_m"),
    [(SUN, PhotometricOptions(), 2e-3), (SPOT, PhotometricOptions("blend"), 4e-3)],
    ids=["raw", "blend"],
)
def test_alignment_finds_the_cross_in_images_of_another_renderer(lights, options, tolerance_m):
    model, rig = yellow_stick(), replace(circle_rig(3, radius=2.5), lights=lights)
    pose = se3.exp(np.array([0.02, -0.03, 1.0, 0.4, 0.3, -0.5]))
    truth = State(pose, np.zeros(0))
    with TargetStudio(rig) as studio:
        walls = [np.full((480, 640, 3), (150, 120, 100), dtype=np.uint8) for _ in rig]
        images = studio.images(Configuration(model, truth), walls)
    objective = PhotometricObjective(model, rig, options)
    objective.set_images(images)
    start = truth.retract(np.array([0.03, -0.02, 0.03, 0.06, -0.05, 0.04]))
    result = align(objective, start, model.chain, AlignmentOptions())
    error = result.state.difference(truth)
    assert np.linalg.norm(error[:3]) < tolerance_m
    assert np.linalg.norm(error[3:]) < np.radians(0.5)


def test_alignment_finds_a_rigid_human_from_afar():
    human = ellipsoid_human()
    rig, posed = replace(circle_rig(4), lights=SUN), Configuration(human, bent_state(human))
    shapes = tuple(replace(s, link="body", T_link_shape=T) for s, T in zip(human.shapes, posed.Ts_world_shape, strict=True))
    model = ArticulatedModel("rigid", KinematicChain(("body",), ()), shapes)
    truth = State.neutral(model)
    with TargetStudio(rig) as studio:
        images = studio.images(Configuration(model, truth))
    objective = PhotometricObjective(model, rig, PhotometricOptions(levels=5))
    objective.set_images(images)
    rng = np.random.default_rng(4)
    for _ in range(3):
        shift, turn = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        # The root lies on the floor: the body is turned about itself
        turned = State(se3.from_rotation_translation(so3.exp(0.35 * turn), np.zeros(3)), np.zeros(0))
        center = np.array([0.0, 0.0, 1.0])
        turned.T_world_root[:3, 3] = center - turned.T_world_root[:3, :3] @ center + 0.2 * shift
        error = align(objective, turned, model.chain, AlignmentOptions(coarsest=4)).state.difference(truth)
        assert np.linalg.norm(error[:3] + np.cross(error[3:], center)) < 3e-3
        assert np.linalg.norm(error[3:]) < np.radians(0.2)
