"""Clicks on a cross and the pose that comes of them."""

import numpy as np
import pytest

from helpers.bodies.wooden_cross import cross
from tracker_node.calibration.points import digitizing
from tracker_node.calibration.points.dlt import dlt_parameters
from tracker_node.experiments.cross.throw import cross_rig, side_somersault
from tracker_node.geometry import se3, so3

MODEL, RIG = cross(), cross_rig()
PARAMETERS = np.array([dlt_parameters(camera) for camera in RIG])
STATE = side_somersault(MODEL).state(7)


def clicks(sigma_px: float, seed: int = 0) -> digitizing.Clicks:
    return digitizing.click(MODEL, [STATE] * 3, list(RIG), sigma_px, np.random.default_rng(seed))


def test_exact_clicks_give_the_pose_back():
    found = digitizing.digitized_state(MODEL, clicks(0.0), PARAMETERS)
    np.testing.assert_allclose(found.T_world_root, STATE.T_world_root, atol=1e-9)


def test_errors_of_clicks_become_errors_of_millimetres_in_the_pose():
    tangents = [
        digitizing.digitized_state(MODEL, clicks(1.5, seed), PARAMETERS).difference(STATE) for seed in range(40)
    ]
    distance = np.linalg.norm(np.array(tangents)[:, :3], axis=1).mean()
    angle = np.rad2deg(np.linalg.norm(np.array(tangents)[:, 3:], axis=1).mean())
    assert 0.001 < distance < 0.015 and 0.2 < angle < 3.0
    exact = clicks(0.0)
    spread = np.std([clicks(1.5, seed).pixels - exact.pixels for seed in range(40)])
    assert spread == pytest.approx(1.5, rel=0.1)


def test_points_behind_the_body_are_not_clicked():
    """Seen along its stick, the cross hides the stick's far end."""
    camera = RIG["top"]
    upright = type(STATE)(se3.from_rotation_translation(np.eye(3), np.append(camera.center[:2], 1.0)), np.zeros(0))
    seen = digitizing.click(MODEL, [upright], [camera], 0.0, np.random.default_rng(0)).visible[:, 0]
    names = MODEL.landmark_names
    assert {name for name, visible in zip(names, seen, strict=True) if visible} == {"top", "left", "right"}


def test_a_late_camera_bends_the_pose_of_whoever_does_not_know():
    trial = side_somersault(MODEL)
    states = [STATE, STATE, trial.state(7, 0.004)]
    late = digitizing.click(MODEL, states, list(RIG), 0.0, np.random.default_rng(0))
    found = digitizing.digitized_state(MODEL, late, PARAMETERS)
    assert 1e-3 < np.linalg.norm(found.difference(STATE)[:3]) < 0.03


def test_too_few_points_give_no_pose():
    two = clicks(0.0)
    hidden = np.zeros_like(two.visible)
    hidden[:2] = True
    assert digitizing.digitized_state(MODEL, digitizing.Clicks(two.pixels, hidden), PARAMETERS) is None


def test_rigid_fit_is_the_best_rigid_transform_and_never_a_mirror():
    rng = np.random.default_rng(3)
    source, true = rng.normal(size=(6, 3)), se3.exp(rng.normal(size=6))
    target = se3.apply(true, source) + 0.05 * rng.normal(size=(6, 3))
    T = digitizing.rigid_fit(source, target)

    def cost(transform):
        return ((se3.apply(transform, source) - target) ** 2).sum()

    assert all(cost(T) <= cost(T @ se3.exp(0.02 * rng.normal(size=6))) for _ in range(50))
    flat = source * [1.0, 1.0, 0.0]
    np.testing.assert_allclose(digitizing.rigid_fit(flat, se3.apply(true, flat)), true, atol=1e-9)
    mirrored = digitizing.rigid_fit(source, source * [1.0, 1.0, -1.0])
    assert np.linalg.det(mirrored[:3, :3]) == pytest.approx(1.0)
    assert so3.log(T[:3, :3] @ true[:3, :3].T) == pytest.approx(np.zeros(3), abs=0.1)
