"""Corrections of a rig, one by one: what each changes, what is fitted, and by how much cameras then agree better."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.cameras.moving_balls import balls_rig
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.doctor import geometry as doctor
from tracker_node.doctor.motion import ImageMotion, agreements
from tracker_node.doctor.setup import Setup
from tracker_node.geometry import se3, so3

N = 40
PERIOD_S = 0.1


def motion(camera: Camera, lag: int = 0) -> ImageMotion:
    """Of eight points in space, each at a time step's place and exact in the camera's pixels; ``lag``: of so much later."""
    rng = np.random.default_rng(1)
    t = np.arange(N)[:, None, None] + lag
    places = 0.8 * np.sin(0.12 * rng.uniform(1, 2, (8, 3)) * t + rng.uniform(0, 6, (8, 3)))
    pixels, _ = camera.project(places)
    time_steps, points = np.indices((N, 8))
    place = (time_steps * 8 + points).ravel()
    return ImageMotion(pixels.reshape(-1, 2), time_steps.ravel(), place, np.ones(len(place)), np.ones(N, dtype=bool))


@pytest.fixture(scope="module")
def sound() -> Setup:
    cameras = balls_rig(3).cameras
    return Setup.of(cameras, {camera.name: motion(camera) for camera in cameras})


def turned(camera: Camera, twist) -> Camera:
    step = np.asarray(twist, dtype=float)
    return replace(camera, T_world_cam=camera.T_world_cam @ se3.from_rotation_translation(so3.exp(step[3:]), step[:3]))


def zoomed(camera: Camera, factor: float) -> Camera:
    K = camera.model.K.copy()
    K[0, 0] *= factor
    K[1, 1] *= factor
    return replace(camera, model=replace(camera.model, K=K))


def test_a_sound_setup_needs_no_repair(sound):
    found = doctor.diagnose(sound, PERIOD_S)
    assert found.corrections == ()
    assert found.setup is sound
    np.testing.assert_array_equal(found.before, found.after)


def test_one_camera_alone_is_not_diagnosed(sound):
    name = sound.cameras[0].name
    alone = Setup.of(sound.cameras[:1], {name: sound.motions[name]})
    assert doctor.diagnose(alone, PERIOD_S).corrections == ()


def exchanges(setup):
    return {(r.kind, r.cameras): r for r in doctor._exchanges(setup, agreements(setup.cameras, setup.motions))}


def away(setup):
    """All that moves is behind the cameras."""
    flip = np.diag([1.0, -1.0, -1.0, 1.0])
    return replace(setup, cameras=tuple(replace(camera, T_world_cam=camera.T_world_cam @ flip) for camera in setup.cameras))


def test_what_is_exchanged(sound):
    a, b, c = (camera.name for camera in sound.cameras)
    one = {(kind, (name,)) for kind in ("mirrored", "upside_down") for name in (a, b, c)}
    pairs = {("swapped", pair) for pair in ((a, b), (a, c), (b, c))}
    assert set(exchanges(sound)) == one | pairs | {("mirrored", ()), ("inverted", ())}
    assert set(exchanges(away(sound))) == one | pairs | {("mirrored", ()), ("axes", ()), ("inverted", ())}
    two = Setup.of(sound.cameras[:2], {name: sound.motions[name] for name in (a, b)})
    assert ("mirrored", ()) not in exchanges(two)  # a world seen in a mirror is as good a world


def test_each_exchange_undoes_itself(sound):
    """Done twice, places and pixels are as before."""
    for kind, cameras in exchanges(sound):
        twice = exchanges(exchanges(sound)[kind, cameras].setup)[kind, cameras].setup
        for before, after in zip(sound.cameras, twice.cameras, strict=True):
            np.testing.assert_allclose(after.T_world_cam, before.T_world_cam, atol=1e-12)
            pixels = twice.motions[after.name].pixels
            np.testing.assert_allclose(pixels, sound.motions[before.name].pixels, atol=1e-9)


def test_what_an_exchange_changes(sound):
    a, b = sound.cameras[0], sound.cameras[1]
    found = exchanges(sound)
    upside_down = found["upside_down", (b.name,)].setup.cameras
    np.testing.assert_allclose(upside_down[1].T_world_cam, b.T_world_cam @ np.diag([-1.0, -1.0, 1.0, 1.0]))
    assert upside_down[0] is a
    axes = exchanges(away(sound))["axes", ()].setup.cameras[1]
    np.testing.assert_allclose(axes.T_world_cam, b.T_world_cam, atol=1e-12)
    np.testing.assert_allclose(found["inverted", ()].setup.cameras[0].T_world_cam, a.T_cam_world)
    mirrored = found["mirrored", (a.name,)].setup.motions
    np.testing.assert_allclose(mirrored[a.name].pixels[:, 0], a.model.width - 1 - sound.motions[a.name].pixels[:, 0])
    assert mirrored[b.name] is sound.motions[b.name]
    swapped = found["swapped", (a.name, b.name)].setup.motions
    np.testing.assert_allclose(swapped[a.name].pixels, sound.motions[b.name].pixels)


def test_swapped_images_of_different_sizes_are_scaled(sound):
    """Pixel centers are at whole numbers: the left edge -0.5 stays where it is."""
    a, b = sound.cameras[:2]
    large = replace(b, model=replace(b.model, width=2 * b.model.width, height=3 * b.model.height))
    corner = np.array([[-0.5, -0.5], [9.5, 9.5]])
    pixels = {camera.name: replace(sound.motions[camera.name], pixels=corner) for camera in (a, b)}
    swapped = doctor._swapped(sound.with_camera(1, large).with_motions(pixels), a, large).motions
    np.testing.assert_allclose(swapped[large.name].pixels, [[-0.5, -0.5], [19.5, 29.5]])
    np.testing.assert_allclose(swapped[a.name].pixels, [[-0.5, -0.5], [4.5, 10.0 / 3.0 - 0.5]])


def test_the_gain_is_as_if_one_camera_were_concerned():
    """Of weights 1 everywhere a camera has two pairs: half the sum over both orders, by two."""
    cameras = balls_rig(3).cameras
    setup = Setup(cameras, {camera.name: motion(camera) for camera in cameras}, np.ones((3, 3)) - np.eye(3))
    now = agreements(setup.cameras, setup.motions)
    assert doctor._total_gain(setup, now) == 0.0
    base = now - np.array([[0.0, 0.3, 0.1], [0.3, 0.0, 0.0], [0.1, 0.0, 0.0]])
    assert doctor._total_gain(setup, base) == pytest.approx((0.3 + 0.1) / 2.0)
    base[0, 1] = base[1, 0] = np.nan  # a pair that had no say
    assert doctor._total_gain(setup, base) == pytest.approx(0.1 / 2.0)


@pytest.mark.parametrize("lag", [-3, 4])
def test_a_clock_is_told_with_its_sign_in_seconds(sound, lag):
    """Images of ``lag`` periods later under an earlier stamp are moved back by as many."""
    camera = sound.cameras[1]
    shifted = sound.with_motions({camera.name: motion(camera, lag)})
    (correction,) = doctor._clock(shifted, 1, shifted.agreement_of(1), PERIOD_S)
    assert (correction.kind, correction.cameras) == ("clock", (camera.name,))
    assert correction.values["late_s"] == pytest.approx(-lag * PERIOD_S, abs=0.03)
    inside = correction.setup.motions[camera.name]
    assert inside.valid.sum() == N - abs(lag)
    assert correction.gain == pytest.approx(correction.setup.agreement_of(1) - shifted.agreement_of(1))
    assert correction.gain > 0.1


def test_a_clock_between_two_images_is_told_between_them(sound):
    other, camera, third = sound.cameras
    doubled = {c.name: motion(c, 0).every(2) for c in (other, third)}
    late = motion(camera, 1).every(2)  # half a period of the thinned images
    halves = sound.with_motions({**doubled, camera.name: late.shifted(2)})
    (correction,) = doctor._clock(halves, 1, halves.agreement_of(1), PERIOD_S)
    assert correction.values["late_s"] == pytest.approx(-2.5 * PERIOD_S, abs=0.2 * PERIOD_S)


@pytest.mark.parametrize(("period_s", "furthest"), [(0.25, 4), (0.05, N // 3), (2.0, 1)])
def test_clocks_are_tried_within_a_second_and_a_third_of_the_recording(sound, period_s, furthest, monkeypatch):
    tried = []
    shifted = ImageMotion.shifted
    monkeypatch.setattr(ImageMotion, "shifted", lambda self, k: (tried.append(k), shifted(self, k))[1])
    assert list(doctor._clock(sound, 1, sound.agreement_of(1), period_s)) == []  # none is better than as it is
    assert tried == list(range(-furthest, furthest + 1))


@pytest.mark.parametrize("factor", [0.87, 1.12])
def test_a_focal_length_is_told_as_a_factor(sound, factor):
    camera = sound.cameras[1]
    wrong = sound.with_camera(1, zoomed(camera, factor))
    corrections = list(doctor._focal_length(wrong, 1))
    best = max(corrections, key=lambda correction: correction.gain)
    assert (best.kind, best.cameras) == ("focal", (camera.name,))
    assert best.values["factor"] == pytest.approx(1.0 / factor, abs=0.02)
    K = best.setup.cameras[1].model.K
    np.testing.assert_allclose([K[0, 0], K[1, 1]], [camera.model.K[0, 0], camera.model.K[1, 1]], rtol=0.02)
    assert best.gain == pytest.approx(best.setup.agreement_of(1) - wrong.agreement_of(1))
    assert best.setup.agreement_of(1) == pytest.approx(sound.agreement_of(1), abs=0.01)


def test_a_focal_length_that_is_right_is_left(sound):
    assert list(doctor._focal_length(sound, 1)) == []


def test_a_turned_camera_is_told_in_degrees_and_priced(sound):
    wrong = sound.with_camera(1, turned(sound.cameras[1], [0, 0, 0, 0.0, 0.07, 0.0]))
    first, *more = doctor._place(wrong, 1)
    assert (first.kind, first.cameras) == ("place", (sound.cameras[1].name,))
    assert first.values["turned_deg"] == pytest.approx(np.degrees(0.07), abs=0.6)
    assert first.values["moved_m"] == pytest.approx(0.0, abs=1e-9)  # three numbers are a turn alone
    now = first.setup.cameras[1]
    angle = np.linalg.norm(so3.log(now.T_world_cam[:3, :3].T @ sound.cameras[1].T_world_cam[:3, :3]))
    assert angle < 0.01
    assert first.gain == pytest.approx(first.setup.agreement_of(1) - wrong.agreement_of(1) - 2 * 0.004)
    for correction in more:
        assert correction.gain == pytest.approx(correction.setup.agreement_of(1) - wrong.agreement_of(1) - 5 * 0.004)
    assert len(more) == 1
    distance = np.linalg.norm(more[0].setup.cameras[1].center - wrong.cameras[1].center)
    assert more[0].values["moved_m"] == pytest.approx(distance)


def test_a_place_that_is_right_is_left(sound):
    assert list(doctor._place(sound, 1)) == []


def test_a_mirrored_image_is_found_and_nothing_else(sound):
    c = sound.cameras[2]
    wrong = sound.with_motions({c.name: sound.motions[c.name].mirrored(c.model.width)})
    found = doctor.diagnose(wrong, PERIOD_S)
    assert [(correction.kind, correction.cameras) for correction in found.corrections] == [("mirrored", (c.name,))]
    np.testing.assert_array_equal(found.before, agreements(wrong.cameras, wrong.motions))
    np.testing.assert_allclose(found.after, agreements(sound.cameras, sound.motions))
    np.testing.assert_allclose(found.setup.motions[c.name].pixels, sound.motions[c.name].pixels)


def test_a_fit_holds_what_is_hardly_seen_at_zero():
    """A number that changes nothing costs its prior and stays; the other goes to where cameras agree best."""
    cameras = balls_rig(3).cameras
    setup = Setup.of(cameras, {camera.name: motion(camera) for camera in cameras})
    wrong = setup.with_camera(1, zoomed(cameras[1], 0.9))

    def repaired(p):
        return zoomed(wrong.cameras[1], float(np.exp(p[0])))

    simplex = np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.5]])
    found, gain = doctor._fitted(wrong, 1, repaired, simplex, np.array([0.3, 1.0]))
    assert found[0] == pytest.approx(-np.log(0.9), abs=0.02)
    assert found[1] == pytest.approx(0.0, abs=0.1)
    assert gain == pytest.approx(wrong.with_camera(1, repaired(found)).agreement_of(1) - wrong.agreement_of(1))


def test_lenses_keep_their_distortion_when_zoomed(sound):
    wrong = sound.with_camera(1, zoomed(sound.cameras[1], 0.87))
    for correction in doctor._focal_length(wrong, 1):
        model: CameraModel = correction.setup.cameras[1].model
        assert (model.width, model.height) == (sound.cameras[1].model.width, sound.cameras[1].model.height)
        np.testing.assert_array_equal(model.K[:2, 2], sound.cameras[1].model.K[:2, 2])
