"""Launch files name executables that exist, options that those take, and arguments that included files have."""

import argparse
import contextlib
import importlib
import io
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import pytest

from helpers.cameras.camera_rigs import circle_rig
from helpers.ros.launch_stand_ins import (
    Arguments,
    LaunchConfiguration,
    LogInfo,
    OnShutdown,
    declared_by,
    description_of,
    launch_stand_ins,
    resolved,
)
from tracker_node.cli import main
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file

ROOT = Path(__file__).resolve().parents[2]
FILES = sorted(path.name for path in (ROOT / "launch").glob("*.py"))
OTHERS = {"robot_state_publisher": "robot_state_publisher", "rviz2": "rviz2"}


@pytest.fixture
def stand_ins(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    """In a folder with a rig.yaml."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(subprocess, "run", run_here)
    write_rig_file(rig_file_of(circle_rig(2)), "rig.yaml")
    with launch_stand_ins():
        yield


def run_here(command: list[str], **_) -> subprocess.CompletedProcess:
    """Our installed command, without the second that it takes to come up."""
    assert command[0] == str(ROOT / "resource/executables/tracker_node")
    with contextlib.redirect_stdout(io.StringIO()) as said:
        status = main.main(command[1:])
    return subprocess.CompletedProcess(command, status, said.getvalue())


@dataclass
class Started:
    """A node that a launch file starts."""

    package: str
    executable: str
    name: str
    arguments: list[str]
    parameters: dict
    remappings: list
    timeouts_s: tuple[float, float]
    namespace: str


def launched(name: str, /, **given: str) -> tuple[list[Started], Arguments]:
    """The nodes of a launch file and of those that it includes, with these arguments, and the arguments of the first."""
    declared = declared_by(name)
    assert set(given) <= set(declared), f"{name} has no argument {set(given) - set(declared)}"
    context = Arguments(given)
    for argument, action in declared.items():
        if argument not in context:
            assert "default_value" in action.kwargs, f"{name} needs {argument}"
            context[argument] = resolved(action.kwargs["default_value"], context)
        choices = action.kwargs.get("choices")
        assert not choices or context.get(argument) in choices, (argument, context.get(argument))
    return nodes_of(description_of(name).args[0], context), context


def started_by(name: str, /, **given: str) -> list[Started]:
    return launched(name, **given)[0]


def nodes_of(actions: list, context: dict[str, str]) -> list[Started]:
    nodes = []
    for action in actions:
        condition = action.kwargs.get("condition")
        if condition is not None and resolved(condition.args[0], context).lower() != "true":
            continue
        kind = type(action).__name__
        if kind == "OpaqueFunction":
            nodes += nodes_of(action.kwargs["function"](context), context)
        elif kind == "IncludeLaunchDescription":
            file = Path(resolved(action.args[0].args[0], context))
            assert file.parent == ROOT / "launch"
            passed = dict(action.kwargs.get("launch_arguments", ()))
            nodes += started_by(file.name, **{key: resolved(value, context) for key, value in passed.items()})
        elif kind == "Node":
            nodes.append(node_of(action.kwargs, context))
    return nodes


def node_of(kwargs: dict, context: dict[str, str]) -> Started:
    arguments = [resolved(argument, context) for argument in kwargs.get("arguments", [])]
    parameters = {}
    for group in kwargs.get("parameters", []):
        for key, value in group.items():
            parameters[key] = resolved(value, context) if isinstance(value, LaunchConfiguration) else value
    name = resolved(kwargs.get("name", kwargs["executable"]), context)
    timeouts_s = (float(kwargs.get("sigterm_timeout", 5.0)), float(kwargs.get("sigkill_timeout", 5.0)))  # 5 are those of launch
    namespace = resolved(kwargs.get("namespace", ""), context)
    remappings = kwargs.get("remappings", [])
    return Started(kwargs["package"], kwargs["executable"], name, arguments, parameters, remappings, timeouts_s, namespace)


def check_runs(node: Started) -> argparse.Namespace | None:
    """What is started is there, and takes its arguments."""
    if node.package != "tracker_node":
        assert OTHERS[node.package] == node.executable
        return None
    assert (ROOT / "resource" / "executables" / node.executable).is_file()
    verb, *rest = node.arguments if node.executable == "tracker_node" else [node.executable, *node.arguments]
    assert "" not in rest
    return main.parser_of(verb, importlib.import_module(main.module_of(verb))).parse_args(rest)


HUMAN = str(ROOT / "config/models/human.yaml")
BODY = {"rig": "rig.yaml", "model": HUMAN}
CASES = [
    ("camera_ingest", {"rig": "rig.yaml"}, ["camera_ingest"]),
    ("camera_ingest", {"rig": "rig.yaml", "rate": "50", "loop": "false", "shrink": "2", "namespace": "lab",
                       "topics": "cam01=/a/image cam02=/b/image"}, ["camera_ingest"]),
    ("tracker", BODY, ["tracker", "tracker_links"]),
    ("tracker", {**BODY, "initial_state": "s.yaml", "occluders": "o.yaml", "params_file": "p.yaml", "calibration": "camera_info",
                 "name": "second", "link_frames": "false", "lossless": "true",
                 "topics": "cam01=/a/image", "use_sim_time": "true", "keypoints_table": "t.yaml"}, ["second"]),
    ("pipeline", {"recording": "recording.yaml"}, ["pipeline"]),
    ("pipeline", {**BODY, "initial_state": "s.yaml", "occluders": "o.yaml", "config": "p.yaml", "output": "out",
                  "keypoints_table": "t.yaml"}, ["pipeline"]),
    ("rviz", {}, ["rviz2"]),
    ("rviz", {"rig": "rig.yaml", "namespace": "lab", "use_sim_time": "true"}, ["rviz2"]),
    ("rig", BODY, ["tracker", "tracker_links", "camera_ingest"]),
    ("rig", {**BODY, "ingest": "false", "bag": "out/bag", "record_images": "raw", "split_mb": "4000", "compression": "zstd",
             "rviz": "true"},
     ["recorder", "tracker", "tracker_links", "rviz2"]),
    ("rig", {**BODY, "keypoints": "true", "keypoints_rate": "5", "weights": "heavy.tflite", "topics": "cam01=/a/image"},
     ["tracker", "tracker_links", "keypoints", "camera_ingest"]),
    ("keypoints", {"rig": "rig.yaml"}, ["keypoints"]),
    ("keypoints", {"rig": "rig.yaml", "keypoints_rate": "5", "weights": "heavy.tflite", "name": "anna", "namespace": "lab",
                   "topics": "cam01=/a/image", "use_sim_time": "true"}, ["keypoints"]),
    ("replay", {"bag": "out/bag"}, ["player"]),
    ("replay", {"bag": "b", "rate": "0.5", "start": "2", "loop": "true", "rviz": "true"}, ["rviz2", "player"]),
    ("replay", {"bag": "b", "track": "true", **BODY}, ["again", "player"]),
    ("demo", {}, ["tracker_node", "rviz2"]),
    ("demo", {"output": "elsewhere", "rviz": "false"}, ["tracker_node"]),
]  # fmt: skip


def test_all_files_have_a_case():
    assert sorted({f"{name}.launch.py" for name, _, _ in CASES}) == FILES


@pytest.mark.parametrize(("name", "given", "expected"), CASES, ids=[f"{name}-{len(given)}" for name, given, _ in CASES])
def test_what_is_started_takes_its_arguments(stand_ins, name, given, expected):
    nodes = started_by(f"{name}.launch.py", **given)
    assert [node.name for node in nodes] == expected
    for node in nodes:
        check_runs(node)


def test_all_nodes_of_a_rig_are_in_its_namespace(stand_ins):
    nodes = started_by("rig.launch.py", **BODY, namespace="lab", bag="out/bag", keypoints="true")
    assert {node.name: node.namespace for node in nodes if node.package == "tracker_node"} == dict.fromkeys(
        ["recorder", "tracker", "keypoints", "camera_ingest"], "lab"
    )


def test_points_of_a_detector_are_compared_unless_a_file_chooses(stand_ins):
    given = {**BODY, "keypoints": "true"}
    assert started_by("rig.launch.py", **given)[0].parameters["modalities"] == ["region", "keypoints"]
    assert "modalities" not in started_by("rig.launch.py", **BODY)[0].parameters
    for silent in ("threads: 2", "# modalities: [region]", "/**:\n  ros__parameters:\n    threads: 2  # no modalities: here", ""):
        Path("p.yaml").write_text(silent)
        (tracker, *_) = started_by("rig.launch.py", **given, params_file="p.yaml")
        assert tracker.parameters["modalities"] == ["region", "keypoints"], silent
    for choice in ("modalities: [region]", "/**:\n  ros__parameters:\n    modalities: []", "{k: 2, 'modalities': [region]}"):
        Path("p.yaml").write_text(choice)
        assert "modalities" not in started_by("rig.launch.py", **given, params_file="p.yaml")[0].parameters, choice


@pytest.mark.parametrize(("name", "given"), [
    ("tracker", {}), ("rig", {}), ("replay", {"bag": "b", "track": "true"}), ("pipeline", {}),
])  # fmt: skip
def test_the_points_of_an_own_detector_are_compared_by_its_table_and_ours_is_not_started(stand_ins, name, given):
    nodes = started_by(f"{name}.launch.py", **BODY, **given, keypoints_table="t.yaml")
    assert check_runs(nodes[0]).keypoints_table == "t.yaml" and "keypoints" not in [node.name for node in nodes]
    assert name == "pipeline" or nodes[0].parameters["modalities"] == ["region", "keypoints"]


@pytest.mark.parametrize(("name", "given", "writer"), [
    ("rig", {**BODY, "bag": "out/bag"}, "recorder"), ("pipeline", BODY, "pipeline"), ("demo", {"rviz": "false"}, "tracker_node"),
])  # fmt: skip
def test_who_writes_a_bag_is_not_killed_before_it_is_finished(stand_ins, name, given, writer):
    """Of themselves launch and its children take five seconds, less than a disk that is behind."""
    (node,) = [node for node in started_by(f"{name}.launch.py", **given) if node.name == writer]
    assert min(node.timeouts_s) >= 30.0


@pytest.mark.parametrize(("name", "given", "absent", "left"), [
    ("rviz", {}, "rviz2", []),
    ("demo", {}, "rviz2", ["tracker_node"]),
    ("rig", {**BODY, "rviz": "true"}, "rviz2", ["tracker", "tracker_links", "camera_ingest"]),
    ("replay", {"bag": "b", "rviz": "true"}, "rviz2", ["player"]),
    ("tracker", BODY, "robot_state_publisher", ["tracker"]),
])  # fmt: skip
def test_without_a_package_of_others_a_line_says_so_and_all_else_goes_on(stand_ins, monkeypatch, name, given, absent, left):
    monkeypatch.setattr("helpers.ros.launch_stand_ins.ABSENT", {absent})
    assert [node.name for node in started_by(f"{name}.launch.py", **given)] == left
    (line,) = LogInfo.said
    assert f"{absent} is not installed (apt install ros-$ROS_DISTRO-{absent.replace('_', '-')}): " in line and "goes on" in line


@pytest.mark.parametrize("name", FILES)
def test_every_argument_is_described_and_used(stand_ins, name):
    declared = declared_by(name)
    assert all(action.kwargs.get("description") for action in declared.values())
    used = [launched(name, **given)[1].used for case, given, _ in CASES if f"{case}.launch.py" == name]
    assert set().union(*used) == set(declared)


@pytest.mark.parametrize("name", FILES)
def test_examples_give_arguments_that_there_are(stand_ins, name):
    examples = re.findall(rf"ros2 launch tracker_node {re.escape(name)}(.*)", (ROOT / "launch" / name).read_text())
    assert examples
    for example in examples:
        given = dict(item.split(":=") for item in example.split())
        started_by(name, **{key: HUMAN if key == "model" else value for key, value in given.items()})


PAGES = ["README.md", *sorted(f"docs/{page.name}" for page in (ROOT / "docs").glob("*.md"))]


@pytest.mark.parametrize("page", PAGES)
def test_launch_commands_of_the_pages_give_arguments_that_there_are(stand_ins, page):
    for name, rest in re.findall(r"ros2 launch tracker_node (\w+\.launch\.py)([^`\n#]*)", (ROOT / page).read_text()):
        given = dict(item.split(":=") for item in rest.split() if ":=" in item)
        assert set(given) <= set(declared_by(name)), (name, given)


def test_link_frames_are_those_of_the_body_that_is_tracked(stand_ins):
    """robot_state_publisher of Jazzy does not start without the description as a parameter."""
    tracker, links = started_by("tracker.launch.py", **BODY, name="second")
    description = links.parameters["robot_description"]
    assert description.kwargs == {"value_type": str}  # or launch would read it as YAML
    robot = ElementTree.fromstring(description.args[0])
    assert robot.tag == "robot" and len(robot.findall("joint")) > 30
    assert check_runs(tracker).model == HUMAN
    assert dict(links.remappings)["joint_states"] == "second/joint_states"


def test_a_replay_has_the_time_of_the_bag(stand_ins):
    nodes = started_by("replay.launch.py", bag="b", track="true", rviz="true", **BODY)
    assert {node.name: node.parameters.get("use_sim_time") for node in nodes} == {"again": True, "rviz2": "true", "player": None}


def test_without_a_rig_rviz_opens_the_shipped_layout(stand_ins):
    (rviz,) = started_by("rviz.launch.py")
    assert Path(rviz.arguments[1]).read_text() == (ROOT / "config/rviz/tracker.rviz").read_text()


def test_rviz_shows_the_cameras_of_a_rig_in_its_namespace(stand_ins):
    nodes = started_by("rig.launch.py", **BODY, namespace="lab", rviz="true")
    layout = Path(next(node for node in nodes if node.name == "rviz2").arguments[1]).read_text()
    topics = set(re.findall(r"Value: (/.+)", layout))
    assert all(topic.startswith("/lab/") for topic in topics)
    assert {"/lab/cam01/image_raw", "/lab/cam02/image_raw", "/lab/tracker/markers", "/lab/robot_description"} <= topics
    assert not any("cam03" in topic for topic in topics)
    (rviz,) = started_by("rviz.launch.py", layout="mine.rviz", namespace="lab")
    assert rviz.arguments == ["-d", "mine.rviz"]


def test_the_layout_is_gone_after_the_launch(stand_ins, tmp_path):
    started_by("rviz.launch.py")
    assert list(tmp_path.glob("tracker_node_*"))
    OnShutdown.shut_down()
    assert not list(tmp_path.glob("tracker_node_*"))


def test_a_body_that_cannot_be_read_ends_the_launch(stand_ins, capsys):
    with pytest.raises(RuntimeError, match=r"urdf nowhere\.yaml: failed with status 2"):
        started_by("tracker.launch.py", rig="rig.yaml", model="nowhere.yaml")
    assert "nowhere.yaml" in capsys.readouterr().err


BARE = """
import sys
from helpers.ros.launch_stand_ins import Arguments, description_of, launch_stand_ins
for name in ("cv2", "llvmlite", "numba", "numpy", "pydantic", "scipy", "threadpoolctl", "yaml"):
    sys.modules[name] = None
with launch_stand_ins():
    actions = description_of(sys.argv[1]).args[0]
    declared = [action for action in actions if type(action).__name__ == "DeclareLaunchArgument"]
    context = Arguments({action.args[0]: action.kwargs.get("default_value", "") for action in declared})
    context.update(word.split(":=") for word in sys.argv[2:])
    for action in actions:
        if type(action).__name__ == "OpaqueFunction":
            assert action.kwargs["function"](context)
"""
NEEDED = {"tracker.launch.py": [f"model:={HUMAN}", "rig:=rig.yaml"]}


@pytest.mark.parametrize("name", FILES)
def test_launch_needs_nothing_but_launch_and_the_installed_command(name, tmp_path):
    """Debian's ros2 is run by the system's Python, which knows nothing of an environment."""
    paths = {
        "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "test")]),
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
    }
    command = [sys.executable, "-c", BARE, name, *NEEDED.get(name, [])]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=120.0, check=False, cwd=tmp_path, env={**os.environ, **paths}
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_cameras_offer_the_images_that_the_bag_takes(stand_ins):
    for images, offered in (("compressed", True), ("raw", False), ("none", False)):
        nodes = started_by("rig.launch.py", **BODY, bag="out/bag", record_images=images)
        ingest = next(node for node in nodes if node.name == "camera_ingest")
        assert ("--compressed" in ingest.arguments) is offered


@pytest.mark.parametrize(("given", "listeners"), [
    ({}, "1"), ({"keypoints": "true"}, "2"), ({"keypoints": "true", "bag": "out/bag"}, "3"), ({"params_file": "p.yaml"}, "0"),
    ({"listeners": "7"}, "7"),
])  # fmt: skip
def test_recordings_wait_for_those_that_are_started_with_them(stand_ins, given, listeners):
    ingest = next(node for node in started_by("rig.launch.py", **BODY, **given) if node.name == "camera_ingest")
    assert ingest.arguments[ingest.arguments.index("--wait-for-info-subscribers") + 1] == listeners
