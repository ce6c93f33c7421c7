"""``reproduce cross --quick`` runs from one end to the other and leaves what it promises; the scene knows what it should."""

import json

import cv2
import numpy as np
import pytest

from tracker_node.cli.main import main
from tracker_node.errors import SourceError
from tracker_node.experiments.cross import methods as _cross_methods
from tracker_node.experiments.cross import scene as _cross_scene
from tracker_node.experiments.cross.scene import Footage

PICTURES = ("fig3_plan", "fig7_side_mask", "fig8_twist_mask", "fig9_side_pose", "fig10_twist_pose", "side_video", "twist_errors")


@pytest.mark.long
def test_the_command_leaves_figures_pictures_and_a_page(tmp_path, capsys):
    assert main(["reproduce", "cross", "--quick", "--output", str(tmp_path)]) == 0
    metrics = json.loads((tmp_path / "metrics.json").read_text())["metrics"]
    for trial, position, angle in (("side", 3.0, 1.0), ("twist", 5.0, 2.0)):
        assert 0.0 < metrics[f"cross.{trial}.position_rms_mm"] <= position
        assert 0.0 < metrics[f"cross.{trial}.angle_rms_deg"] <= angle
        for kind in ("published.", "digitizing.", "vs_digitizing."):
            assert position / 10.0 < metrics[f"cross.{trial}.{kind}position_rms_mm"] < 20.0
            assert 0.1 < metrics[f"cross.{trial}.{kind}angle_rms_deg"] < 9.0
        assert abs(metrics[f"cross.{trial}.phase_ms"]) < 4.0
    assert 0.2 < metrics["cross.calibration.none_rms_px"] <= metrics["cross.calibration.centered_rms_px"] + 1e-9
    for name in PICTURES:
        assert cv2.imread(str(tmp_path / f"{name}.png")).std() > 5.0
    table = (tmp_path / "table.txt").read_text()
    assert "paper: stepping, against digitizing" in table and "< 17 mm" in table
    assert table in capsys.readouterr().out + "\n"
    assert (tmp_path / "report.html").read_text().count("data:image/png") == 9


@pytest.fixture(scope="module")
def scene():
    return _cross_scene.cross_scene(3, 0.25, 3)


def test_the_tracker_knows_neither_true_lights_nor_gain_nor_gamma(scene):
    assert scene.rigs["lit"] is scene.rig
    for rig in (rig for name, rig in scene.rigs.items() if name != "lit"):
        assert [camera.gain for camera in rig] == [(1.0, 1.0, 1.0)] * 3 and [camera.gamma for camera in rig] == [1.0] * 3
        for light, true in zip(rig.lights, scene.rig.lights, strict=True):
            assert abs(light.intensity[0] / true.intensity[0] - 1.0) == pytest.approx(0.15)
    centers = {name: np.array([camera.center for camera in rig]) for name, rig in scene.rigs.items()}
    np.testing.assert_array_equal(centers["true"], [camera.center for camera in scene.rig])
    assert 0.001 < np.linalg.norm(centers["dlt"] - centers["true"], axis=1).max() < 2.0  # 1 px of so small an image is much
    bent = {name: [camera.model.distortion.any() for camera in rig] for name, rig in scene.rigs.items()}
    assert {name for name, cameras in bent.items() if all(cameras)} == {"true", "lit", "dlt_radial"}
    assert {name for name, cameras in bent.items() if not any(cameras)} == {"dlt", "dlt_no_skew", "dlt_square", "dlt_centered"}


def test_colors_are_picked_from_the_cross(scene):
    trial = scene.trials[0]
    footage = scene.film(trial, "raycaster")
    colors = scene.picked_colors(trial, footage.interpolated(0))
    assert colors.shape == (3, 2, 3)
    red, green, blue = np.moveaxis(colors, 2, 0)
    assert (red > 100).all() and (green > 0.6 * red).all() and (blue < 0.5 * green).all()


def test_raw_colors_are_those_of_light_of_factor_one():
    """The rig as it is gives the cross its own color back, which its cameras show darker or brighter."""
    large = _cross_scene.cross_scene(3, 1.0, 1)
    trial = large.trials[1]  # turned away from a light
    fields = large.film(trial, "raycaster", 0.0).interpolated(0)
    own = np.broadcast_to(large.model.shapes[0].color_rgb, (3, 2, 3))
    assert np.abs(large.picked_colors(trial, fields) - own).max() > 60.0
    np.testing.assert_allclose(large.picked_colors(trial, fields, large.rig), own, atol=15.0)


def test_progressive_video_is_refused(scene, monkeypatch):
    full = _cross_scene.cross_scene(3, 0.5, 8)
    trial = full.trials[0]

    def film_progressive(*arguments, **options):
        fields = film(*arguments, **options)
        return Footage(tuple(tuple(fields.interpolated(k)[i] for k in range(4)) for i in range(3)), 8)

    film = _cross_scene.film
    monkeypatch.setattr(_cross_scene, "film", film_progressive)
    with pytest.raises(SourceError, match=r"side somersault, camera left.*no comb"):
        full.film(trial, "raycaster")


def test_the_first_start_is_50_mm_and_5_degrees_off():
    error = np.array(_cross_methods.START_ERROR)
    assert np.linalg.norm(error[:3]) == pytest.approx(50.0, abs=0.2) and np.linalg.norm(error[3:]) == pytest.approx(5.0, abs=0.05)


def test_the_low_pass_keeps_edges_in_place_and_removes_noise():
    rng = np.random.default_rng(0)
    image = np.full((60, 80, 3), 60, np.uint8)
    image[:, 40:] = 180
    noisy = np.clip(image + 8.0 * rng.standard_normal(image.shape), 0, 255).astype(np.uint8)
    smooth = _cross_methods.low_passed(noisy)
    assert smooth[:, 5:25].std() < 0.4 * noisy[:, 5:25].std()
    crossing = np.argmax(smooth.mean(axis=(0, 2)) > 120.0)
    assert crossing == 40


@pytest.fixture(scope="module")
def footage(scene):
    return scene.film(scene.trials[0], "raycaster")


def method(key):
    return next(one for one in _cross_methods.METHODS if one.key == key)


def test_the_low_pass_is_wider_along_the_lines():
    dot = np.zeros((41, 41, 3), np.float32)
    dot[20, 20] = 1.0
    smooth = _cross_methods.low_passed(dot)[..., 0].astype(float)
    offsets = np.arange(-20, 21)
    widths = [np.sqrt((smooth.sum(axis=axis) * offsets**2).sum()) for axis in (0, 1)]
    assert widths == pytest.approx([2.0, 0.5], abs=0.1)


class Shown:
    """Images that an objective is given."""

    def __init__(self):
        self.images, self.velocity = None, "none yet"

    def set_images(self, images):
        self.images = images


def shown(scene, footage, key, field):
    fitter = _cross_methods._Fitter(scene, scene.trials[0], footage, method(key), scene.late_s)
    assert len(fitter._of_line) == 2
    fitter._of_line = [(Shown(), Shown()), (Shown(), Shown())]
    fitter.show(field, np.ones(6))
    line = [i for i, pair in enumerate(fitter._of_line) if pair[0].images is not None]
    assert len(line) == 1
    score, aligned = fitter._of_line[line[0]]
    assert score.images is aligned.images
    assert np.array_equal(score.velocity, np.ones(6))
    assert np.array_equal(aligned.velocity, np.ones(6))
    assert (fitter._score, fitter._aligned) == (score, aligned)
    return line[0], score.images


def test_a_fit_is_shown_the_field_filtered_but_for_the_paper_s(scene, footage):
    line, images = shown(scene, footage, "", 0)
    for image, field in zip(images, footage.interpolated(0), strict=True):
        np.testing.assert_array_equal(image, _cross_methods.low_passed(field))
    _, plain = shown(scene, footage, "stepping.", 0)
    for image, field in zip(plain, footage.interpolated(0), strict=True):
        np.testing.assert_array_equal(image, field)
    assert shown(scene, footage, "", 1)[0] == 1 - line
    assert shown(scene, footage, "", 2)[0] == line


def test_own_lines_are_half_as_high_and_filtered_by_half(scene, footage):
    _, images = shown(scene, footage, "own_lines.", 1)
    for image, field in zip(images, footage.own_lines(1), strict=True):
        np.testing.assert_array_equal(image, _cross_methods.low_passed(field, 2.0, 0.25))


def test_colors_are_compared_as_the_method_says(scene, footage):
    found = {}
    for key in ("", "raw.", "gained."):
        fitter = _cross_methods._Fitter(scene, scene.trials[0], footage, method(key), scene.late_s)
        parts = [part for pair in fitter._of_line for objective in pair for _, _, part in objective._parts]
        found[key] = {(part.options.representation, part.options.gained) for part in parts}
    assert found == {"": {("normalized", False)}, "raw.": {("raw", False)}, "gained.": {("raw", True)}}


def test_methods_differ_in_what_they_say():
    assert len({one.key for one in _cross_methods.METHODS}) == len(_cross_methods.METHODS) == 17
    best = _cross_methods.BEST
    assert (best.rig, best.times, best.fit, best.colors) == ("dlt_radial", "estimated", "alignment", "normalized")
    assert (best.shutter_s, best.own_lines) == (0.004, False)
    published = _cross_methods.AS_PUBLISHED
    assert (published.rig, published.times, published.fit) == ("dlt_centered", "ignored", "stepping")
    assert (published.colors, published.shutter_s) == ("normalized", 0.004)


def test_the_start_is_off_by_what_is_said(scene):
    trial = scene.trials[0]
    off = _cross_methods._start(trial).T_world_root[:3, 3] - trial.state(0).T_world_root[:3, 3]
    assert np.linalg.norm(off) == pytest.approx(1e-3 * np.linalg.norm(_cross_methods.START_ERROR[:3]))


@pytest.mark.parametrize(("key", "fits"), [("stepping.", 3), ("", 6), ("without_time.", 3)])
def test_every_field_is_fitted_once_and_again_where_velocities_are_used(scene, footage, monkeypatch, key, fits):
    done = []

    def fit(self, start):
        done.append(start)
        return _cross_methods.align(self._aligned, start, self._chain, _cross_methods.AlignmentOptions(coarsest=0))

    monkeypatch.setattr(_cross_methods._Fitter, "first", fit)
    monkeypatch.setattr(_cross_methods._Fitter, "again", fit)
    tracked = _cross_methods.track(scene, scene.trials[0], footage, method(key), scene.late_s)
    assert len(tracked.states) == 3
    assert len(done) == fits
