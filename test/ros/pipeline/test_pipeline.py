"""Three processes as one command: every image set tracked and recorded, and a readable bag however it ends."""

import json
import os
import shutil
import signal
from pathlib import Path

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo, Image
from tracker_msgs.msg import TrackedState

from helpers.ros.graph import NodeProcess
from helpers.ros.samples import write_recording
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.runs.image_sets import SourceStream
from tracker_node.tracking.config import SynchronizerConfig


def files_of(recording: Path) -> list:
    files = ["--rig", recording / "rig.yaml", "--model", recording / "model.yaml", "--initial-state", recording / "state.yaml"]
    return ["pipeline", *files]


def counts_of(bag: Path) -> dict[str, int]:
    with BagReader(bag) as reader:
        counts = dict.fromkeys(reader.topics, 0)
        for message in reader.messages():
            counts[message.topic] += 1
        return counts


def children_of(process: NodeProcess) -> list[int]:
    """Processes that have this one as their parent."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(stat.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
        if parent == process.pid:
            found.append(int(stat.parent.name))
    return found


def test_everything_is_tracked_and_recorded(launch, recording, tmp_path):
    bag = tmp_path / "bag"
    also = ("--masks", "--overlays", "--masked-images", "--markers", "--images")
    pipeline = launch(*files_of(recording), "--bag", bag, *also)
    assert pipeline.wait() == 0, pipeline.err
    assert "12 image sets: 12 TRACKING" in pipeline.out
    assert "12/12 image sets" in pipeline.err
    counts = counts_of(bag)
    assert counts.pop("/robot_description") == 1
    assert counts.pop("/diagnostics") >= 1
    cameras = ("cam1", "cam2", "cam3")
    expected = {"/tracker/state", "/tracker/state_covariance", "/tracker/pose", "/tracker/joint_states", "/tracker/markers"}
    expected |= {f"/{camera}/{topic}" for camera in cameras for topic in ("image_raw", "camera_info")}
    pictures = ("mask", "overlay/compressed", "masked_image/compressed")
    expected |= {f"/tracker/{camera}/{topic}" for camera in cameras for topic in pictures}
    assert counts == dict.fromkeys(expected, 12)


def test_resampled_in_real_time(probe, launch, recording):
    """The lenses come from camera_info then; image sets may be skipped, and nothing is recorded."""
    states, infos = probe.listen(TrackedState, "tracker/state"), probe.listen(CameraInfo, "cam1/camera_info")
    pipeline = launch(*files_of(recording), "--resize", "120x90", "--rate", "30", "--loop", "--real-time")
    probe.spin_until(lambda: len(states) > 5 and infos, "states and calibrations")
    assert (infos[0].width, infos[0].height) == (120, 90)
    pipeline.interrupt()
    assert pipeline.wait() == 0, pipeline.err
    assert states[-1].status == TrackedState.TRACKING, states[-1].status_reason


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_all_and_leaves_a_readable_bag(probe, launch, recording, tmp_path, number):
    bag = tmp_path / "bag"
    states = probe.listen(TrackedState, "tracker/state")
    pipeline = launch(*files_of(recording), "--loop", "--bag", bag)
    probe.spin_until(lambda: len(states) > 30, "states of more than two rounds")
    children = children_of(pipeline)
    assert len(children) == 3
    pipeline.interrupt(number)
    assert pipeline.wait() == 0, pipeline.err
    assert "Traceback" not in pipeline.err
    assert not any(Path(f"/proc/{child}").exists() for child in children)
    n_said = int(pipeline.out.splitlines()[-1].split()[0])
    assert counts_of(bag)["/tracker/state"] == n_said >= 30


def test_it_ends_when_the_tracker_dies(probe, launch, recording, tmp_path):
    bag = tmp_path / "bag"
    states = probe.listen(TrackedState, "tracker/state")
    pipeline = launch(*files_of(recording), "--loop", "--bag", bag)
    probe.spin_until(lambda: len(states) > 8, "states")
    (tracker,) = [pid for pid in children_of(pipeline) if b".main\0tracker\0" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    os.kill(tracker, signal.SIGKILL)
    assert pipeline.wait() != 0
    assert "tracker ended by itself" in pipeline.err
    assert counts_of(bag)["/tracker/state"] > 5  # what was recorded is not lost; the last ones may have reached the probe alone


def test_the_children_end_when_the_pipeline_is_killed(probe, launch, recording):
    images = probe.listen(Image, "cam1/image_raw")
    pipeline = launch(*files_of(recording), "--loop")
    probe.spin_until(lambda: len(images) > 3, "images")
    pipeline.interrupt(signal.SIGKILL)
    pipeline.wait()
    graph = probe.node
    probe.spin_until(lambda: not graph.count_publishers("/cam1/image_raw") and not graph.count_publishers("/tracker/state"))


def test_cameras_that_fail_are_named_and_the_others_are_tracked(launch, recording, tmp_path):
    """One cannot be read at all, one ends in the middle; with two cameras enough for a set, every instant is tracked."""
    broken = tmp_path / "broken"
    write_recording(broken, 12, n_cameras=4)
    shutil.rmtree(broken / "cam1")
    for i in range(4, 12):
        (broken / "cam3" / f"{i:04}.png").unlink()
    (broken / "config.yaml").write_text("synchronizer: {min_cameras: 2, queue_s: 0.1}\n")
    pipeline = launch(*files_of(broken), "--config", broken / "config.yaml", "--bag", tmp_path / "bag")
    assert pipeline.wait() == 1
    assert "cam1" in pipeline.err and "no such file or folder" in pipeline.err
    assert pipeline.out.startswith("12 image sets: ")
    assert counts_of(tmp_path / "bag")["/tracker/state"] == 12
    offline = SourceStream(load_rig(broken / "rig.yaml"), SynchronizerConfig())
    assert json.loads((tmp_path / "run.json").read_text())["expected_image_sets"] == offline.n_expected == 4  # of the shortest


@pytest.mark.long
def test_a_run_that_is_lost_throughout_says_so_and_has_a_status_of_its_own(launch, tmp_path):
    write_recording(tmp_path / "empty", 6)
    for path in tmp_path.glob("empty/cam*/*.png"):
        cv2.imwrite(str(path), np.full(cv2.imread(str(path)).shape, 90, np.uint8))
    pipeline = launch(*files_of(tmp_path / "empty"), "--bag", tmp_path / "bag")
    assert pipeline.wait() == 3
    assert pipeline.out.startswith("6 image sets: 6 LOST")
    (line,) = [line for line in pipeline.err.splitlines() if "LOST in all 6 image sets" in line]
    assert "leave out the initial state" in line and "rig check" in line


def test_mistakes_are_one_line(launch, recording, tmp_path):
    (tmp_path / "bag").mkdir()
    exists = launch(*files_of(recording), "--bag", tmp_path / "bag")
    no_bag = launch(*files_of(recording), "--masks")
    for process, said in ((exists, "something already"), (no_bag, "--bag")):
        assert process.wait() == 2
        assert said in process.err and len(process.err.splitlines()) == 1
