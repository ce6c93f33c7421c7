"""Clicks on a cross and the pose that comes of them."""

import numpy as np
import pytest

from helpers.bodies.wooden_cross import cross
from tracker_node.calibration.points.dlt import dlt_parameters
from tracker_node.experiments.cross import scene
from tracker_node.experiments.cross.throw import cross_rig, side_somersault
from tracker_node.geometry import se3

MODEL, RIG = cross(), cross_rig()
PARAMETERS = np.array([dlt_parameters(camera) for camera in RIG])
STATE = side_somersault(MODEL).state(7)


def clicks(sigma_px: float, seed: int = 0) -> scene.Clicks:
    return scene.click(MODEL, [STATE] * 3, list(RIG), sigma_px, np.random.default_rng(seed))


def test_exact_clicks_give_the_pose_back():
    found = scene.digitized_state(MODEL, clicks(0.0), PARAMETERS)
    np.testing.assert_allclose(found.T_world_root, STATE.T_world_root, atol=1e-9)


def test_errors_of_clicks_become_errors_of_millimetres_in_the_pose():
    tangents = [
        scene.digitized_state(MODEL, clicks(1.5, seed), PARAMETERS).difference(STATE) for seed in range(40)
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
    seen = scene.click(MODEL, [upright], [camera], 0.0, np.random.default_rng(0)).visible[:, 0]
    names = MODEL.landmark_names
    assert {name for name, visible in zip(names, seen, strict=True) if visible} == {"top", "left", "right"}


def test_a_late_camera_bends_the_pose_of_whoever_does_not_know():
    trial = side_somersault(MODEL)
    states = [STATE, STATE, trial.state(7, 0.004)]
    late = scene.click(MODEL, states, list(RIG), 0.0, np.random.default_rng(0))
    found = scene.digitized_state(MODEL, late, PARAMETERS)
    assert 1e-3 < np.linalg.norm(found.difference(STATE)[:3]) < 0.03


def test_too_few_points_give_no_pose():
    two = clicks(0.0)
    hidden = np.zeros_like(two.visible)
    hidden[:2] = True
    assert scene.digitized_state(MODEL, scene.Clicks(two.pixels, hidden), PARAMETERS) is None
