"""Faults of processes and disks: killed and started again, bags that loop, disks that are full, files that are broken."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Callable
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

from benchmark.faults._graph import ERROR, OK, WARN, Drill, Graph, N, Outcome
from helpers.ros.graph import stamps
from tracker_node.errors import TrackerError
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.ros.conversions import stamp_ns_of

CAMERA = "tracker: cam2"
KILL_LOSS_S = 2.0  # what a killed recorder may cost
RESULTS = ("/tracker/state:tracker_msgs/msg/TrackedState", "/tracker/pose:geometry_msgs/msg/PoseWithCovarianceStamped")
LIVE = ("--wait-for-subscribers", "1")


def _camera_killed(graph: Graph) -> Outcome:
    config = graph.folder / "free_running.yaml"  # two processes do not expose together
    config.write_text("synchronizer: {image_period_s: 0.1, tolerance: 0.6}\n")
    graph.tracker("--config", str(config))
    graph.ingest("--cameras", "cam1", "cam3", *LIVE)
    camera = graph.ingest("--cameras", "cam2", *LIVE)
    graph.wait_for_states(10)
    graph.wait_said(CAMERA, OK, "receiving")
    graph.kill(camera)
    mark = len(graph.said)
    said = graph.wait_said(CAMERA, ERROR, "stopped sending images", since=mark)
    graph.wait_for_states(5)
    without = _n_cameras(graph.states[-1])
    graph.ingest("--cameras", "cam2", *LIVE)
    graph.wait_said(CAMERA, OK, "receiving", since=len(graph.said))
    graph.until(lambda: _n_cameras(graph.states[-1]) == 3, "sets of three cameras")
    return Outcome(
        f"ERROR cam2: {said}; tracked with {without} cameras; then OK with 3", "images of cam2 meanwhile", without == 2
    )


def _n_cameras(state) -> int:
    return sum(stamp.sec > 0 for stamp in state.camera_stamps)


def _ingest_killed(graph: Graph) -> Outcome:
    graph.tracker()
    ingest = graph.ingest(*LIVE)
    graph.wait_for_states(10)
    graph.kill(ingest)
    said = graph.wait_said("tracker: rate", WARN, "no image sets", since=len(graph.said))
    graph.ingest(*LIVE)
    graph.wait_for_states(10)
    graph.wait_said("tracker: rate", OK, "tracking", since=len(graph.said))
    return Outcome(f"WARN rate: {said}; then OK, tracking", "images meanwhile")


def _tracker_killed(graph: Graph) -> Outcome:
    tracker = graph.tracker()
    graph.ingest(*LIVE)
    bag = graph.folder / "bag"
    recorder = graph.launch("recorder", "--output", bag, "--topics", *RESULTS)
    graph.until(lambda: "ready" in recorder.out, "the recorder")
    graph.wait_for_states(10)
    graph.kill(tracker)
    n_before, killed_ns = len(graph.states), time.time_ns()
    graph.tracker("--wait-for", "state=2")  # this process and the recorder
    graph.wait_for_states(10)
    back_s = 1e-9 * (stamps(graph.states)[n_before] - killed_ns)
    recorder.interrupt()
    ended = recorder.wait()
    with BagReader(bag) as reader:
        recorded = {stamp_ns_of(state.header.stamp) for _, state in reader.decoded("/tracker/state")}
    missing = len(set(stamps(graph.states[n_before : n_before + 10])) - recorded)
    seen = f"cameras and recorder go on; states again after {back_s:.1f} s; {missing} of the next 10 missing in the bag"
    return Outcome(seen, "states meanwhile", ended == 0 and missing == 0)


def _recorder_killed(graph: Graph) -> Outcome:
    graph.tracker("--wait-for", "state=2")  # this process and the recorder
    bag, again = graph.folder / "bag", graph.folder / "again"
    recorder = graph.launch("recorder", "--output", bag, "--topics", *RESULTS)
    graph.until(lambda: "ready" in recorder.out, "the recorder")
    graph.ingest(*LIVE)
    graph.wait_for_states(50)
    killed_ns = time.time_ns()
    graph.kill(recorder)
    before = set(stamps(graph.states))
    graph.launch("recorder", "--output", again, "--topics", *RESULTS)
    with BagReader(bag) as reader:
        received_ns = {stamp_ns_of(state.header.stamp): at_ns for at_ns, state in reader.decoded("/tracker/state")}
        problem = reader.problem
    loss_s = 1e-9 * (killed_ns - max(received_ns.values()))
    missing = before - set(received_ns)
    n_gaps = sum(stamp < max(received_ns) for stamp in missing)
    graph.until(lambda: _n_recorded(again) >= 5, "states in the new recorder's bag")
    seen = f"the bag reads to {loss_s:.2f} s before the kill ({problem}), {n_gaps} states missing before; "
    seen += "tracking goes on, a new recorder takes over"
    lost = f"{len(missing)} states, {loss_s:.2f} s of at most {KILL_LOSS_S:g} s"
    return Outcome(seen, lost, loss_s <= KILL_LOSS_S and n_gaps == 0)


def _n_recorded(bag: Path) -> int:
    """States in a bag that is being written."""
    try:
        with BagReader(bag) as reader:
            return reader.topics["/tracker/state"].message_count
    except (TrackerError, KeyError):
        return 0


@contextmanager
def _small_disk(graph: Graph, megabytes: int):
    """A file system of its own, as root only."""
    place = graph.folder / "disk"
    place.mkdir()
    options = ["-t", "tmpfs", "-o", f"size={megabytes}m", "tmpfs", str(place)]
    mounted = (
        os.geteuid() == 0 and shutil.which("mount") and subprocess.run(["mount", *options], capture_output=True).returncode == 0
    )
    try:
        yield place if mounted else None
    finally:
        if mounted:
            subprocess.run(["umount", str(place)], check=True)


def _disk_full(min_free_mb: int, *texts: str) -> Callable[[Graph], Outcome]:
    def inject(graph: Graph) -> Outcome:
        with _small_disk(graph, 24) as place:
            if place is None:
                return Outcome("only root can mount a small file system", "", skipped=True)
            graph.tracker()
            options = ["--regex", "/cam[0-9]/image_raw", "--min-free-mb", str(min_free_mb)]
            recorder = graph.launch("recorder", "--output", place / "bag", *options)
            graph.until(lambda: "ready" in recorder.out, "the recorder")
            graph.ingest(*LIVE)
            graph.until(lambda: recorder.ended, "the recorder's end")
            said, status = graph.wait_said("recorder: bag", ERROR, "stopped", *texts), recorder.wait()
            with BagReader(place / "bag") as reader:
                n, problem = reader.message_count, reader.problem
            graph.wait_for_states(5)
        seen = f"ERROR recorder: {said}; it ends with exit status {status}; {n} images in a finished bag; tracking goes on"
        return Outcome(seen, "what came after", n > 0 and not problem and status == 1)

    return inject


def _bag_loops(graph: Graph) -> Outcome:
    """The recording as a bag, played again and again with its clock."""
    bag = graph.folder / "images"
    recorder = graph.launch("recorder", "--output", bag, "--regex", "/cam[0-9]/.*")
    graph.until(lambda: "ready" in recorder.out, "the recorder")
    source = graph.launch("camera_ingest", "--rig", graph.recording / "rig.yaml", "--rate", "10", "--wait-for-subscribers", "1",
                          "--wait-for-info-subscribers", "1", "--no-frame-skip")  # fmt: skip
    assert source.wait() == 0, source.err
    recorder.interrupt()
    assert recorder.wait() == 0, recorder.err
    graph.tracker("--lossless", "--ros-args", "-p", "use_sim_time:=true")
    graph.launch("player", bag, "--loop", "--wait-for-subscribers", "1")
    graph.until(lambda: len(_jumps(graph)) >= 3, "three jumps back, and states between them")
    graph.wait_said("tracker: clock", WARN, "went back")
    n, jumps = len(graph.states), _jumps(graph)
    sound = sum(state.status == 1 for state in graph.states[:n])
    n_lost = max(N - (b - a) for a, b in pairwise(jumps))
    seen = f"begins again at each of {len(jumps)} jumps back; {n} states, {sound} of them TRACKING"
    return Outcome(seen, f"{n_lost} of the {N} sets of a loop", n_lost <= 1 and sound == n)


def _jumps(graph: Graph) -> list[int]:
    """Numbers of the states whose stamp is before that of the state before."""
    return [i for i, (a, b) in enumerate(pairwise(stamps(graph.states)), 1) if b < a]


def _broken_file(graph: Graph) -> Outcome:
    folder = graph.folder / "broken"
    shutil.copytree(graph.recording, folder)
    rig = (folder / "rig.yaml").read_text().replace(str(graph.recording), str(folder))
    (folder / "rig.yaml").write_text(rig)
    for i in (4, 5):
        image = folder / "cam2" / f"{i:04}.png"
        image.write_bytes(image.read_bytes()[:100])
    graph.tracker("--lossless", "--wait-for", "state=1")  # this process: the cameras show everything once
    arguments = ["--rig", folder / "rig.yaml", "--rate", "10", "--no-frame-skip", *LIVE]
    ingest = graph.launch("camera_ingest", *arguments)
    status = ingest.wait()
    line = next((line for line in ingest.out.splitlines() if line.startswith("cam2")), "")
    others = [line for line in ingest.out.splitlines() if line.startswith(("cam1", "cam3"))]
    n_whole = sum(f"{N} published" in line for line in others)
    graph.until(lambda: any(_n_cameras(state) == 2 for state in graph.states), "a set of the other cameras")
    graph.until(lambda: _n_cameras(graph.states[-1]) == 3, "sets of three cameras after it")
    seen = f"{line}; of the other cameras {n_whole} published all {N}; their sets are tracked; exit status {status}"
    return Outcome(seen, "2 images", f"{N - 2} published" in line and n_whole == 2 and status == 1)


DRILLS = (
    Drill("camera process killed, started again", "named as silent; tracked without it; taken back by itself", _camera_killed),
    Drill("all cameras killed, started again", "no image sets is said; tracked again by itself", _ingest_killed),
    Drill("tracker killed, started again", "cameras and recorder go on; states again, all recorded", _tracker_killed),
    Drill("recorder killed", f"bag readable to at most {KILL_LOSS_S:g} s before; tracking goes on", _recorder_killed),
    Drill(
        "disk full",
        "the recorder ends with a finished bag and says why; tracking goes on",
        _disk_full(0, "No space left on device"),
    ),
    Drill(
        "disk nearly full",
        "the recorder ends at its limit, with a finished bag, and says why; tracking goes on",
        _disk_full(2, "free on the disk"),
    ),
    Drill("bag played in a loop", "the tracker begins again by itself at each jump of the stamps", _bag_loops),
    Drill("damaged image files", "counted, the camera named; the others go on", _broken_file),
)
