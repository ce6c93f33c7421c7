"""Target images: how much of a pixel the body covers, what is behind it, and the noise."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers.cameras.render_scenes import LIGHTS, colored_scene, look_at, single_shape
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import UnknownNameError
from tracker_node.experiments.target_images import BACKENDS, TargetStudio
from tracker_node.geometry import se3
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.segments18 import ellipsoid_human
from tracker_node.model.shapes.primitives import Box, Ellipsoid
from tracker_node.render.opengl.renderer import RendererError
from tracker_node.synthesis.scenes.room import cluttered_background

LENS = CameraModel(192, 144, np.array([[200.0, 0.0, 95.5], [0.0, 200.0, 71.5], [0.0, 0.0, 1.0]]))
BENT = CameraModel(192, 144, LENS.K, "plumb_bob", np.array([-0.25, 0.1, 0.004, -0.003, 0.0]))
FRONT = look_at((0.0, -2.0, 0.0), (0.0, 0.0, 0.0), LENS, "front")
SIDE = look_at((2.0, 0.3, 0.4), (0.0, 0.0, 0.0), BENT, "side")
RIG = CameraRig((FRONT, SIDE), lights=LIGHTS)


@pytest.fixture(params=BACKENDS)
def open_studio(request):
    """Opens studios of one backend, and closes them."""
    opened = []

    def make(rig, **arguments):
        try:
            opened.append(TargetStudio(rig, request.param, **arguments))
        except RendererError as error:
            pytest.skip(str(error))  # says what to install
        return opened[-1]

    yield make
    for studio in opened:
        studio.__exit__()


def plate(shift):
    """A sheet that faces the front camera, 100 px wide and 80 high, ``shift`` (2,) pixels to the right and down; gray 180."""
    T = np.eye(4)
    T[:3, 3] = 0.01 * shift[0], 0.005, -0.01 * shift[1]
    return single_shape(Box((1.0, 0.01, 0.8)), T)


@pytest.mark.parametrize("shift", [(0.25, 0.0), (0.5, 0.25), (0.75, 0.5)])
def test_outlines_mix_in_proportion(open_studio, shift):
    background = np.full((144, 192, 3), (10, 60, 110), np.uint8)
    image = open_studio(CameraRig((FRONT,)), supersampling=4).images(plate(shift), [background])[0]
    # The sheet ends half way between pixels if it is not shifted: its edges are at columns 45.5 and 145.5, rows 31.5 and 111.5
    cover = [np.zeros(n) for n in (192, 144)]
    for share, first, count, s in zip(cover, (46, 32), (100, 80), shift, strict=True):
        share[first], share[first + 1 : first + count], share[first + count] = 1.0 - s, 1.0, s
    both = np.outer(cover[1], cover[0])[:, :, None]
    assert np.abs(image - (180.0 * both + (1.0 - both) * background)).max() <= 1.0


def test_black_where_no_background_is_given(open_studio):
    image = open_studio(CameraRig((FRONT,))).images(plate((0.0, 0.0)))[0]
    expected = np.zeros((144, 192, 3))
    expected[32:112, 46:146] = 180
    assert np.abs(image - expected).max() <= 1.0


def test_balls_appear_where_the_lens_has_them(open_studio):
    studio = open_studio(RIG, supersampling=3)
    for point in [(0.0, 0.0, 0.0), (0.3, 0.2, 0.25), (-0.25, -0.2, -0.3)]:
        ball = single_shape(Ellipsoid((0.02, 0.02, 0.02)), se3.from_rotation_translation(np.eye(3), np.array(point)))
        for camera, image in zip(RIG, studio.images(ball, [np.zeros((144, 192, 3), np.uint8)] * 2), strict=True):
            light = replace(camera, gain=(1.0, 1.0, 1.0))
            weight = (image.max(axis=2) > 0).astype(float)
            v, u = np.nonzero(weight)
            assert np.abs((u.mean(), v.mean()) - light.project(np.array(point))[0]).max() < 0.35


def test_backends_make_the_same_images():
    scenes = [colored_scene(3, spread=0.3), Configuration(ellipsoid_human(), State.neutral(ellipsoid_human()))]
    backgrounds = [cluttered_background(camera, 5) for camera in RIG]
    images = []
    for backend in BACKENDS:
        try:
            with TargetStudio(RIG, backend) as studio:
                images.append([studio.images(scene, backgrounds) for scene in scenes])
        except RendererError as error:
            pytest.skip(str(error))
    for ours, theirs in zip(*images, strict=True):
        for a, b, behind in zip(ours, theirs, backgrounds, strict=True):
            body = (a != behind).any(axis=2)
            assert body.sum() > 300
            assert np.abs(a.astype(float) - b)[body].mean() < 1.0


def test_noise_is_seeded_and_grows_with_the_signal(open_studio):
    rig = CameraRig((FRONT,))
    scene, backgrounds = plate((0.0, 0.0)), [np.full((144, 192, 3), 20, np.uint8)]
    clean = open_studio(rig).images(scene, backgrounds)[0].astype(float)
    noisy = open_studio(rig, noise_levels=4.0, seed=1)
    first = noisy.images(scene, backgrounds, 7)[0]
    assert (first == open_studio(rig, noise_levels=4.0, seed=1).images(scene, backgrounds, 7)[0]).all()
    for other in (noisy.images(scene, backgrounds, 8), open_studio(rig, noise_levels=4.0, seed=2).images(scene, backgrounds, 7)):
        assert (first != other[0]).mean() > 0.7
    for level in (20.0, 180.0):
        there = clean[..., 0] == level
        expected = 4.0 * np.sqrt(0.5 + level / 255.0)
        assert (first - clean)[there].std() == pytest.approx(expected, rel=0.05)
        assert abs((first - clean)[there].mean()) < 0.1


def test_gain_and_gamma_are_those_of_the_camera(open_studio):
    camera = replace(FRONT, gain=(0.5, 0.25, 1.0), gamma=2.0)
    image = open_studio(CameraRig((camera,))).images(plate((0.0, 0.0)))[0]
    assert np.abs(image[70, 96] - 180.0 * np.sqrt([1.0, 0.25, 0.5])).max() <= 1.0  # BGR


def test_bad_input_says_what_is_expected():
    with pytest.raises(UnknownNameError, match="povray"):
        TargetStudio(RIG, "povray")
    with pytest.raises(ValueError, match="supersampling of 1 or more, got 0"):
        TargetStudio(RIG, "raycaster", supersampling=0)
    with TargetStudio(RIG, "raycaster") as studio:
        with pytest.raises(ValueError, match="background for each of 2 cameras, got 1"):
            studio.images(plate((0.0, 0.0)), [None])
        with pytest.raises(ValueError, match=r"camera 'side': expected a background \(144, 192, 3\) uint8, got \(144, 190, 3\)"):
            studio.images(plate((0.0, 0.0)), [None, np.zeros((144, 190, 3), np.uint8)])


def test_clutter_has_no_saturated_yellow_but_beige():
    large = look_at((0.0, -2.0, 0.0), (0.0, 0.0, 0.0), CameraModel(768, 576, LENS.K), "front")
    beige = []
    for seed in range(6):
        picture = cluttered_background(large, seed)
        assert picture.shape == (576, 768, 3) and picture.dtype == np.uint8
        hue, saturation, value = np.moveaxis(cv2.cvtColor(picture, cv2.COLOR_BGR2HSV).astype(int), 2, 0)
        yellowish = (2 * hue >= 40) & (2 * hue <= 70)
        assert not (yellowish & (saturation > 0.5 * 255) & (value > 60)).any()
        beige.append((yellowish & (saturation > 0.1 * 255) & (value > 100)).mean())
        assert cv2.Canny(picture, 60, 120).mean() / 255.0 > 0.01  # clutter has edges
    assert min(beige) > 0.02
    assert (cluttered_background(large, 0) == cluttered_background(large, 0)).all()
    for other in (cluttered_background(large, 1), cluttered_background(replace(large, name="side"), 0)):
        assert np.abs(cluttered_background(large, 0).astype(float) - other).mean() > 15.0
