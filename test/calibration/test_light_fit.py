"""Lights, gains and gammas from images that OpenGL has drawn; what is fitted is our own law of light."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tracker_node.calibration.light_fit import fit_lights, irradiance, load_pose_images, with_lights
from tracker_node.camera.light import Light
from tracker_node.errors import CalibrationError, SourceError, TrackerError
from tracker_node.experiments.cross.throw import cross_rig, measured_lights, twisting_somersault, yellow_stick
from tracker_node.experiments.target_images import TargetStudio
from tracker_node.loaders.rig.rig_yaml import rig_file_of
from tracker_node.model.configuration import Configuration
from tracker_node.render.raycast.raycaster import render_color
from tracker_node.render.raycast.surface_samples import surface_samples

MODEL, RIG = yellow_stick(), cross_rig()
POSES = [Configuration(MODEL, twisting_somersault(MODEL).state(k)) for k in (2, 10, 18, 26, 32)]


def given():
    """What the experimenters know: lights 20 cm and 15 % off, gains and gammas of a usual camera."""
    cameras = [RIG.cameras[0], *(replace(c, gain=(1.0, 1.0, 1.0)) for c in RIG.cameras[1:])]
    cameras = tuple(replace(c, gamma=1.8) for c in cameras)
    return replace(RIG, cameras=cameras, lights=measured_lights(RIG.lights, np.random.default_rng(0)))


@pytest.fixture(scope="module")
def images():
    with TargetStudio(RIG, "pyrender", supersampling=2, noise_levels=1.5) as studio:
        return [studio.images(pose, None, k) for k, pose in enumerate(POSES)]


def test_samples_are_the_pixels_of_the_renderer():
    camera = RIG.cameras[1]
    samples = surface_samples(POSES[0], camera)
    view = render_color(POSES[0], camera, RIG.lights)
    assert len(samples.pixels) == np.count_nonzero(view.labels)
    light = np.maximum(np.array(camera.gain) * irradiance(RIG.lights, samples.points, samples.normals), 1e-9)
    shown = np.minimum(samples.colors_rgb * light ** (1.0 / camera.gamma), 255.0)
    u, v = samples.pixels.T
    np.testing.assert_allclose(shown, view.rgb[v, u], atol=2e-3)
    np.testing.assert_array_equal(samples.shapes + 1, view.labels[v, u])
    np.testing.assert_allclose(camera.project(samples.points)[0], samples.pixels, atol=1e-3)


def test_pixels_at_the_rim_of_a_face_are_left_out():
    all_of_it, inner = (surface_samples(POSES[0], RIG.cameras[0], rim=rim) for rim in (0, 2))
    assert 0.4 * len(all_of_it.pixels) < len(inner.pixels) < 0.95 * len(all_of_it.pixels)
    seen = set(map(tuple, all_of_it.pixels))
    for u, v in inner.pixels[::50]:
        assert {(u + 2, v), (u - 2, v), (u, v + 2), (u, v - 2)} <= seen


def test_lights_and_cameras_are_found(images):
    start = given()
    fit = fit_lights(start, POSES, images)
    assert fit.converged
    for name in RIG.names:
        assert fit.rms_after[name] < 1.9 < 3.0 < fit.rms_before[name]
        true, found = RIG[name], fit.rig[name]
        np.testing.assert_allclose(found.gain, true.gain, atol=0.04)
        assert found.gamma == pytest.approx(true.gamma, rel=0.07)
    assert fit.rig.cameras[0].gain == RIG.cameras[0].gain
    for true, before, found in zip(RIG.lights, start.lights, fit.rig.lights, strict=True):
        np.testing.assert_allclose(found.intensity, true.intensity, rtol=0.08)
        if true.position is not None:
            off, was = (np.linalg.norm(np.subtract(light.position, true.position)) for light in (found, before))
            assert off < 0.15 < 0.19 < was


def test_cameras_can_be_kept_and_cameras_without_images_do_no_harm(images):
    start = replace(given(), cameras=RIG.cameras)
    some = [[first, None, third] if k else [first, second, third] for k, (first, second, third) in enumerate(images)]
    fit = fit_lights(start, POSES, some, free_cameras=False)
    assert [c.gain for c in fit.rig] == [c.gain for c in RIG] and [c.gamma for c in fit.rig] == [c.gamma for c in RIG]
    assert max(fit.rms_after.values()) < 1.9
    off = [np.linalg.norm(np.subtract(a.position, b.position)) for a, b in zip(fit.rig.lights[1:], RIG.lights[1:], strict=True)]
    assert max(off) < 0.12


def test_a_sun_is_found_by_its_direction():
    lights = (Light("ambient", (0.3, 0.3, 0.35)), Light("directional", (0.6, 0.6, 0.5), direction=(0.3, 0.6, -0.7)))
    rig = replace(RIG, lights=lights)
    with TargetStudio(rig, "pyrender", supersampling=1, noise_levels=1.0) as studio:
        shown = [studio.images(pose, None, k) for k, pose in enumerate(POSES[:3])]
    rough = (lights[0], replace(lights[1], direction=(0.1, 0.7, -0.5), intensity=(0.5, 0.5, 0.5)))
    fit = fit_lights(replace(rig, lights=rough), POSES[:3], shown, free_cameras=False)
    found, true = (np.array(light.direction) / np.linalg.norm(light.direction) for light in (fit.rig.lights[1], lights[1]))
    assert np.degrees(np.arccos(min(1.0, found @ true))) < 2.0
    assert np.isnan(fit.position_sigma_m[1])


def test_a_camera_without_images_stays_as_it_is(images):
    start = given()
    fit = fit_lights(start, POSES[:2], [[each[0], None, each[2]] for each in images[:2]])
    missing = RIG.names[1]
    assert fit.rig.names == RIG.names and set(fit.n_pixels) == set(fit.rms_after) == {RIG.names[0], RIG.names[2]}
    assert fit.rig[missing] is start[missing]
    file = rig_file_of(start)
    written = with_lights(file, fit)
    assert written.cameras[missing] is file.cameras[missing]
    assert written.cameras[RIG.names[2]].gamma == pytest.approx(fit.rig[RIG.names[2]].gamma)
    assert written.lights == rig_file_of(fit.rig).lights != file.lights


def test_images_of_poses_by_the_camera_s_name(tmp_path):
    image = np.random.default_rng(0).integers(0, 256, (4, 6, 3), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "a.png"), image)
    ((first, second),) = load_pose_images([f"{tmp_path}/{{name}}.png"], ("a", "b"))
    np.testing.assert_array_equal(first, image)
    assert second is None
    (tmp_path / "c.png").write_text("no image")
    for pattern, names, message in (
        (f"{tmp_path}/{{name}}.png", ("b",), "no image of any camera"),
        (f"{tmp_path}/{{name}}.png", ("c",), "cannot be read as an image"),
        (f"{tmp_path}/{{camera}}.png", ("a",), "a pattern with {name}"),
    ):
        with pytest.raises(SourceError, match=message):
            load_pose_images([pattern], names)


def test_what_tells_nothing_is_refused(images):
    with pytest.raises(TrackerError, match="no lights to start with"):
        fit_lights(replace(RIG, lights=()), POSES, images)
    with pytest.raises(TrackerError, match="no image of any camera"):
        fit_lights(RIG, POSES, [[None] * len(RIG)] * len(POSES))
    dark = [[np.zeros_like(image) for image in each] for each in images]
    with pytest.raises(CalibrationError, match=r"'left': only 0 pixels of the body"):
        fit_lights(RIG, POSES, dark)
    small = [[image[::2, ::2] for image in each] for each in images]
    with pytest.raises(CalibrationError, match="expected 768x576, got 384x288"):
        fit_lights(RIG, POSES, small)
