"""Launch files as the real ``ros2 launch`` runs them, until they reach their state, and their end by Ctrl-C."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "test"))

from sensor_msgs.msg import CameraInfo, Image
from tracker_msgs.msg import Keypoints, TrackedState

from helpers.ros import ros2_env
from helpers.ros.graph import Probe
from helpers.ros.samples import write_recording
from tracker_node.loaders.bag.reader import BagReader

PATIENCE_S = 900.0  # what is installed there compiles its inner loops first
N_IMAGES = 30


class Launched:
    """``ros2 launch tracker_node FILE ...`` as a process; its output is kept."""

    def __init__(self, file: str, *arguments: str, folder: Path):
        self.process = subprocess.Popen(
            ["ros2", "launch", "tracker_node", file, *arguments],
            env=ros2_env.now(),
            cwd=folder,  # not among our sources, which Python would take in place of what is installed
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        self.lines.extend(iter(self.process.stdout.readline, ""))

    @property
    def text(self) -> str:
        return "".join(self.lines)

    @property
    def ended(self) -> bool:
        return self.process.poll() is not None

    def end(self) -> int:
        """Ctrl-C; the exit status of launch."""
        if not self.ended:
            self.process.send_signal(signal.SIGINT)
        return self.wait()

    def wait(self) -> int:
        status = self.process.wait(PATIENCE_S)
        self._reader.join(5.0)
        return status

    def close(self) -> None:
        """For the end of a test: whatever is left goes, children too."""
        if not self.ended:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait(30.0)


class Stage:
    """A recording, a probe in the graph, and a folder to write to."""

    def __init__(self, probe: Probe, folder: Path, recording: Path):
        self.probe, self.folder, self.recording = probe, folder, recording
        self._launched: list[Launched] = []

    def body(self, rig: str = "rig.yaml") -> list[str]:
        files = {"rig": rig, "model": "model.yaml", "initial_state": "state.yaml"}
        return [f"{name}:={self.recording / file}" for name, file in files.items()]

    def launch(self, file: str, *arguments: str) -> Launched:
        self._launched.append(Launched(f"{file}.launch.py", *arguments, folder=self.folder))
        return self._launched[-1]

    def until(self, launched: Launched, reached: Callable[[], object], what: str) -> None:
        """AssertionError with all that launch has said where it ends before."""
        self.probe.spin_until(lambda: bool(reached()) or launched.ended, what, PATIENCE_S)
        assert reached(), f"{what} was not reached:\n{launched.text}"

    def close(self) -> None:
        for launched in self._launched:
            launched.close()


def _ends_well(launched: Launched) -> None:
    status = launched.end()
    assert status == 0, launched.text
    assert "Traceback" not in launched.text and "exit code" not in launched.text, launched.text


def _n_states(bag: Path, topic: str = "/tracker/state") -> int:
    with BagReader(bag) as reader:
        assert not reader.recovered, reader.problem
        return sum(message.topic == topic for message in reader.messages())


def _camera_ingest(stage: Stage) -> None:
    images = stage.probe.listen(Image, "cam1/image_raw")
    launched = stage.launch("camera_ingest", f"rig:={stage.recording / 'rig.yaml'}", "rate:=10")
    stage.until(launched, lambda: images, "an image")
    _ends_well(launched)


def _tracker(stage: Stage) -> None:
    """Beside the cameras of another launch; there is no robot_state_publisher in this environment."""
    states = stage.probe.listen(TrackedState, "second/state")
    cameras = stage.launch("camera_ingest", f"rig:={stage.recording / 'rig.yaml'}", "rate:=10")
    launched = stage.launch("tracker", *stage.body(), "name:=second")
    stage.until(launched, lambda: states, "a state")
    assert _says_once(launched, "robot_state_publisher")
    _ends_well(launched)
    _ends_well(cameras)


def _keypoints(stage: Stage) -> None:
    """Beside the cameras of another launch; where its weights cannot be fetched, the line that says where to put them."""
    points = stage.probe.listen(Keypoints, "cam1/keypoints")
    cameras = stage.launch("camera_ingest", f"rig:={stage.recording / 'rig.yaml'}", "rate:=10")
    launched = stage.launch("keypoints", f"rig:={stage.recording / 'rig.yaml'}")
    stage.until(launched, lambda: points or "pose_landmark_full.tflite as" in launched.text, "points")
    if points:
        _ends_well(launched)
    else:
        launched.end()
    _ends_well(cameras)


def _says_once(launched: Launched, package: str) -> bool:
    """One line, or the package is there."""
    lines = [line for line in launched.lines if f"{package} is not installed" in line]
    return len(lines) == 1 or not (lines or not _installed(package))


def _installed(package: str) -> bool:
    return (
        subprocess.run(["ros2", "pkg", "prefix", package], env=ros2_env.now(), capture_output=True, check=False).returncode == 0
    )


def _rviz(stage: Stage) -> None:
    launched = stage.launch("rviz", f"rig:={stage.recording / 'rig.yaml'}")
    if _installed("rviz2"):
        stage.until(launched, lambda: stage.probe.node.count_subscribers("/cam1/image_raw"), "RViz subscribes")
        _ends_well(launched)
        return
    assert launched.wait() == 0, launched.text
    assert _says_once(launched, "rviz2"), launched.text
    assert "Foxglove" in launched.text and "Traceback" not in launched.text


def _rig(stage: Stage) -> None:
    """All of it, under other names: two cameras' topics from the rig file, the third's from the command line."""
    rig = stage.recording / "rig_topics.yaml"
    text = (stage.recording / "rig.yaml").read_text()
    for name in ("cam1", "cam2"):
        text = text.replace(f"  {name}:\n", f"  {name}:\n    topic: /drivers/{name}/image_color\n")
    rig.write_text(text)
    states = stage.probe.listen(TrackedState, "/lab/anna/state")
    infos = stage.probe.listen(CameraInfo, "/drivers/cam2/camera_info")
    images = stage.probe.listen(Image, "/third/image_raw")
    bag = stage.folder / "bag"
    arguments = ["rate:=10", "loop:=true", "name:=anna", "namespace:=lab", "frame_prefix:=anna/", f"bag:={bag}", "rviz:=true"]
    launched = stage.launch("rig", *stage.body(rig.name), *arguments, "topics:=cam3=/third/image_raw")
    stage.until(launched, lambda: states and infos and images, "states, and cameras under their names")
    n_states = len(states)
    stage.until(launched, lambda: len(states) > n_states + 5, "more states")
    assert stage.probe.node.count_publishers("/lab/cam1/image_raw") == 0
    _ends_well(launched)
    assert _n_states(bag, "/lab/anna/state") > 5


def _pipeline(stage: Stage) -> None:
    output = stage.folder / "run"
    launched = stage.launch("pipeline", *stage.body(), f"output:={output}")
    stage.until(launched, lambda: launched.ended, "its end")
    assert launched.wait() == 0, launched.text
    assert _n_states(output / "bag") == N_IMAGES


def _replay(stage: Stage) -> None:
    """Every image set of the bag is tracked again."""
    bag = stage.folder / "bag"
    command = [sys.executable, "-m", "tracker_node.cli.main", "camera_ingest", "--rig", str(stage.recording / "rig.yaml")]
    subprocess.run([*command, "--record", str(bag), "--no-frame-skip"], check=True, capture_output=True)
    states = stage.probe.listen(TrackedState, "again/state")
    launched = stage.launch("replay", f"bag:={bag}", "track:=true", *stage.body())
    stage.until(launched, lambda: "messages published" in launched.text and len(states) == N_IMAGES, "all image sets")
    _ends_well(launched)
    assert len(states) == N_IMAGES


def _demo(stage: Stage) -> None:
    output = stage.folder / "demo"
    launched = stage.launch("demo", f"output:={output}")
    stage.until(launched, lambda: launched.ended, "its end")
    assert launched.wait() == 0, launched.text
    assert (output / "report.html").is_file(), launched.text
    assert _says_once(launched, "rviz2"), launched.text


FILES: dict[str, Callable[[Stage], None]] = {
    "camera_ingest": _camera_ingest,
    "tracker": _tracker,
    "keypoints": _keypoints,
    "rviz": _rviz,
    "rig": _rig,
    "pipeline": _pipeline,
    "replay": _replay,
    "demo": _demo,
}


@contextmanager
def stage_in(folder: Path) -> Iterator[Stage]:
    """A graph of its own; whatever is left in it at the end is killed."""
    recording = folder / "recording"
    write_recording(recording, N_IMAGES)
    stage = Stage(Probe(), folder, recording)
    try:
        yield stage
    finally:
        stage.close()
        stage.probe.close()
