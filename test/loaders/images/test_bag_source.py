"""Images of bags as sources: raw, compressed, mosaics; stamps of the messages; parts, loops, and bags that break off."""

import itertools
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.sources import bag_samples
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CaptureSettings
from tracker_node.errors import CalibrationError, FileFormatError, SourceError, UnknownNameError
from tracker_node.loaders.bag.message_types import typestore
from tracker_node.loaders.bag.writer import BagWriter
from tracker_node.loaders.images.feed import ImageFeed
from tracker_node.loaders.images.source import open_camera_source, open_source

WIDTH, HEIGHT, N = 16, 12, 6
START_NS, PERIOD_NS = 1_700_000_000_000_000_000, 40_000_000
RAW, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"


def pixels(i: int) -> np.ndarray:
    return np.full((HEIGHT, WIDTH, 3), (10 * i, 10 * i + 1, 10 * i + 2), np.uint8)


def jpeg(i: int) -> bytes:
    return cv2.imencode(".jpg", np.full((HEIGHT, WIDTH, 3), 40 * i, np.uint8))[1].tobytes()


def stamp(i: int) -> int:
    """Not quite regular, as those of a camera are."""
    return START_NS + PERIOD_NS * i + 1000 * (i % 3)


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """Raw images of left, JPEG images of right, a mosaic of upper, and texts."""
    path = tmp_path / "bag"
    with BagWriter(path) as writer:
        writer.add_topic("/left/image_raw", RAW)
        writer.add_topic("/right/image_raw/compressed", COMPRESSED)
        writer.add_topic("/upper/image_raw", RAW)
        writer.add_topic("/notes", "std_msgs/msg/String")
        for i in range(N):
            compressed = typestore().types[COMPRESSED](
                header=bag_samples.header(stamp(i)), format="bgr8; jpeg compressed bgr8", data=np.frombuffer(jpeg(i), np.uint8)
            )
            mosaic = np.tile(np.array([[200, 90], [90, 30]], np.uint8), (HEIGHT // 2, WIDTH // 2))
            at_ns = START_NS + PERIOD_NS * i
            writer.write_message("/left/image_raw", at_ns, bag_samples.image(stamp(i), pixels(i)[:, :, ::-1].copy(), "rgb8"))
            writer.write_message("/right/image_raw/compressed", at_ns, compressed)
            writer.write_message("/upper/image_raw", at_ns, bag_samples.image(stamp(i), mosaic, "bayer_rggb8"))
            writer.write_message("/notes", at_ns, bag_samples.text("a note"))
    return path


def camera(name: str, source: str, width: int = WIDTH) -> Camera:
    return Camera(name, CameraModel(width, HEIGHT, np.diag([20.0, 20.0, 1.0])), np.eye(4), source=source, time_offset_ns=7)


def test_raw_images_with_the_stamps_of_their_headers(bag: Path):
    source = open_source(f"bag:{bag}#/left/image_raw")
    assert (source.width, source.height, source.n_images, round(source.rate_hz, 2)) == (WIDTH, HEIGHT, N, 25.0)
    stamps, images = zip(*source, strict=True)
    assert list(stamps) == [stamp(i) for i in range(N)]
    assert all(np.array_equal(image, pixels(i)) for i, image in enumerate(images))


def test_a_part_and_a_loop(bag: Path):
    part = list(open_source(f"bag:{bag}#/left/image_raw", start=2, end=4))
    assert [(at, int(image[0, 0, 0])) for at, image in part] == [(stamp(2), 20), (stamp(3), 30)]
    again = list(itertools.islice(open_source(f"bag:{bag}#/left/image_raw", start=4, loop=True), 5))
    assert [int(image[0, 0, 0]) for _, image in again] == [40, 50, 40, 50, 40]
    assert [b[0] - a[0] for a, b in itertools.pairwise(again)][1:] == [PERIOD_NS, stamp(5) - stamp(4), PERIOD_NS]


def test_a_cameras_topic_is_found_by_its_name_and_gets_its_offset(bag: Path):
    source = open_camera_source(camera("right", f"bag:{bag}"))
    assert [at for at, _ in source] == [stamp(i) + 7 for i in range(N)]
    with pytest.raises(SourceError, match="no images of camera 'lower'; name the topic"):
        open_camera_source(camera("lower", f"bag:{bag}"))
    with pytest.raises(CalibrationError, match="expected 20x12, got 16x12"):
        open_camera_source(camera("left", f"bag:{bag}", width=20))


def test_jpeg_images_stay_as_they_are(bag: Path):
    passed = open_source(f"bag:{bag}#/right/image_raw/compressed", capture=CaptureSettings(publish="jpeg"))
    assert [image.jpeg for image in passed.images()] == [jpeg(i) for i in range(N)]


def test_a_mosaic_says_its_pattern(bag: Path):
    (_, bgr), *_ = open_source(f"bag:{bag}#/upper/image_raw")
    assert np.abs(bgr[4, 4].astype(int) - (30, 90, 200)).max() <= 1
    first = next(open_source(f"bag:{bag}#/upper/image_raw", capture=CaptureSettings(publish="native")).images())
    assert first.encoding == "bayer_rggb8"


def test_several_sources_of_a_bag_are_sets(bag: Path):
    sources = {name: open_camera_source(camera(name, f"bag:{bag}")) for name in ("left", "right")}
    with ImageFeed(sources) as feed:
        assert [len(feed_set.images) for feed_set in feed] == [2] * N


def test_a_bag_that_breaks_off_says_so(bag: Path):
    source = open_source(f"bag:{bag}#/left/image_raw")
    source._n_in_file += 2  # as if its index promised more
    assert len(list(source)) == N and source.counts.missing == 2
    assert "ends after 6 images, 8 were expected" in source.counts.problems[0]


@pytest.mark.parametrize(
    ("address", "error", "said"),
    [
        (
            "bag:{bag}",
            SourceError,
            "expected one topic of images, found /left/image_raw, /right/image_raw/compressed, /upper/image_raw",
        ),
        ("bag:{bag}#/notes", SourceError, "expected a topic of images, /notes has std_msgs/msg/String"),
        ("bag:{bag}#/absent", UnknownNameError, "'/absent'"),
        ("bag:{bag}/absent", FileFormatError, "absent"),
    ],
)
def test_mistakes_are_named(bag: Path, address: str, error: type, said: str):
    with pytest.raises(error, match=said):
        open_source(address.format(bag=bag))
