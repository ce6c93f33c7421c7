"""A small running graph of real processes that faults are injected into, and what /diagnostics says of them."""

from __future__ import annotations

import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "test"))

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Image
from tracker_msgs.msg import TrackedState

from helpers.ros.cameras import Cameras, N, files_of, image_set_of
from helpers.ros.graph import NodeProcess, Probe, remove_left_segments, ros_context, shared_memory_files
from helpers.ros.samples import write_recording
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.ros.conversions import image_message
from tracker_node.ros.diagnostics import ERROR, OK, WARN

__all__ = [
    "ERROR", "OK", "PERIOD_NS", "WARN", "Drill", "Graph", "N", "Outcome", "Sender", "graph_of", "image_set_of", "load_rig",
    "recorded_and_ros", "run_drill",
]  # fmt: skip

PERIOD_NS = round(1e9 / 30.0)
TIMEOUT_S = 240.0
QUEUE_S = 0.2
_BACK_AND_FORTH = [*range(N), *range(N - 2, 0, -1)]  # so that the body never jumps


@dataclass(frozen=True)
class Outcome:
    """What was seen, and which data were lost; ``expected`` is False where the drill found something else."""

    seen: str
    lost: str
    expected: bool = True
    skipped: bool = False


@dataclass(frozen=True)
class Drill:
    """A fault, what is expected of the graph, and what injects it."""

    name: str
    expected: str
    inject: Callable[[Graph], Outcome]


class Graph:
    """Processes, and a node of this process that listens to them and can stand where cameras stand."""

    def __init__(self, folder: Path, recording: Path):
        self.folder, self.recording = folder, recording
        self.probe = Probe()
        self.said: list[tuple[str, bytes, str]] = []
        self.values: dict[str, dict[str, str]] = {}
        self.states: list[TrackedState] = self.probe.listen(TrackedState, "tracker/state")
        self._processes: list[NodeProcess] = []
        self._config = folder / "tracker.yaml"
        self._config.write_text(f"synchronizer: {{queue_s: {QUEUE_S}}}\n")
        self.probe.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 100)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.said.append((status.name, status.level, status.message))
            self.values[status.name] = {pair.key: pair.value for pair in status.values}

    def launch(self, *arguments: str | Path, **env: str) -> NodeProcess:
        """``tracker_node <verb>`` as a process, with further variables of its environment."""
        self._processes.append(NodeProcess(*arguments, env=env))
        return self._processes[-1]

    def tracker(self, *options: str) -> NodeProcess:
        """The tracker of the recording's body."""
        return self.launch("tracker", *files_of(self.recording), "--config", self._config, *options)

    def ingest(self, *options: str | Path) -> NodeProcess:
        """Cameras that show the recording again and again, in real time."""
        rig = ["--rig", self.recording / "rig.yaml", "--rate", "10", "--loop", "--preload"]
        return self.launch("camera_ingest", *rig, *options)

    def kill(self, process: NodeProcess) -> None:
        """With -9: it can say nothing any more."""
        process.interrupt(signal.SIGKILL)
        process.wait()

    def until(self, predicate: Callable[[], object], what: str) -> None:
        self.probe.spin_until(lambda: bool(predicate()), what, TIMEOUT_S)

    def wait_for_states(self, n: int) -> None:
        """``n`` more states."""
        wanted = len(self.states) + n
        self.until(lambda: len(self.states) >= wanted, f"{n} more states")

    def wait_said(self, part: str, level: bytes, *texts: str, since: int = 0) -> str:
        """The first message of a part of /diagnostics with this level and these texts."""

        def found() -> str | None:
            for name, said_level, message in self.said[since:]:
                if name.endswith(part) and said_level == level and all(text in message for text in texts):
                    return message
            return None

        try:
            self.until(found, "")
        except AssertionError:
            said = sorted({message for name, _, message in self.said[since:] if name.endswith(part)})
            raise AssertionError(f"expected that '{part}' says '{' ... '.join(texts)}', it said {said}") from None
        return str(found())

    def count(self, part: str, key: str) -> int:
        """A count of /diagnostics."""
        return int(self.values.get(part, {}).get(key, "0"))

    def spin(self, seconds: float) -> None:
        until_s = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > until_s, "time")

    def sender(self) -> Sender:
        return Sender(self)

    def close(self) -> None:
        for process in self._processes:
            process.close()
        self.probe.close()


class Sender:
    """The cameras of the recording as this process, whose images can be spoilt one by one."""

    def __init__(self, graph: Graph):
        self._graph, self.rig = graph, load_rig(graph.recording / "rig.yaml")
        self.cameras = Cameras(graph.probe, graph.recording, self.rig)
        self.number = 0
        self.offset_ns = 10**9

    def stamp_ns(self, number: int) -> int:
        return self.offset_ns + number * PERIOD_NS

    def message(self, camera: str, number: int, shift_ns: int = 0) -> Image:
        shown = image_set_of(self._graph.recording, _BACK_AND_FORTH[number % len(_BACK_AND_FORTH)])
        pixels = next(image.pixels for image in shown.images if image.camera == camera)
        return image_message(self.stamp_ns(number) + shift_ns, self.rig[camera].frame_id, pixels)

    def publish(self, camera: str, message: Image) -> None:
        self.cameras.images[camera].publish(message)

    def sets(self, n: int = 1, damage: dict[str, Callable[[Image], Sequence[Image]]] | None = None, shift_ns: int = 0) -> None:
        """The next sets; ``damage`` makes of a camera's image what is sent instead, ``shift_ns`` is of cam2's stamps."""
        for _ in range(n):
            for camera in self.rig.names:
                message = self.message(camera, self.number, shift_ns if camera == "cam2" else 0)
                for sent in (damage or {}).get(camera, lambda image: [image])(message):
                    self.publish(camera, sent)
            self.number += 1

    def tracked(self, n: int) -> None:
        """The next sets, and their states."""
        before = len(self._graph.states)
        self.sets(n)
        self._graph.until(lambda: len(self._graph.states) >= before + n, f"{n} states of {n} sound image sets")


@contextmanager
def graph_of(recording: Path) -> Iterator[Graph]:
    """A graph of its own, gone with the block."""
    with tempfile.TemporaryDirectory(prefix="faults_") as name:
        graph = Graph(Path(name), recording)
        try:
            yield graph
        finally:
            graph.close()


def run_drill(drill: Drill, recording: Path) -> Outcome:
    """Inject the fault; what does not happen, or ends in an error, is not as expected, and the next drill can be run."""
    with graph_of(recording) as graph:
        try:
            return drill.inject(graph)
        except AssertionError as error:
            return Outcome(_first_line(error), "?", expected=False)
        except Exception as error:
            return Outcome(f"{type(error).__name__}: {_first_line(error)}", "?", expected=False)


def _first_line(error: Exception) -> str:
    return next(iter(str(error).splitlines()), "(without a text)")


@contextmanager
def recorded_and_ros() -> Iterator[Path]:
    """The recording of the small arm, ROS in this process; killed processes' shared memory is removed at the end."""
    before = shared_memory_files()
    with tempfile.TemporaryDirectory(prefix="arm_") as name, ros_context():
        write_recording(Path(name) / "arm", N)
        yield Path(name) / "arm"
    remove_left_segments(before)
