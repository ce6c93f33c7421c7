"""Ingest, tracker, recorder, and a detector of people where it is asked for, as processes of one command.

They are started from the receiving end, so nothing is sent before everybody listens, and ended from the sending end, so nothing
that was sent is missed.
"""

from __future__ import annotations

import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from tracker_msgs.msg import TrackedState

from ..loaders.bag.message_types import BODIES, KEYPOINTS
from ..loaders.source_address import sources_for_child
from ..runs.load import TOPIC
from ..runs.messages import CAMERA_INFO, IMAGE
from ..runs.outputs import BODY_OUTPUTS, CAMERA_OUTPUTS, DESCRIPTION, MARKER_ARRAY, MARKERS, Output, recorded
from ..runs.writer import counted_sets, write_summary
from ..tracking.estimate import Status, known_sets
from .child_process import Child
from .ending import asked_again
from .executor import ros_process, spin
from .guarded_node import GuardedNode
from .qos import RESULT

RECORDER_READY, DETECTOR_READY = "recorder: ready", "keypoints: ready"
_READY_S = 900.0  # on the first start of all, inner loops are compiled
_TELL_S = 10.0  # without a process being ready, after which that is said
_END_S = 60.0  # a tracker may still have image sets to track, a recorder messages to write
_HURRY_S = 0.3  # for the cameras and the tracker, when somebody wants it to end
_LEAVE_S = 3.0
_LAST_STATES_S = 0.3  # on their way to us when the tracker has ended
_N_LISTENERS = 2  # to the state: the ingest (its flow control) and this process; with a recorder one more


@dataclass(frozen=True)
class PipelineOptions:
    """What runs.

    Parameters
    ----------
    body : options of ``tracker_node tracker``.
    source : options of ``tracker_node camera_ingest``.
    sources : camera -> source, instead of the rig's; handed over where nobody else can read a password in them.
    cameras : names, for the topics.
    bodies : of several that are tracked together, name, for the topics -> file of its model; empty: there is one.
    joining : names of those among them who may join.
    bag : folder to record to, or None.
    masks, overlays, masked_images, markers, images : record these too.
    recorder : further options of ``tracker_node recorder``.
    detector : options of ``tracker_node keypoints``; None: it is not started.
    own_detector : somebody else's publishes points.
    lossless : every image set is tracked, as fast as the tracker can; otherwise in real time, the newest wins.
    n_expected : image sets, for the progress; None if not known.
    modalities : of the tracker, which alone has no detector and compares outlines.
    ros_args : given to every process.
    folder : of the run, for ``run.json``; None: it is not written.
    summary : what ``run.json`` says from the beginning.
    """

    body: list[str]
    source: list[str]
    cameras: tuple[str, ...]
    bodies: dict[str, str] = field(default_factory=dict)
    joining: tuple[str, ...] = ()
    sources: dict[str, str] = field(default_factory=dict)
    bag: Path | None = None
    masks: bool = False
    overlays: bool = False
    masked_images: bool = False
    markers: bool = False
    images: bool = False
    recorder: list[str] = field(default_factory=list)
    detector: list[str] | None = None
    own_detector: bool = False
    lossless: bool = True
    n_expected: int | None = None
    modalities: Sequence[str] = ()
    ros_args: list[str] = field(default_factory=list)
    folder: Path | None = None
    summary: dict[str, Any] = field(default_factory=dict)

    def recorded_topics(self) -> list[str]:
        """``name:type`` of everything that goes into the bag."""
        of_body, of_cameras = self._recorded_outputs
        topics = ["/diagnostics:diagnostic_msgs/msg/DiagnosticArray", *([f"tracker/bodies:{BODIES}"] if self.bodies else [])]
        for of in self.prefixes:
            topics += [f"tracker/{of}{output.topic}:{output.type_name}" for output in of_body]
            topics.append(of + DESCRIPTION)  # latched: recorded when its publisher is there and has said so
            if self.markers:
                topics.append(f"tracker/{of}{MARKERS}:{MARKER_ARRAY}")
            topics += [f"tracker/{of}{name}/{output.topic}:{output.type_name}" for name in self.cameras for output in of_cameras]
        if find_spec("tf2_msgs") is not None:
            topics += ["/tf:tf2_msgs/msg/TFMessage", "/tf_static:tf2_msgs/msg/TFMessage"]
        for camera in self.cameras:
            topics.append(f"{camera}/camera_info:{CAMERA_INFO}")
            if self.detector is not None or self.own_detector:
                topics.append(f"{camera}/keypoints:{KEYPOINTS}")
            if self.images:
                topics.append(f"{camera}/image_raw:{IMAGE}")
        return topics

    @property
    def prefixes(self) -> tuple[str, ...]:
        """Before the tracker's topics of each body; the last one's state is the last that is said of an image set."""
        return tuple(f"{name}/" for name in self.bodies) or ("",)

    def recorded_names(self) -> list[str]:
        """Outputs of the tracker that go into the bag."""
        of_body, of_cameras = self._recorded_outputs
        return [output.name for output in (*of_body, *of_cameras)] + [MARKERS] * self.markers

    @property
    def _recorded_outputs(self) -> tuple[list[Output], list[Output]]:
        """Of the body, of each camera."""
        requested = ["mask"] * self.masks + ["overlay"] * self.overlays + ["masked_image"] * self.masked_images
        return recorded(BODY_OUTPUTS, requested), recorded(CAMERA_OUTPUTS, requested)


@dataclass
class Progress:
    """What the states have said so far."""

    sets: int = 0
    status: Status = Status.INITIALIZING
    residual: str = ""
    statuses: Counter = field(default_factory=Counter)
    first_s: float = 0.0

    def add(self, message: TrackedState) -> None:
        self.sets += 1
        self.first_s = self.first_s or time.monotonic()
        self.status, self.residual = Status(message.status), f"{message.residual:.1f} {message.residual_unit}"
        self.statuses[self.status] += 1

    @property
    def came(self) -> bool:
        """Whether the body was ever known; there are seats for people who may join."""
        return any(n for status, n in self.statuses.items() if status.known)

    def line(self, n_expected: int | None) -> str:
        elapsed_s = time.monotonic() - self.first_s if self.first_s else 0.0
        rate = (self.sets - 1) / elapsed_s if elapsed_s > 0 else 0.0
        total = f"/{n_expected}" if n_expected else ""
        return f"{self.sets}{total} image sets, {rate:.1f} a second, {self.status.name}, {self.residual}"


class Pipeline:
    """The processes, and what is known of them; use `run_pipeline`."""

    def __init__(self, options: PipelineOptions, node: GuardedNode, stop: threading.Event):
        self._options, self._node, self._stop = options, node, stop
        self._children: dict[str, Child] = {}
        self.progress = {name: Progress() for name in options.bodies or ("",)}
        self._shown_s = 0.0
        self.interrupted = False
        self._recorder_ready, self._detector_ready = threading.Event(), threading.Event()
        self._last = f"tracker/{options.prefixes[-1]}"
        self._subscriptions = [
            node.create_subscription(TrackedState, f"tracker/{of}state", progress.add, RESULT)
            for of, progress in zip(options.prefixes, self.progress.values(), strict=True)
        ]

    def run(self) -> int:
        """Until the sources have ended, or something or somebody ends it; returns the exit status."""
        try:
            if self._start():
                self._spin(lambda: any(child.returncode is not None for child in self._children.values()))
        finally:
            status = self._end()
        return status

    def _start(self) -> bool:
        options = self._options
        if options.bag is not None:
            topics = [self._resolved(topic) for topic in options.recorded_topics()]
            arguments = ["recorder", "--output", str(options.bag), "--topics", *topics, *options.recorder, *options.ros_args]
            self._children["recorder"] = Child(arguments, self._on_recorder_line)
            if not self._wait_for("the recorder", self._recorder_ready.is_set):
                return False
        *others, last = options.prefixes
        listeners = [f"{last}state={_N_LISTENERS - (not options.lossless) + (options.bag is not None)}"]
        listeners += [f"{of}state={1 + (options.bag is not None)}" for of in others]
        if options.bag is not None:
            listeners += [f"{of}{name}=1" for of in options.prefixes for name in options.recorded_names() if name != "state"]
        lossless = ["--lossless"] if options.lossless else []
        tracker = ["tracker", *options.body, *lossless, "--end-on-failure", "--wait-for", *listeners]
        chosen = ["--ros-args", "-p", f"modalities:=[{', '.join(options.modalities)}]", "--"] if options.modalities else []
        self._children["tracker"] = Child([*tracker, *chosen, *options.ros_args])
        if options.detector is not None:
            arguments = ["keypoints", *options.detector, *options.ros_args]
            self._children["keypoints"] = Child(arguments, self._on_detector_line)
        if not self._wait_for("the tracker", self._tracker_is_there):
            return False
        if options.detector is not None and not self._wait_for("the detector of people", self._detector_ready.is_set):
            return False
        recorded = options.bag is not None
        pace = ["--as-fast-as-consumed", "--consumer", self._last.rstrip("/")] if options.lossless else []
        n_subscribers = 1 + (recorded and options.images) + (options.detector is not None)
        waits = ["--wait-for-subscribers", str(n_subscribers)]
        waits += ["--wait-for-info-subscribers", str(1 + recorded)]
        arguments = ["camera_ingest", *options.source, *pace, *waits]
        self._children["camera_ingest"] = Child(
            [*arguments, *options.ros_args], lambda line: None, environment=sources_for_child(options.sources)
        )
        return True

    def _tracker_is_there(self) -> bool:
        return all(subscription.get_publisher_count() > 0 for subscription in self._subscriptions)

    def _resolved(self, topic: str) -> str:
        name, colon, type_name = topic.partition(":")
        return self._node.resolve_topic_name(name) + colon + type_name

    def _on_recorder_line(self, line: str) -> None:
        if line.startswith(RECORDER_READY):
            self._recorder_ready.set()
        else:
            self._say(line)

    def _on_detector_line(self, line: str) -> None:
        if line.startswith(DETECTOR_READY):
            self._detector_ready.set()

    def _wait_for(self, what: str, ready: Callable[[], bool]) -> bool:
        began_s = time.monotonic()
        until_s, tell_s = began_s + _READY_S, began_s + _TELL_S

        def over() -> bool:
            nonlocal tell_s
            if time.monotonic() > tell_s:
                self._say(f"waiting for {what}: on a first start inner loops are compiled, which takes minutes")
                tell_s = until_s
            ended = any(child.returncode is not None for child in self._children.values())
            return ready() or ended or time.monotonic() > until_s

        self._spin(over)
        if not ready() and not self._stop.is_set():
            self._say(f"{what} did not start")
        return ready()

    def _spin(self, done: Callable[[], bool]) -> None:
        def done_with_progress() -> bool:
            self._show()
            return done()

        spin(self._node, self._stop, done_with_progress)

    def _show(self, last: bool = False) -> None:
        now, terminal = time.monotonic(), sys.stderr.isatty()
        each = list(self.progress.values())
        progress = next((one for one in each if one.status.known), each[-1])
        if not progress.sets or (not last and now - self._shown_s < (0.2 if terminal else 5.0)):
            return
        self._shown_s = now
        end = "\r" if terminal and not last else "\n"
        print(f"pipeline: {progress.line(self._options.n_expected):<75}", end=end, file=sys.stderr, flush=True)

    @staticmethod
    def _say(text: str) -> None:
        print(text if text.startswith("recorder:") else f"pipeline: {text}", file=sys.stderr, flush=True)

    def _end(self) -> int:
        """From the sending end to the receiving end; each passes on what it has, or ends soon if that is asked for."""
        status = 0
        asked = self._stop.is_set()
        if asked:
            self._interrupt("camera_ingest", "tracker", "keypoints")
            self._wait(_HURRY_S, lambda: self._ended("camera_ingest") and self._ended("tracker"))
            self._interrupt("recorder")  # by now nothing more comes, or nothing that could be waited for
        for verb in ("camera_ingest", "tracker", "keypoints", "recorder"):
            child = self._children.get(verb)
            if child is None:
                continue
            unasked = child.returncode is not None and verb != "camera_ingest" and not asked
            if not self._stop.is_set():
                child.finish()
                self._wait(_END_S, partial(self._ended_or, verb, self._stop.is_set))
            elif asked:  # a recorder may still have messages to write
                self._wait(_END_S, partial(self._ended_or, verb, asked_again))
            code = child.end(timeout_s=_LEAVE_S)
            if code or unasked:
                self._say(f"{verb} ended {'by itself ' if unasked else ''}with status {code}")
                status = status or code or 1
            if verb == "tracker" and not asked:
                self._wait(_LAST_STATES_S, lambda: False)
        self._show(last=True)
        self.interrupted = self._stop.is_set()
        return status

    def _interrupt(self, *verbs: str) -> None:
        for verb in verbs:
            if verb in self._children:
                self._children[verb].interrupt()

    def _ended(self, verb: str) -> bool:
        return verb not in self._children or self._children[verb].returncode is not None

    def _ended_or(self, verb: str, impatient: Callable[[], bool]) -> bool:
        return self._ended(verb) or impatient()

    def _wait(self, seconds: float, done: Callable[[], bool]) -> None:
        until_s = time.monotonic() + seconds

        def over() -> bool:
            self._show()
            return done() or time.monotonic() > until_s

        spin(self._node, threading.Event(), over)


def run_pipeline(options: PipelineOptions) -> tuple[int, dict[str, Progress], bool]:
    """Run it to its end; returns the exit status, what the states of each body have said, and whether somebody has ended it."""
    if options.folder is not None:
        write_summary(options.folder, options.summary)  # now, for a run that is killed
    with ros_process(options.ros_args, forced=False) as stop:
        node = GuardedNode("pipeline")
        try:
            topics = {name: node.resolve_topic_name(f"tracker/{name}/state") for name in options.bodies}
            pipeline = Pipeline(options, node, stop)
            status = pipeline.run()
        finally:
            node.destroy_node()
    if options.folder is not None:
        write_summaries(options, options.folder, pipeline.progress, topics)
    return status, pipeline.progress, pipeline.interrupted


def write_summaries(options: PipelineOptions, folder: Path, progress: Mapping[str, Progress], topics: Mapping[str, str]) -> None:
    """``run.json``, of several bodies with the figures of the one that was known in the fewest image sets, and one for each body.

    Parameters
    ----------
    options : what has run.
    folder : of the run; each of several bodies has a folder there, by which its states in the bag are found.
    progress : what the states of each body have said.
    topics : of the states of each of several bodies.
    """
    counted = {name: counted_sets(each.statuses) for name, each in progress.items()}
    there = [name for name, each in progress.items() if each.came or name not in options.joining]
    expected = [name for name in there if name not in options.joining]
    worst = min(expected or there or progress, key=lambda name: known_sets(counted[name]["status_counts"]))
    several = {"bodies": counted} if options.bodies else {}
    write_summary(folder, {**counted[worst], **options.summary, **several})
    for name in there if several else ():
        asked = {**options.summary.get("options", {}), "model": options.bodies[name]}
        write_summary(folder / name, {**counted[name], **options.summary, "options": asked, TOPIC: topics[name]})
