"""The sets of a recorded run made again from its images: which, in which order, and what is told of those that are gone."""

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from helpers.sources.bag_samples import PERIOD_NS, START_NS, header, image, tracked_state
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import SourceError
from tracker_node.geometry import se3
from tracker_node.loaders.bag.message_types import typestore
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.bag.writer import BagWriter
from tracker_node.loaders.images.source import SourceOptions
from tracker_node.model.configuration import State
from tracker_node.runs.recorded_sets import RecordedRunStream, RecordedSet, recorded_set
from tracker_node.tracking.estimate import Status

NAMES = ("cam01", "cam02")


def small_rig(sources=("", "")) -> CameraRig:
    cameras = circle_rig(2).cameras
    return CameraRig(
        tuple(
            replace(camera, model=replace(camera.model, width=8, height=6), source=source)
            for camera, source in zip(cameras, sources, strict=True)
        )
    )


def state(stamp_ns: int, *stamps: int):
    return replace(tracked_state(stamp_ns), cameras=list(NAMES), camera_stamps=[header(ns).stamp for ns in stamps])


def pixels(level: int) -> np.ndarray:
    return np.full((6, 8, 3), level, dtype=np.uint8)


def bag(path, states, images=()):
    """``states``: stamp, then that of each camera; ``images``: camera, stamp and level, in the order of the bag."""
    with BagWriter(path) as writer:
        for k, (camera, stamp_ns, level) in enumerate(images):
            writer.write_message(f"/{camera}/image_raw", START_NS + k, image(stamp_ns, pixels(level)))
        for k, stamps in enumerate(states):
            writer.write_message("/tracker/state", START_NS + k, state(*stamps))
    return path


def made_again(path):
    with BagReader(path) as reader:
        stream = RecordedRunStream(small_rig(), reader)
        sets = [(s.stamp_ns, {i.camera: int(i.pixels[0, 0, 0]) for i in s.images}) for s in stream]
    return stream, sets


def at(k: int) -> int:
    return START_NS + k * PERIOD_NS


def estimate(stamp_ns: int, off_m: float = 0.0, status: Status = Status.TRACKING):
    place = tracked_state(stamp_ns).root_pose.position
    T = se3.from_rotation_translation(np.eye(3), np.array([place.x + off_m, place.y, place.z]))
    return SimpleNamespace(stamp_ns=stamp_ns, status=status, state=State(T, np.empty(0)))


def test_states_that_differ_from_the_recorded_ones_are_told(tmp_path):
    """As after a tracker was restarted: a bag does not say so."""
    path = bag(tmp_path / "bag", [(at(k), at(k), 0) for k in range(4)], [("cam01", at(k), 10) for k in range(4)])
    with BagReader(path) as reader:
        stream = RecordedRunStream(small_rig(), reader)
        stream.compare(estimate(at(0), 0.0005))
        stream.compare(estimate(at(1), 3.0, Status.INITIALIZING))
        assert stream.difference == ""
        stream.compare(estimate(at(2), 0.02))
        stream.compare(estimate(at(3), 0.01))
    after_s = 2e-9 * PERIOD_NS
    assert stream.difference.startswith(f"states differ from the recorded ones from {after_s:.2f} s on, by up to 20 mm: was the")


def test_sets_come_in_the_order_of_the_states_with_their_own_images(tmp_path):
    images = [
        ("cam02", at(0) + 3, 20),
        ("cam01", at(1), 11),
        ("cam01", at(0), 10),
        ("cam02", at(1) + 3, 21),
        ("cam01", at(2), 12),
    ]
    stream, sets = made_again(bag(tmp_path / "bag", [(at(k), at(k), at(k) + 3) for k in range(2)], images))
    assert sets == [(at(0), {"cam01": 10, "cam02": 20}), (at(1), {"cam01": 11, "cam02": 21})]
    assert stream.n_expected == 2
    assert stream.incomplete_sets == 0
    assert stream.errors == []
    assert stream.counters == {"cam01": {"received": 3, "used": 2}, "cam02": {"received": 2, "used": 2}}
    assert stream.source_options is None


def test_a_camera_without_an_image_is_left_out_of_its_set(tmp_path):
    _, sets = made_again(bag(tmp_path / "bag", [(at(0), at(0), 0)], [("cam01", at(0), 10)]))
    assert sets == [(at(0), {"cam01": 10})]


def test_a_set_whose_image_is_gone_is_told_once_and_left_out(tmp_path):
    images = [("cam01", at(k), 10 + k) for k in range(3)] + [("cam02", at(1), 21)]
    stream, sets = made_again(bag(tmp_path / "bag", [(at(k), at(k), at(k)) for k in range(3)], images))
    assert sets == [(at(1), {"cam01": 11, "cam02": 21})]
    assert stream.incomplete_sets == 2
    (error,) = stream.errors
    assert f"the set at {at(0)} ns" in error
    assert f"images are missing: cam02 at {at(0)} ns;" in error
    assert stream.counters == {"cam01": {"received": 3, "used": 1}, "cam02": {"received": 1, "used": 1}}


def test_a_set_that_names_no_image_is_told(tmp_path):
    stream, sets = made_again(bag(tmp_path / "bag", [(at(0), 0, 0)], [("cam01", at(0), 10)]))
    assert sets == []
    assert stream.incomplete_sets == 1
    assert "it names no image" in stream.errors[0]


def test_an_image_of_two_sets_is_given_to_both(tmp_path):
    """The second camera has half the rate: its images come again before they are needed again."""
    images = [("cam01", at(0), 10), ("cam02", at(0), 20), ("cam01", at(1), 11), ("cam02", at(0), 20)]
    stream, sets = made_again(bag(tmp_path / "bag", [(at(0), at(0), at(0)), (at(1), at(1), at(0))], images))
    assert sets == [(at(0), {"cam01": 10, "cam02": 20}), (at(1), {"cam01": 11, "cam02": 20})]
    assert stream.counters["cam02"] == {"received": 2, "used": 2}


@pytest.mark.parametrize(("ahead", "given"), [(2, []), (3, [0])])
def test_no_more_than_so_many_sets_wait_for_an_image(tmp_path, monkeypatch, ahead, given):
    """Two images of a set: more than ``ahead`` times two that are there, and the first set is given up.

    The image of camera 2 for set 0 comes after six others.
    """
    monkeypatch.setattr(RecordedRunStream, "AHEAD", ahead)
    late = [("cam02", at(0), 20)]
    images = [(c, at(k), 1) for k in (1, 2) for c in NAMES] + [("cam01", at(0), 10), ("cam01", at(3), 1)] + late
    stream, sets = made_again(bag(tmp_path / "bag", [(at(k), at(k), at(k)) for k in (0, 1, 2)], images))
    expected = [at(k) for k in (*given, 1, 2)]
    assert [stamp for stamp, _ in sets] == expected
    assert stream.incomplete_sets == 3 - len(expected)


def test_images_of_another_size_are_told_once_and_not_used(tmp_path):
    path = tmp_path / "bag"
    with BagWriter(path) as writer:
        for k in range(2):
            writer.write_message("/cam01/image_raw", START_NS + k, image(at(k), pixels(1)))
            writer.write_message("/cam02/image_raw", START_NS + k, image(at(k), np.zeros((5, 8, 3), np.uint8)))
            writer.write_message("/tracker/state", START_NS + k, state(at(k), at(k), at(k)))
    stream, sets = made_again(path)
    assert sets == []
    assert len(stream.errors) == 2
    assert "expected 8x6, got 8x5" in stream.errors[0]
    assert stream.counters["cam02"] == {"received": 0, "used": 0}


@pytest.mark.parametrize(
    ("stamp_ns", "stamps", "kept"),
    [(5, (5, 0), (("cam01", 5),)), (0, (0, 0), (("cam01", 0), ("cam02", 0))), (1, (0, 0), ())],
)
def test_stamp_0_says_no_image_but_in_a_set_at_0(stamp_ns, stamps, kept):
    assert recorded_set(state(stamp_ns, *stamps)) == RecordedSet(stamp_ns, kept, root=(1.0, 2.0, 3.0))


def test_a_set_before_0_has_images_at_0():
    message = SimpleNamespace(
        header=SimpleNamespace(stamp=SimpleNamespace(sec=-1, nanosec=5 * 10**8)), cameras=["cam01"],
        camera_stamps=[SimpleNamespace(sec=0, nanosec=0)], status=Status.INITIALIZING, root_pose=tracked_state(0).root_pose,
    )  # fmt: skip
    assert recorded_set(message) == RecordedSet(-(5 * 10**8), (("cam01", 0),))


@pytest.fixture
def folders(tmp_path):
    """A rig with a folder of four images for each camera."""
    sources = []
    for c, name in enumerate(NAMES):
        (tmp_path / name).mkdir()
        for k in range(4):
            cv2.imwrite(str(tmp_path / name / f"{k:03d}.png"), pixels(10 * (c + 1) + k))
        sources.append(str(tmp_path / name))
    return small_rig(sources)


def from_files(rig, path, options):
    with BagReader(path) as reader:
        stream = RecordedRunStream(rig, reader, options)
        sets = [(s.stamp_ns, {i.camera: int(i.pixels[0, 0, 0]) for i in s.images}) for s in stream]
    return stream, sets


def test_images_of_the_rig_s_files_are_found_by_their_stamps(folders, tmp_path):
    options = SourceOptions(base_stamp_ns=START_NS, rate_hz=50.0)
    states = [(START_NS + k * 20_000_000,) * 3 for k in (1, 3)]
    stream, sets = from_files(folders, bag(tmp_path / "bag", states), options)
    assert sets == [(states[0][0], {"cam01": 11, "cam02": 21}), (states[1][0], {"cam01": 13, "cam02": 23})]
    assert stream.source_options == options


def test_stamps_that_the_files_do_not_have_are_refused(folders, tmp_path):
    options = SourceOptions(base_stamp_ns=START_NS, rate_hz=50.0)
    with pytest.raises(SourceError, match="not those of the rig's sources"):
        from_files(folders, bag(tmp_path / "bag", [(START_NS + 80_000_000,) * 3]), options)  # the fifth of four
    with pytest.raises(SourceError, match="not those of the rig's sources"):
        from_files(folders, bag(tmp_path / "later", [(START_NS + 20_000_001,) * 3]), options)


def test_at_stamp_0_only_cameras_with_such_an_image_had_one(folders, tmp_path):
    """From image 1 on there is no image at 0; the run's set at 0 had none."""
    states = [(0, 0, 0), (20_000_000,) * 3]
    stream, sets = from_files(folders, bag(tmp_path / "bag", states), SourceOptions(rate_hz=50.0, start=1))
    assert sets == [(20_000_000, {"cam01": 11, "cam02": 21})]
    assert stream.incomplete_sets == 1
    _, sets = from_files(folders, tmp_path / "bag", SourceOptions(rate_hz=50.0))
    assert [stamp for stamp, _ in sets] == [0, 20_000_000]


def info(stamp_ns: int):
    types = typestore().types
    region = types["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    return types["sensor_msgs/msg/CameraInfo"](
        header=header(stamp_ns), height=6, width=8, distortion_model="plumb_bob", d=np.zeros(5), k=np.eye(3).ravel(),
        r=np.eye(3).ravel(), p=np.eye(3, 4).ravel(), binning_x=0, binning_y=0, roi=region,
    )  # fmt: skip


@pytest.mark.parametrize("start", [0, 2])
def test_the_stamp_of_image_0_is_told_by_the_run_s_first_camera_info(folders, tmp_path, start):
    """That is of the run's first image, ``start`` periods after image 0."""
    first = START_NS + start * 20_000_000
    with BagWriter(tmp_path / "bag") as writer:
        writer.write_message("/other/camera_info", START_NS, info(START_NS + 7))
        writer.write_message("/tracker/cam02/camera_info", START_NS, info(first))
        writer.write_message("/tracker/state", START_NS, state(first, first, first))
    stream, sets = from_files(folders, tmp_path / "bag", SourceOptions(base_stamp_ns=5, rate_hz=50.0, start=start))
    assert sets == [(first, {"cam01": 10 + start, "cam02": 20 + start})]
    assert stream.source_options.base_stamp_ns == START_NS
