"""The images of a finished run, by what its run.json says."""

import pytest
from camera_rigs import circle_rig

from tracker_node.errors import FileFormatError
from tracker_node.evaluation.run_images import config_of_run, image_bag_of, options_of, rig_of_run, source_options_of
from tracker_node.loaders.image_source import SourceOptions
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
