#!/usr/bin/env python3
"""Whether it runs for hours: six 640x480 cameras at 30 Hz, ingest, tracker and recorder, with an eye on memory and losses.

Four processes: `tracker_node camera_ingest` sends decoded images (a recording forward and backward, again and again: the body
never jumps), `tracker_node tracker` tracks them as they come, `tracker_node recorder` takes its results, and this one listens.

An image set is lost if no state of its stamp has come; the start (the first tenth, five minutes at most) is not judged. Every
image that the tracker has received must be in its accounts, used or left out for a reason; what is in none is `unaccounted`. What
the ingest has published and the tracker has not received is `lost_in_transport`: images are best effort, and a receiver that gets
no time of the processor misses some. Memory is the share that each process has of its pages (Pss), fitted by a robust line (Theil
and Sen) from the end of the start; growth is what the line rises by until the end, in percent of where it began. The bag is
written in files of a minute, and all but the last ones are deleted once they have been counted, so that the disk does not fill.
Exit status 1 when image sets are lost, unaccounted or not recorded. Ctrl-C ends it early, with the figures so far.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.stats import theilslopes

from tracker_node.errors import TrackerError
from tracker_node.report.metrics_file import report_metrics
from tracker_node.runs.config_file import dump_config
from tracker_node.synthesis.recording import Request
from tracker_node.tracking.config import TrackerConfig

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark.contour._runs import DEFAULT_CACHE, Clip, configured, print_circumstances, recorded
from benchmark.ros.live import N_IMAGES, there_and_back
from benchmark.ros.transport import wait_until

RATE_HZ, MINUTES = 30.0, 60.0
PATIENCE_S = 120.0  # the tracker may have to compile
QUIET_S = 3.0  # after the last image: two reports on /diagnostics
START_SHARE, START_MOST_S = 0.1, 300.0
SPLIT_S, KEPT_FILES = 60.0, 3
RESULTS = ("state:tracker_msgs/msg/TrackedState", "pose:geometry_msgs/msg/PoseWithCovarianceStamped")
NOT_REASONS = ("images per second", "received", "lost in transport")  # in the tracker's accounts of a camera
FATES = ("used", "late", "duplicate", "incomplete", "too_old", "ahead", "clock_jump", "reset", "waiting")


Metrics = dict[str, float | int]


@dataclass(frozen=True)
class Plan:
    """What is run, for how long."""

    clip: Clip
    config: TrackerConfig
    body: str = "person.yaml"
    seconds: float = 60.0 * MINUTES
    rate_hz: float = RATE_HZ

    @property
    def start_s(self) -> float:
        return min(START_SHARE * self.seconds, START_MOST_S)


@dataclass
class Heard:
    """What the listener has heard so far; stamps in ns, times in s of the steady clock."""

    sent_ns: list[int] = field(default_factory=list)
    arrivals_ns: dict[int, int] = field(default_factory=dict)  # stamp -> arrival
    accounts: dict[str, dict[str, str]] = field(default_factory=dict)  # part of /diagnostics -> its values
    memory: dict[str, list[tuple[float, float]]] = field(default_factory=dict)  # process -> (time, MB)

    def latencies_ms(self, from_ns: int = 0) -> np.ndarray:
        arrivals = list(self.arrivals_ns.items())  # at once: others come meanwhile
        return np.array([1e-6 * (arrival - stamp) for stamp, arrival in arrivals if stamp >= from_ns])

    def lost(self, from_ns: int, to_ns: int) -> int:
        return sum(stamp not in self.arrivals_ns for stamp in self.sent_ns if from_ns <= stamp < to_ns)


def memory_mb(pid: int) -> float:
    """Proportional set size: a process's own pages, and its part of those that it shares."""
    text = Path(f"/proc/{pid}/smaps_rollup").read_text()
    return int(re.search(r"^Pss:\s+(\d+) kB", text, re.MULTILINE)[1]) / 1e3  # type: ignore[index]


def growth_percent(samples: list[tuple[float, float]], from_s: float) -> float:
    """What a robust line through (time, MB) rises by from ``from_s`` to the end, in percent of its value there.

    Raises
    ------
    TrackerError : less than two samples from there on.
    """
    judged = [sample for sample in samples if sample[0] >= from_s]
    if len(judged) < 2:
        raise TrackerError("too short: memory was not looked at twice after the start; nothing can be said")
    times, values = np.array(judged).T
    slope, intercept, _, _ = theilslopes(values, times)
    return float(100.0 * slope * (times[-1] - times[0]) / (intercept + slope * times[0]))


class Files:
    """The recorder's files: counted and deleted as they are finished."""

    def __init__(self, bag: Path):
        self._bag, self._counted = bag, Counter[str]()

    def sweep(self, keep: int) -> None:
        """Count all finished files but the newest ``keep``, and delete them."""
        files = sorted(self._bag.glob("*.mcap"), key=lambda file: int(file.stem.rpartition("_")[2]))
        for file in files[: len(files) - keep]:
            self._counted += _message_counts(file)
            file.unlink()

    def counts(self) -> Counter[str]:
        """Messages by topic, once the recorder has ended."""
        self.sweep(0)
        return self._counted


def _message_counts(file: Path) -> Counter[str]:
    from mcap.reader import make_reader

    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    if summary is None or summary.statistics is None:
        raise TrackerError(f"{file}: not finished")
    counts = summary.statistics.channel_message_counts
    return Counter({summary.channels[number].topic: n for number, n in counts.items()})


def measure(
    plan: Plan, say: Callable[[str], None] = print, stopped: Callable[[], bool] = lambda: False
) -> dict[str, float | int]:
    """Run the processes until the time is over or somebody stops them; the figures."""
    from tracker_node.ros.executor import ros_process, spin

    heard = Heard()
    with tempfile.TemporaryDirectory(prefix="soak_") as name, ros_process([]) as interrupted:
        folder, done = Path(name), threading.Event()
        node = _listener(plan, heard)
        spinner = threading.Thread(target=spin, args=(node, done), daemon=True)
        spinner.start()
        try:
            return _run(plan, folder, heard, say, lambda: interrupted.is_set() or stopped())
        finally:
            done.set()
            spinner.join(timeout=5.0)
            node.destroy_node()


def _listener(plan: Plan, heard: Heard):
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.node import Node
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import CameraInfo
    from tracker_msgs.msg import TrackedState

    from tracker_node.ros.conversions import stamp_ns_of

    def on_state(message: TrackedState) -> None:
        heard.arrivals_ns[stamp_ns_of(message.header.stamp)] = time.time_ns()

    def on_diagnostics(message: DiagnosticArray) -> None:
        for status in message.status:
            heard.accounts[status.name] = {pair.key: pair.value for pair in status.values}

    node, quality = Node("soak_benchmark"), QoSProfile(depth=1000)
    first = plan.clip.rig.names[0]
    node.create_subscription(
        CameraInfo, f"{first}/camera_info", lambda m: heard.sent_ns.append(stamp_ns_of(m.header.stamp)), quality
    )
    node.create_subscription(TrackedState, "tracker/state", on_state, quality)
    node.create_subscription(DiagnosticArray, "/diagnostics", on_diagnostics, quality)
    return node


def _run(
    plan: Plan, folder: Path, heard: Heard, say: Callable[[str], None], stopped: Callable[[], bool]
) -> dict[str, float | int]:
    from tracker_node.ros.child_process import Child

    rig_file, bag = there_and_back(plan.clip, folder), folder / "bag"
    dump_config(plan.config, folder / "tracker.yaml")
    body = ["--model", str(plan.clip.folder / plan.body), "--initial-state", str(plan.clip.folder / "state.yaml")]
    lines: dict[str, list[str]] = {"ingest": [], "tracker": [], "recorder": []}
    topics = [f"/tracker/{topic}" for topic in RESULTS]
    commands = {
        "recorder": ["recorder", "--output", str(bag), "--split-s", f"{SPLIT_S:g}", "--topics", *topics],
        "tracker": ["tracker", "--rig", str(rig_file), *body, "--config", str(folder / "tracker.yaml"),
                    "--wait-for", "state=2", "pose=1"],
        "ingest": ["camera_ingest", "--rig", str(rig_file), "--rate", str(plan.rate_hz), "--loop", "--preload", "--no-frame-skip",
                   "--wait-for-subscribers", "1", "--wait-for-info-subscribers", "1"],
    }  # fmt: skip
    children: dict[str, Child] = {}
    try:
        for name, command in commands.items():
            children[name] = Child(command, lines[name].append)
        wait_until("the first state", lambda: bool(heard.arrivals_ns) or _ended(children) is not None or stopped(), PATIENCE_S)
        files = Files(bag)
        began_s = time.monotonic()
        from_ns = time.time_ns() + round(1e9 * plan.start_s)
        _watch(plan, children, heard, files, began_s, say, stopped)
        to_ns, run_s = time.time_ns() - round(1e9), time.monotonic() - began_s
        children["ingest"].end(30.0)
        time.sleep(QUIET_S)
    finally:
        for name in reversed(commands):
            if name in children:
                children[name].end(60.0)
    for text in (line for name in commands for line in lines[name]):
        say(text)
    published = {m[1]: int(m[2]) for line in lines["ingest"] for m in [re.match(r"(\w+): (\d+) published", line)] if m}
    return figures(heard, files.counts(), published, (from_ns, to_ns), began_s + plan.start_s, run_s)


def _ended(children: dict) -> str | None:
    return next((name for name, child in children.items() if child.returncode is not None), None)


def _watch(plan: Plan, children: dict, heard: Heard, files: Files, began_s: float, say, stopped) -> None:
    """Sample memory, delete old files, say how it goes; until the time is over."""
    every_s, told_s = max(1.0, plan.seconds / 1000.0), began_s
    while (now := time.monotonic()) - began_s < plan.seconds and not stopped():
        gone = _ended(children)
        if gone is not None:
            raise TrackerError(f"{gone} has ended by itself, with exit status {children[gone].returncode}")
        for name, child in children.items():
            heard.memory.setdefault(name, []).append((now, memory_mb(child.pid)))
        files.sweep(KEPT_FILES)
        if now - told_s >= max(10.0, plan.seconds / 100.0):
            told_s = now
            memory = ", ".join(f"{name} {samples[-1][1]:.0f} MB" for name, samples in heard.memory.items())
            latencies = heard.latencies_ms(time.time_ns() - 10**10)
            latency = f"p99 {np.percentile(latencies, 99):.0f} ms" if len(latencies) else "none in the last 10 s"
            say(f"{(now - began_s) / 60.0:.1f} min: {len(heard.arrivals_ns)} states, {latency}, {memory}")
        time.sleep(every_s)


def figures(
    heard: Heard, recorded_counts: Counter[str], published: dict[str, int], span_ns: tuple[int, int], from_s: float, run_s: float
) -> Metrics:
    """The metrics of a run that took ``run_s``, of which what came from ``from_s`` on, or within ``span_ns``, is judged.

    Raises
    ------
    TrackerError : it was too short.
    """
    if span_ns[1] <= span_ns[0] or not {"tracker: status", "tracker: image sets"} <= set(heard.accounts):
        raise TrackerError(f"too short: stopped after {run_s:.0f} s, before anything was judged")
    status, sets = heard.accounts["tracker: status"], heard.accounts["tracker: image sets"]
    growth = {name: growth_percent(samples, from_s) for name, samples in heard.memory.items()}
    latencies = heard.latencies_ms(span_ns[0])
    tracked, skipped = int(status["image sets tracked"]), int(status["image sets skipped"])
    formed = int(sets["complete"]) + int(sets["of fewer cameras"])
    accounted = {camera: _arrived(heard.accounts[f"tracker: {camera}"]) for camera in published}
    used = sum(int(heard.accounts[f"tracker: {camera}"]["used"]) for camera in published)
    missing = {camera: n - accounted[camera] for camera, n in published.items()}
    # Images that are on their way while their process ends may go down with it: the last set, where it has no state.
    cut_off = max(heard.sent_ns) not in heard.arrivals_ns
    result: Metrics = {
        "soak.minutes": run_s / 60.0,
        "soak.cameras": len(published),
        "soak.images": sum(published.values()),
        "soak.sets": sum(span_ns[0] <= stamp < span_ns[1] for stamp in heard.sent_ns),
        "soak.tracked": tracked,
        "soak.images_used": used,
        "soak.images_left_out": sum(accounted.values()) - used,
        "soak.lost": heard.lost(*span_ns),
        "soak.skipped": skipped,
        "soak.not_formed": sum(int(n) for name, n in sets.items() if name.startswith("not formed")),
        "soak.lost_in_transport": sum(n - cut_off if n > 0 else n for n in missing.values()),
        "soak.unaccounted_images": sum(abs(_unaccounted(heard.accounts[f"tracker: {camera}"])) for camera in published),
        "soak.unaccounted_sets": formed - tracked - skipped,
        "soak.recorder_lost": tracked - recorded_counts["/tracker/state"],
        "soak.memory_growth_percent": max(growth.values()),
    }
    for percent in (50, 95, 99):
        result[f"soak.latency_ms_p{percent}"] = float(np.percentile(latencies, percent)) if len(latencies) else float("nan")
    for name, samples in heard.memory.items():
        result |= {f"soak.{name}_growth_percent": growth[name], f"soak.{name}_mb": samples[-1][1]}
    return result


def all_sound(metrics: Metrics) -> bool:
    """Whether no image set was lost, and everything is in an account and in the bag."""
    return not any(metrics[f"soak.{name}"] for name in ("lost", "unaccounted_images", "unaccounted_sets", "recorder_lost"))


def _arrived(values: dict[str, str]) -> int:
    """Images of a camera in the tracker's accounts, whatever became of them."""
    return sum(int(n) for name, n in values.items() if name not in NOT_REASONS)


def _unaccounted(values: dict[str, str]) -> int:
    """Images that have gone to the synchronizer without a fate."""
    return int(values["received"]) - sum(int(values[fate]) for fate in FATES)


def main(arguments: list[str] | None = None) -> int:
    parser = parser_of(
        __doc__, "python benchmark/ros/soak.py --minutes 60 --set threads=2 --json out/benchmark/soak.json", "one minute"
    )
    parser.add_argument("--minutes", type=float, metavar="N", help=f"how long (default: {MINUTES:g}, one with --quick)")
    parser.add_argument("--rate", type=float, default=RATE_HZ, metavar="HZ", help="images per second (default: %(default)g)")
    parser.add_argument("--cache", type=Path, default=DEFAULT_CACHE, help="where recordings are kept (default: %(default)s)")
    parser.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE", dest="changes", help="parameters of the tracker")
    args = parser.parse_args(arguments)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    minutes = args.minutes or (1.0 if args.quick else MINUTES)
    try:
        clip = recorded(f"cones-{N_IMAGES}", Request(subject="model", motion="waves", n_images=N_IMAGES), args.cache)
        plan = Plan(clip, configured(args.changes), seconds=60.0 * minutes, rate_hz=args.rate)
        metrics = measure(plan, lambda text: print(text, flush=True))
    except TrackerError as error:
        print(f"soak: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(metrics, args.json)
    return 0 if all_sound(metrics) else 1


if __name__ == "__main__":
    sys.exit(main())
