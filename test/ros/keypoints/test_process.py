"""The detector node as a process: what is missing is one line, and it ends soon, whatever it is doing."""

import time
from pathlib import Path

import numpy as np
import pytest
from sensor_msgs.msg import Image
from tracker_msgs.msg import Keypoints

from tracker_node.errors import TrackerError
from tracker_node.loaders.fetched_files import pose_weights
from tracker_node.ros.conversions import image_message
from tracker_node.ros.qos import images_published


@pytest.fixture(scope="module")
def weights():
    pytest.importorskip("ai_edge_litert", reason="the extra keypoints is not installed")
    try:
        return pose_weights()
    except TrackerError as error:
        pytest.skip(str(error))


def one_line_of(process) -> str:
    assert process.wait() == 2, process.err
    (line,) = [line for line in process.err.splitlines() if "error:" in line]
    assert "Traceback" not in process.err and line.startswith("tracker_node keypoints: error: ")
    return line


def test_a_missing_extra_is_one_line(launch, recording, tmp_path):
    (tmp_path / "ai_edge_litert.py").write_text("raise ModuleNotFoundError(name='ai_edge_litert')\n")
    process = launch("keypoints", "--rig", recording / "rig.yaml", env={"PYTHONPATH": str(tmp_path)})
    assert "pip install 'tracker_node[keypoints]'" in one_line_of(process)


def test_missing_weights_are_one_line(launch, recording, tmp_path):
    environment = {"XDG_CACHE_HOME": str(tmp_path), "PIP_NO_INDEX": "1", "PIP_CONFIG_FILE": "/dev/null"}
    process = launch("keypoints", "--rig", recording / "rig.yaml", env=environment)
    assert "pose_detection.tflite" in one_line_of(process)


@pytest.mark.parametrize("content, said", [(b"....TFL3....", "SHA-256"), (b"text", "TensorFlow Lite")])
def test_weights_that_are_not_what_their_name_says_are_one_line(launch, recording, tmp_path, content, said):
    file = tmp_path / "pose_landmark_heavy.tflite"
    file.write_bytes(content)
    assert said in one_line_of(launch("keypoints", "--rig", recording / "rig.yaml", "--weights", file))


def test_weights_that_cannot_be_loaded_are_one_line(launch, recording, tmp_path, weights):
    file = tmp_path / "own.tflite"
    file.write_bytes(b"....TFL3" + bytes(100))
    assert "the networks cannot be loaded" in one_line_of(launch("keypoints", "--rig", recording / "rig.yaml", "--weights", file))


def test_it_finds_nobody_in_noise_and_ends_within_two_seconds_at_work(probe, launch, recording, weights):
    points = probe.listen(Keypoints, "cam1/keypoints")
    create = probe.node.create_publisher
    images = [create(Image, f"cam{i}/image_raw", images_published()) for i in (1, 2, 3)]
    process = launch("keypoints", "--rig", recording / "rig.yaml")
    probe.spin_until(lambda: all(each.get_subscription_count() for each in images) or process.ended, "the node")
    noise, n = np.random.default_rng(0).integers(0, 256, (480, 640, 3), dtype=np.uint8), 0

    def came() -> bool:
        nonlocal n
        n += 1
        for each in images:
            each.publish(image_message(n * 33_333_333, "f", noise))
        time.sleep(0.02)
        return len(points) >= 3

    probe.spin_until(came, "points of three images")
    assert not points[-1].persons
    group = Path(f"/proc/{process.pid}/autogroup")  # of a session of its own, as here: others go first
    assert not group.exists() or group.read_text().split()[-1] == "5"
    began_s = time.monotonic()
    process.interrupt()
    assert process.wait() == 0, process.err
    assert time.monotonic() - began_s < 2.0 and "Traceback" not in process.err
