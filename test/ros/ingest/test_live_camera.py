"""The threads of one live camera: what they publish, and that every image that they do not publish is counted."""

import queue
import threading

import numpy as np

from helpers.ros.processes import wait_until
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CaptureSettings
from tracker_node.loaders.images.live_capture import Connection, LiveSource
from tracker_node.loaders.images.recorded_source import SourceOptions
from tracker_node.ros.ingest.cameras import IngestCamera
from tracker_node.ros.ingest.live_camera import WAITING, LiveCamera

WIDTH, HEIGHT = 32, 24
MODEL = CameraModel(WIDTH, HEIGHT, np.array([[30.0, 0.0, 15.5], [0.0, 30.0, 11.5], [0.0, 0.0, 1.0]]))


class Given:
    """A source of the images that a test puts into it."""

    def __init__(self) -> None:
        self.connection = Connection(connected=True)
        self.images: queue.SimpleQueue = queue.SimpleQueue()

    def close(self) -> None:
        self.images.put(None)

    def __iter__(self):
        while (item := self.images.get()) is not None:
            yield item


def camera(capture: CaptureSettings | None = None, **of_rig) -> IngestCamera:
    known = Camera("cam1", MODEL, np.eye(4), source="topic:/a", **of_rig)
    return IngestCamera("cam1", "topic:/a", capture or CaptureSettings(), MODEL, known)


def run(ingest_camera: IngestCamera, images: list, options: SourceOptions | None = None) -> tuple[list, LiveCamera]:
    """What is published of ``images`` (stamp, content), given one by one."""
    published, usable, source = [], [], Given()
    options = options or SourceOptions()
    live = LiveCamera(ingest_camera, source, options, lambda image, _: published.append(image), lambda *_: usable.append(1))
    live.start()
    for i, item in enumerate(images):
        source.images.put(item)
        wait_until(lambda n=i + 1: live.counts.unusable + len(usable) >= n)
    live.close()
    return published, live


def frame(value: int = 0, width: int = WIDTH, height: int = HEIGHT) -> np.ndarray:
    return np.full((height, width, 3), value, np.uint8)


def test_fields_at_double_rate():
    """Of the first image only the first field, as the rate is not known; with the rate in the settings both."""
    woven = []
    for i in range(3):
        image = frame(2 * i)
        image[1::2] = 2 * i + 1
        woven.append((10**18 + 40_000_000 * i, image))
    published, live = run(camera(interlaced="top_first"), woven)
    assert [(image.stamp_ns - 10**18, int(image.pixels[4, 4, 0])) for image in published] == [
        (0, 0), (40_000_000, 2), (60_000_000, 3), (80_000_000, 4), (100_000_000, 5),
    ]  # fmt: skip
    assert (live.counts.published, live.counts.unstamped) == (5, 1)
    published, live = run(camera(CaptureSettings(rate_hz=25.0), interlaced="bottom_first"), woven[:1])
    assert [(image.stamp_ns - 10**18, int(image.pixels[4, 4, 0])) for image in published] == [(0, 1), (20_000_000, 0)]


def test_stamps_become_those_of_common_time():
    published, _ = run(camera(time_offset_ns=5_000_000, time_drift_ppm=100.0), [(10**18, frame()), (10**18 + 10**9, frame(1))])
    assert [image.stamp_ns - 10**18 for image in published] == [5_000_000, 10**9 + 5_100_000]


def test_what_cannot_be_published_is_counted_and_the_rest_goes_on():
    images = [(1, frame(9)), (2, frame(9, 16, 12)), (3, b"no jpeg"), (4, frame(9))]
    published, live = run(camera(), images)
    assert [image.stamp_ns for image in published] == [1, 4]
    assert (live.counts.published, live.counts.unusable, live.counts.duplicated) == (2, 2, 1)


def test_a_slow_publication_drops_the_oldest_and_counts_them():
    source, let_go, published = Given(), threading.Event(), []

    def publish(image, _size) -> None:
        let_go.wait(20.0)
        published.append(image.stamp_ns)

    live = LiveCamera(camera(), source, SourceOptions(), publish)
    live.start()
    for i in range(10):
        source.images.put((i, frame(i)))
    wait_until(lambda: live.counts.dropped >= 10 - WAITING - 1)
    let_go.set()
    live.close()
    assert published[-WAITING:] == [7, 8, 9]
    assert len(published) + live.counts.dropped == 10


class Broken:
    """A connection that gives ``n`` images and is lost."""

    def __init__(self, n: int):
        self.left, self.closed = n, False

    def read(self):
        self.left -= 1
        return (self.left, frame()) if self.left >= 0 else None

    def close(self) -> None:
        self.closed = True


def test_waits_between_attempts_double_until_there_are_images_again():
    """Two images, then nothing for five attempts, then one image, then nothing."""
    made: list[Broken] = []
    waits: list[float] = []

    def connect() -> Broken:
        made.append(Broken({0: 2, 6: 1}.get(len(made), 0)))
        return made[-1]

    source = LiveSource(connect, retry_s=(0.5, 4.0))

    def wait(seconds: float) -> bool:
        waits.append(seconds)
        if len(waits) == 9:
            source.close()
        return False

    source._closed.wait = wait  # type: ignore[method-assign]
    assert len(list(source)) == 3
    assert waits == [0.5, 1.0, 2.0, 4.0, 4.0, 4.0, 0.5, 1.0, 2.0]
    assert all(capture.closed for capture in made)
    assert source.connection.times == 2 and source.connection.problem
