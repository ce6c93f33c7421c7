"""What the benchmark of the report makes its recording of, and how it reads a browser's times."""

import shutil

import numpy as np
import pytest

from benchmark import report as benchmark
from helpers.studio.browser import NAMES

needs_browser = pytest.mark.skipif(not any(map(shutil.which, NAMES)), reason="no browser: sudo apt-get install -y chromium")


def test_instants_go_there_and_back_without_a_jump():
    order = benchmark.forward_and_backward(5, 20)
    assert order[:10] == [0, 1, 2, 3, 4, 3, 2, 1, 0, 1] and len(order) == 20
    assert np.abs(np.diff(order)).max() == np.abs(np.diff(order)).min() == 1


@needs_browser
def test_times_of_a_page_are_those_of_the_browser(tmp_path):
    page = tmp_path / "page.html"
    script = "setTimeout(() => { document.documentElement.dataset.drawn = performance.now(); }, 300);"
    page.write_text(f"<!DOCTYPE html><title>t</title><script>{script}</script>")
    (load,) = benchmark.load_times(page, 1)
    assert 0.0 < load.event_s < load.drawn_s and load.drawn_s >= 0.3 and 0.0 < load.cpu_s < load.drawn_s


@needs_browser
def test_a_page_with_errors_is_not_timed(tmp_path):
    page = tmp_path / "page.html"
    page.write_text("<!DOCTYPE html><script>document.documentElement.dataset.drawn = 1; undefinedThing();</script>")
    with pytest.raises(RuntimeError, match="undefinedThing"):
        benchmark.load_times(page, 1)
