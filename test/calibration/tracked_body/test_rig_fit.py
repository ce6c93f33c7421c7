from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.person_pictures import CONFIG, LATE_CAMERA, RATE_HZ, pictures
from tracker_node.calibration.tracked_body.body_fit import BodyFitOptions
from tracker_node.calibration.tracked_body.lines import SilhouetteEvidence
from tracker_node.calibration.tracked_body.rig_fit import RigFitOptions, fit_rig, world_of_most
from tracker_node.camera.rig import CameraRig
from tracker_node.geometry import se3, so3

TURNED = 1
OPTIONS = RigFitOptions(body=BodyFitOptions(groups=(), rounds=2, pose_rounds=2, config=CONFIG))


def _angle_deg(a, b) -> float:
    return float(np.degrees(np.linalg.norm(so3.log(a.T_world_cam[:3, :3].T @ b.T_world_cam[:3, :3]))))


def test_a_camera_that_was_turned_is_found():
    world = pictures()
    turned = world.rig.cameras[TURNED].T_world_cam @ se3.exp(np.r_[np.zeros(3), np.radians([0.6, 0.8, 0.0])])
    cameras = [replace(c, T_world_cam=turned) if i == TURNED else c for i, c in enumerate(world.rig)]
    rig = CameraRig(tuple(cameras))
    evidence = SilhouetteEvidence(world.sets, CONFIG, world.backgrounds)
    fit = fit_rig(world.person, rig, world.sets, world.states, world.velocities, replace(OPTIONS, times=False), evidence=evidence)
    for i, (true, found) in enumerate(zip(world.rig, fit.rig, strict=True)):
        assert _angle_deg(true, found) < 0.25
        assert abs(np.degrees(fit.cameras[true.name].turned_rad) - (1.0 if i == TURNED else 0.0)) < 0.25
    assert fit.overall[1].rms_px < 0.7 * fit.overall[0].rms_px
    assert all(camera.time_offset_ns == 0 for camera in fit.rig)


def test_a_camera_that_is_an_image_late_is_found():
    world = pictures()
    evidence = SilhouetteEvidence(world.late, CONFIG, world.backgrounds)
    options = replace(OPTIONS, places=False)
    fit = fit_rig(world.person, world.rig, world.late, world.states, world.velocities, options, evidence=evidence)
    for i, (name, camera) in enumerate(fit.cameras.items()):
        assert camera.later_s == pytest.approx(-1.0 / RATE_HZ if i == LATE_CAMERA else 0.0, abs=0.005)
        assert fit.rig[name].time_offset_ns == round(1e9 * camera.later_s)
        assert np.allclose(fit.rig[name].T_world_cam, world.rig[name].T_world_cam, atol=1e-9)


def test_a_body_that_is_too_thin_does_not_bring_the_cameras_nearer():
    """As a person is without the clothes; turns of cameras are found all the same."""
    world = pictures()
    thin = replace(world.person, shapes=tuple(replace(s, primitive=_thinner(s.primitive)) for s in world.person.shapes))
    evidence = SilhouetteEvidence(world.sets, CONFIG, world.backgrounds)
    options = replace(OPTIONS, times=False)
    kept, taken = (
        fit_rig(thin, world.rig, world.sets, world.states, world.velocities, replace(options, scale=scale), evidence=evidence)
        for scale in (False, True)
    )
    given, of_kept, of_taken = (_spread_m(each) for each in (world.rig, kept.rig, taken.rig))
    assert kept.scale == taken.scale < 0.992
    assert of_taken / given == pytest.approx(taken.scale, abs=0.004) and of_kept / given == pytest.approx(1.0, abs=0.004)
    assert max(camera.moved_m for camera in kept.cameras.values()) < 0.5 * max(c.moved_m for c in taken.cameras.values())
    assert kept.overall == taken.overall


def _thinner(primitive, factor=0.8):
    return replace(primitive, **{name: factor * getattr(primitive, name) for name in ("a", "b") if hasattr(primitive, name)})


def _spread_m(rig) -> float:
    centers = np.array([camera.center for camera in rig])
    return float(np.linalg.norm(centers - centers.mean(axis=0)))


@pytest.mark.parametrize("factor", [1.0, 0.96])
def test_the_world_stays_where_most_cameras_have_it(factor):
    rig = pictures().rig
    given = np.array([camera.T_world_cam for camera in rig])
    moved = given.copy()
    moved[0] = moved[0] @ se3.exp(np.array([0.05, -0.02, 0.1, 0.02, 0.03, -0.01]))
    elsewhere = se3.exp(np.array([0.3, -0.2, 0.1, 0.2, -0.1, 0.4]))
    found = moved.copy()
    found[:, :3, 3] *= factor
    back, growth = world_of_most(elsewhere @ found, given)
    again = elsewhere @ found
    again[:, :3, 3] *= growth
    assert growth == pytest.approx(1.0 / factor, abs=1e-4) and np.allclose((back @ again)[1:], given[1:], atol=1e-3)
    if factor == 1.0:
        back, growth = world_of_most(elsewhere @ moved, given, scaled=False)
        assert growth == 1.0 and np.allclose((back @ elsewhere @ moved)[1:], given[1:], atol=1e-4)
