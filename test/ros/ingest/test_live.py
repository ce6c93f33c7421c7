"""Live cameras as ROS cameras: streams that break, other nodes' topics, devices that are none, calibrations by service."""

import threading
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from sensor_msgs.srv import SetCameraInfo

from helpers.ros.graph import stamps
from helpers.sources.mjpeg_server import HEIGHT, WIDTH, MjpegServer, number_of, numbered_jpeg
from helpers.sources.v4l2_camera import V4l2Camera
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.rig.camera_info import load_camera_info
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.ros.conversions import camera_image_of, camera_info_message, image_message, jpeg_message
from tracker_node.ros.ingest.live_camera import TopicSource
from tracker_node.runs.messages import lens_of


@pytest.fixture
def stream() -> Iterator[MjpegServer]:
    server = MjpegServer()
    yield server
    server.close()


@pytest.fixture
def rig_file(recording: Path) -> Path:
    """Three cameras of 160x120, with recorded sources."""
    return recording / "rig.yaml"


def is_at(probe, camera: str, level: bytes) -> bool:
    """Whether the last diagnostics of a camera have this level."""
    status = probe.diagnostics.get(f"camera_ingest: {camera}")
    return status is not None and status.level == level


def values_of(status) -> dict[str, str]:
    return {value.key: value.value for value in status.values}


def test_a_stream_that_breaks_is_picked_up_again(probe, launch, rig_file, tmp_path):
    """Halved for the graph, its own JPEG bytes into the bag; another camera of the rig plays a file all the time."""
    first = MjpegServer()
    small, infos = probe.listen(Image, "cam1/image_raw"), probe.listen(CameraInfo, "cam1/camera_info")
    others = probe.listen(Image, "cam2/image_raw")
    bag, status = tmp_path / "bag", probe.diagnostics
    process = launch(
        "camera_ingest", "--rig", rig_file, "--cameras", "cam1", "cam2", "--source", f"cam1={first.url}",
        "--shrink", "2", "--loop", "--record", bag,
    )  # fmt: skip
    probe.spin_until(lambda: len(small) > 10 and len(others) > 10, "images of both")
    images = [camera_image_of("cam1", message).pixels for message in small]
    assert all(image.shape == (HEIGHT // 2, WIDTH // 2, 3) for image in images)
    numbers = [number_of(image) for image in images]
    assert all(0 < (b - a) % 20 < 10 for a, b in pairwise(numbers)), numbers  # in order; a busy machine may drop some
    lens, full = lens_of("cam1", infos[0]), load_rig(rig_file)["cam1"].model
    point = np.array([0.1, -0.05, 2.0])
    assert np.allclose(lens.project(point)[0], (full.project(point)[0] + 0.5) / 2 - 0.5)

    first.close()
    probe.spin_until(lambda: is_at(probe, "cam1", DiagnosticStatus.ERROR), "the break is told")
    assert any(word in status["camera_ingest: cam1"].message for word in ("no more images", "no answer"))
    before, others_before = len(small), len(others)
    again = MjpegServer(port=first.port)
    probe.spin_until(lambda: len(small) > before + 10, "images again")
    assert len(others) > others_before + 5
    probe.spin_until(lambda: not is_at(probe, "cam1", DiagnosticStatus.ERROR), "all is well again")
    assert values_of(status["camera_ingest: cam1"])["connections"] == "2"
    assert stamps(small) == sorted(stamps(small))
    process.interrupt()
    assert process.wait() == 0, process.err
    again.close()
    assert "cam1: " in process.out and "2 connections" in process.out

    with BagReader(bag) as reader:
        recorded = [message for _, message in reader.decoded("/cam1/image_raw/compressed")]
        lens_size = {(m.width, m.height) for _, m in reader.decoded("/cam1/camera_info")}
    assert {bytes(m.data) for m in recorded} <= {numbered_jpeg(i) for i in range(20)}  # as the camera sent them, at their size
    assert lens_size == {(WIDTH, HEIGHT)} and len(recorded) >= len(small)


def test_a_stream_that_is_silent_but_open_is_connected_to_again(probe, launch, rig_file, stream):
    images = probe.listen(Image, "cam1/image_raw")
    process = launch("camera_ingest", "--rig", rig_file, "--cameras", "cam1", "--source", f"cam1={stream.url}")
    probe.spin_until(lambda: len(images) > 5, "images")
    stream.pause.set()
    probe.spin_until(lambda: is_at(probe, "cam1", DiagnosticStatus.ERROR), "silence is told")
    stream.pause.clear()
    n = len(images)
    probe.spin_until(lambda: len(images) > n + 5, "images again")
    stream.pause.set()
    process.interrupt()
    process.wait()  # though it waits for an image


def test_jpeg_images_of_a_stream_pass_through_and_a_camera_may_be_uncalibrated(probe, launch, stream):
    """Without a rig, as somebody does who is about to record for a calibration."""
    images, infos = probe.listen(CompressedImage, "left/image_raw/compressed"), probe.listen(CameraInfo, "left/camera_info")
    launch("camera_ingest", "--source", f"left={stream.url}", "--capture", "publish=jpeg", env={"ROS_HOME": "/nowhere"})
    probe.spin_until(lambda: len(images) > 5 and len(infos) > 5, "images")
    assert {bytes(message.data) for message in images} <= {numbered_jpeg(i) for i in range(20)}
    assert {message.format for message in images} == {"bgr8; jpeg compressed bgr8"}
    assert (infos[0].width, infos[0].height, infos[0].k[0]) == (WIDTH, HEIGHT, 0.0)


def test_images_of_a_wrong_size_or_damaged_are_counted_and_the_others_go_on(probe, launch, rig_file):
    def image(i: int) -> bytes:
        if i % 4 == 1:
            return numbered_jpeg(i, 80, 60)
        return numbered_jpeg(i)[:40] if i % 4 == 2 else numbered_jpeg(i)

    server = MjpegServer(image)
    good = probe.listen(Image, "cam1/image_raw")
    process = launch("camera_ingest", "--rig", rig_file, "--cameras", "cam1", "--source", f"cam1={server.url}")
    told: set[str] = set()

    def ready() -> bool:
        told.add(getattr(probe.diagnostics.get("camera_ingest: cam1"), "message", ""))
        return len(good) > 40 and any("160x120" in text for text in told)

    probe.spin_until(ready, "good images, and what is wrong with the others")
    assert {(message.width, message.height) for message in good} == {(WIDTH, HEIGHT)}
    assert any("image size contradicts the calibration: expected 160x120, got 80x60" in text for text in told)
    process.interrupt()
    process.wait()
    server.close()
    counted = {key: int(n) for n, key in (part.split() for part in process.out.partition(": ")[2].split(", "))}
    assert counted["unusable"] >= 0.8 * counted["published"] > 0


def test_topics_of_other_nodes(probe, launch, rig_file, tmp_path):
    """Raw, compressed and Bayer images under new names, with the calibration of the rig; recorded as what they are."""
    picture = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    picture[:, : WIDTH // 2] = (40, 120, 200)
    mosaic = np.empty((HEIGHT, WIDTH), np.uint8)
    mosaic[::2, ::2], mosaic[::2, 1::2] = picture[::2, ::2, 2], picture[::2, 1::2, 1]
    mosaic[1::2, ::2], mosaic[1::2, 1::2] = picture[1::2, ::2, 1], picture[1::2, 1::2, 0]
    publishers = {
        "raw": probe.node.create_publisher(Image, "/a/image", 10),
        "jpeg": probe.node.create_publisher(CompressedImage, "/b/image/compressed", 10),
        "bayer": probe.node.create_publisher(Image, "/c/image", 10),
    }
    received = {name: probe.listen(Image, f"{name}/image_raw") for name in ("cam1", "cam2", "cam3")}
    process = launch(
        "camera_ingest", "--rig", rig_file, "--record", tmp_path / "bag",
        "--source", "cam1=topic:/a/image", "cam2=topic:/b/image/compressed", "cam3=topic:/c/image",
    )  # fmt: skip
    sent = 0

    def publish_until_all_came() -> bool:
        nonlocal sent
        sent += 1
        stamp = 10**18 + 10**7 * sent
        publishers["raw"].publish(image_message(stamp, "other", picture[:, :, ::-1], "rgb8"))
        publishers["jpeg"].publish(jpeg_message(stamp, "other", cv2.imencode(".jpg", picture)[1].tobytes()))
        message = image_message(stamp, "other", mosaic, "mono8")
        message.encoding = "bayer_rggb8"
        publishers["bayer"].publish(message)
        return all(len(messages) > 3 for messages in received.values())

    probe.spin_until(publish_until_all_came, "images of all three")
    for name, messages in received.items():
        pixels = camera_image_of(name, messages[-1]).pixels.astype(int)
        assert np.abs(pixels - picture)[:, 8 : WIDTH // 2 - 8].max() <= 4, name
        assert messages[-1].header.frame_id == f"{name}_optical_frame"
        assert all(10**18 < stamp <= 10**18 + 10**7 * sent for stamp in stamps(messages))  # those of the messages
    process.interrupt()
    assert process.wait() == 0, process.err
    with BagReader(tmp_path / "bag") as reader:
        recorded = [message for _, message in reader.decoded("/cam3/image_raw")]
    assert {message.encoding for message in recorded} == {"bayer_rggb8"}
    assert recorded[0].data.tobytes() == mosaic.tobytes()

    received["cam3"].clear()  # and once more, from the bag to the graph and to another bag
    options = ("--rig", rig_file, "--cameras", "cam3", "--source", f"cam3=bag:{tmp_path / 'bag'}", "--preload", "--end", "2")
    again = launch("camera_ingest", *options, "--no-frame-skip", "--record", tmp_path / "again")
    assert again.wait() == 0, again.err
    with BagReader(tmp_path / "again") as reader:
        assert [message.encoding for _, message in reader.decoded("/cam3/image_raw")] == ["bayer_rggb8"] * 2


def test_a_topic_that_comes_back_with_another_quality_of_service(probe):
    node = Node("away")  # discovers publishers as another process would
    probe.add_node(node)
    source, images = TopicSource(node, "/back/image"), []
    reader = threading.Thread(target=lambda: images.extend(source), daemon=True)
    reader.start()
    message = image_message(1, "other", np.zeros((4, 4), np.uint8), "mono8")

    def publish_until(n: int, publisher) -> None:
        def came() -> bool:
            publisher.publish(message)
            return source.connection.received >= n

        probe.spin_until(came, f"{n} images")

    first = probe.node.create_publisher(Image, "/back/image", QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE))
    publish_until(3, first)
    probe.node.destroy_publisher(first)
    probe.spin_until(lambda: not source.connection.connected, "it is gone")
    assert "nobody publishes /back/image" in source.connection.problem
    weaker = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
    publish_until(source.connection.received + 3, probe.node.create_publisher(Image, "/back/image", weaker))
    probe.spin_until(lambda: source.connection.connected and not source.connection.problem, "all is well")
    probe.spin_until(lambda: "nothing has come for 4 s" in source.connection.problem, "silence is told")
    source.close()
    reader.join(timeout=10.0)
    node.destroy_node()


def test_recordings_are_recorded_and_published_as_asked_for(probe, launch, rig_file, tmp_path):
    """JPEG files at half the size, with their own bytes in the bag; a folder as gray images; the bag as a source."""
    (tmp_path / "jpeg").mkdir()
    for i in range(4):
        (tmp_path / "jpeg" / f"{i}.jpg").write_bytes(numbered_jpeg(i))
    common = ("--stamps", "file", "--no-frame-skip", "--wait-for-subscribers", "1", "--rate", "20", "--end", "4")
    bag = tmp_path / "bag"
    small, gray = probe.listen(Image, "cam1/image_raw"), probe.listen(Image, "cam2/image_raw")
    process = launch(
        "camera_ingest", "--rig", rig_file, "--cameras", "cam1", "cam2", "--source", f"cam1={tmp_path / 'jpeg'}",
        "--capture", "cam2.publish=mono", "--shrink", "2", "--record", bag, *common,
    )  # fmt: skip
    probe.spin_until(lambda: len(small) == len(gray) == 4, "four images of both")
    assert process.wait() == 0 and "recorded: 16 messages" in process.out, process.out
    assert [number_of(camera_image_of("cam1", message).pixels) for message in small] == [0, 1, 2, 3]
    assert {(message.encoding, message.width) for message in gray} == {("mono8", WIDTH // 2)}
    with BagReader(bag) as reader:
        kept = [bytes(message.data) for _, message in reader.decoded("/cam1/image_raw/compressed")]
        raw = [message for _, message in reader.decoded("/cam2/image_raw")]
    assert kept == [numbered_jpeg(i) for i in range(4)]
    file = cv2.imread(str(Path(load_rig(rig_file)["cam2"].source) / "0003.png"))
    assert raw[3].encoding == "bgr8" and raw[3].data.tobytes() == file.tobytes()

    small.clear()
    again = launch(
        "camera_ingest",
        "--rig",
        rig_file,
        "--cameras",
        "cam1",
        "--source",
        f"cam1=bag:{bag}",
        "--capture",
        "publish=native",
        *common,
    )
    probe.spin_until(lambda: len(small) == 4, "the images of the bag")
    assert again.wait() == 0 and {(message.encoding, message.width) for message in small} == {("bgr8", WIDTH)}


def test_devices_that_cannot_be_used_are_named_and_the_others_go_on(probe, launch, rig_file, tmp_path):
    plain = tmp_path / "plain"
    plain.write_text("no device")
    images, status = probe.listen(Image, "cam3/image_raw"), probe.diagnostics
    process = launch(
        "camera_ingest", "--rig", rig_file, "--loop",
        "--source", "cam1=v4l2:/dev/v4l/by-id/usb-absent-index0", "cam2=v4l2:/dev/null",
    )  # fmt: skip
    names = ("cam1", "cam2")
    probe.spin_until(lambda: len(images) > 5 and all(is_at(probe, name, DiagnosticStatus.ERROR) for name in names), "errors")
    assert "no such device, is it plugged in?" in status["camera_ingest: cam1"].message
    assert "is not a video device" in status["camera_ingest: cam2"].message
    process.interrupt()
    assert process.wait() == 1
    assert "/dev/null" in process.err and "Traceback" not in process.err


def test_mistakes_about_sources_are_one_line(launch, rig_file, tmp_path):
    (tmp_path / "bag").mkdir()
    said = {
        "unknown kind of source": ("--source", "cam1=gopher://x"),
        "unknown camera 'cam9'": ("--source", "cam9=a.mp4"),
        "field 'exposure'": ("--capture", "exposure=3"),
        "can be set for v4l2: sources only": ("--cameras", "cam1", "--capture", "cam1.exposure_us=100"),
        "does not wait for its consumer": (
            "--source", "cam1=http://127.0.0.1:9/", "--as-fast-as-consumed", "--record", tmp_path / "none",
        ),
        "is not overwritten": ("--record", tmp_path / "bag"),
    }  # fmt: skip
    started = {text: launch("camera_ingest", "--rig", rig_file, *options) for text, options in said.items()}
    started["camera 'käse': expected a-z"] = launch("rectify", "--cameras", "käse")
    started["nothing to publish"] = launch("camera_ingest")
    live = ("--rig", rig_file, "--model", rig_file.parent / "model.yaml", "--source", "cam1=http://127.0.0.1:9/")
    started["cam1: live cameras do not wait for the tracker: give --real-time"] = launch("pipeline", *live)
    for text, process in started.items():
        assert process.wait() == 2, process.err
        assert text in process.err and len(process.err.splitlines()) == 1, process.err
    assert list((tmp_path / "bag").iterdir()) == [] and not (tmp_path / "none").exists()


def test_a_calibration_is_taken_by_the_service_and_kept(probe, launch, rig_file, tmp_path):
    infos = probe.listen(CameraInfo, "cam1/camera_info")
    url = f"file://{tmp_path}/lenses/${{NAME}}.yaml"
    arguments = ("camera_ingest", "--rig", rig_file, "--loop", "--cameras", "cam1", "--capture", f"camera_info_url={url}")
    process = launch(*arguments)
    probe.spin_until(lambda: len(infos) > 2, "calibrations")
    old = lens_of("cam1", infos[-1])
    new = camera_info_message(0, "", old.mapped(np.array([[1.01, 0.0, 3.0], [0.0, 1.01, -2.0]]), WIDTH, HEIGHT))

    wrong = camera_info_message(0, "", old.resized(80, 60))
    answer = probe.ask(SetCameraInfo, "cam1/set_camera_info", SetCameraInfo.Request(camera_info=wrong))
    assert not answer.success and "images of 160x120, got one for 80x60" in answer.status_message
    answer = probe.ask(
        SetCameraInfo, "cam1/set_camera_info", SetCameraInfo.Request(camera_info=CameraInfo(width=160, height=120))
    )
    assert not answer.success and "uncalibrated" in answer.status_message
    assert not (tmp_path / "lenses").exists()

    answer = probe.ask(SetCameraInfo, "cam1/set_camera_info", SetCameraInfo.Request(camera_info=new))
    assert answer.success, answer.status_message
    probe.spin_until(lambda: infos[-1].k[0] == new.k[0], "the new calibration is published")
    assert load_camera_info(tmp_path / "lenses/cam1.yaml")[1].K.tolist() == new.k.reshape(3, 3).tolist()
    process.interrupt()
    assert process.wait() == 0
    infos.clear()
    launch(*arguments)
    probe.spin_until(lambda: len(infos) > 0, "calibrations")
    assert infos[0].k[0] == new.k[0]  # the file goes before the rig


def test_a_camera_that_is_unplugged_is_used_again_when_it_is_back(probe, launch, tmp_path):
    camera = V4l2Camera(tmp_path)
    images = probe.listen(Image, "left/image_raw")
    process = launch(
        "camera_ingest", "--source", f"left=v4l2:{camera.path}", "--capture", "pixel_format=MJPG", "exposure_us=4000",
        "rate_hz=50", env=camera.env | {"ROS_HOME": "/nowhere"},
    )  # fmt: skip
    probe.spin_until(lambda: len(images) > 5, "images")
    camera.unplug()
    probe.spin_until(lambda: is_at(probe, "left", DiagnosticStatus.ERROR), "it is told")
    probe.spin_until(lambda: "no such device" in probe.diagnostics["camera_ingest: left"].message, "why")
    camera.plug()
    n = len(images)
    probe.spin_until(lambda: len(images) > n + 5, "images again")
    assert np.abs(camera_image_of("left", images[-1]).pixels.astype(int) - 99).max() <= 1
    process.interrupt()
    assert process.wait() == 0, process.err
    assert len(camera.controls_set()) == 4  # automatic exposure off and exposure, set with each connection
