"""What is said of a camera: silent or not, what becomes of its images, and whether its calibration is the one in use."""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from helpers.ros.samples import small_rig
from tracker_node.camera.model import CameraModel
from tracker_node.ros.conversions import camera_info_message
from tracker_node.ros.diagnostics import ERROR, OK, STALE, WARN
from tracker_node.ros.tracker.camera_diagnostics import CameraDiagnostics, compared_lenses, lens_distance
from tracker_node.ros.tracker.image_inbox import ImageInbox, InboxOptions
from tracker_node.ros.tracker.setup import WorkerCounts
from tracker_node.tracking.estimate import CameraFault

NAMES = ("cam1", "cam2", "cam3")


class Bench:
    """Counts that a test sets, at times that it sets."""

    def __init__(self, folder, monkeypatch, lossless=False, from_topics=True):
        self.now_s, self.said, self.values, self.reports = 100.0, {}, {}, []
        monkeypatch.setattr("tracker_node.ros.tracker.camera_diagnostics.time", SimpleNamespace(monotonic=lambda: self.now_s))
        self.rig = small_rig(folder)
        self.inbox = ImageInbox(None, NAMES, InboxOptions(lossless=lossless, most_bytes=3 * 2**20), None)
        self.counters = {name: Counter() for name in NAMES}
        formation = SimpleNamespace(counters=self.counters)
        state = {"lossless": lossless, "busy": False, "paused": False, "rig": None}
        self.worker = SimpleNamespace(formation=formation, counts=WorkerCounts(), **state)
        self.told = CameraDiagnostics(SimpleNamespace(report=self._keep), self.rig, self.inbox, from_topics)

    def _keep(self, part, level, said, values=None, *, hardware_id=""):
        self.said[part] = level, said
        self.values = values if part == "cam1" else self.values
        self.reports.append((part, level, said, hardware_id))

    def came(self, *names, n=1):
        for name in names:
            self.inbox.arrived[name] += n
            self.inbox.last_arrival_s[name] = self.now_s

    def report(self, after_s=1.0, cameras=NAMES):
        self.now_s += after_s
        self.told.report(self.worker, cameras)
        return self.said["cam1"]


@pytest.fixture
def bench(tmp_path, monkeypatch):
    return Bench(tmp_path, monkeypatch)


def test_before_any_image_half_a_minute_is_waited(bench):
    assert bench.report(29.9) == (OK, "waiting for the first image")
    assert bench.report(0.1) == (STALE, "no camera sends images")
    bench.told.restart()
    assert bench.report(29.9) == (OK, "waiting for the first image")


def test_a_camera_that_stops_is_said_to_after_two_seconds(bench):
    bench.came(*NAMES)
    assert bench.report(1.5) == (OK, "receiving")
    bench.came("cam2", "cam3")
    assert bench.report(0.4) == (OK, "receiving")
    assert bench.report(0.1) == (ERROR, "has stopped sending images")
    bench.report(0.5)  # the others have been silent for a second too
    assert bench.said["cam1"] == (STALE, "no camera sends images") and bench.said["cam2"] == (OK, "receiving")


def test_a_camera_that_has_never_sent_is_said_to_once_others_have(bench):
    bench.report(20.0)
    bench.came("cam2")
    assert bench.report(0.0) == (OK, "waiting for the first image")
    bench.now_s += 1.9
    bench.came("cam2")
    assert bench.report(0.0) == (OK, "waiting for the first image")
    assert bench.report(0.1) == (ERROR, "has sent no image yet")


def test_sources_that_wait_for_us_have_ten_seconds(tmp_path, monkeypatch):
    bench = Bench(tmp_path, monkeypatch, lossless=True)
    bench.came("cam1")
    bench.report(0.0)
    assert bench.report(9.9) == (OK, "receiving")
    assert bench.said["cam2"] == (STALE, "no camera sends images")  # it never sent one: two seconds
    bench.worker.busy = True
    assert bench.report(0.1) == (OK, "waits for the tracker")


def test_images_that_cannot_be_used_come_first(bench):
    bench.came("cam1")
    bench.worker.counts.problems["cam1"] = "damaged"
    assert bench.report() == (ERROR, "damaged") and bench.said["cam2"][0] == OK


def test_a_camera_out_of_use_is_no_trouble(bench):
    bench.worker.counts.problems["cam1"] = "damaged"
    assert bench.report(60.0, cameras=("cam2",)) == (OK, "not in use") and bench.said["cam2"][0] == STALE


def test_images_per_second_are_those_since_the_last_report(bench):
    bench.came("cam1", n=60)
    bench.report(2.0)
    assert bench.values["images per second"] == pytest.approx(30.0)
    bench.came("cam1", n=10)
    bench.report(0.5)
    assert bench.values["images per second"] == pytest.approx(20.0)
    bench.report(0.5)
    assert bench.values["images per second"] == 0.0


def test_what_became_of_the_images_is_counted(bench):
    bench.counters["cam1"].update(used=7, late=1)
    bench.inbox.lost["cam1"], bench.inbox.overflowed["cam1"] = 2, 3
    bench.worker.counts.refused["cam1"] = 4
    bench.worker.counts.idle["paused"]["cam1"] = 5
    bench.report()
    expected = {"used": 7, "late": 1, "lost in transport": 2, "overflowed": 3, "refused": 4}
    idle = {"paused": 5, "inactive": 0, "uncalibrated": 0}
    assert bench.values == {"images per second": 0.0, **expected, **idle}


def test_more_than_half_of_the_images_in_no_set_is_trouble(bench):
    bench.came("cam1", n=10)
    bench.counters["cam1"].update(late=3, ahead=2)
    assert bench.report() == (OK, "receiving")
    bench.came("cam1", n=10)
    bench.counters["cam1"].update(late=4, ahead=2)
    assert bench.report() == (WARN, "most of its images are in no set (late 4, ahead 2)")
    bench.came("cam1", n=10)
    assert bench.report() == (OK, "receiving")  # only new ones count


@pytest.mark.parametrize("reason", ["late", "duplicate", "incomplete", "too_old", "ahead"])
def test_of_a_few_images_nothing_is_said(bench, reason):
    bench.came("cam1")
    bench.counters["cam1"][reason] = 2
    assert bench.report() == (OK, "receiving")
    bench.came("cam1")
    bench.counters["cam1"][reason] = 5
    assert bench.report() == (WARN, f"most of its images are in no set ({reason} 3)")


def test_images_on_their_way_that_are_lost_are_trouble_from_a_tenth_on(bench):
    bench.came("cam1", n=90)
    bench.inbox.lost["cam1"] = 10
    assert bench.report() == (OK, "receiving")
    bench.came("cam1", n=90)
    bench.inbox.lost["cam1"] += 11
    level, text = bench.report()
    assert level == WARN and text.startswith("images are lost (lost in transport 11): ") and "PROFILES_FILE" in text
    bench.came("cam1", n=100)
    bench.inbox.overflowed["cam1"] += 10  # these have arrived
    assert bench.report() == (OK, "receiving")
    bench.came("cam1", n=100)
    bench.inbox.overflowed["cam1"] += 11
    assert bench.report() == (WARN, "images are lost (overflowed 11)")


def test_where_none_may_be_lost_a_single_one_is_an_error(tmp_path, monkeypatch):
    bench = Bench(tmp_path, monkeypatch, lossless=True)
    bench.came("cam1", n=100)
    bench.inbox.overflowed["cam1"] = 1
    said = "images are lost though none may be: 3 MiB of images wait, the tracker is too slow for these cameras"
    assert bench.report() == (ERROR, said)
    bench.came("cam1", n=100)
    assert bench.report() == (OK, "receiving")


def test_a_contradicted_camera_is_said_to_be_until_it_agrees(bench):
    bench.told.contradicted([CameraFault("cam2", "delayed", 0.05, 0.002, 0)])
    part = "cam2 against the others"
    assert bench.reports == [(part, ERROR, "images of cam2 are 50 ms (+- 2) late", "cam2")]
    bench.worker.paused = True
    bench.report()
    assert bench.said[part] == (OK, "paused by request")
    bench.told.contradicted([])
    assert bench.said[part] == (OK, "agrees with them") and bench.reports[-1][3] == "cam2"
    n = len(bench.reports)
    bench.told.contradicted([])
    assert len(bench.reports) == n


def test_contradictions_are_not_paused_by_themselves(bench):
    bench.told.contradicted([CameraFault("cam2", "delayed", 0.05, 0.002, 0)])
    bench.report()
    assert bench.said["cam2 against the others"][0] == ERROR


@pytest.mark.parametrize("from_topics", [True, False])
def test_calibrations_are_compared_where_the_rig_file_s_are_used(tmp_path, monkeypatch, from_topics):
    bench = Bench(tmp_path, monkeypatch, from_topics=from_topics)
    bench.inbox.infos["cam2"] = camera_info_message(0, "f", bench.rig["cam2"].model)
    bench.report()
    assert ("calibration of cam2" in bench.said) is not from_topics and "calibration of cam1" not in bench.said
    bench.report(cameras=("cam1",))
    if not from_topics:
        assert bench.said["calibration of cam2"] == (OK, "not in use")


def lens(f=100.0, width=101, height=81):
    return CameraModel(width, height, np.array([[f, 0.0, 50.0], [0.0, f, 40.0], [0.0, 0.0, 1.0]]))


def info_of(model):
    return camera_info_message(0, "f", model)


def test_lenses_are_as_far_apart_as_at_their_farthest_pixel():
    corner_px = np.hypot(50.0, 40.0)
    assert lens_distance(lens(), lens(110.0)) == pytest.approx(0.1 * corner_px)
    assert lens_distance(lens(), lens()) == pytest.approx(0.0, abs=1e-9)


def test_a_calibration_is_compared_with_that_of_the_rig_file():
    assert compared_lenses("a", info_of(lens()), lens()) == (OK, "calibrated: camera_info and the rig file agree")
    near, far = 100.0 * (1 + 0.99 / np.hypot(50, 40)), 100.0 * (1 + 1.06 / np.hypot(50, 40))
    assert compared_lenses("a", info_of(lens(near)), lens())[0] == OK
    said = "camera_info and the rig file are up to 1.1 px apart; the rig file's is used"
    assert compared_lenses("a", info_of(lens(far)), lens()) == (WARN, said)


@pytest.mark.parametrize(("width", "height"), [(102, 81), (101, 82)])
def test_calibrations_of_other_images_are_said_to_be(width, height):
    said = f"camera_info speaks of images of {width}x{height}, the rig file of 101x81; --calibration camera_info takes the former"
    other = info_of(lens(width=width, height=height))
    assert compared_lenses("a", other, lens()) == (WARN, said)


def test_a_camera_without_a_calibration_is_no_trouble():
    info = info_of(lens())
    info.k[0] = 0.0
    assert compared_lenses("a", info, lens()) == (OK, "that of the rig file (camera_info: uncalibrated)")


def test_a_calibration_that_cannot_be_read_is_said_to_be():
    info = info_of(lens())
    info.distortion_model = "odd"
    level, said = compared_lenses("a", info, lens())
    assert level == WARN and said.startswith("that of the rig file; ") and "odd" in said


def test_a_camera_info_that_changes_while_its_first_one_is_used_is_said_to(bench):
    bench.worker.rig, model = bench.rig, bench.rig["cam1"].model

    def said(info):
        bench.inbox.infos["cam1"] = info
        bench.report()
        return bench.said["calibration of cam1"]

    assert said(info_of(model)) == (OK, "calibrated: camera_info and its first message agree")
    other = info_of(model)
    other.k[0] *= 2.0
    level, text = said(other)
    assert level == WARN and "px from its first message, which is used" in text and text.endswith("cleaned up and configured")
    other.k[0] = 0.0
    assert said(other) == (WARN, "that of its first message (camera_info: uncalibrated)")
    other.k[0] = float("nan")
    assert said(other)[0] == WARN
    level, text = said(info_of(CameraModel(10, 10, model.K)))
    assert level == WARN and "images of 10x10, its first message of" in text
    assert said(info_of(model))[0] == OK
