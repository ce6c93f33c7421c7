"""Layouts of viewers: every topic and field that they name is in a real recording, with the type that the panel shows.

RViz, Foxglove and PlotJuggler themselves are not here. What they read is: the bag's topics and message definitions; Foxglove's
settings, as its own SDK types them.
"""

import dataclasses
import json
import re
import subprocess
import sys
import threading
import time
import types
import typing
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

import cv2
import foxglove
import foxglove.layouts as fl
import numpy as np
import pytest
import yaml
from geometry_msgs.msg import PoseWithCovarianceStamped
from mcap.reader import make_reader
from websockets.sync.client import connect

from tracker_node.cli.main import main
from tracker_node.loaders.bag.reader import BagReader

SHIPPED = ("rviz/tracker.rviz", "foxglove/tracker.json", "plotjuggler/tracker.xml")
DISPLAYS = {
    "MarkerArray": "visualization_msgs/msg/MarkerArray",
    "RobotModel": "std_msgs/msg/String",
    "PoseWithCovariance": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "Camera": "sensor_msgs/msg/Image",
    "Image": "sensor_msgs/msg/Image",
}
IN_3D = {
    "visualization_msgs/msg/MarkerArray", "geometry_msgs/msg/PoseWithCovarianceStamped", "std_msgs/msg/String",
    "sensor_msgs/msg/CameraInfo",
}  # fmt: skip
PANELS = {
    "3D": fl.ThreeDeeConfig, "Image": fl.ImageConfig, "Plot": fl.PlotConfig, "StateTransitions": fl.StateTransitionsConfig,
    "DiagnosticSummary": fl.DiagnosticsSummaryConfig, "RawMessages": fl.RawMessagesConfig,
}  # fmt: skip


class Recording:
    """Types and last messages of a bag's topics."""

    def __init__(self, bag: Path):
        self.bag = bag
        with BagReader(bag) as reader:
            self.types = {name: topic.type_name for name, topic in reader.topics.items()}
            self.last = {}
            for name in self.types:
                for _, message in reader.decoded(name):
                    self.last[name] = message

    def value(self, path: str):
        """What a message path of Foxglove points to: ``/topic.field[i]``."""
        topic, *fields = re.split(r"\.", path)
        here = self.last[topic]
        for field in fields:
            name, index = re.fullmatch(r"(\w+)(?:\[(\d+|:)\])?", field).groups()
            here = getattr(here, name)
            here = here[0 if index == ":" else int(index)] if index else here
        return here


@pytest.fixture(scope="module")
def recorded(recording, tmp_path_factory, ros_domain_id) -> Recording:
    from helpers.ros.graph import NodeProcess

    bag = tmp_path_factory.mktemp("layouts") / "bag"
    files = ["--rig", recording / "rig.yaml", "--model", recording / "model.yaml", "--initial-state", recording / "state.yaml"]
    pipeline = NodeProcess("pipeline", *files, "--bag", bag, "--masks", "--overlays", "--markers", "--images")
    assert pipeline.wait() == 0, pipeline.err
    return Recording(bag)


@pytest.fixture(scope="module")
def layouts(recording, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("layouts") / "made"
    rig, model = str(recording / "rig.yaml"), str(recording / "model.yaml")
    assert main(["layouts", "--rig", rig, "--model", model, "--output", str(folder)]) == 0
    return folder


def test_the_shipped_files_are_those_of_the_command(repository, tmp_path, capsys):
    arguments = ["layouts", "--cameras", "cam01", "cam02", "cam03", "cam04", "--output", str(tmp_path)]
    assert main(arguments) == 0
    for name in SHIPPED:
        assert (repository / "config" / name).read_text() == (tmp_path / name).read_text()
    assert main(arguments) == 2
    assert "--force" in capsys.readouterr().err
    assert main([*arguments, "--force"]) == 0


def test_rviz_shows_what_is_there(layouts, recorded):
    config = yaml.safe_load((layouts / "rviz/tracker.rviz").read_text())["Visualization Manager"]
    assert config["Global Options"]["Fixed Frame"] == recorded.last["/tracker/pose"].header.frame_id
    shown = {}
    for display in config["Displays"]:
        kind = display["Class"].removeprefix("rviz_default_plugins/")
        topic = display.get("Topic") or display.get("Description Topic")
        if topic:
            shown[topic["Value"]] = kind
            assert recorded.types[topic["Value"]] == DISPLAYS[kind], display["Name"]
    assert {"/tracker/markers", "/robot_description", "/cam1/image_raw", "/tracker/cam3/mask"} <= set(shown)
    names = {display["Name"] for display in config["Displays"]}
    for camera in (display for display in config["Displays"] if display["Class"].endswith("/Camera")):
        assert set(camera["Visibility"]) - {"Value"} <= names
        info = camera["Topic"]["Value"].replace("image_raw", "camera_info")  # where RViz looks for it
        assert recorded.types[info] == "sensor_msgs/msg/CameraInfo"


def test_rviz_tools_publish_what_the_tracker_takes(layouts, recording, probe, launch):
    config = yaml.safe_load((layouts / "rviz/tracker.rviz").read_text())["Visualization Manager"]
    (tool,) = [tool for tool in config["Tools"] if tool["Class"].endswith("/SetInitialPose")]
    launch("tracker", "--rig", recording / "rig.yaml", "--model", recording / "model.yaml")
    infos = probe.node.get_subscriptions_info_by_topic
    probe.spin_until(lambda: infos(tool["Topic"]["Value"]), "the tracker to listen")
    kind = f"{PoseWithCovarianceStamped.__module__.split('.')[0]}/msg/PoseWithCovarianceStamped"
    assert [info.topic_type for info in infos(tool["Topic"]["Value"])] == [kind]


def panels_of(layouts: Path) -> dict[str, dict]:
    return json.loads((layouts / "foxglove/tracker.json").read_text())["configById"]


def assert_there(panels: dict[str, dict], recorded: Recording) -> None:
    """Every topic and field of the panels is in the recording, of the type that the panel shows."""
    for name, panel in panels.items():
        kind = name.partition("!")[0]
        if kind == "3D":
            assert all(recorded.types[topic] in IN_3D for topic in panel["topics"])
            robots = [settings for topic, settings in panel["topics"].items() if topic.endswith("robot_description")]
            assert robots and all(recorded.types[robot["jointStatesTopic"]].endswith("/JointState") for robot in robots)
        elif kind == "Image":
            assert recorded.types[panel["imageMode"]["imageTopic"]] == "sensor_msgs/msg/CompressedImage"
            assert recorded.types[panel["imageMode"]["calibrationTopic"]] == "sensor_msgs/msg/CameraInfo"
        elif kind in ("Plot", "StateTransitions"):
            for path in panel["paths"]:
                assert isinstance(float(recorded.value(path["value"])), float), path["value"]
        elif kind == "RawMessages":
            assert isinstance(recorded.value(panel["topicPath"]), str)
        else:
            assert recorded.types[panel["topicToRender"]] == "diagnostic_msgs/msg/DiagnosticArray"


def test_foxglove_shows_what_is_there(layouts, recorded):
    panels = panels_of(layouts)
    assert_there(panels, recorded)
    joints = recorded.last["/tracker/joint_states"].name
    plotted = {path["label"]: path["value"] for path in panels["Plot!joints"]["paths"]}
    assert plotted == {name: f"/tracker/joint_states.position[{i}]" for i, name in enumerate(joints)}


def test_foxglove_calls_states_by_their_names(layouts, recorded):
    (path,) = panels_of(layouts)["StateTransitions!status"]["paths"]
    kind = type(recorded.last["/tracker/state"])
    for state in path["customStates"]["states"]:
        assert getattr(kind, state["label"]) == int(state["value"])


def leaves(tree) -> list[str]:
    return [tree] if isinstance(tree, str) else [*leaves(tree["first"]), *leaves(tree["second"])]


def test_every_panel_has_its_place(layouts):
    tree = json.loads((layouts / "foxglove/tracker.json").read_text())["layout"]
    assert sorted(leaves(tree)) == sorted(panels_of(layouts))


def check_typed(value, hint, where: str) -> None:
    """A value of a layout against a type of Foxglove's SDK, whose fields are ours in camel case."""
    options = typing.get_args(hint) if typing.get_origin(hint) in (typing.Union, types.UnionType) else (hint,)
    for option in options:
        origin, arguments = typing.get_origin(option), typing.get_args(option)
        if dataclasses.is_dataclass(option) and isinstance(value, dict):
            return check_fields(value, [o for o in options if dataclasses.is_dataclass(o)], where)
        if origin is typing.Literal and value in arguments:
            return None
        if origin is dict and isinstance(value, dict):
            return [check_typed(item, arguments[1], f"{where}.{key}") for key, item in value.items()] and None
        if origin in (list, tuple) and isinstance(value, list):
            return [check_typed(item, arguments[0], f"{where}[]") for item in value] and None
        if option is float and isinstance(value, (int, float)) and not isinstance(value, bool):
            return None
        if isinstance(option, type) and origin is None and type(value) is option:
            return None
    raise AssertionError(f"{where}: {value!r} is none of {hint}")


def check_fields(value: dict, classes: list, where: str) -> None:
    """The fields of one of the classes, the one that knows them all."""
    known = []
    for cls in classes:
        if "type" in value and cls()._to_dict().get("type") not in (None, value["type"]):
            continue
        hints = typing.get_type_hints(cls, vars(fl))
        fields = {re.sub("_(.)", lambda m: m[1].upper(), name): hint for name, hint in hints.items()}
        fields |= {"type": str, "layerId": str}  # constants that the SDK adds itself
        if set(value) - {"foxglovePanelTitle"} <= set(fields):
            known.append(fields)
    assert known, f"{where}: {set(value)} are not all known to any of {[c.__name__ for c in classes]}"
    for key in set(value) - {"foxglovePanelTitle"}:
        check_typed(value[key], known[0][key], f"{where}.{key}")


def test_foxglove_knows_every_setting(layouts):
    for name, panel in panels_of(layouts).items():
        check_fields(panel, [PANELS[name.partition("!")[0]]], name)
    with pytest.raises(AssertionError):
        check_fields({"paths": [{"values": "/a.b"}]}, [fl.PlotConfig], "wrong field")
    with pytest.raises(AssertionError):
        check_fields({"xAxisVal": "time"}, [fl.PlotConfig], "wrong choice")


def plotjuggler_names(topic: str, message) -> set[str]:
    """Names of the numbers of a message: fields by /, items of arrays by [i], joints by their names."""
    if hasattr(message, "position") and hasattr(message, "effort"):
        return {f"{topic}/{name}/position" for name in message.name}
    names = set()

    def walk(prefix: str, value) -> None:
        if isinstance(value, (str, bytes)):
            return
        if dataclasses.is_dataclass(value):
            for field in dataclasses.fields(value):
                if not field.name.startswith("__"):
                    walk(f"{prefix}/{field.name}", getattr(value, field.name))
        elif hasattr(value, "__len__"):
            for i, item in enumerate(value):
                walk(f"{prefix}[{i}]", item)
        else:
            names.add(prefix)

    walk(topic, message)
    return names


def test_plotjuggler_finds_every_curve(layouts, recorded):
    root = ElementTree.parse(layouts / "plotjuggler/tracker.xml").getroot()
    curves = [curve.get("name") for curve in root.iter("curve")]
    assert len(curves) >= 20 and len(curves) == len(set(curves))
    there = plotjuggler_names("/tracker/state", recorded.last["/tracker/state"])
    there |= plotjuggler_names("/tracker/joint_states", recorded.last["/tracker/joint_states"])
    assert set(curves) <= there, set(curves) - there
    for splitter in root.iter("DockSplitter"):
        assert int(splitter.get("count")) == len(splitter) == len(splitter.get("sizes").split(";"))


UNITS = {"_px": "px", "_ms": "ms", "joint_states": "rad", "root_pose/position": "m", "velocities": "m/s"}


def test_plots_say_their_units(layouts):
    areas = ElementTree.parse(layouts / "plotjuggler/tracker.xml").getroot().iter("DockArea")
    plots = [(area.get("name"), [curve.get("name") for curve in area.iter("curve")]) for area in areas]
    shown = [panel for name, panel in panels_of(layouts).items() if name.startswith("Plot!")]
    plots += [(panel["foxglovePanelTitle"], [path["value"] for path in panel["paths"]]) for panel in shown]
    for title, curves in plots:
        units = {unit for curve in curves for part, unit in UNITS.items() if part in curve}
        assert len(units) <= 1 and all(title.endswith(f", {unit}") for unit in units), title
        assert re.match(r"\w{4}", title)


def test_the_pictures_of_the_documentation_can_be_made_again(repository, layouts, recorded, tmp_path):
    tool, layout = repository / "tools/monitoring_pictures.py", layouts / "plotjuggler/tracker.xml"
    run = [sys.executable, tool, recorded.bag, "--output", tmp_path, "--layout", layout]
    subprocess.run(list(map(str, run)), check=True)
    for name in ("monitoring_markers.jpg", "monitoring_overlays.jpg", "monitoring_curves.png"):
        assert f"images/{name}" in (repository / "docs/nodes.md").read_text()
        picture = cv2.imread(str(tmp_path / name))
        assert picture.std() > 5.0 and picture.shape[1] > 300


def topics_of(layouts: Path) -> set[str]:
    """Every topic that RViz and Foxglove are told of."""
    rviz, foxglove = (layouts / "rviz/tracker.rviz").read_text(), (layouts / "foxglove/tracker.json").read_text()
    return {*re.findall(r"Value: (/\S+)", rviz), *re.findall(r'"(/[\w/]+)', foxglove)}


def test_in_a_namespace_are_tracker_and_cameras(recording, probe, launch, tmp_path):
    rig, model = str(recording / "rig.yaml"), str(recording / "model.yaml")
    assert main(["layouts", "--rig", rig, "--model", model, "--namespace", "/lab/", "--output", str(tmp_path)]) == 0
    named = topics_of(tmp_path)
    assert {"/lab/tracker/markers", "/lab/cam1/image_raw", "/lab/initialpose", "/diagnostics"} <= named
    namespace = ("--ros-args", "-r", "__ns:=/lab")  # what `namespace:=lab` of the launch files becomes
    launch("tracker", "--rig", rig, "--model", model, *namespace)
    launch("camera_ingest", "--rig", rig, "--loop", *namespace)
    there = probe.node.get_topic_names_and_types
    probe.spin_until(lambda: named <= {name for name, _ in there()}, "all topics of the layouts")
    curves = [curve.get("name") for curve in ElementTree.parse(tmp_path / "plotjuggler/tracker.xml").getroot().iter("curve")]
    assert curves and all(curve.startswith(("/lab/tracker/state/", "/lab/tracker/joint_states/")) for curve in curves)


@pytest.fixture(scope="module")
def two_recorded(tmp_path_factory, ros_domain_id) -> tuple[Recording, Path]:
    """A graph of two people, and the layouts for it."""
    from helpers.cameras import two_people
    from helpers.ros.graph import NodeProcess

    folder = tmp_path_factory.mktemp("two")
    recording = two_people.write_recording(folder / "two", 3)
    rig, layouts = str(recording.parent / "rig.yaml"), folder / "layouts"
    pipeline = NodeProcess("pipeline", recording, "--bag", folder / "bag", "--masks", "--overlays", "--markers", "--images")
    assert pipeline.wait() == 0, pipeline.err
    assert main(["layouts", "--rig", rig, "--bodies", str(recording), "--output", str(layouts)]) == 0
    return Recording(folder / "bag"), layouts


@pytest.mark.long
def test_layouts_of_several_bodies_show_what_is_there(two_recorded):
    recorded, layouts = two_recorded
    panels = panels_of(layouts)
    assert_there(panels, recorded)
    for name, panel in panels.items():
        check_fields(panel, [PANELS[name.partition("!")[0]]], name)
    assert sorted(leaves(json.loads((layouts / "foxglove/tracker.json").read_text())["layout"])) == sorted(panels)
    assert {"/tracker/one/markers", "/tracker/other/markers", "/other/robot_description"} <= set(panels["3D!body"]["topics"])
    for body in ("one", "other"):
        joints = recorded.last[f"/tracker/{body}/joint_states"].name
        for path in panels[f"Plot!joints {body}"]["paths"]:
            assert path["value"] == f"/tracker/{body}/joint_states.position[{list(joints).index(path['label'])}]"
    config = yaml.safe_load((layouts / "rviz/tracker.rviz").read_text())["Visualization Manager"]
    named = {display["Name"] for display in config["Displays"]}
    for display in config["Displays"]:
        if topic := display.get("Topic") or display.get("Description Topic"):
            assert recorded.types[topic["Value"]] == DISPLAYS[display["Class"].removeprefix("rviz_default_plugins/")]
        assert set(display.get("Visibility", {})) - {"Value"} <= named
    curves = [curve.get("name") for curve in ElementTree.parse(layouts / "plotjuggler/tracker.xml").getroot().iter("curve")]
    there = {name for topic in recorded.last if topic.endswith("state") or topic.endswith("joint_states")
             for name in plotjuggler_names(topic, recorded.last[topic])}  # fmt: skip
    assert len(curves) == len(set(curves)) and set(curves) <= there, set(curves) - there


@pytest.mark.long
@pytest.mark.parametrize("bodies", ["one", "several"])
def test_a_client_of_foxglove_s_protocol_is_offered_every_topic(bodies, recorded, layouts, two_recorded):
    """The bag, read by Foxglove's reader of MCAP and served by Foxglove's SDK: what a client hears and gets."""
    bag, folder = (recorded.bag, layouts) if bodies == "one" else (two_recorded[0].bag, two_recorded[1])
    types, wanted = (recorded if bodies == "one" else two_recorded[0]).types, topics_of(folder)
    wanted = {topic.partition(".")[0] for topic in wanted} & types.keys()
    with served(bag) as url:
        offered, first = heard(url, wanted)
    shown = {topic for topic in wanted if topic.startswith(("/tracker/", "/cam"))}
    assert len(shown) > 10 and shown <= offered.keys()
    for topic in wanted:
        channel = offered[topic]
        assert (channel["schemaName"], channel["encoding"], channel["schemaEncoding"]) == (types[topic], "cdr", "ros2msg")
        assert channel["schema"] and first[topic]


@contextmanager
def served(bag: Path) -> Iterator[str]:
    """The last message of every topic, again and again, by the server of Foxglove's SDK on the loopback."""
    last, channels, context, stop = {}, {}, foxglove.Context(), threading.Event()
    (file,) = bag.glob("*.mcap")
    with file.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            if channel.topic not in channels:
                known = foxglove.Schema(name=schema.name, encoding=schema.encoding, data=schema.data)
                channels[channel.topic] = foxglove.Channel(
                    channel.topic, message_encoding=channel.message_encoding, schema=known, context=context
                )
            last[channel.topic] = message.data
    server = foxglove.start_server(host="127.0.0.1", port=0, context=context)

    def publish() -> None:
        while not stop.wait(0.1):
            for topic, data in last.items():
                channels[topic].log(data)

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        yield f"ws://127.0.0.1:{server.port}"
    finally:
        stop.set()
        thread.join()
        server.stop()


def heard(url: str, topics: set[str]) -> tuple[dict[str, dict], dict[str, bytes]]:
    """Channels that a server offers, by topic, and the first message of the topics that are subscribed to."""
    offered: dict[str, dict] = {}
    first: dict[str, bytes] = {}
    asked: dict[int, str] = {}
    with connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None) as socket:
        until_s = time.monotonic() + 60.0
        while first.keys() != topics:
            assert time.monotonic() < until_s, f"never came: {topics - first.keys()}"
            said = socket.recv(timeout=30.0)
            if isinstance(said, bytes):
                if said[0] == 1 and (topic := asked[int.from_bytes(said[1:5], "little")]) not in first:
                    first[topic] = said[13:]
            elif (message := json.loads(said))["op"] == "advertise":
                new = {channel["topic"]: channel for channel in message["channels"]}
                offered |= new
                wanted = [(i, channel) for i, channel in enumerate(new.values(), len(asked)) if channel["topic"] in topics]
                asked |= {i: channel["topic"] for i, channel in wanted}
                subscriptions = [{"id": i, "channelId": channel["id"]} for i, channel in wanted]
                socket.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
    return offered, first


@pytest.mark.long
def test_the_bag_of_several_bodies_is_a_file_of_rerun_too(two_recorded, tmp_path):
    pytest.importorskip("rerun", reason="the extra rerun is not installed")
    from helpers.rerun_file import RerunFile

    bag = two_recorded[0].bag
    assert main(["rerun", str(bag), "--output", str(tmp_path / "two.rrd")]) == 0  # run.json names rig and bodies
    file = RerunFile(tmp_path / "two.rrd")
    with BagReader(bag) as reader:
        for body in ("one", "other"):
            said = [message.root_pose.position for _, message in reader.decoded(f"/tracker/{body}/state")]
            places = file.array(f"/world/bodies/{body}/pelvis", "Transform3D:translation")
            np.testing.assert_allclose(places, [[p.x, p.y, p.z] for p in said], rtol=1e-6, atol=1e-6)
            assert len(file.over_time(f"/world/cameras/cam0/{body}", "LineStrips2D:strips")[1]) == len(said) == 3
