"""The ingest as a process of its own: what it says arrives, bit for bit, with the right stamps."""

import re
import shutil
import signal
from pathlib import Path

import cv2
import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from helpers.ros.graph import stamps
from tracker_node.loaders.images.source import open_source
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.ros.conversions import bgr_of_compressed, camera_image_of
from tracker_node.ros.qos import LATCHED
from tracker_node.runs.messages import lens_of

PACED = ("--rate", "50", "--no-frame-skip", "--stamps", "file", "--wait-for-subscribers", "1", "--wait-for-info-subscribers", "1")


def image_of(recording: Path, camera: str, i: int) -> np.ndarray:
    return cv2.imread(str(recording / camera / f"{i:04}.png"))


def test_every_image_arrives_with_its_calibration(probe, launch, recording):
    rig = load_rig(recording / "rig.yaml")
    images = {name: probe.listen(Image, f"{name}/image_raw") for name in rig.names}
    infos = {name: probe.listen(CameraInfo, f"{name}/camera_info") for name in rig.names}
    process = launch("camera_ingest", "--rig", recording / "rig.yaml", *PACED)
    probe.spin_until(lambda: all(len(m) == 12 for m in (*images.values(), *infos.values())), "12 images of each camera")
    for name in rig.names:
        assert stamps(images[name]) == stamps(infos[name]) == [20_000_000 * i for i in range(12)]
        for i, message in enumerate(images[name]):
            assert message.header.frame_id == f"{name}_optical_frame" and message.encoding == "bgr8"
            assert np.array_equal(camera_image_of(name, message).pixels, image_of(recording, name, i))
        assert np.array_equal(lens_of(name, infos[name][0]).K, rig[name].model.K)
    assert process.wait() == 0
    assert [line.partition(",")[0] for line in process.out.splitlines()] == [f"{name}: 12 published" for name in rig.names]


def test_part_of_one_camera_resampled_with_its_calibration(probe, launch, recording):
    images, infos = probe.listen(Image, "cam2/image_raw"), probe.listen(CameraInfo, "cam2/camera_info")
    options = ("--cameras", "cam2", "--start", "3", "--end", "6", "--resize", "80x60")
    process = launch("camera_ingest", "--rig", recording / "rig.yaml", *options, *PACED)
    probe.spin_until(lambda: len(images) == len(infos) == 3, "three images")
    assert process.wait() == 0
    assert stamps(images) == [60_000_000, 80_000_000, 100_000_000]
    expected = dict(open_source(recording / "cam2", size=(80, 60), rate_hz=50.0))
    for message in images:
        assert np.array_equal(camera_image_of("cam2", message).pixels, expected[stamps([message])[0]])
    lens, full = lens_of("cam2", infos[0]), load_rig(recording / "rig.yaml")["cam2"].model
    point = np.array([0.1, -0.05, 2.0])
    assert np.allclose(lens.project(point)[0], (full.project(point)[0] + 0.5) / 2 - 0.5)


def test_compressed_images_beside_raw_ones(probe, launch, recording):
    raw, compressed = probe.listen(Image, "cam1/image_raw"), probe.listen(CompressedImage, "cam1/image_raw/compressed")
    probe.listen(CameraInfo, "cam1/camera_info")
    launch("camera_ingest", "--rig", recording / "rig.yaml", "--cameras", "cam1", "--compressed", *PACED)
    probe.spin_until(lambda: len(raw) == len(compressed) == 12, "12 images of both kinds")
    assert stamps(raw) == stamps(compressed)
    difference = bgr_of_compressed("cam1", compressed[5]).pixels.astype(int) - image_of(recording, "cam1", 5)
    assert np.abs(difference).mean() < 6.0


def test_a_camera_without_images_is_named_and_the_others_go_on(probe, launch, recording, tmp_path):
    broken = tmp_path / "broken"
    shutil.copytree(recording, broken)
    shutil.rmtree(broken / "cam2")
    cv2.imwrite(str(broken / "cam3" / "0004.png"), np.zeros((5, 5, 3), np.uint8))  # another size
    (broken / "cam1" / "0006.png").write_bytes((broken / "cam1" / "0005.png").read_bytes())  # repeats
    rig_text = (broken / "rig.yaml").read_text().replace(str(recording), str(broken))
    (broken / "rig.yaml").write_text(rig_text)
    images = {name: probe.listen(Image, f"{name}/image_raw") for name in ("cam1", "cam3")}
    for name in images:
        probe.listen(CameraInfo, f"{name}/camera_info")
    process = launch("camera_ingest", "--rig", broken / "rig.yaml", *PACED)
    probe.spin_until(lambda: len(images["cam1"]) == 12 and len(images["cam3"]) == 11, "what can be read")
    assert process.wait() == 1
    assert "cam2" in process.err and "no such file or folder" in process.err
    assert "0004.png is of 5x5 pixels, not 160x120" in process.err
    assert re.search(r"cam3: 11 published,.* 1 unusable", process.out)
    assert re.search(r"cam1: 12 published,.* 1 duplicated", process.out)  # and some late, on a busy machine
    status = probe.diagnostics
    ends = [f"camera_ingest: {name}" for name in ("cam2", "cam3")]

    def in_error(end: str) -> bool:
        return end in status and status[end].level == DiagnosticStatus.ERROR

    def values_of_first() -> dict[str, str]:
        return {v.key: v.value for v in status["camera_ingest: cam1"].values}

    probe.spin_until(lambda: all(map(in_error, ends)), "both errors", 20.0)
    assert "5x5 pixels, not 160x120" in status["camera_ingest: cam3"].message
    probe.spin_until(lambda: values_of_first()["published"] == "12", "the last report", 20.0)
    assert values_of_first()["duplicated"] == "1"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_loop_ends_cleanly_on_a_signal(probe, launch, recording, number):
    images = probe.listen(Image, "cam1/image_raw")
    process = launch("camera_ingest", "--rig", recording / "rig.yaml", "--loop", "--rate", "100")
    probe.spin_until(lambda: len(images) > 15, "more images than the folder has")
    process.interrupt(number)
    assert process.wait() == 0
    assert "Traceback" not in process.err
    assert stamps(images) == sorted(stamps(images))


def test_rates_and_subscribers_that_do_not_match_are_told(probe, launch, recording):
    launch("camera_ingest", "--rig", recording / "rig.yaml", "--loop", "--rate", "20")
    status = probe.diagnostics

    def rate() -> float:
        part = status.get("camera_ingest: cam1")
        return float({v.key: v.value for v in part.values}["images per second"]) if part else 0.0

    probe.spin_until(lambda: rate() > 1.0, "a rate")
    assert rate() < 25.0 and status["camera_ingest: cam1"].hardware_id == "cam1"
    late = probe.node.create_subscription(Image, "cam1/image_raw", lambda _: None, LATCHED)  # nobody keeps images for latecomers
    name = "camera_ingest: quality of service of cam1/image_raw"
    probe.spin_until(lambda: name in status and status[name].level == DiagnosticStatus.WARN, "the mismatch")
    assert "durability" in status[name].message
    probe.node.destroy_subscription(late)
    probe.spin_until(lambda: status[name].level == DiagnosticStatus.OK, "its end")


def test_mistakes_are_one_line(launch, recording, tmp_path):
    absent = launch("camera_ingest", "--rig", tmp_path / "absent.yaml")
    wrong = launch("camera_ingest", "--rig", recording / "rig.yaml", "--start", "7", "--end", "7")
    unknown = launch("camera_ingest", "--rig", recording / "rig.yaml", "--cameras", "cam9")
    override = "qos_overrides./cam1/image_raw.publisher.reliability:=sometimes"
    quality = launch("camera_ingest", "--rig", recording / "rig.yaml", "--ros-args", "-p", override)
    for process, said in ((absent, "absent.yaml"), (wrong, "start < end"), (unknown, "cam9"), (quality, "sometimes")):
        assert process.wait() == 2
        assert said in process.err and len(process.err.splitlines()) == 1
