"""The images of a finished run, by what its run.json says."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from helpers.sources.bag_samples import START_NS, image, tracked_state, write_bag
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import FileFormatError
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.bag.writer import BagWriter
from tracker_node.loaders.images.source import SourceOptions
from tracker_node.runs.images import (
    config_of_run,
    image_bag_of,
    image_bags_of,
    options_of,
    rig_from_bag,
    rig_of_run,
    run_stream,
    source_options_of,
)
from tracker_node.tracking.config import TrackerConfig, flatten

RIG = circle_rig(3)


def info(**options):
    return {"options": options}


@pytest.mark.parametrize("unknown", [{}, {"options": None}, {"options": [1]}])
def test_a_run_that_tells_nothing_was_asked_for_nothing(unknown):
    assert options_of(unknown) == {}
    assert source_options_of(unknown) == SourceOptions()
    assert rig_of_run(RIG, unknown).names == RIG.names


def test_the_part_of_the_sources_that_a_run_took():
    taken = source_options_of(info(start=3, end=9, shrink=2, base_stamp_ns=7, rate=25.0, resize=[320, 240]))
    assert (taken.start, taken.end, taken.shrink, taken.base_stamp_ns) == (3, 9, 2, 7)
    assert (taken.rate_hz, taken.size) == (25.0, (320, 240))
    assert source_options_of(info(start=None, rate=None)) == SourceOptions()


@pytest.mark.parametrize("options", [{"start": "x"}, {"resize": 3}, {"start": 5, "end": 2}, {"rate": -1.0}])
def test_options_of_another_kind_are_refused(options):
    with pytest.raises(FileFormatError) as told:
        source_options_of(info(**options), "out/run")
    assert told.value.file.endswith("run.json")
    assert told.value.field == "options"


def test_cameras_of_a_run_are_in_the_order_of_the_rig():
    assert rig_of_run(RIG, info(cameras=["cam03", "cam01"])).names == ("cam01", "cam03")
    assert rig_of_run(RIG, info(cameras=["another"])).names == RIG.names
    assert rig_of_run(RIG, info(cameras=[])).names == RIG.names


def test_sources_and_settings_of_the_command_line():
    run = info(source=[["cam02", "b.mp4"]], capture=["publish=mono", "cam03.publish=native"])
    rig = rig_of_run(RIG, run)
    assert [camera.source for camera in rig] == [None, "b.mp4", None]
    assert [camera.capture.publish for camera in rig] == ["mono", "mono", "native"]
    own = rig_of_run(RIG, run, other_file=True)
    assert [camera.source for camera in own] == [None] * 3
    assert [camera.capture.publish for camera in own] == ["color"] * 3


def test_a_run_without_a_bag_took_its_images_from_sources(tmp_path):
    assert image_bag_of(None, {}, RIG.names) is None
    assert image_bag_of(None, info(bag=str(tmp_path / "gone")), RIG.names) is None


def test_parameters_that_are_not_known_any_more_are_left_out():
    name, value = "motion.frames", 3
    known = flatten(TrackerConfig())
    assert name not in known
    some = next(key for key, default in known.items() if isinstance(default, bool))
    config = config_of_run({"parameters": {name: value, some: not known[some]}})
    assert flatten(config)[some] is not known[some]
    for nothing in ({}, {"parameters": None}, {"parameters": []}):
        assert config_of_run(nothing) == TrackerConfig()


def small_rig(source=None):
    """One camera with the 64 x 48 images of the sample bags."""
    camera = circle_rig(1).cameras[0]
    return CameraRig((replace(camera, model=camera.model.resized(64, 48), source=source, gain=2.0),))


def states_alone(path, n=3):
    with BagWriter(path) as writer:
        for i in range(n):
            stamp_ns = START_NS + i * 100_000_000
            writer.write_message("/tracker/state", stamp_ns, tracked_state(stamp_ns))
    return path


def folder_of_images(path, n=3):
    path.mkdir()
    for i in range(n):
        cv2.imwrite(str(path / f"{i:04d}.png"), np.full((48, 64, 3), 10 * i, np.uint8))
    return path


def test_the_bag_of_the_images_is_the_runs_own_or_the_one_it_was_tracked_in(tmp_path):
    own, other, alone = write_bag(tmp_path / "own", 2), write_bag(tmp_path / "other", 2), states_alone(tmp_path / "alone")
    assert image_bag_of(own, info(bag=str(other)), ("cam01",)) == own
    assert image_bag_of(alone, info(bag=str(other)), ("cam01",)) == other
    assert image_bag_of(alone, info(from_run_bag=str(other)), ("cam01",)) == other
    assert image_bag_of(alone, info(bag=str(own), from_run_bag=str(other)), ("cam01",)) == own
    assert image_bag_of(alone, {}, ("cam01",)) is None
    assert image_bag_of(own, {}, ("cam02",)) is None


def test_cameras_may_have_their_images_in_bags_of_their_own(tmp_path):
    own, alone = write_bag(tmp_path / "own", 2), states_alone(tmp_path / "alone")
    assert image_bags_of(alone, info(bag=str(own)), ("cam01", "cam02")) == {"cam01": own}
    assert image_bags_of(own, info(bag=str(tmp_path / "gone")), ("cam01",)) == {"cam01": own}
    assert image_bags_of(alone, {}, ("cam01",)) == {}


def test_cameras_of_a_bag_have_it_as_their_source_or_none(tmp_path):
    bag = write_bag(tmp_path / "bag", 2)
    one, two = circle_rig(2)
    rig = rig_from_bag(CameraRig((replace(one, source="a.mp4", gain=2.0, gamma=0.5), replace(two, source="b.mp4")), "room"), bag)
    assert [camera.source for camera in rig] == [f"bag:{bag}", None]
    assert (rig["cam01"].gain, rig["cam01"].gamma, rig.world_frame) == (2.0, 0.5, "room")
    assert np.array_equal(rig["cam01"].T_world_cam, one.T_world_cam)


def test_sets_from_the_runs_own_bag(tmp_path):
    bag = write_bag(tmp_path / "own", 3)
    with BagReader(bag) as reader:
        rig, stream = run_stream(small_rig("gone.mp4"), reader, {})
        assert stream.source_options is None
        assert [image_set.stamp_ns for image_set in stream] == [START_NS + i * 33_333_333 for i in range(3)]
    assert rig["cam01"].source == "gone.mp4" and rig["cam01"].gain == 2.0


def test_sets_from_the_bag_that_a_run_was_tracked_in(tmp_path):
    tracked_in = tmp_path / "tracked_in"
    with BagWriter(tracked_in) as writer:
        for i in range(4):
            stamp_ns = START_NS + i * 100_000_000
            writer.write_message("/cam01/image_raw", stamp_ns, image(stamp_ns, np.full((48, 64, 3), i, np.uint8)))
    with BagReader(states_alone(tmp_path / "alone")) as reader:
        rig, stream = run_stream(small_rig("gone.mp4"), reader, info(bag=str(tracked_in), start=2, shrink=2))
        assert rig["cam01"].source == f"bag:{tracked_in}" and rig["cam01"].model.width == 64
        assert [found.images[0].pixels[0, 0, 0] for found in stream] == [0, 1, 2] and not stream.errors


def test_sets_from_the_sources_as_the_run_took_them(tmp_path):
    folder = folder_of_images(tmp_path / "images", 5)
    run = info(rate=10.0, base_stamp_ns=START_NS, shrink=2)
    with BagReader(states_alone(tmp_path / "alone")) as reader:
        rig, stream = run_stream(small_rig(str(folder)), reader, run)
        assert (rig["cam01"].model.width, rig["cam01"].model.height) == (32, 24)
        sets = list(stream)
        assert [found.images[0].pixels.shape for found in sets] == [(24, 32, 3)] * 3
        assert [found.stamp_ns for found in sets] == [START_NS, START_NS + 100_000_000, START_NS + 200_000_000]
        # Options given go before those of the run.
        whole = SourceOptions(rate_hz=10.0, base_stamp_ns=START_NS)
        rig, stream = run_stream(small_rig(str(folder)), reader, run, whole)
        assert rig["cam01"].model.width == 64 and next(iter(stream)).images[0].pixels.shape == (48, 64, 3)
