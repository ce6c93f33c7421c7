"""Parts of the experiments that need no tracking: what is tried, what is remarked, where cameras stand, what is measured."""

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from tracker_node.cli.groups import reproduce
from tracker_node.errors import FileFormatError
from tracker_node.experiments import figures
from tracker_node.experiments.plots import Profile
from tracker_node.experiments.rigid_tracking import PAPER_RMS, UNITS, VARIABLES
from tracker_node.experiments.somersault import experiments
from tracker_node.experiments.somersault.scene import somersault_scene
from tracker_node.objective.color.score import ColorObjective
from tracker_node.parallel import Workers


@pytest.fixture(scope="module")
def scene():
    return somersault_scene(2, 96)


def test_the_methods_of_table_1_and_their_renderers():
    objectives = SimpleNamespace(score=None, capped=None, ambient=None, pyramid=None, chain=None)
    methods = {method.key: method for method in experiments._methods(objectives)}
    assert list(methods) == [key for keys in experiments.TABLES.values() for key in keys]
    assert {key for key, method in methods.items() if method.targets == "raycaster"} == {
        "same_backend", "same_backend_best", "same_backend_floor",
    }  # fmt: skip
    assert {key for key, method in methods.items() if method.from_truth} == {*experiments.FLOORS, "same_backend_floor"}
    ambient = {key for key, method in methods.items() if method.targets == experiments.AMBIENT}
    assert ambient == {"stepping_ambient", "floor_ambient"}


def remarks(**rms):
    metrics = {f"table1.floor_hard.{name}_rms_{unit}": rms.get(name, 0.0) for name, unit in zip(VARIABLES, UNITS, strict=True)}
    metrics |= {"table1.evaluations_per_variable": 20.25, "table1.best.evaluations_per_variable": 300.0}
    metrics |= {"table1.overhang_cost_share": 0.314, "table1.overhang_pixel_share": 0.021}
    metrics |= {"table1.valley_hard_twist_deg": 2.54, "table1.valley_capped_twist_deg": 1.26}
    metrics["table1.floor_hard.twist_worst_image"] = 2
    biases = {"floor_hard": (2.0, -1.0, 2.0), "floor_ambient": (0.0, 0.3, 0.4), "floor": (0.0, 0.0, -0.7)}
    metrics |= experiments._biases({key: np.array([[*bias, 0.0, 0.0, 0.0]]) for key, bias in biases.items()})
    return experiments._remarks(metrics | {"table1.mask_pixels": 1234, "table1.surface_distance_mean_mm": 5.55})


def test_variables_whose_floor_is_above_half_of_the_paper_s_rms_are_named():
    half = 0.5 * PAPER_RMS
    assert "rms in: no variable.\n" in remarks()
    assert "rms in: A-P, twist.\n" in remarks(ap=half[1] + 1e-6, lateral=half[2] - 1e-6, twist=half[5] + 1e-6)


def test_remarks_tell_the_start_s_error_with_signs():
    text = remarks()
    assert "+30, -30, +20, +4, -3, +4." in text
    assert "20.2 stepping, 300.0 for alignment" in text
    assert "1234 pixels" in text


def test_remarks_tell_where_the_floor_comes_from():
    text = remarks()
    assert "31 % of the squares are on the 2 % of the mask" in text
    assert "on average by 3.0 mm, in ambient light alone 0.5, and 0.7 where" in text
    assert "worst in image 2 " in text and "2.5 degrees before" in text and "(1.3 capped)" in text


def test_a_floor_s_rms_is_its_bias_and_the_rest():
    errors = np.array([[1.0] * 6, [4.0] * 6, [-2.0] * 6])
    found = experiments._biases({"floor": errors})
    assert len(found) == 12 and found["table1.floor.tilt_bias_deg"] == pytest.approx(1.0)
    assert np.hypot(found["table1.floor.ap_bias_mm"], found["table1.floor.ap_rest_mm"]) == pytest.approx(np.sqrt(7.0))


def test_the_overhang_is_what_the_body_covers_of_black(scene):
    """Two of four pixels are covered; one of them over black, with three times the difference of the other."""
    off = np.array([[30.0, 10.0], [np.nan, np.nan]])
    image = np.array([[[0, 0, 0], [9, 0, 0]], [[0, 0, 0], [9, 9, 9]]], dtype=np.uint8)
    assert experiments._overhang([[off]], [[image]]) == {
        "table1.overhang_pixel_share": 0.5, "table1.overhang_cost_share": pytest.approx(0.9),
    }  # fmt: skip
    alike = experiments._differences(scene, scene.draw(scene.tracked, scene.truth))
    assert all(np.nanmax(off) == 0.0 for of_set in alike for off in of_set)


def test_ambient_light_has_no_direction(scene):
    lights = scene.in_ambient_light().rig.lights
    assert [light.kind for light in lights] == ["ambient"]
    assert scene.in_ambient_light().truth is scene.truth


def test_how_far_twist_moves_is_read_along_the_valley():
    """The lowest score of every row, not that of a column: 1, 1.005, 1, and 2 beyond."""
    scores = np.array([[2.0, 2.0, 2.0], [2.0, 1.0, 2.0], [2.0, 2.0, 1.005], [1.0, 2.0, 2.0], [2.0, 2.0, 2.0]])
    valley = Profile(np.arange(5.0), scores)
    steep = Profile(np.arange(5.0), scores + np.arange(5.0)[:, None])
    found = experiments._of_valleys([valley, steep])
    assert found == {"table1.valley_hard_twist_deg": 2.0, "table1.valley_capped_twist_deg": 1.0}


def test_circumstances_are_means_over_image_sets(scene):
    objectives = experiments._Objectives(scene)
    images = scene.draw(scene.tracked, scene.truth)
    at_truth = SimpleNamespace(states=scene.truth, evaluations_per_variable=7.0)
    tracked = {key: at_truth for key in experiments.TABLES["Table 1"]}
    tracked["best"] = SimpleNamespace(states=scene.truth, evaluations_per_variable=9.0)
    alike = replace(scene, measured=scene.tracked)
    found = experiments._circumstances(alike, objectives, images, tracked)
    assert (found["table1.evaluations_per_variable"], found["table1.best.evaluations_per_variable"]) == (7.0, 9.0)
    assert found["table1.stepping.score"] == found["table1.floor.score"] < 1.0  # drawn by the renderer that scores
    masks = [sum(np.any(image > 0, axis=2).sum() for image in images[i]) for i in range(2)]
    assert found["table1.mask_pixels"] == pytest.approx(np.mean(masks), rel=0.1)
    assert 0.0 <= found["table1.surface_distance_mean_mm"] <= found["table1.surface_distance_max_mm"] < 1.0


def test_fig_4_and_the_page_show_two_views(tmp_path, scene):
    targets = scene.draw(scene.tracked, scene.truth)
    table = [["variable", "rms"], ["tilt", "1.0"]]
    for name in ("bias", "cost", "valley"):
        cv2.imwrite(str(tmp_path / f"{name}.png"), targets[0][0])
    experiments._write_figures(tmp_path, scene, targets, scene.truth, {"Table 1": table}, "remarked")
    page = (tmp_path / "report.html").read_text()
    assert (tmp_path / "fig4.png").exists()
    order = [page.index(text) for text in ("What it is", "remarked", "Table 1", "tilt", "Fig. 4", "Floors")]
    assert order == sorted(order)


@pytest.mark.parametrize("trials", [0, -3])
def test_no_starts_are_refused(trials):
    with pytest.raises(FileFormatError, match="--trials"):
        reproduce._run_convergence(SimpleNamespace(trials=trials))


def test_profiles_reach_as_far_on_both_sides(scene):
    score = ColorObjective(scene.tracked, scene.rig, workers=Workers(1))
    images = scene.draw(scene.tracked, scene.truth)
    profiles = experiments._profiles(lambda i: score.set_images(images[i]), score, scene.truth, 3)
    assert [list(of) for of in profiles] == [list(VARIABLES)] * 2
    for of in profiles:
        for name, unit in zip(VARIABLES, UNITS, strict=True):
            reach = experiments.REACH_MM if unit == "mm" else experiments.REACH_DEG
            assert of[name].changes == pytest.approx([-reach, 0.0, reach])
            assert of[name].scores[1] < min(of[name].scores[0], of[name].scores[2])


def test_widths_are_of_the_worst_image_and_side():
    """Valleys with their lowest score at 0 and at 10, falling from -30 and -40, rising to 20 and 40."""
    changes = np.arange(-50.0, 51.0, 10.0)
    first = Profile(changes, np.array([3, 4, 9, 7, 5, 1, 5, 9, 4, 3, 2.0]))
    second = Profile(changes, np.array([2, 9, 8, 7, 6, 5, 1, 5, 7, 9, 2.0]))
    found = experiments._widths("c", [dict.fromkeys(VARIABLES, first), dict.fromkeys(VARIABLES, second)])
    assert found["c.tilt_minimum_off_deg"] == 10.0
    assert set(found) == {f"c.{n}_{what}_{u}" for n, u in zip(VARIABLES, UNITS, strict=True)
                          for what in ("basin_narrowest", "basin_median", "minimum_off")}  # fmt: skip
    single = experiments._widths("c", [dict.fromkeys(VARIABLES, first)])
    assert single["c.ap_minimum_off_mm"] == 0.0
    assert single["c.ap_basin_narrowest_mm"] < single["c.ap_basin_median_mm"]
    assert found["c.ap_basin_narrowest_mm"] == single["c.ap_basin_narrowest_mm"]


def test_rates_are_by_optimizer_and_size_of_error(scene):
    fits = {"stays": lambda start: SimpleNamespace(state=start, evaluations=1)}
    near, far = experiments._rates(lambda i: None, fits, scene.truth, [(1.0, 0.1), (500.0, 0.1)], 4, 5.0)["stays"]
    assert (near, far) == (1.0, 0.0)


def test_portraits_are_upright_and_look_at_the_body_s_middle():
    """Eight meters off, in front, half from the right and from the right; the middle of the body in the picture's middle."""
    rig = figures._portrait_rig(160)
    assert rig.names == ("front", "half-side", "side")
    root = np.sqrt(0.5)
    for camera, direction in zip(rig, ([1.0, 0.0], [root, -root], [0.0, -1.0]), strict=True):
        assert (camera.model.width, camera.model.height) == (80, 160)
        assert camera.center == pytest.approx([8.0 * direction[0], 8.0 * direction[1], -0.33])
        pixels, seen = camera.project(np.array([[0.0, 0.0, -0.33], [0.0, 0.0, 0.67]]))
        assert seen.all()
        assert pixels[0] == pytest.approx([39.5, 79.5])
        assert pixels[1] == pytest.approx([39.5, 79.5 - 3.7 * 160 / 8.0])
    assert rig.lights


def test_the_plan_shows_the_cross_s_rig_and_both_ways(tmp_path):
    rig, paths = figures._plan(None)
    assert len(rig) == 3
    assert list(paths) == ["side somersault", "twisting somersault"]
    for path in paths.values():
        assert path.shape[1] == 3
        assert np.linalg.norm(path - path[0], axis=1).max() > 0.2
