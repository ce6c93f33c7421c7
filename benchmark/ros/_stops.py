"""Processes at a moment at which they are stopped: each node, at random times in what it does longest."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "test"))

from diagnostic_msgs.msg import DiagnosticArray

from helpers.ros.graph import NodeProcess, Probe
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import dump_state
from tracker_node.model.configuration import State

HUMAN = Path(__file__).resolve().parents[2] / "config/models/human.yaml"
VERB = [sys.executable, "-m", "tracker_node.cli.main"]


@dataclass
class Scene:
    """A running graph for one stop.

    Parameters
    ----------
    folder : to write to, of this stop alone.
    recording : of a small arm, with rig, body and state.
    """

    probe: Probe
    folder: Path
    recording: Path
    random: random.Random
    bags: list[Path] = field(default_factory=list)
    processes: list[NodeProcess] = field(default_factory=list)
    said: set[tuple[str, str]] = field(default_factory=set)

    def launch(self, *arguments: str | Path, **env: str) -> NodeProcess:
        self.processes.append(NodeProcess(*arguments, env=env))
        return self.processes[-1]

    def cameras(self, *options: str | Path) -> NodeProcess:
        rig = ("--rig", self.recording / "rig.yaml", "--rate", "15", "--loop", "--preload")
        return self.launch("camera_ingest", *rig, *options)

    def tracker(self, *options: str | Path, **env: str) -> NodeProcess:
        """Of a human, which these images do not show: it is looked for, limb by limb."""
        return self.launch("tracker", "--rig", self.recording / "rig.yaml", "--model", HUMAN, *options, **env)

    def arm(self) -> list[str | Path]:
        """The body that the images show."""
        files = {"--rig": "rig.yaml", "--model": "model.yaml", "--initial-state": "state.yaml"}
        return [part for option, name in files.items() for part in (option, self.recording / name)]

    def bag(self) -> Path:
        self.bags.append(self.folder / "bag")
        return self.bags[-1]

    def wait(self, low_s: float, high_s: float) -> None:
        """A random time; the graph is served meanwhile."""
        until_s = time.monotonic() + self.random.uniform(low_s, high_s)
        self.probe.spin_until(lambda: time.monotonic() > until_s, "time goes on")

    def until_active(self) -> None:
        self.probe.spin_until(lambda: ("tracker: lifecycle", "active") in self.said, "the tracker is active")


def _starting(verb: str) -> Callable[[Scene], NodeProcess]:
    def begin(scene: Scene) -> NodeProcess:
        ends = {
            "camera_ingest": ["--rig", scene.recording / "rig.yaml", "--loop"],
            "tracker": scene.arm(),
            "recorder": ["--output", scene.folder / "bag", "--all"],
            "player": [scene.recording / "bag", "--loop"],
            "rectify": ["--cameras", "cam1", "cam2"],
            "keypoints": ["--rig", scene.recording / "rig.yaml"],
            "pipeline": [*scene.arm(), "--loop", "--bag", scene.folder / "bag"],
        }
        process = scene.launch(verb, *ends[verb])
        scene.wait(0.4, 5.0)  # the interpreter itself has come up
        if (scene.folder / "bag").exists():
            scene.bag()
        return process

    return begin


def _compiling(scene: Scene) -> NodeProcess:
    tracker = scene.tracker(NUMBA_CACHE_DIR=str(scene.folder / "cache"))
    scene.wait(3.0, 25.0)
    return tracker


def _searching(scene: Scene) -> NodeProcess:
    scene.cameras()
    tracker = scene.tracker()
    scene.until_active()
    scene.wait(1.0, 12.0)
    return tracker


def _searching_limbs(scene: Scene) -> NodeProcess:
    state = scene.folder / "state.yaml"
    human = load_model(HUMAN)
    dump_state(State.neutral(human), human, state)
    scene.cameras()
    tracker = scene.tracker("--initial-state", state)
    scene.until_active()
    scene.wait(1.0, 12.0)
    return tracker


def _tracking(scene: Scene) -> NodeProcess:
    scene.cameras()
    tracker = scene.launch("tracker", *scene.arm())
    scene.until_active()
    scene.wait(0.2, 3.0)
    return tracker


def _recording(scene: Scene) -> NodeProcess:
    scene.cameras()
    recorder = scene.launch("recorder", "--output", scene.bag(), "--all")
    scene.probe.spin_until(lambda: "ready" in recorder.out, "the recorder is ready")
    scene.wait(0.2, 3.0)
    return recorder


def _recording_input(scene: Scene) -> NodeProcess:
    cameras = scene.cameras("--record", scene.bag())
    scene.probe.spin_until(lambda: bool(list(scene.folder.glob("bag/*.mcap"))), "the bag is begun")
    scene.wait(0.2, 4.0)
    return cameras


def _playing(scene: Scene) -> NodeProcess:
    player = scene.launch("player", scene.recording / "bag", "--loop")
    scene.probe.spin_until(lambda: "messages of" in player.out, "the player plays")
    scene.wait(0.1, 2.0)
    return player


def _pipeline(searches: bool) -> Callable[[Scene], NodeProcess]:
    def begin(scene: Scene) -> NodeProcess:
        body = ["--rig", scene.recording / "rig.yaml", "--model", HUMAN] if searches else scene.arm()
        process = scene.launch("pipeline", *body, "--loop", "--images", "--bag", scene.bag())
        scene.until_active()
        scene.wait(0.5, 6.0)
        return process

    return begin


MOMENTS: dict[str, Callable[[Scene], NodeProcess]] = {
    **{
        f"{verb} starting": _starting(verb)
        for verb in ("camera_ingest", "tracker", "recorder", "player", "rectify", "keypoints", "pipeline")
    },
    "tracker compiling": _compiling,
    "tracker looking for the body": _searching,
    "tracker looking for limbs": _searching_limbs,
    "tracker tracking": _tracking,
    "recorder recording": _recording,
    "camera_ingest recording": _recording_input,
    "player playing": _playing,
    "pipeline recording": _pipeline(False),
    "pipeline looking for the body": _pipeline(True),
}


@dataclass(frozen=True)
class Stop:
    """How a process ended: the time that it took, its exit status, its bags and how many of them are sound."""

    seconds: float
    status: int
    bags: int
    sound: int


def stopped(moment: str, number: signal.Signals, scene: Scene) -> Stop:
    """Bring a process to the moment, stop it, and look at what it leaves."""
    scene.probe.node.create_subscription(DiagnosticArray, "/diagnostics", lambda m: _hear(scene, m), 100)
    process = MOMENTS[moment](scene)
    began_s = time.monotonic()
    process.interrupt(number)
    status = process.wait(60.0)
    seconds = time.monotonic() - began_s
    if status or "Traceback" in process.err:
        print(f"{moment}, {number.name}: status {status}\n{process.err}", file=sys.stderr)
    return Stop(seconds, status, len(scene.bags), sum(map(_is_sound, scene.bags)))


def _hear(scene: Scene, message: DiagnosticArray) -> None:
    scene.said.update((status.name, status.message) for status in message.status)


def _is_sound(bag: Path) -> bool:
    done = subprocess.run([*VERB, "bag", "check", str(bag)], capture_output=True, text=True, check=False)
    if done.returncode:
        print(f"{bag}: {done.stdout}{done.stderr}", file=sys.stderr)
    return done.returncode == 0


@contextmanager
def scene_in(folder: Path, recording: Path, seed: str) -> Iterator[Scene]:
    """A graph of its own; whatever is left in it at the end is killed."""
    folder.mkdir()
    scene = Scene(Probe(), folder, recording, random.Random(seed))
    try:
        yield scene
    finally:
        for process in scene.processes:
            process.close()
        scene.probe.close()
