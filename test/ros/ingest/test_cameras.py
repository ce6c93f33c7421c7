"""Which cameras are published, from which sources, with which lenses."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import CalibrationError, SourceError, TrackerError, UnknownNameError
from tracker_node.loaders.images.source import SourceOptions
from tracker_node.loaders.rig.camera_info import dump_camera_info
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.ros.ingest.cameras import chosen_cameras, open_cameras


@pytest.fixture
def rig(recording: Path):
    return load_rig(recording / "rig.yaml")


def test_sources_and_settings_of_the_command_line_go_before_those_of_the_rig(rig):
    chosen = chosen_cameras(
        rig, ["cam2", "cam3"], {"cam3": "rtsp://host/a"}, [(None, "publish", "mono"), ("cam3", "rate_hz", "25")]
    )
    assert [(c.name, c.source, c.capture.publish, c.capture.rate_hz) for c in chosen] == [
        ("cam2", rig["cam2"].source, "mono", None),
        ("cam3", "rtsp://host/a", "mono", 25.0),
    ]
    opened = open_cameras(chosen, SourceOptions())
    assert list(opened.recorded) == ["cam2"] and opened.live == ("cam3",) and not opened.problems
    with pytest.raises(UnknownNameError, match="'cam9'"):
        chosen_cameras(rig, sources={"cam9": "a.mp4"})


def test_a_camera_without_a_rig_is_not_calibrated_unless_ros_has_kept_its_lens(rig, tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    (camera,) = chosen_cameras(None, sources={"front": rig["cam1"].source})
    assert open_cameras([camera], SourceOptions()).cameras["front"].lens is None
    lens = CameraModel(160, 120, np.array([[170.0, 0.0, 80.0], [0.0, 170.0, 60.0], [0.0, 0.0, 1.0]]))
    dump_camera_info("front", lens, tmp_path / "camera_info/front.yaml")
    assert np.array_equal(open_cameras([camera], SourceOptions()).cameras["front"].lens.K, lens.K)
    dump_camera_info("front", lens.resized(80, 60), tmp_path / "camera_info/front.yaml")
    with pytest.raises(CalibrationError, match="expected 80x60, got 160x120"):
        open_cameras([camera], SourceOptions())


def test_recordings_of_different_clocks_are_refused(rig, tmp_path):
    """Images with times of the day beside a video that begins at zero would wait for it for half a century."""
    (tmp_path / "stamps.csv").write_text("\n".join(["time", *(f"{1.7e9 + 0.05 * i:.2f}" for i in range(12))]))
    cameras = [replace(c, stamp_file=str(tmp_path / "stamps.csv")) if c.name == "cam2" else c for c in rig]
    chosen = chosen_cameras(CameraRig(tuple(cameras)))
    with pytest.raises(SourceError, match=r"camera 'cam2' begins 1700000000 s after camera 'cam1': .* different clocks"):
        open_cameras(chosen, SourceOptions())


def test_cameras_that_a_tracker_can_follow(rig):
    recorded = open_cameras(chosen_cameras(rig), SourceOptions())
    recorded.check_trackable(real_time=False)
    assert recorded.n_sets() == 12 and recorded.n_sets(loop=True) is None
    live = open_cameras(chosen_cameras(rig, sources={"cam3": "rtsp://host/a"}), SourceOptions())
    live.check_trackable(real_time=True)
    assert live.n_sets() is None
    with pytest.raises(TrackerError, match="cam3: live cameras do not wait"):
        live.check_trackable(real_time=False)
    undecoded = open_cameras(
        chosen_cameras(rig, sources={"cam3": "rtsp://host/a"}, changes=[("cam3", "publish", "jpeg")]), SourceOptions()
    )
    with pytest.raises(TrackerError, match="cam3: publish: jpeg gives no pixels"):
        undecoded.check_trackable(real_time=True)
