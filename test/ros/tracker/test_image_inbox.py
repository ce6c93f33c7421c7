"""Images that wait: how many, which are thrown away, and what is counted."""

import threading
import time

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from tracker_node.observation.image_set import CameraImage
from tracker_node.ros.conversions import image_message
from tracker_node.ros.diagnostics import Diagnostics, QosMismatches
from tracker_node.ros.qos import LIVE_IMAGES, images_published
from tracker_node.ros.tracker.image_inbox import MOST_BYTES, ImageInbox, InboxOptions, Received


def inbox_of(**options):
    return ImageInbox(None, ("a", "b"), InboxOptions(**options), None)


def put(inbox, *items):
    for camera, content in items:
        inbox._enqueue(Received(camera, content))


def contents(inbox):
    return [(received.camera, received.content) for received in inbox.take(0.0)]


def test_by_default_thirty_images_of_a_camera_wait_and_two_gibibytes_where_none_may_be_lost():
    assert InboxOptions() == InboxOptions(lossless=False, compressed=False, capacity=30, most_bytes=2147483648)
    assert MOST_BYTES == 2147483648


def test_the_size_of_an_image_is_that_of_its_bytes():
    assert Received("a", b"12345").size == 5
    assert Received("a", CompressedImage(data=b"1234567")).size == 7
    image = CameraImage("a", 3, np.zeros((4, 5, 3), np.uint8))
    assert Received("a", image).size == 60
    assert Received("a", image).decode() is image


def test_images_that_wait_are_told_with_their_stamps():
    """Raw ones by their first bytes; those that cannot be images, and those that are thrown away, are not told."""
    told = []
    inbox = ImageInbox(None, ("a", "b"), InboxOptions(lossless=True, most_bytes=4000), None, lambda *one: told.append(one))
    pixels = np.zeros((20, 40, 3), np.uint8)
    packed = CompressedImage()
    packed.header.stamp.sec = 2
    raw = serialize_message(image_message(1_000_000_003, "frame", pixels))
    put(inbox, ("a", raw), ("b", packed), ("a", b"no"), ("a", raw), ("b", CameraImage("b", 5, pixels[:5])))
    assert told == [("a", 1_000_000_003), ("b", 2_000_000_000), ("b", 5)] and inbox.overflowed == {"a": 1, "b": 0}


def test_the_newest_images_of_each_camera_wait():
    inbox = inbox_of(capacity=2)
    put(inbox, ("a", b"1"), ("b", b"2"), ("a", b"3"))
    assert inbox.waiting == 3 and inbox.overflowed == {"a": 0, "b": 0}
    put(inbox, ("a", b"4"))
    assert inbox.overflowed == {"a": 1, "b": 0} and inbox.arrived == {"a": 3, "b": 1}
    put(inbox, ("a", b"5"))
    assert contents(inbox) == [("b", b"2"), ("a", b"4"), ("a", b"5")] and inbox.waiting == 0
    assert inbox.overflowed == {"a": 2, "b": 0} and inbox.lost == {"a": 0, "b": 0}


def test_after_they_are_taken_there_is_room_again():
    inbox = inbox_of(capacity=1)
    put(inbox, ("a", b"1"), ("b", b"1"))
    inbox.take(0.0)
    put(inbox, ("a", b"2"), ("b", b"2"))
    assert inbox.overflowed == {"a": 0, "b": 0} and inbox.waiting == 2


def test_where_nothing_may_be_lost_bytes_are_counted_and_the_newest_thrown_away():
    inbox = inbox_of(lossless=True, capacity=1, most_bytes=10)
    put(inbox, ("a", b"123456"), ("a", b"1234"))
    assert inbox.overflowed["a"] == 0 and inbox.most_bytes == 10
    put(inbox, ("b", b"1"))
    assert inbox.overflowed == {"a": 0, "b": 1} and inbox.arrived["b"] == 1
    assert [len(content) for _, content in contents(inbox)] == [6, 4]
    put(inbox, ("b", b"1234567890"))
    assert inbox.overflowed["b"] == 1 and inbox.waiting == 1


def test_where_images_may_be_lost_bytes_are_no_limit():
    inbox = inbox_of(most_bytes=2)
    put(inbox, ("a", b"12345"))
    assert inbox.waiting == 1 and inbox.most_bytes is None


def test_when_an_image_came_is_known_also_of_one_that_was_thrown_away(monkeypatch):
    inbox = inbox_of(lossless=True, most_bytes=0)
    monkeypatch.setattr(time, "monotonic", lambda: 7.5)
    put(inbox, ("b", b"1"))
    assert inbox.last_arrival_s == {"b": 7.5} and inbox.waiting == 0


def test_taking_waits_for_an_image_as_long_as_asked():
    inbox = inbox_of()
    began = time.monotonic()
    assert inbox.take(0.1) == [] and 0.08 < time.monotonic() - began < 2.0
    timer = threading.Timer(0.05, put, [inbox, ("a", b"1")])
    timer.start()
    assert len(inbox.take(20.0)) == 1 and time.monotonic() - began < 10.0
    put(inbox, ("a", b"2"))
    assert len(inbox.take(20.0)) == 1 and time.monotonic() - began < 10.0


def test_waking_ends_the_wait_with_nothing():
    inbox = inbox_of()
    began = time.monotonic()
    timer = threading.Timer(0.05, inbox.wake)
    timer.start()
    assert inbox.take(20.0) == [] and time.monotonic() - began < 10.0


@pytest.fixture
def make(probe):
    """An inbox that really subscribes, on the probe's node."""

    def make(**options):
        diagnostics = Diagnostics(probe.node)
        return ImageInbox(probe.node, ("a", "b"), InboxOptions(**options), QosMismatches(probe.node, diagnostics))

    return make


def test_only_cameras_in_use_are_listened_to(probe, make):
    inbox = make(lossless=True)
    count = probe.node.count_subscribers
    inbox.subscribe(("a", "b"))
    inbox.subscribe(("a", "b"))
    assert [count(f"{name}/{topic}") for name in "ab" for topic in ("image_raw", "camera_info")] == [1, 1, 1, 1]
    inbox.last_arrival_s.update(a=1.0, b=2.0)
    inbox.infos.update(a=None, b=None)
    inbox.subscribe(("b",))
    assert [count(f"{name}/image_raw") for name in "ab"] == [0, 1]
    assert inbox.last_arrival_s == {"b": 2.0} and list(inbox.infos) == ["b"]
    inbox.subscribe(())
    assert count("b/image_raw") == count("b/camera_info") == 0


@pytest.mark.parametrize(("compressed", "topic", "kind"), [
    (False, "a/image_raw", "sensor_msgs/msg/Image"), (True, "a/image_raw/compressed", "sensor_msgs/msg/CompressedImage"),
])  # fmt: skip
def test_raw_or_compressed_images_are_listened_to(probe, make, compressed, topic, kind):
    inbox = make(compressed=compressed)
    inbox.subscribe(("a",))
    (end,) = probe.node.get_subscriptions_info_by_topic(f"/{topic}")
    assert end.topic_type == kind


def test_calibrations_that_are_offered_best_effort_come_to_a_lossless_tracker_too(probe, make):
    inbox = make(lossless=True)
    inbox.subscribe(("a",))
    publisher = probe.node.create_publisher(CameraInfo, "a/camera_info", LIVE_IMAGES)
    probe.spin_until(lambda: publisher.get_subscription_count() == 1)
    publisher.publish(CameraInfo(width=640))
    probe.spin_until(lambda: "a" in inbox.infos, "a calibration")
    assert inbox.infos["a"].width == 640


def test_an_image_comes_serialized_and_is_decoded_when_wanted(probe, make):
    inbox = make(lossless=True)
    inbox.subscribe(("a",))
    publisher = probe.node.create_publisher(Image, "a/image_raw", images_published(5))
    probe.spin_until(lambda: publisher.get_subscription_count() == 1)
    publisher.publish(image_message(1_500_000_000, "f", np.full((2, 3, 3), 9, np.uint8)))
    probe.spin_until(lambda: inbox.waiting == 1)
    (received,) = inbox.take(0.0)
    image = received.decode()
    assert (image.camera, image.stamp_ns, image.pixels.shape, image.pixels.max()) == ("a", 1_500_000_000, (2, 3, 3), 9)
    assert inbox.lost == {"a": 0, "b": 0}
