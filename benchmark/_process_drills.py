"""Faults of processes and disks: killed and started again, bags that loop, disks that are full, files that are broken."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from contextlib import contextmanager
from itertools import pairwise

from _fault_graph import ERROR, OK, WARN, Drill, Graph, N, Outcome
from ros_graph import stamps

from tracker_node.loaders.bag_reader import BagReader
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
    without = list(graph.states[-1].camera_samples)
    graph.ingest("--cameras", "cam2", *LIVE)
    graph.wait_said(CAMERA, OK, "receiving", since=len(graph.said))
    graph.until(lambda: _n_cameras(graph.states[-1]) == 3, "sets of three cameras")
    return Outcome(
        f"ERROR cam2: {said}; tracked with {sum(n > 0 for n in without)} cameras; then OK with 3", "images of cam2 meanwhile"
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
    graph.tracker()
    bag, again = graph.folder / "bag", graph.folder / "again"
    recorder = graph.launch("recorder", "--output", bag, "--topics", *RESULTS)
    graph.until(lambda: "ready" in recorder.out, "the recorder")
    graph.ingest(*LIVE)
    graph.wait_for_states(50)
    killed_ns = time.time_ns()
    graph.kill(recorder)
    n_before = len(graph.states)
    graph.launch("recorder", "--output", again, "--topics", *RESULTS)
    with BagReader(bag) as reader:
        received_ns = [message.stamp_ns for message in reader.messages() if message.topic == "/tracker/state"]
        problem = reader.problem
    loss_s = 1e-9 * (killed_ns - max(received_ns))
    n_lost = n_before - len(received_ns)
    graph.until(lambda: any(again.glob("*.mcap")), "the new recorder")
    graph.wait_for_states(5)
    seen = f"the bag reads to {loss_s:.2f} s before the kill ({problem}); tracking goes on, a new recorder takes over"
    return Outcome(seen, f"{n_lost} states, {loss_s:.2f} s of at most {KILL_LOSS_S:g} s", loss_s <= KILL_LOSS_S)


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


def _disk_full(graph: Graph) -> Outcome:
    with _small_disk(graph, 24) as place:
        if place is None:
            return Outcome("only root can mount a small file system", "", skipped=True)
        graph.tracker()
        bag = place / "bag"
        recorder = graph.launch("recorder", "--output", bag, "--regex", "/cam[0-9]/image_raw", "--min-free-mb", "2")
        graph.until(lambda: "ready" in recorder.out, "the recorder")
        graph.ingest(*LIVE)
        graph.until(lambda: recorder.ended, "the recorder's end")
        said = graph.wait_said("recorder: bag", ERROR, "stopped", "free on the disk")
        with BagReader(bag) as reader:
            n, problem = sum(topic.message_count for topic in reader.topics.values()), reader.problem
        graph.wait_for_states(5)
        recorder.close()
    return Outcome(
        f"ERROR recorder: {said}; it ends by itself; {n} images in a finished bag; tracking goes on",
        "what came after",
        n > 0 and not problem,
    )


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
    graph.tracker("--ros-args", "-p", "use_sim_time:=true")
    graph.launch("player", bag, "--loop", "--wait-for-subscribers", "1")
    graph.until(lambda: _n_jumps(graph) >= 2 and len(graph.states) > 2 * N, "two jumps back, and states between them")
    graph.wait_said("tracker: clock", WARN, "went back")
    n, n_stamps = len(graph.states), len({*stamps(graph.states)})
    sound = sum(state.status == 1 for state in graph.states)
    seen = f"begins again at each of {_n_jumps(graph)} jumps back; {n} states of {n_stamps} image sets, {sound} of them TRACKING"
    return Outcome(seen, "1 set a loop at most", n > n_stamps and sound == n)


def _n_jumps(graph: Graph) -> int:
    return sum(b < a for a, b in pairwise(stamps(graph.states)))


def _broken_file(graph: Graph) -> Outcome:
    folder = graph.folder / "broken"
    shutil.copytree(graph.recording, folder)
    rig = (folder / "rig.yaml").read_text().replace(str(graph.recording), str(folder))
    (folder / "rig.yaml").write_text(rig)
    for i in (4, 5):
        image = folder / "cam2" / f"{i:04}.png"
        image.write_bytes(image.read_bytes()[:100])
    graph.tracker()
    arguments = ["--rig", folder / "rig.yaml", "--rate", "10", "--no-frame-skip", *LIVE]
    ingest = graph.launch("camera_ingest", *arguments)
    status = ingest.wait()
    line = next((line for line in ingest.out.splitlines() if line.startswith("cam2")), "")
    others = [line for line in ingest.out.splitlines() if line.startswith(("cam1", "cam3"))]
    whole = all(f"{N} published" in line for line in others)
    return Outcome(
        f"{line}; the other cameras: {N} published; exit status {status}", "2 images", f"{N - 2} published" in line and whole
    )


DRILLS = (
    Drill("camera process killed, started again", "named as silent; tracked without it; taken back by itself", _camera_killed),
    Drill("all cameras killed, started again", "no image sets is said; tracked again by itself", _ingest_killed),
    Drill("tracker killed, started again", "cameras and recorder go on; states again, all recorded", _tracker_killed),
    Drill("recorder killed", f"bag readable to at most {KILL_LOSS_S:g} s before; tracking goes on", _recorder_killed),
    Drill("disk full", "the recorder ends with a finished bag and says why; tracking goes on", _disk_full),
    Drill("bag played in a loop", "the tracker begins again by itself at each jump of the clock", _bag_loops),
    Drill("damaged image files", "counted, the camera named; the others go on", _broken_file),
)
