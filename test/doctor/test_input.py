"""Where the doctor gets its images from, and which of them it takes."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from helpers.sources.bag_samples import PERIOD_NS, START_NS, image, write_bag
from tracker_node.camera.rig import CameraRig
from tracker_node.doctor import recording as doctor_recording
from tracker_node.doctor.recording import DEFAULT_SECONDS, record, with_inputs
from tracker_node.errors import SourceError, UnknownNameError
from tracker_node.loaders.bag.writer import BagWriter

RIG = circle_rig(2)


def sources(rig):
    return [camera.source for camera in rig]


def test_without_inputs_the_rigs_own_sources_count():
    rig = CameraRig(tuple(replace(camera, source=f"{camera.name}.mp4") for camera in RIG))
    assert with_inputs(rig, []) is rig
    assert sources(with_inputs(rig, ["cam02=other.mp4"])) == ["cam01.mp4", "other.mp4"]
    assert sources(with_inputs(rig, ["cam02=http://host/a?b=c", "cam01=a=b.mp4"])) == ["a=b.mp4", "http://host/a?b=c"]


def test_one_source_for_each_camera_in_the_order_of_the_rig():
    assert sources(with_inputs(RIG, ["a.mp4", "b.mp4"])) == ["a.mp4", "b.mp4"]
    assert sources(with_inputs(RIG, ["a=1.mp4", "b.mp4"])) == ["a=1.mp4", "b.mp4"]  # not all of them are of a form


def test_a_bag_is_for_all_cameras(tmp_path):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "metadata.yaml").write_text("")
    for text in ("run.mcap", "run.db3", str(tmp_path / "bag")):
        assert sources(with_inputs(RIG, [text])) == [f"bag:{text}"] * 2
    assert sources(with_inputs(RIG, ["bag:anything"])) == ["bag:anything"] * 2
    assert sources(with_inputs(circle_rig(1), ["a.mp4"])) == ["a.mp4"]


@pytest.mark.parametrize("inputs", [["a.mp4"], ["a.mp4", "b.mp4", "c.mp4"], ["a.mcap", "b.mp4", "c.mp4"]])
def test_another_number_of_sources_is_refused(inputs):
    with pytest.raises(SourceError) as told:
        with_inputs(RIG, inputs)
    assert f"one source for each of cam01, cam02, or camera=source; got {len(inputs)} sources" in str(told.value)
    assert " ".join(inputs) in str(told.value)


def test_cameras_that_are_not_in_the_rig_are_named():
    with pytest.raises(UnknownNameError, match=r"cam03.*cam01, cam02"):
        with_inputs(RIG, ["cam01=a.mp4", "cam03=b.mp4"])


def folder(path, n, first=1):
    path.mkdir()
    for i in range(first, first + n):
        cv2.imwrite(str(path / f"{i:04d}.png"), np.full((48, 64, 3), i, np.uint8))
    return str(path)


def rig_of(*given):
    return CameraRig(tuple(replace(camera, source=source) for camera, source in zip(circle_rig(len(given)), given, strict=True)))


def test_a_few_seconds_of_every_camera(tmp_path):
    rig, told = rig_of(folder(tmp_path / "a", 8), folder(tmp_path / "b", 3)), []
    rate = record(rig)["cam01"].rate_hz
    found = record(rig, 5 / rate, told.append)
    assert told == ["cam01", "cam02"] == list(found)
    assert [len(found[name]) for name in told] == [5, 3] and found["cam02"].n_expected == 3
    assert found["cam01"].size == (64, 48) and [image[0, 0] for image in found["cam01"].small] == [1, 2, 3, 4, 5]
    assert len(record(rig, 0.0)["cam01"]) == 2  # fewer tell nothing
    assert not found["cam01"].problems
    assert DEFAULT_SECONDS == 4.0


def test_what_cannot_be_opened_is_told_and_the_others_are_read(tmp_path):
    found = record(rig_of(str(tmp_path / "gone.mp4"), folder(tmp_path / "b", 3)))
    gone = found["cam01"]
    assert (
        (len(gone), gone.n_expected, gone.rate_hz) == (0, 0, 1.0) and len(gone.problems) == 1 and "gone.mp4" in gone.problems[0]
    )
    assert len(found["cam02"]) == 3
    assert len(record(rig_of(str(tmp_path / "gone.mp4")))) == 1


def test_images_begin_when_the_last_camera_does(tmp_path):
    bag = tmp_path / "bag"
    first = {"cam01": 0, "cam02": 4}
    with BagWriter(bag) as writer:
        for i in range(12):
            for camera, begin in first.items():
                if i >= begin:
                    stamp = START_NS + i * PERIOD_NS
                    writer.write_message(f"/{camera}/image_raw", stamp, image(stamp, np.full((48, 64, 3), 10 + i, np.uint8)))
    found = record(with_inputs(circle_rig(2), [f"bag:{bag}"]))
    assert found["cam01"].stamps_ns == found["cam02"].stamps_ns == [START_NS + i * PERIOD_NS for i in range(4, 12)]
    assert found["cam01"].n_expected == 8 and found["cam01"].small[0][0, 0] == 14


def test_a_camera_that_is_over_before_is_read_from_its_own_beginning(tmp_path):
    (camera,) = rig_of(folder(tmp_path / "a", 4))
    source = doctor_recording._opened(camera)
    period_ns = source.stamp_ns(1) - source.stamp_ns(0)
    for later, read in ((0, 4), (2, 2), (3, 1), (4, 4), (9, 4)):
        found = doctor_recording._recorded("cam01", source, 4.0, source.stamp_ns(0) + later * period_ns, None)
        assert (len(found), found.n_expected) == (read, read)
        source = doctor_recording._opened(camera)


def test_a_bag_without_a_camera_says_so(tmp_path):
    found = record(with_inputs(circle_rig(2), [str(write_bag(tmp_path / "bag", 3))]))
    assert len(found["cam01"]) == 3 and not found["cam01"].problems
    assert len(found["cam02"].problems) == 1
