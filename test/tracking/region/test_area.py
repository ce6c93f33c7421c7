"""What the colors gain by a limb: against the labels of the ray-caster, pixel by pixel."""

import numpy as np
import pytest

from helpers.cameras.render_scenes import look_at
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import CameraRig
from tracker_node.model.configuration import Configuration, State
from tracker_node.objective.lines.correspondences import View
from tracker_node.observation.region.colors import N_COLORS, color_classes
from tracker_node.parallel import Workers
from tracker_node.render.raycast.raycaster import render_view
from tracker_node.synthesis.subjects.figure import figure_model
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.limbs.tree import limbs_of
from tracker_node.tracking.poses import Poses
from tracker_node.tracking.region.area import RegionArea
from tracker_node.tracking.region.modality import RegionModality

MODEL = figure_model()
LENS = CameraModel(160, 120, np.array([[110.0, 0.0, 79.5], [0.0, 110.0, 59.5], [0.0, 0.0, 1.0]]))
RIG = CameraRig(tuple(look_at(eye, (0.0, 0.0, 0.0), LENS, f"cam{i}") for i, eye in enumerate([(3, 1, 0.3), (-1, 3, 0.5)])))
CLASSES = color_classes(MODEL)
CLAMP = 2.0
CONFIG = from_dict({"region.max_log_ratio": CLAMP, "background.shadow": 0.4})
ARM = next(limb for limb in limbs_of(MODEL) if limb.name == "left_forearm")


def area(views: list[View | None], state: State, cell_px: int, threads: int = 1) -> RegionArea:
    workers = Workers(threads)
    region = RegionModality(RIG, MODEL, CONFIG, workers.map)
    region.views = views
    made = RegionArea(RIG, MODEL, CONFIG, region, workers)
    made._views = views
    made.set_views(views, state, cell_px)
    return made


def totals_of(made: RegionArea, poses: Poses) -> np.ndarray:
    """(n, n_cameras, 2) of the arm."""
    return made._score.totals(poses.roots, poses.joints, ARM.shapes)


def posed(**degrees: float) -> State:
    state = State.neutral(MODEL)
    for name, angle in degrees.items():
        state.joint_positions[MODEL.chain.axis_index(name)] += np.radians(angle)
    return state


def densities(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    values = rng.uniform(0.2, 5.0, (CLASSES.max() + 2, N_COLORS)).astype(np.float32) / N_COLORS
    return values[:-1], values[-1]


def noise_views(rng: np.random.Generator) -> list[View]:
    return [View(rng.integers(0, 256, (120, 160, 3), dtype=np.uint8), densities(rng)) for _ in RIG]


def gain_of(view: View, labels: np.ndarray) -> float:
    """Log-likelihood of an image whose pixels show the shapes ``labels`` - 1, or the scene, against the scene alone."""
    body, scene = view.densities
    colors = (view.bgr.astype(np.int64) >> 4) @ [256, 16, 1]
    odds = np.clip(np.log(body[CLASSES[labels.astype(int) - 1], colors] / scene[colors]), -CLAMP, CLAMP)
    return float(odds[labels > 0].sum())


def painted(truth: State) -> list[View]:
    """Every part in the middle of a bin of its own, the room in another."""
    views = []
    for camera in RIG:
        labels = render_view(Configuration(MODEL, truth), camera).labels
        image = np.full((120, 160, 3), 200, dtype=np.uint8)
        image[labels > 0] = 8 + 16 * (labels[labels > 0, None] % 12)
        body, scene = np.full((CLASSES.max() + 1, N_COLORS), 1e-5, np.float32), np.full(N_COLORS, 1e-5, np.float32)
        for shape, kind in enumerate(CLASSES):
            body[kind, ((8 + 16 * ((shape + 1) % 12)) >> 4) * 273] = 1.0
        scene[(200 >> 4) * 273] = 1.0
        views.append(View(image, (body, scene)))
    return views


@pytest.mark.parametrize("elsewhere", [{"left_shoulder_flexion": 60.0}, {"left_elbow_flexion": 90.0}], ids=["front", "bent"])
def test_a_limb_elsewhere_changes_the_sum_over_all_parts_by_what_is_said(elsewhere):
    rng = np.random.default_rng(3)
    views, here, there = noise_views(rng), posed(left_shoulder_abduction=-8.0), posed(**elsewhere)
    made, poses = area(views, here, 1), Poses.of([here, there])
    totals = totals_of(made, poses)
    np.testing.assert_allclose(made.gains(poses, ARM.shapes), totals.sum(axis=1), rtol=1e-6)
    for i, (camera, view) in enumerate(zip(RIG, views, strict=True)):
        labels = [render_view(Configuration(MODEL, state), camera).labels for state in (here, there)]
        expected = gain_of(view, labels[1]) - gain_of(view, labels[0])
        assert totals[1, i, 0] - totals[0, i, 0] == pytest.approx(expected, abs=0.05)
        shown = [np.isin(found, np.flatnonzero(ARM.shapes) + 1).sum() for found in labels]
        np.testing.assert_array_equal(totals[:, i, 1], shown)


def test_the_true_place_gains_most_in_small_images_too():
    truth, rng = posed(left_shoulder_flexion=40.0, left_elbow_flexion=50.0), np.random.default_rng(4)
    made = area(painted(truth), posed(), 3)
    own = ARM.dofs[6:]
    joints = np.repeat(truth.joint_positions[None], 200, axis=0)
    joints[1:, own] += rng.choice([-1.0, 1.0], (199, own.sum())) * rng.uniform(0.25, 0.8, (199, own.sum()))
    poses = Poses.with_joints(truth, np.clip(joints, MODEL.chain.lower, MODEL.chain.upper))
    gains = made.gains(poses, ARM.shapes)[:, 0]
    assert gains.argmax() == 0 and gains[0] > 1.5 * np.sort(gains)[-20]


def test_cameras_without_images_say_nothing():
    views = [noise_views(np.random.default_rng(5))[0], None]
    totals = totals_of(area(views, posed(), 2), Poses.of([posed()]))
    assert totals[0, 0, 1] > 0 and not totals[0, 1].any()
