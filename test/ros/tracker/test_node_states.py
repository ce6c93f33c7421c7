"""The tracker's node before and after it is configured, and what it says while it waits for lenses."""

import time
from dataclasses import replace
from types import SimpleNamespace

import pytest

from helpers.ros.held_tracker import HeldTracker
from helpers.ros.samples import small_rig, some_state, tracked_arm
from tracker_node.ros.conversions import camera_info_message
from tracker_node.ros.diagnostics import ERROR, OK, WARN
from tracker_node.ros.tracker.image_inbox import InboxOptions
from tracker_node.ros.tracker.node import TrackerNode, TrackerOptions
from tracker_node.ros.tracker.setup import UNCALIBRATED

START = some_state(tracked_arm())


def without_backgrounds(rig):
    return replace(rig, cameras=tuple(replace(camera, background=None) for camera in rig))


@pytest.fixture
def make(ros, tmp_path):
    nodes = []

    def make(lossless=True, **changes):
        rig, inbox = without_backgrounds(small_rig(tmp_path)), InboxOptions(lossless=lossless)
        nodes.append(
            TrackerNode(TrackerOptions(rig, tracked_arm(), inbox=inbox, make_tracker=lambda *_: HeldTracker(), **changes))
        )
        return nodes[-1]

    yield make
    for node in nodes:
        node.close()
        node.destroy_node()


def said(node, part="calibration"):
    status = node._diagnostics._statuses[part]
    return status.level, status.message


def test_before_it_is_configured_there_is_nothing(make):
    node = make()
    assert node.skipped == 0 and node.counters() == {} and node.fatal is None and not node.has_subscribers({})
    assert node.autostart and not make(autostart=False).autostart
    assert said(node, "lifecycle") == (OK, "unconfigured")
    node._take_setup()  # of no worker


def test_once_it_is_configured_the_worker_is_asked(make):
    node = make(initial_state=START)
    assert node.configure() and node._worker._initial_states[""] is START and node._worker.lossless
    node._worker.counts.skipped = 3
    node._worker._thread.fatal = error = RuntimeError("gone")
    assert node.skipped == 3 and node.fatal is error and set(node.counters()) == {"cam1", "cam2", "cam3"}
    assert node.has_subscribers({}) and node.has_subscribers({"state": 0}) and not node.has_subscribers({"state": 1})
    node._worker._thread.fatal = None


def test_without_a_state_the_neutral_one_is_first(make):
    node = make(lossless=False)
    assert node.configure() and not node._worker.lossless
    assert (node._worker._initial_states[""].joint_positions == 0.0).all()


@pytest.fixture
def waiting(make, monkeypatch):
    """An active node that has heard of no lens, and a clock that is set by hand."""
    clock = SimpleNamespace(now_s=time.monotonic())
    monkeypatch.setattr("tracker_node.ros.tracker.node.time", SimpleNamespace(monotonic=lambda: clock.now_s))
    node = make(calibration_from_topics=True)
    assert node.start()
    return node, clock


def test_lenses_are_waited_for_half_a_minute_since_listening_began(waiting):
    node, clock = waiting
    clock.now_s += 30.0
    node._take_calibrations()
    assert said(node) == (OK, "waiting for camera_info of cam1, cam2, cam3")
    clock.now_s += 0.1
    node._take_calibrations()
    assert said(node)[0] == WARN
    node._worker.counts.idle[UNCALIBRATED]["cam2"] = 4
    node._take_calibrations()
    text = "waiting for camera_info of cam1, cam2, cam3; 4 images are lost meanwhile, for want of room"
    assert said(node) == (ERROR, text)


def test_tracking_begins_when_the_last_lens_is_known(waiting, tmp_path):
    node, _ = waiting
    rig = small_rig(tmp_path)
    infos = {name: camera_info_message(0, "f", rig[name].model) for name in rig.names}
    node._inbox.infos.update(cam1=infos["cam1"], cam3=infos["cam3"])
    node._take_calibrations()
    assert said(node) == (OK, "waiting for camera_info of cam2") and not node._builder.busy
    node._inbox.infos["cam2"] = infos["cam2"]
    node._take_calibrations()
    assert node._builder.busy
    node._builder.wait()
    node._use_new_setup()
    assert said(node) == (OK, "complete") and said(node, "parameters") == (OK, "in effect")
    node._inbox.infos.clear()
    node._take_calibrations()  # they are known
    assert said(node) == (OK, "complete") and not node._builder.busy


def test_lenses_are_not_looked_at_at_rest_nor_right_after_a_failure(waiting):
    node, clock = waiting
    clock.now_s += 60.0
    node._again_s = clock.now_s + 0.1
    node._take_calibrations()
    assert "calibration" not in node._diagnostics._statuses
    node._again_s = clock.now_s
    node.state = "inactive"
    node._take_calibrations()
    assert "calibration" not in node._diagnostics._statuses
    node.state = "active"
    node._take_calibrations()
    assert said(node)[0] == WARN


def test_lenses_of_the_rig_are_not_waited_for(make):
    node = make()
    assert node.start()
    node._take_calibrations()
    assert "calibration" not in node._diagnostics._statuses


def test_a_first_start_says_how_far_it_has_compiled(make, monkeypatch):
    node, clock, lines = make(), SimpleNamespace(now_s=100.0), []
    monkeypatch.setattr("tracker_node.ros.tracker.node.time", SimpleNamespace(monotonic=lambda: clock.now_s))
    monkeypatch.setattr(node, "get_logger", lambda: SimpleNamespace(info=lines.append))
    for done in range(1, 21):
        node._maker._progress(done, 20)
        clock.now_s += 1.0
    assert lines == [f"compiling, once: {done} of 20" for done in (1, 7, 13, 19, 20)]
