"""The color benchmarks run, and count and measure what they say; on small images, drawn by the renderer that scores."""

import json

import numpy as np
import pytest

from benchmark.color import _fits as _color_fits
from benchmark.color import _scene as _color_scene
from benchmark.color import basin as color_basin
from benchmark.color import step as color_step


@pytest.fixture(scope="module")
def scene():
    return _color_scene.make_scene(2, width=384, backend="raycaster")


def test_starts_are_exactly_so_far_off(scene):
    tools, rng = _color_scene, np.random.default_rng(0)
    starts = [tools.displaced(scene.truth[1], 0.2, np.radians(20.0), rng) for _ in range(20)]
    for start in starts:
        assert tools.root_error(start, scene.truth[1]) == pytest.approx((200.0, 20.0))
    assert len({start.T_world_root.tobytes() for start in starts}) == 20


class Knows:
    """Goes to the true state of the first image, whatever the start."""

    def __init__(self, scene):
        self.state, self.evaluations, self.seen = scene.truth[0], 1, []

    def __call__(self, images, start):
        self.seen.append(images)
        return self


def test_arrivals_are_counted(scene):
    knows = Knows(scene)
    assert color_basin.arrival_rate(scene, knows, 200, 20, 8) == 0.5
    assert [images is scene.images[i % 2] for i, images in enumerate(knows.seen)] == [True] * 8


@pytest.mark.long
def test_every_optimizer_has_its_figures(scene):
    metrics = color_step.measure(scene, 2)
    for name in ("stepping", "stepping_published", "simplex", "alignment", "default"):
        assert 0.0 < metrics[f"step.{name}_ms"] <= metrics[f"step.{name}_ms_p95"]
        assert metrics[f"step.{name}_error_mm_p50"] < 20.0
    assert 90 < metrics["step.stepping_evaluations"] < 180
    assert metrics["step.default_error_mm_p90"] < 5.0


@pytest.mark.long
def test_the_default_arrives_from_200_mm_and_20_degrees(scene):
    default = _color_fits.contestants(scene)["default"]
    assert color_basin.arrival_rate(scene, default, 200, 20, 6) == 1.0


def test_writes_json(scene, tmp_path, monkeypatch):
    basin = color_basin
    monkeypatch.setattr(basin, "make_scene", lambda *_, **__: scene)
    monkeypatch.setattr(basin, "measure", lambda prefix, *_: {f"{prefix}.x": 1.0})
    assert basin.main(["--quick", "--json", str(tmp_path / "basin.json")]) == 0
    metrics = json.loads((tmp_path / "basin.json").read_text())["metrics"]
    assert metrics == {"basin.trials": 4, "basin.x": 1.0, "basin.cluttered.x": 1.0, "basin.same_renderer.x": 1.0}
