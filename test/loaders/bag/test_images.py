"""Images in bags."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.sources import bag_samples
from tracker_node.errors import SourceError
from tracker_node.loaders.bag.images import image_of, image_topics
from tracker_node.loaders.bag.message_types import typestore
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.bag.writer import BagWriter


def images_of(path: Path, camera: str = "cam01"):
    with BagReader(path) as reader:
        return [image_of(reader, message, camera) for message in reader.messages(image_topics(reader, [camera]))]


def test_pixels_and_stamps_come_back_as_views(tmp_path: Path) -> None:
    images = images_of(bag_samples.write_bag(tmp_path / "run", 3))
    expected = np.random.default_rng(5).integers(0, 256, (48, 64, 3), dtype=np.uint8)
    assert [image.stamp_ns for image in images] == [bag_samples.START_NS + i * bag_samples.PERIOD_NS for i in range(3)]
    assert (images[0].pixels == expected).all()
    assert images[0].pixels.base is not None
    assert not images[0].pixels.flags.writeable


def test_padded_rows_and_other_encodings(tmp_path: Path) -> None:
    padded = np.arange(4 * 16, dtype=np.uint8).reshape(4, 16)
    message = bag_samples.image(5, padded, "mono8")
    message.width = 10  # six bytes of padding at the end of each row
    with BagWriter(tmp_path / "run") as writer:
        writer.write_message("/robot/cam01/image_raw", 0, message)
        writer.write_message("/robot/cam01/image_raw", 1, bag_samples.image(6, padded, "8UC1"))
    first, second = images_of(tmp_path / "run")
    assert (first.pixels == padded[:, :10]).all()
    assert (second.encoding, second.pixels.shape) == ("mono8", (4, 16))


def test_compressed_images_stand_in_for_raw_ones(tmp_path: Path) -> None:
    picture = cv2.GaussianBlur(np.random.default_rng(1).integers(0, 256, (48, 64, 3), dtype=np.uint8), (9, 9), 3)
    data = cv2.imencode(".png", picture)[1]
    types = typestore().types
    message = types["sensor_msgs/msg/CompressedImage"](header=bag_samples.header(9), format="bgr8; png", data=data.reshape(-1))
    broken = types["sensor_msgs/msg/CompressedImage"](header=bag_samples.header(10), format="jpeg", data=data.reshape(-1)[:9])
    with BagWriter(tmp_path / "run") as writer:
        writer.write_message("/cam01/image_raw/compressed", 0, message)
        writer.write_message("/cam02/image_raw/compressed", 0, broken)
    (image,) = images_of(tmp_path / "run")
    assert (image.pixels == picture).all()
    with pytest.raises(SourceError, match=r"cam02.*at 10 ns cannot be decoded"):
        images_of(tmp_path / "run", "cam02")


@pytest.mark.parametrize(("encoding", "problem"), [("16UC1", "16UC1"), ("bgr8", "contradicts itself")])
def test_unusable_images_name_the_camera(tmp_path: Path, encoding: str, problem: str) -> None:
    message = bag_samples.image(5, np.zeros((4, 16), np.uint8), encoding)
    with BagWriter(tmp_path / "run") as writer:
        writer.write_message("/cam01/image_raw", 0, message)
    with pytest.raises(SourceError, match=rf"cam01.*{problem}"):
        images_of(tmp_path / "run")


def test_two_topics_for_one_camera_are_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run") as writer:
        for robot in ("a", "b"):
            writer.write_message(f"/{robot}/cam01/image_raw", 0, bag_samples.image(5, np.zeros((4, 4), np.uint8), "mono8"))
    with pytest.raises(SourceError, match=r"cam01.*/a/cam01/image_raw, /b/cam01/image_raw"):
        images_of(tmp_path / "run")
    with BagReader(tmp_path / "run") as reader:
        assert image_topics(reader, ["01", "cam02"]) == {}
