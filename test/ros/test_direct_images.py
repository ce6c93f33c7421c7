"""Images that pass from one node to another in the same process."""

import numpy as np

from tracker_node.loaders.decoding import SourceImage
from tracker_node.observation.image_set import CameraImage
from tracker_node.ros.direct_images import DirectImages

COLORS = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)


def test_the_pixels_are_the_publishers_own_and_cannot_be_written_to() -> None:
    direct, got = DirectImages(["left"]), list[CameraImage]()
    direct.listen("left", got.append)
    direct.hand_over("left", SourceImage(5, COLORS, "bgr8"), 17)
    assert (got[0].camera, got[0].stamp_ns, got[0].encoding) == ("left", 17, "bgr8")
    assert np.shares_memory(got[0].pixels, COLORS)
    assert not got[0].pixels.flags.writeable
    assert COLORS.flags.writeable


def test_who_has_left_gets_nothing() -> None:
    direct, got = DirectImages(["left", "right"]), list[CameraImage]()
    direct.listen("left", got.append)
    assert direct.has_listener("left")
    assert not direct.has_listener("right")
    direct.hand_over("right", SourceImage(0, COLORS, "bgr8"), 1)
    direct.leave("left")
    direct.hand_over("left", SourceImage(0, COLORS, "bgr8"), 2)
    direct.leave("left")
    assert got == []


def test_mosaics_come_as_colors_and_gray_images_as_they_are() -> None:
    direct, got = DirectImages(["left"]), list[CameraImage]()
    direct.listen("left", got.append)
    gray = np.full((4, 6), 90, np.uint8)
    direct.hand_over("left", SourceImage(0, gray, "mono8"), 1)
    direct.hand_over("left", SourceImage(0, gray, "bayer_rggb8"), 2)
    assert [image.encoding for image in got] == ["mono8", "bgr8"]
    assert got[1].pixels.shape == (4, 6, 3)
    assert (got[1].pixels == 90).all()
