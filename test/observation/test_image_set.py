"""Images of one camera and of one instant: which pixels an encoding takes, and what is BGR."""

import numpy as np
import pytest

from tracker_node.observation.image_set import CameraImage, ImageSet

COLOR = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
GRAY = np.arange(8, dtype=np.uint8).reshape(2, 4)


def test_bgr_is_handed_on_without_a_copy():
    image = CameraImage("a", 5, COLOR)
    assert image.encoding == "bgr8" and image.bgr is COLOR


def test_rgb_is_turned_over_in_its_channels_only():
    bgr = CameraImage("a", 5, COLOR, "rgb8").bgr
    assert bgr.shape == (2, 4, 3)
    assert bgr[0, 0].tolist() == [2, 1, 0] and bgr[1, 3].tolist() == [23, 22, 21]


def test_gray_is_the_same_in_three_channels():
    bgr = CameraImage("a", 5, GRAY, "mono8").bgr
    assert bgr.shape == (2, 4, 3) and bgr.dtype == np.uint8
    assert bgr[0, 1].tolist() == [1, 1, 1] and bgr[1, 3].tolist() == [7, 7, 7]


@pytest.mark.parametrize(
    ("pixels", "encoding"),
    [
        (GRAY, "bgr8"),
        (GRAY, "rgb8"),
        (COLOR, "mono8"),
        (GRAY[0], "mono8"),
        (COLOR[None], "bgr8"),
        (COLOR.astype(np.float32), "bgr8"),
        (COLOR.astype(np.int8), "rgb8"),
        (GRAY.astype(np.uint16), "mono8"),
    ],
)
def test_pixels_that_are_not_of_the_encoding_are_refused(pixels, encoding):
    with pytest.raises(ValueError, match=f"expected uint8 pixels for {encoding}, got {pixels.dtype}"):
        CameraImage("a", 5, pixels, encoding)


def test_unknown_encodings_are_refused():
    with pytest.raises(ValueError, match=r"an encoding of \['bgr8', 'mono8', 'rgb8'\], got 'bgr16'"):
        CameraImage("a", 5, COLOR, "bgr16")


def test_images_of_a_set_are_found_by_camera():
    a, b = CameraImage("a", 5, COLOR), CameraImage("b", 6, GRAY, "mono8")
    images = ImageSet(5, (b, a))
    assert images.cameras == ("b", "a")
    assert images.get("a") is a and images.get("b") is b and images.get("c") is None
    assert ImageSet(5, ()).cameras == ()
