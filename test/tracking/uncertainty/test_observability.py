"""What cameras cannot see of symmetric bodies: it has no information, a huge variance, and a name."""

import numpy as np
import pytest

from helpers.cameras.render_scenes import look_at
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import CameraRig
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid, TruncatedCone
from tracker_node.objective.lines.correspondences import LineDrawer, LineOptions, View
from tracker_node.observation.region.colors import N_COLORS
from tracker_node.render.raycast.raycaster import render_mask
from tracker_node.render.shape_arrays import ShapeArrays
from tracker_node.tracking.uncertainty.covariance import levers, unobservable

LENS = CameraModel(320, 240, np.array([[400.0, 0.0, 160.0], [0.0, 400.0, 120.0], [0.0, 0.0, 1.0]]))
EYES = ((1.0, 0.1, 0.3), (-0.4, 0.9, 0.4), (-0.5, -0.8, 0.2))


def rigid(primitive):
    return ArticulatedModel("m", KinematicChain(("body",), ()), (Shape("s", "body", primitive),))


def information_of(model, state, n_cameras):
    """Of the region lines of images that show the body white before black."""
    rig = CameraRig(tuple(look_at(eye, (0, 0, 0), LENS, f"cam{i}") for i, eye in enumerate(EYES[:n_cameras])))
    drawer = LineDrawer(rig, model, ShapeArrays.from_model(model), np.zeros(len(model.shapes), dtype=np.int32), LineOptions())
    body, scene = np.full((1, N_COLORS), 1e-6, dtype=np.float32), np.full(N_COLORS, 1e-6, dtype=np.float32)
    body[0, -1], scene[0] = 1.0, 1.0
    configuration = Configuration(model, state)
    views = []
    for camera in rig:
        mask = render_mask(configuration, camera).astype(np.uint8)
        views.append(View(np.repeat(255 * mask[:, :, None], 3, axis=2), (body, scene)))
    return drawer.draw(views, state, 1.0, 0.5).linearize(state).H


def turned(seed=3):
    return se3.from_rotation_translation(so3.exp(np.random.default_rng(seed).normal(size=3)), np.array([0.02, -0.03, 0.01]))


@pytest.mark.parametrize("n_cameras", [1, 3])
def test_nobody_sees_a_cylinder_turn_about_its_axis(n_cameras):
    model = rigid(TruncatedCone(0.06, 0.06, 0.0, -0.12, 0.12))
    T = turned()
    H = information_of(model, State.neutral(model, T), n_cameras)
    axis = T[:3, 2]
    about = np.concatenate([np.zeros(3), axis])
    across = np.concatenate([np.zeros(3), T[:3, 0]])
    covariance = np.linalg.inv(H + 1e-9 * np.diag(H).max() * np.eye(6))
    assert about @ covariance @ about > 1e4 * (across @ covariance @ across)
    (name,) = unobservable(H, model)
    assert name.startswith("root rotation about (")
    named = np.array([float(value) for value in name.split("(")[1].rstrip(")").split(",")])
    assert abs(named @ axis) > 0.999


@pytest.mark.parametrize("n_cameras", [1, 2])
def test_no_turn_of_a_sphere_is_seen(n_cameras):
    model = rigid(Ellipsoid((0.1, 0.1, 0.1)))
    H = information_of(model, State.neutral(model, turned()), n_cameras)
    assert unobservable(H, model) == ["root_rx", "root_ry", "root_rz"]


@pytest.mark.parametrize("n_cameras", [1, 3])
def test_a_box_is_seen_in_all_directions(n_cameras):
    model = rigid(Box((0.2, 0.12, 0.08)))
    assert unobservable(information_of(model, State.neutral(model, turned()), n_cameras), model, 0.3 / n_cameras) == []


def test_a_round_limb_in_line_with_another_rolls_unseen():
    """Two round links in line, each free to roll about their common axis: both rolls and none else."""
    joints = (Joint("neck", "base", "tip", se3.exp(np.array([0, 0, 0.1, 0, 0, 0.0])), (Axis("roll", (0.0, 0.0, 1.0)),)),)
    shapes = (
        Shape("a", "base", TruncatedCone(0.05, 0.05, 0.0, -0.1, 0.1)),
        Shape("b", "tip", TruncatedCone(0.03, 0.03, 0.0, 0.0, 0.15)),
    )
    model = ArticulatedModel("m", KinematicChain(("base", "tip"), joints), shapes)
    H = information_of(model, State.neutral(model), 2)
    assert unobservable(H, model) == ["root_rz", "roll"]


def test_directions_of_several_are_named_together():
    """Only the sum of two joint angles is seen: their difference is not."""
    axis = Axis("first", (0.0, 1.0, 0.0)), Axis("second", (0.0, 1.0, 0.0))
    joints = (Joint("j", "base", "tip", np.eye(4), axis),)
    model = ArticulatedModel("m", KinematicChain(("base", "tip"), joints), (Shape("b", "tip", Box((0.1, 0.1, 0.4))),))
    assert levers(model)[6] == pytest.approx(0.5 * np.linalg.norm((0.1, 0.1, 0.4)))
    H = np.eye(8) * 1e6
    H[6:, 6:] = 1e6
    (name,) = unobservable(H, model)
    assert name in ("first -1.00 second", "second -1.00 first")


def test_how_much_is_too_little_is_a_choice():
    model = rigid(Box((0.2, 0.2, 0.2)))
    H = np.diag([1e6, 1e6, 1.0 / 0.03**2, 1e6, 1e6, 1e6])
    assert unobservable(H, model) == []
    assert unobservable(H, model, 0.01) == ["root_z"]


def test_a_direction_of_many_small_parts_has_a_name():
    """None of its parts is notable by itself; that must not end a run."""
    model = human_model()
    n, lever = len(model.chain.dof_names), levers(model)
    direction = np.r_[np.zeros(6), np.full(n - 6, (n - 6) ** -0.5)]
    information = 1e8 * np.outer(lever, lever) * (np.eye(n) - np.outer(direction, direction))
    (name,) = unobservable(information, model)
    first, _, others = name.partition(" ")
    assert first in model.chain.dof_names
    assert others == "with others"  # a part of the root would else be told as the body as a whole
