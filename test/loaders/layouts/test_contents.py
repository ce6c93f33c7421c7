"""What layouts of viewers hold: topics, curves, colors, shares and switches."""

from xml.etree import ElementTree

import pytest

from tracker_node.loaders.layouts import ViewedGraph, color_of, foxglove_layout, plotjuggler_layout, rviz_layout

GRAPH = ViewedGraph(("left", "right", "top"), (("knee", 4), ("elbow", 0), ("hip", 2)), "room", namespace="/lab/")


def displays():
    return {display["Name"]: display for display in rviz_layout(GRAPH)["Visualization Manager"]["Displays"]}


def test_rviz_shows_the_body_and_every_camera():
    shown = displays()
    assert list(shown) == [
        "Grid", "Frames", "Shapes", "Robot model", "Root", "left", "right", "top", "left mask", "right mask", "top mask",
    ]  # fmt: skip
    assert [name for name, display in shown.items() if display["Enabled"]] == [
        "Grid", "Frames", "Shapes", "Root", "left", "right", "top",
    ]  # fmt: skip
    assert all(display["Enabled"] == display["Value"] for display in shown.values())
    assert shown["Shapes"]["Class"] == "rviz_default_plugins/MarkerArray"


def test_rviz_subscribes_as_topics_are_offered():
    shown = displays()
    topics = {name: shown[name]["Topic"] for name in ("Shapes", "Root", "left", "left mask")}
    assert [topics[name]["Value"] for name in topics] == [
        "/lab/tracker/markers", "/lab/tracker/pose", "/lab/left/image_raw", "/lab/tracker/left/mask",
    ]  # fmt: skip
    assert [topics[name]["Reliability Policy"] for name in topics] == ["Reliable", "Reliable", "Best Effort", "Reliable"]
    assert {topic["Durability Policy"] for topic in topics.values()} == {"Volatile"}
    assert {(topic["Depth"], topic["History Policy"]) for topic in topics.values()} == {(5, "Keep Last")}
    described = shown["Robot model"]["Description Topic"]
    assert (described["Value"], described["Durability Policy"]) == ("/lab/robot_description", "Transient Local")


def test_in_rviz_s_cameras_only_the_shapes_are_seen():
    visible = displays()["left"]["Visibility"]
    assert {name for name, seen in visible.items() if seen} == {"Shapes", "Value"}
    assert displays()["left"]["Zoom Factor"] == 1


def test_rviz_looks_at_a_body_that_stands():
    manager = rviz_layout(GRAPH)["Visualization Manager"]
    view = manager["Views"]["Current"]
    assert (view["Distance"], view["Focal Point"]) == (5.0, {"X": 0.0, "Y": 0.0, "Z": 1.0})
    assert manager["Global Options"] == {"Background Color": "240; 240; 240", "Fixed Frame": "room", "Frame Rate": 30}
    grid = displays()["Grid"]
    assert (grid["Cell Size"], grid["Plane Cell Count"]) == (1, 10)
    assert manager["Tools"][3]["Topic"]["Value"] == "/lab/initialpose"


def tabs():
    root = ElementTree.fromstring(plotjuggler_layout(GRAPH).partition("\n")[2])
    return {tab.get("tab_name"): tab for tab in root.iter("Tab")}, root


def curves(tab):
    return [[curve.get("name") for curve in area.iter("curve")] for area in tab.iter("DockArea")]


def test_plotjuggler_plots_these_curves():
    found, _ = tabs()
    state = "/lab/tracker/state"
    assert list(found) == ["Fit", "Timings", "Joint angles", "Root", "Cameras"]
    residuals = [f"{state}/residual", *(f"{state}/camera_residuals[{i}]" for i in range(3))]
    assert curves(found["Fit"]) == [residuals, [f"{state}/status"], [f"{state}/iterations", f"{state}/evaluations"]]
    assert curves(found["Timings"]) == [[f"{state}/observe_ms", f"{state}/optimize_ms", f"{state}/total_ms"]]
    joints = "/lab/tracker/joint_states"
    assert curves(found["Joint angles"]) == [[f"{joints}/knee/position", f"{joints}/elbow/position"], [f"{joints}/hip/position"]]
    assert curves(found["Root"])[0] == [f"{state}/root_pose/position/{axis}" for axis in "xyz"]
    assert curves(found["Root"])[1] == [f"{state}/velocities[{i}]" for i in range(3)]
    assert curves(found["Cameras"]) == [[f"{state}/camera_samples[{i}]" for i in range(3)]]


def test_plotjuggler_shares_a_tab_out_evenly():
    found, root = tabs()
    splitters = {name: tab.find("Container/DockSplitter") for name, tab in found.items()}
    assert (splitters["Fit"].get("count"), splitters["Fit"].get("sizes")) == ("3", "0.333333;0.333333;0.333333")
    assert (splitters["Cameras"].get("count"), splitters["Cameras"].get("sizes")) == ("1", "1")
    assert [curve.get("color") for curve in found["Fit"].iter("curve")][:4] == [color_of(i) for i in range(4)]
    assert root.find("tabbed_widget/currentTabIndex").get("index") == "0"
    assert root.find("use_relative_time_offset").get("enabled") == "1"


def test_one_joint_has_one_plot():
    layout = plotjuggler_layout(ViewedGraph(("left",), (("knee", 0),)))
    assert layout.count("/joint_states/") == 1
    tab = next(t for t in ElementTree.fromstring(layout.partition("\n")[2]).iter("Tab") if t.get("tab_name") == "Joint angles")
    assert len(list(tab.iter("DockArea"))) == 1


PANELS = foxglove_layout(GRAPH)["configById"]


def test_foxglove_has_these_panels():
    assert list(PANELS) == [
        "3D!body", "Image!left", "Image!right", "Image!top", "StateTransitions!status", "Plot!residual", "Plot!effort",
        "Plot!timings", "Plot!joints", "Plot!limbs", "RawMessages!reason", "DiagnosticSummary!all",
    ]  # fmt: skip
    assert PANELS["RawMessages!reason"] == {"topicPath": "/lab/tracker/state.status_reason"}
    assert PANELS["DiagnosticSummary!all"]["minLevel"] == 0


def test_foxglove_plots_these_paths():
    paths = {name: [path["value"] for path in panel["paths"]] for name, panel in PANELS.items() if "paths" in panel}
    state = "/lab/tracker/state"
    assert paths["Plot!residual"] == [f"{state}.residual", *(f"{state}.camera_residuals[{i}]" for i in range(3))]
    assert paths["Plot!joints"] == [f"/lab/tracker/joint_states.position[{i}]" for i in (4, 0, 2)]
    assert [path["label"] for path in PANELS["Plot!joints"]["paths"]] == ["knee", "elbow", "hip"]
    assert [path["label"] for path in PANELS["Plot!residual"]["paths"]] == ["all cameras", "left", "right", "top"]
    assert [path["color"] for path in PANELS["Plot!joints"]["paths"]] == [color_of(i) for i in range(3)]
    assert "showLine" not in PANELS["Plot!joints"]["paths"][0]
    assert PANELS["Plot!limbs"]["paths"][0]["showLine"] is False


def test_foxglove_s_states_are_those_of_the_message():
    states = PANELS["StateTransitions!status"]["paths"][0]["customStates"]["states"]
    assert [(state["value"], state["label"]) for state in states] == [
        ("0", "INITIALIZING"), ("1", "TRACKING"), ("2", "DEGRADED"), ("3", "LOST"),
    ]  # fmt: skip


def test_foxglove_shows_overlays_and_the_body():
    assert PANELS["Image!left"]["imageMode"] == {
        "imageTopic": "/lab/tracker/left/overlay/compressed", "calibrationTopic": "/lab/left/camera_info", "rectifyImage": False,
    }  # fmt: skip
    body = PANELS["3D!body"]
    assert body["followTf"] == "room"
    camera = body["cameraState"]
    assert (camera["distance"], camera["phi"], camera["thetaOffset"], camera["targetOffset"], camera["fovy"]) == (
        6,
        70,
        45,
        [0, 0, 1],
        45,
    )
    assert body["layers"]["grid"]["size"] == body["layers"]["grid"]["divisions"] == 10
    assert body["topics"]["/lab/robot_description"]["visible"] is False
    assert body["topics"]["/lab/top/camera_info"] == {"visible": True}


def shares(tree):
    """Share of the whole that each panel has, in percent."""
    if isinstance(tree, str):
        return {tree: 100.0}
    first, second = shares(tree["first"]), shares(tree["second"])
    part = tree["splitPercentage"] / 100.0
    return {k: part * v for k, v in first.items()} | {k: (1.0 - part) * v for k, v in second.items()}


def test_foxglove_s_panels_share_the_window():
    layout = foxglove_layout(GRAPH)["layout"]
    found = shares(layout)
    assert sum(found.values()) == pytest.approx(100.0)
    assert found["Image!left"] == pytest.approx(0.62 * 45.0 / 3.0)
    assert found["Image!left"] == pytest.approx(found["Image!right"]) == pytest.approx(found["Image!top"])
    assert found["3D!body"] == pytest.approx(0.38 * 60.0)
    assert found["StateTransitions!status"] == pytest.approx(38.0 * 0.4 * 0.35)
    assert found["Plot!residual"] == pytest.approx(0.62 * 55.0 * 0.2)
    assert found["Plot!joints"] == pytest.approx(found["Plot!limbs"])
    assert (layout["direction"], layout["second"]["direction"]) == ("row", "row")
    assert layout["first"]["direction"] == "column"
