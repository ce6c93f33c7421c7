"""The accuracy benchmark's machinery, on a recording of three image sets."""


import numpy as np
import pytest

from benchmark.contour import accuracy as benchmark
from tracker_node.synthesis.recording import Request, produce
from tracker_node.synthesis.scenes.scene import SceneConfig
from tracker_node.tracking.config import from_dict


def test_a_recording_is_tracked_and_judged(tmp_path):
    scene = SceneConfig(n_cameras=3, width=320, height=240, focal_px=290.0)
    produce(Request(subject="model", motion="waves", n_images=3, scene=scene), tmp_path)
    config = from_dict({"modalities": ["chamfer"]})  # limbs are a few pixels wide here
    result = benchmark.track(tmp_path, "cones", config)
    figures = benchmark._cone_figures(result) | benchmark._sliding_figures(tmp_path, config)
    assert figures["cones.sets"] == 3 and figures["cones.lost_sets"] == 0
    assert 0.0 < figures["cones.joint_error_mm"] < 50.0
    assert figures["cones.joint_error_mm"] == pytest.approx(result.raw.errors_m.mean() * 1e3)
    assert figures["sliding.iterations_with"] >= figures["cones.iterations"]
    assert figures["sliding.error_with_mm"] == pytest.approx(figures["sliding.error_without_mm"], abs=3.0)
    mannequin = benchmark._mannequin_figures(result)
    assert mannequin["cones.lost_limbs"] == 0 and np.isfinite(list(mannequin.values())).all()
    # An offset that is constant in a segment explains at least as much as none.
    assert mannequin["cones.mpjpe_mm"] <= mannequin["cones.mpjpe_raw_mm"]


def test_without_the_clips_it_says_what_is_not_measured(capsys):
    jobs = benchmark._jobs("full", None)
    assert [job.name for job in jobs] == ["cones", "mannequin_scaled_swing"]
    message = capsys.readouterr().err
    lacking = ", ".join(f"mannequin_scaled_{clip}" for clip in ("walk", "cartwheel", "spinkick"))
    assert f"NOT MEASURED: {lacking}" in message and "--motions" in message


def test_with_the_clips_all_targets_are_measured():
    names = [job.name for job in benchmark._jobs("quick", "clips")]
    assert names == ["cones", "mannequin_scaled_walk", "mannequin_scaled_spinkick"]
