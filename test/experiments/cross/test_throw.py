"""The scene of the wooden cross is the one that the experiment asks for."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.wooden_cross import cross as model_of_cross
from tracker_node.experiments.cross import throw as cross
from tracker_node.experiments.cross.scene import SHUTTER_S, TapeFaults, cross_scene, exposed, film
from tracker_node.experiments.target_images import TargetStudio
from tracker_node.model.configuration import Configuration, to_variables
from tracker_node.observation.deinterlace import comb_ratio, interpolate_lines

MODEL = model_of_cross()
TRIALS = pytest.mark.parametrize("trial", [cross.side_somersault(MODEL), cross.twisting_somersault(MODEL)], ids=lambda t: t.name)


def variables(trial) -> np.ndarray:
    rows: list[np.ndarray] = []
    for state in trial.states():
        rows.append(to_variables(state, rows[-1] if rows else None))
    return np.array(rows)


@TRIALS
def test_the_cross_stays_in_the_volume_and_in_every_image(trial):
    ends = np.concatenate([Configuration(MODEL, s).landmarks_world for s in trial.states()])
    assert (np.ptp(ends, axis=0) < cross.VOLUME + 0.1).all() and ends[:, 2].min() > 0.0
    for camera in cross.cross_rig():
        pixels, valid = camera.project(ends)
        assert valid.all() and camera.model.in_image(pixels).all()


def test_the_trials_are_those_of_the_paper():
    side, twist = cross.side_somersault(MODEL), cross.twisting_somersault(MODEL)
    assert (side.n_fields, twist.n_fields) == (39, 34)
    turned = np.rad2deg(np.ptp(variables(side), axis=0))
    assert 330.0 < turned[3] < 390.0 and turned[4:6].max() < 15.0
    turned = np.rad2deg(np.ptp(variables(twist), axis=0))
    assert 300.0 < turned[3] < 390.0 and 140.0 < turned[5] < 200.0


def test_the_late_camera_sees_a_later_instant():
    trial = cross.side_somersault(MODEL)
    moved = trial.state(5, cross.LATE_S).difference(trial.state(5))
    one_field = trial.state(6).difference(trial.state(5))
    np.testing.assert_allclose(moved, 0.2 * one_field, atol=2e-3)


def test_two_cameras_look_horizontally_and_one_down_and_all_see_the_control_points():
    rig, points = cross.cross_rig(), cross.control_points(np.random.default_rng(1))
    assert points.shape == (20, 3)
    np.testing.assert_allclose([camera.T_world_cam[2, 2] for camera in rig], [0.0, 0.0, -1.0], atol=1e-12)
    assert (np.ptp(points, axis=0) > 1.6).all() and (np.ptp(points, axis=0) < 2.5).all()
    for camera in rig:
        pixels, valid = camera.project(points)
        assert valid.all() and camera.model.in_image(pixels).all()


def test_lights_are_measured_as_badly_as_stated():
    true = cross.cross_rig().lights
    measured = cross.measured_lights(true, np.random.default_rng(0))
    for a, b in zip(true, measured, strict=True):
        assert b.intensity[0] / a.intensity[0] == pytest.approx(1.15) or b.intensity[0] / a.intensity[0] == pytest.approx(0.85)
        if a.position is not None:
            assert np.linalg.norm(np.subtract(a.position, b.position)) == pytest.approx(0.2)


def small_rig():
    rig = cross.cross_rig()
    return replace(rig, cameras=tuple(replace(c, model=c.model.resized(192, 144)) for c in rig))


def test_a_film_is_interlaced_and_every_field_shows_its_own_instant():
    rig, trial = small_rig(), replace(cross.side_somersault(MODEL), n_fields=5)
    backgrounds = [np.full((144, 192, 3), (90, 40, 60), np.uint8)] * 3
    faults = TapeFaults(luma_noise=0.0, chroma_noise=0.0, luma_blur_px=0.0, chroma_blur_px=0.0)
    with TargetStudio(rig, "raycaster") as studio:
        footage = film(MODEL, trial, studio, backgrounds, np.random.default_rng(0), faults, 0.0)
        assert [len(images) for images in footage.images] == [3, 3, 3]
        assert comb_ratio(footage.images[0]) > 1.0
        for field in (2, 3):
            whole = footage.interpolated(field)
            for i, own in enumerate(footage.own_lines(field)):
                state = trial.state(field, cross.LATE_S if rig.names[i] == "top" else 0.0)
                alone = studio.image(i, Configuration(MODEL, state), backgrounds[i])
                assert np.abs(own.astype(int) - alone[field % 2 :: 2]).max() <= 2
                np.testing.assert_array_equal(whole[i], interpolate_lines(own, field % 2))


def test_a_field_shows_the_whole_exposure():
    """Beside a still background a bright cross covers what it passes through, for part of the time at its ends."""
    rig, trial = small_rig(), replace(cross.side_somersault(MODEL), n_fields=2)
    backgrounds = [np.zeros((144, 192, 3), np.uint8)] * 3
    faults = TapeFaults(luma_noise=0.0, chroma_noise=0.0, luma_blur_px=0.0, chroma_blur_px=0.0)
    with TargetStudio(rig, "raycaster", supersampling=1) as studio:

        def shown(shutter_s):
            filmed = film(MODEL, trial, studio, backgrounds, np.random.default_rng(0), faults, shutter_s)
            return filmed.own_lines(0)[0].max(axis=2)

        sharp, short, long = (shown(shutter_s) for shutter_s in (0.0, SHUTTER_S, 4.0 * SHUTTER_S))
        ends = [
            studio.image(0, Configuration(MODEL, trial.state(0, part * 4.0 * SHUTTER_S)))[::2].max(axis=2) for part in (-0.4, 0.4)
        ]
    covered = [(image > 8).sum() for image in (sharp, short, long)]
    assert covered[0] < covered[1] < covered[2]
    assert (long[(ends[0] > 60) | (ends[1] > 60)] > 8).all() and (sharp[(ends[0] > 60) | (ends[1] > 60)] <= 8).any()


def test_light_is_averaged_and_not_gray_levels():
    dark, bright = np.zeros((2, 2, 3), np.uint8), np.full((2, 2, 3), 200, np.uint8)
    np.testing.assert_array_equal(exposed([bright, bright], 2.2), bright)
    np.testing.assert_array_equal(exposed([dark, bright], 1.0), np.full((2, 2, 3), 100))
    np.testing.assert_array_equal(exposed([dark, bright], 2.2), np.full((2, 2, 3), round(200 * 0.5 ** (1 / 2.2))))


def test_lenses_bend_straight_lines_by_a_percent_or_two_in_the_corners():
    for camera in cross_scene(3).rig:
        straight = replace(camera.model, distortion_model="none", distortion=np.zeros(0))
        corner = straight.rays(np.zeros((1, 2)))[0]
        seen, middle = camera.model.project(corner)[0][0], camera.model.K[:2, 2]
        assert 0.005 < 1.0 - np.linalg.norm(seen - middle) / np.linalg.norm(middle) < 0.025
