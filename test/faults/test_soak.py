"""Two minutes of the soak: every image is accounted for, everything that was said is recorded, memory stays flat."""

import os
import signal
from collections import Counter

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS is not installed")

from benchmark.contour._runs import Clip
from benchmark.ros import soak
from benchmark.ros.transport import wait_until
from helpers.ros.samples import write_recording
from tracker_node.errors import TrackerError
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.tracking.config import TrackerConfig

SECONDS, RATE_HZ, N_CAMERAS = 120.0, 10.0, 6


def the_arm(folder):
    write_recording(folder, 12, N_CAMERAS)
    model = load_model(folder / "model.yaml")
    return Clip(folder, load_rig(folder / "rig.yaml"), model, load_state(folder / "state.yaml", model))


def test_an_interrupt_ends_it(tmp_path, monkeypatch):
    def interrupted(*arguments):
        os.kill(os.getpid(), signal.SIGINT)
        return wait_until(*arguments)

    monkeypatch.setattr(soak, "wait_until", interrupted)
    plan = soak.Plan(the_arm(tmp_path / "arm"), TrackerConfig(), "model.yaml", 3600.0, RATE_HZ)
    with pytest.raises(TrackerError, match=r"too short: stopped after \d+ s"):
        soak.measure(plan)


@pytest.mark.long
def test_two_minutes(tmp_path):
    said: list[str] = []
    figures = soak.measure(soak.Plan(the_arm(tmp_path / "arm"), TrackerConfig(), "model.yaml", SECONDS, RATE_HZ), said.append)
    assert figures["soak.cameras"] == N_CAMERAS
    assert figures["soak.images"] > 0
    assert figures["soak.unaccounted_images"] == 0, said
    assert figures["soak.unaccounted_sets"] == 0
    assert figures["soak.recorder_lost"] == 0
    n_sent, n_formed = figures["soak.images"] / N_CAMERAS, figures["soak.tracked"] + figures["soak.skipped"]
    assert n_formed <= figures["soak.images_used"] <= N_CAMERAS * n_formed
    accounted = figures["soak.images_used"] + figures["soak.images_left_out"] + figures["soak.lost_in_transport"]
    assert 0 <= figures["soak.images"] - accounted <= N_CAMERAS  # the last set may go down with the ingest
    assert figures["soak.tracked"] > 0.5 * n_sent, said
    assert figures["soak.sets"] > 0.5 * n_sent, said
    assert 0 <= figures["soak.lost"] <= n_sent - figures["soak.tracked"] + 1, said  # whatever was tracked has been heard of
    assert figures["soak.memory_growth_percent"] <= 5.0, said
    assert any(" min: " in line for line in said)


def test_a_leak_is_seen_and_a_spike_is_not():
    times = np.arange(0.0, 100.0, 1.0)
    flat = [(t, 200.0 + (50.0 if t == 70.0 else 0.0)) for t in times]
    leaking = [(t, 200.0 + 0.2 * t) for t in times]
    assert soak.growth_percent(flat, 10.0) == pytest.approx(0.0)
    assert soak.growth_percent(leaking, 10.0) == pytest.approx(100.0 * 0.2 * 89.0 / 202.0)


def test_files_are_counted_before_they_are_deleted(tmp_path, monkeypatch):
    for i in (0, 1, 2, 10):
        (tmp_path / f"bag_{i}.mcap").write_text(str(i + 1))
    monkeypatch.setattr(soak, "_message_counts", lambda file: Counter({"/a": int(file.read_text())}))
    files = soak.Files(tmp_path)
    files.sweep(2)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["bag_10.mcap", "bag_2.mcap"]
    assert files.counts() == {"/a": 1 + 2 + 3 + 11}


@pytest.mark.parametrize(("states", "lost"), [((1, 2, 3), 2), ((1, 2), 0)])
def test_images_that_go_down_with_their_process_are_the_last(states, lost):
    """An image of each camera has not arrived: the last, which no state has, or another."""
    heard = soak.Heard([1, 2, 3], {stamp: stamp + 10 for stamp in states})
    heard.memory["tracker"] = [(float(t), 100.0) for t in range(5)]
    heard.accounts = {
        "tracker: status": {"image sets tracked": "2", "image sets skipped": "0"},
        "tracker: image sets": {"complete": "2", "of fewer cameras": "0", "not formed, late": "0"},
        **{
            f"tracker: {camera}": {"images per second": "9.9", "received": "2", **dict.fromkeys(soak.FATES, "0"), "used": "2"}
            for camera in "ab"
        },
    }
    figures = soak.figures(heard, Counter({"/tracker/state": 2}), {"a": 3, "b": 3}, (1, 3), 0.0, 90.0)
    assert figures["soak.minutes"] == 1.5
    assert (figures["soak.tracked"], figures["soak.images_used"], figures["soak.images_left_out"]) == (2, 4, 0)
    assert figures["soak.lost_in_transport"] == lost
    assert figures["soak.unaccounted_images"] == 0
    assert figures["soak.lost"] == 0
    assert figures["soak.recorder_lost"] == 0
    assert figures["soak.memory_growth_percent"] == 0.0
    assert soak.all_sound(figures)
    assert not soak.all_sound({**figures, "soak.lost": 1})


def test_a_run_that_was_stopped_early_is_too_short():
    heard = soak.Heard([1, 2, 3], {1: 2})
    with pytest.raises(TrackerError, match="too short: stopped after 4 s"):
        soak.figures(heard, Counter(), {"a": 3}, (10, 5), 0.0, 4.0)
    with pytest.raises(TrackerError, match="too short"):
        soak.growth_percent([(1.0, 100.0), (2.0, 100.0)], 1.5)
