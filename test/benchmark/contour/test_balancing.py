"""What the benchmark of the Balancing clip is made of; the clip itself takes minutes."""

import numpy as np
import pytest

from benchmark.contour import balancing as benchmark
from tracker_node.errors import FileFormatError, TrackerError
from tracker_node.evaluation.evaluate import ErrorSeries
from tracker_node.model.configuration import State
from tracker_node.model.humans.human import human_model
from tracker_node.observation.image_set import CameraImage, ImageSet


def test_disturbed_starts_are_off_in_every_degree_of_freedom():
    model = human_model()
    rng, start = np.random.default_rng(1), State.neutral(model)
    off = [benchmark.disturbed(start, rng).difference(start) for _ in range(20)]
    for tangent in off:
        assert np.linalg.norm(tangent[:3]) == pytest.approx(0.020)
        assert np.degrees(np.linalg.norm(tangent[3:6])) == pytest.approx(6.0)
        assert np.allclose(np.abs(np.degrees(tangent[6:])), 6.0)
    assert np.abs(np.mean(off, axis=0)).max() < np.radians(6.0)  # not always the same way


def test_parameters_on_the_command_line_win_over_the_file():
    changes = ["modalities=region,chamfer", "threads=1", "chamfer.sliding=false", "region.max_log_ratio=1e0"]
    config = benchmark.configured(benchmark.CONFIG, changes)
    assert config.modalities == ("region", "chamfer") and config.threads == 1
    assert not config.chamfer.sliding and config.region.max_log_ratio == 1.0
    assert config.synchronizer.image_period_s == pytest.approx(1 / 60, rel=1e-3)  # of the file
    with pytest.raises(TrackerError, match="KEY=VALUE"):
        benchmark.configured(benchmark.CONFIG, ["modalities"])
    with pytest.raises(FileFormatError, match="some of"):
        benchmark.configured(benchmark.CONFIG, ["modalities=magic"])


def test_time_is_turned_round_about_an_instant():
    image = CameraImage("cam01", 130, np.zeros((2, 2, 3), np.uint8))
    (mirrored,) = benchmark._mirrored(ImageSet(120, (image,)), 200)
    assert mirrored.stamp_ns == 270 and mirrored.pixels is image.pixels


def test_joints_without_truth_say_nothing_and_others_must_be_near_it():
    from_undisturbed, off = np.full((25, 3), 0.01), np.full((25, 3), 0.05)
    known = np.ones((25, 3), dtype=bool)
    assert benchmark.arrived(from_undisturbed, ErrorSeries(off, known))
    off[-1, 1], off[0, 0] = 0.3, 0.3  # sets before the last ones do not count
    assert not benchmark.arrived(from_undisturbed, ErrorSeries(off, known))
    known[-1, 1] = False
    assert benchmark.arrived(from_undisturbed, ErrorSeries(off, known))
    from_undisturbed[-3, 2] = 0.07
    assert not benchmark.arrived(from_undisturbed, ErrorSeries(off, known))
    with pytest.raises(TrackerError, match="truth"):
        benchmark.arrived(from_undisturbed, ErrorSeries(off, ~np.ones((25, 3), dtype=bool)))
