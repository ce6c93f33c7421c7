"""Faults of what a command is started with: files that never end or nest without end, a rig in another unit, no ROS."""

from __future__ import annotations

import time
import zipfile
from collections.abc import Callable
from pathlib import Path

from benchmark.faults._graph import Drill, Graph, Outcome
from helpers.cameras.camera_rigs import in_millimetres
from helpers.ros.graph import NodeProcess

QUICK_S = 30.0  # for a refusal, on a busy machine; what has no limit takes minutes, or all memory
Arguments = list[str | Path]


def _refused_file(arguments: Callable[[Graph], Arguments], *texts: str) -> Callable[[Graph], Outcome]:
    """A command that is refused by one line with these texts."""

    def inject(graph: Graph) -> Outcome:
        process = graph.launch(*arguments(graph))
        began_s = time.monotonic()
        status = process.wait()
        took_s, said = time.monotonic() - began_s, process.err.strip()
        good = status == 2 and "\n" not in said and len(said) < 1000 and all(text in said for text in texts)
        return Outcome(f"{said[-300:]}; exit status {status} after {took_s:.1f} s", "nothing", good and took_s < QUICK_S)

    return inject


def _deep_storage(extension: str, text: str) -> Callable[[Graph], Arguments]:
    def arguments(graph: Graph) -> Arguments:
        path = graph.folder / f"deep.{extension}"
        path.write_text(text)
        return ["rig", "import", path, "--output", graph.folder / "rig.yaml"]

    return arguments


def _endless_rig(graph: Graph) -> Arguments:
    return ["tracker", "--rig", "/dev/zero", "--model", graph.recording / "model.yaml"]


def _long_integer(graph: Graph) -> Arguments:
    path, text = graph.folder / "rig.yaml", (graph.recording / "rig.yaml").read_text()
    path.write_text(f"{text}lights: [{{kind: ambient, intensity: {'9' * 5000}}}]\n")
    return ["rig", "check", path]


def _endless_archive(graph: Graph) -> Arguments:
    """Some 700 MB of blanks in a few."""
    path, blanks = graph.folder / "endless.zip", b" " * 4_000_000
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("cam1/a_0.json", "w") as member,
    ):
        for _ in range(180):
            member.write(blanks)
    rig = graph.recording / "rig.yaml"
    return ["calibrate", "refine", "--rig", rig, "--points2d", path, "--output", graph.folder / "refined.yaml"]


def _rig_in_millimetres(graph: Graph) -> Outcome:
    rig = in_millimetres(graph.recording / "rig.yaml", graph.folder / "rig_mm.yaml")
    tracker = graph.launch("tracker", "--rig", rig, "--model", graph.recording / "model.yaml", "--end-on-failure")
    status = tracker.wait()
    lines = [line for line in tracker.err.splitlines() if "millimeters" in line]
    good = status == 2 and "Divide it by 1000" in "".join(lines) and "Traceback" not in tracker.err
    return Outcome(f"{lines[-1] if lines else tracker.err[-300:]}; exit status {status}", "nothing", good)


def _without_ros(graph: Graph) -> Outcome:
    """Of this process alone: a package of that name that is not one, found before the real one."""
    (graph.folder / "rclpy.py").write_text("raise ModuleNotFoundError(\"No module named 'rclpy'\", name='rclpy')\n")
    rig = graph.recording / "rig.yaml"
    ingest = NodeProcess("camera_ingest", "--rig", rig, env={"PYTHONPATH": str(graph.folder)})
    try:
        status = ingest.wait()
        said = ingest.err.strip()
    finally:
        ingest.close()
    return Outcome(f"{said}; exit status {status}", "nothing", status == 2 and "needs ROS 2" in said and "\n" not in said)


_REFUSED = "refused by one line at once, exit status 2"
DRILLS = (
    Drill(
        "OpenCV calibration nested 100 000 times (YAML)",
        _REFUSED,
        _refused_file(_deep_storage("yml", "%YAML:1.0\n---\na: " + "[" * 100_000), "deep.yml", "levels"),
    ),
    Drill(
        "OpenCV calibration nested 100 000 times (XML)",
        _REFUSED,
        _refused_file(
            _deep_storage("xml", "<opencv_storage>" + "<_>" * 100_000 + "</_>" * 100_000 + "</opencv_storage>"),
            "deep.xml",
            "levels",
        ),
    ),
    Drill("/dev/zero as a rig", _REFUSED, _refused_file(_endless_rig, "/dev/zero", "a regular file")),
    Drill("a number of 5000 digits in a rig", _REFUSED, _refused_file(_long_integer, "rig.yaml", "digits")),
    Drill("an archive that unpacks to 720 MB", _REFUSED, _refused_file(_endless_archive, "endless.zip", "at most 4 MB")),
    Drill("rig in millimeters", "refused with the unit and the factor, exit status 2", _rig_in_millimetres),
    Drill("a node without ROS", "one line with the remedy, exit status 2", _without_ros),
)
