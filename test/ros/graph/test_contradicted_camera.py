"""A camera that was turned after its calibration is named on /diagnostics while the tracker runs."""

from dataclasses import replace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from tracker_msgs.msg import TrackedState

from helpers.ros.samples import write_recording
from tracker_node.geometry import so3
from tracker_node.loaders.rig.rig_yaml import load_rig, rig_file_of, write_rig_file
from tracker_node.ros.diagnostics import statuses_of
from tracker_node.tracking.estimate import BLIND, BUMPED, DELAYED, FROZEN, TURNED, CameraFault

RATE_HZ, N = 30.0, 50
TILT_DEG = 1.0


@pytest.fixture(scope="module")
def moving_arm(tmp_path_factory):
    """Five cameras, less than two seconds."""
    folder = tmp_path_factory.mktemp("contradicted") / "arm"
    write_recording(folder, N, n_cameras=5)
    return folder


def test_a_turned_camera_is_named_within_five_seconds_and_no_other(probe, launch, moving_arm):
    rig, turned = load_rig(moving_arm / "rig.yaml"), "cam3"
    tilt = so3.exp(np.radians([TILT_DEG, 0.0, 0.0]))
    cameras = []
    for camera in rig:
        T = camera.T_world_cam.copy()
        if camera.name == turned:
            T[:3, :3] = T[:3, :3] @ tilt
        cameras.append(replace(camera, T_world_cam=T))
    file = moving_arm / "rig_turned.yaml"
    write_rig_file(rig_file_of(replace(rig, cameras=tuple(cameras))), file)
    states = probe.listen(TrackedState, "tracker/state")
    files = ["--rig", file, "--model", moving_arm / "model.yaml", "--initial-state", moving_arm / "state.yaml"]
    tracker = launch("tracker", *files, "--lossless", "--wait-for", "state=2")  # us, and the cameras
    consumed = ("--as-fast-as-consumed", "--wait-for-subscribers", "1")
    launch("camera_ingest", "--rig", moving_arm / "rig.yaml", "--rate", str(RATE_HZ), *consumed)
    about_it = f"tracker: {turned} against the others"

    def told() -> bool:
        return about_it in probe.diagnostics and probe.diagnostics[about_it].level == DiagnosticStatus.ERROR

    probe.spin_until(lambda: len(states) == N and told(), f"{N} states and an error about {turned}")
    tracker.interrupt()
    assert tracker.wait() == 0, tracker.err
    status = probe.diagnostics[about_it]
    assert f"{turned} is turned by" in status.message, status
    values = {value.key: float(value.value) for value in status.values}
    assert values["turned [deg]"] == pytest.approx(TILT_DEG, abs=0.5)
    others = {name: other for name, other in probe.diagnostics.items() if name.endswith("against the others")}
    assert all(other.level == DiagnosticStatus.OK for name, other in others.items() if name != about_it), others
    assert N / RATE_HZ < 5.0  # all that has been seen


def test_levels_and_texts():
    turned = CameraFault("cam1", TURNED, np.radians(1.04), np.radians(0.1), 3 * 10**9, ("cam3",))
    late = CameraFault("cam2", DELAYED, 0.067, 0.002, 4 * 10**9)
    statuses = statuses_of([turned, late])
    assert set(statuses) == {"cam1", "cam2", "cam3"}
    for name in ("cam1", "cam3"):
        level, said, values = statuses[name]
        assert level == DiagnosticStatus.WARN
        assert said == "cam1 or cam3 is turned by 1.0 degrees (+- 0.1) from where its calibration has it"
        assert values == {"turned [deg]": pytest.approx(1.04), "sigma [deg]": pytest.approx(0.1), "since [s]": 3.0}
    level, said, values = statuses["cam2"]
    assert (level, said) == (DiagnosticStatus.ERROR, "images of cam2 are 67 ms (+- 2) late")
    assert values["delayed [ms]"] == pytest.approx(67.0)


def test_a_camera_that_is_both_turned_and_late_says_both():
    turned = CameraFault("cam1", TURNED, np.radians(2.0), np.radians(0.1), 3 * 10**9, ("cam2",))
    late = CameraFault("cam1", DELAYED, -0.05, 0.002, 4 * 10**9)
    level, said, values = statuses_of([turned, late])["cam1"]
    assert level == DiagnosticStatus.ERROR and "turned by 2.0" in said and "50 ms (+- 2) early" in said
    assert {"turned [deg]", "delayed [ms]"} <= set(values)


def test_sizes_of_all_kinds_are_in_their_units():
    faults = [CameraFault("a", BUMPED, np.radians(0.5), np.radians(0.01), 0), CameraFault("b", BLIND, 0.12, 0.0, 0)]
    statuses = statuses_of([*faults, CameraFault("c", FROZEN, 0.2, 0.0, 0)])
    assert statuses["a"][2]["bumped [deg]"] == pytest.approx(0.5) and statuses["b"][2]["blind [%]"] == pytest.approx(12.0)
    assert statuses["c"][2]["frozen [ms]"] == pytest.approx(200.0)
    assert "a has been bumped" in statuses["a"][1]
