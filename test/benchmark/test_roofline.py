"""Kernels under their roofs: what is caught of a run, what is counted, and the page."""

import numpy as np
import pytest

from benchmark import roofline
from benchmark.color._scene import make_scene
from benchmark.color.score import MASK_PIXELS, Drawing, zoomed
from tracker_node.observation import appearance


def test_arguments_of_a_kernel_are_kept_and_the_kernel_comes_back():
    kernel = appearance.spread_counts
    with pytest.raises(RuntimeError), roofline.captured("observation.appearance", "spread_counts") as calls:
        assert appearance.spread_counts is not kernel
        raise RuntimeError
    assert appearance.spread_counts is kernel and calls == []


def test_roofs_are_in_an_order_that_a_machine_can_have():
    operations, in_cache, in_memory = roofline.roofs(0.02)
    assert operations > 1e9 and in_memory > 1e8 and in_cache > 0.5 * in_memory


def test_a_drawing_visits_at_least_what_it_covers():
    scene = make_scene(1)
    drawing = Drawing(scene.model, zoomed(scene, MASK_PIXELS))
    drawing.draw(scene.truth[0])
    assert drawing.pixels == pytest.approx(MASK_PIXELS, rel=0.02)
    assert drawing.pixels < drawing.visited < 10 * drawing.pixels and drawing.visited % 16 == 0


def test_the_page_and_the_picture_show_every_kernel(tmp_path):
    metrics = {f"roofline.{key}": 100.0 for key in ("reference_ms", "peak_gflops", "cache_gbs", "memory_gbs")}
    keys = ("ms", "in_references", "operations", "bytes", "gflops", "share", "of_memory")
    metrics |= {f"roofline.{name}.{key}": 0.25 for name in roofline.MEANINGS for key in keys}
    text = roofline.page(metrics)
    assert text.startswith("<!-- Generated")
    assert all(f"| `{name}`: " in text for name in roofline.MEANINGS) and text.count("| 25% |") >= len(roofline.MEANINGS)
    roofline.draw_picture(metrics, tmp_path / "picture.png")
    assert (tmp_path / "picture.png").read_bytes().startswith(b"\x89PNG")
    assert set(roofline.LIMITS) == set(roofline.MEANINGS) and set(roofline.OPERATIONS) == set(roofline.BYTES)
    assert set(roofline.OPERATIONS) == set(roofline.MEANINGS) - {"reference"} and np.isfinite(list(metrics.values())).all()
