"""Layouts of RViz, Foxglove and PlotJuggler for one tracker and its cameras; `ViewedGraph` says which topics they show.

RViz: the body's shapes, the robot model, frames, and every camera's image with the body in it. Foxglove: the body in 3D, the
cameras with the body drawn over them, status, plots and diagnostics. PlotJuggler: residuals, steps, timings, joint angles, the
root and the limbs, a tab each.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from ..model.articulated import ArticulatedModel
from ..model.kinematic_chain import N_ROOT_DOF
from ..render.palette import STATES
from .whole_file import write_whole
from .yaml_file import write_mapping

COLORS = ("#1f77b4", "#d62728", "#2ca02c", "#ff7f0e", "#9467bd", "#8c564b", "#e377c2", "#7f7f7f", "#bcbd22", "#17becf")
"""Of the curves, in their order, and then again."""
_LARGE_JOINTS = ("knee_flexion", "hip_flexion", "elbow_flexion", "shoulder_elevation_front")
_SHOWN_JOINTS = 8


@dataclass(frozen=True)
class ViewedGraph:
    """Parameters
    ----------
    cameras : names.
    joints : name and place in `JointState` of the joints whose angles are plotted.
    world_frame : the frame that stands still.
    tracker : name of the tracker's node.
    namespace : of the tracker and the cameras.
    bodies : of several, the names that their topics have, and the joints of each.
    """

    cameras: tuple[str, ...]
    joints: tuple[tuple[str, int], ...]
    world_frame: str = "world"
    tracker: str = "tracker"
    namespace: str = ""
    bodies: Mapping[str, tuple[tuple[str, int], ...]] = field(default_factory=dict)

    @property
    def each(self) -> dict[str, ViewedGraph]:
        """The graph of each body by its name; of one that is alone by ""."""
        found = {n: replace(self, tracker=f"{self.tracker}/{n}", joints=j, bodies={}) for n, j in self.bodies.items()}
        return found or {"": self}

    def topic(self, name: str) -> str:
        """A topic of the tracker."""
        return self.resolved(f"{self.tracker}/{name}")

    def resolved(self, name: str) -> str:
        """Name of a relative topic in the graph, such as a camera's, ``robot_description`` and ``initialpose``."""
        return "/".join(["", *filter(None, (self.namespace.strip("/"), name))])


def joints_to_plot(model: ArticulatedModel) -> tuple[tuple[str, int], ...]:
    """Knees, hips, elbows and shoulders where a body has them, then its other joints in their order."""
    joints = [(name, i) for i, name in enumerate(model.chain.dof_names[N_ROOT_DOF:])]
    large = [joint for large_name in _LARGE_JOINTS for joint in joints if joint[0].endswith(large_name)]
    return tuple([*large, *(joint for joint in joints if joint not in large)][:_SHOWN_JOINTS])


def color_of(i: int) -> str:
    """Color of the i-th curve of a plot."""
    return COLORS[i % len(COLORS)]


_FIXED, _OF_BODY = ("Grid", "Frames"), ("Shapes", "Robot model", "Root")


def write_rviz_layout(graph: ViewedGraph, path: str | Path) -> None:
    """Write a configuration, which ``rviz2 -d FILE`` opens.

    Parameters
    ----------
    graph, path : topics that it shows; ``.rviz`` file.
    """
    write_mapping(rviz_layout(graph), path, "RViz: rviz2 -d FILE. Made by `tracker_node layouts`.")


def rviz_layout(graph: ViewedGraph) -> dict[str, Any]:
    """The configuration as RViz reads it from YAML."""
    displays = [
        _display("Grid", "Grid", Plane="XY", Color="160; 160; 164", **{"Cell Size": 1, "Plane Cell Count": 10}),
        _display("TF", "Frames", **{"Show Names": False, "Show Arrows": False, "Marker Scale": 0.3, "Frame Timeout": 15}),
        *(display for body, own in graph.each.items() for display in _body(own, body)),
        *(_camera(graph, name) for name in graph.cameras),
        *(_mask(own, name, body) for body, own in graph.each.items() for name in graph.cameras),
    ]
    return {
        "Panels": [
            {"Class": "rviz_common/Displays", "Name": "Displays", "Help Height": 0},
            {"Class": "rviz_common/Views", "Name": "Views"},
            {"Class": "rviz_common/Time", "Name": "Time"},
        ],
        "Visualization Manager": {
            "Class": "",
            "Name": "root",
            "Enabled": True,
            "Value": True,
            "Global Options": {"Background Color": "240; 240; 240", "Fixed Frame": graph.world_frame, "Frame Rate": 30},
            "Displays": displays,
            "Tools": [
                {"Class": "rviz_default_plugins/Interact"},
                {"Class": "rviz_default_plugins/MoveCamera"},
                {"Class": "rviz_default_plugins/Measure"},
                {"Class": "rviz_default_plugins/SetInitialPose", "Topic": _topic(graph.resolved("initialpose"), "Reliable")},
            ],
            "Views": {"Current": _view(), "Saved": None},
        },
        "Window Geometry": {"Width": 1600, "Height": 1000, "Hide Left Dock": False, "Hide Right Dock": True},
    }


_ROOT_LOOK = {"Axes Length": 0.2, "Axes Radius": 0.01, "Covariance": {"Value": True, "Position": {"Value": True, "Scale": 3}}}


def _display(kind: str, name: str, **fields: Any) -> dict[str, Any]:
    return {"Class": f"rviz_default_plugins/{kind}", "Name": name, "Enabled": True, "Value": True, **fields}


def _topic(name: str, reliability: str, durability: str = "Volatile") -> Mapping[str, Any]:
    return {
        "Value": name,
        "Depth": 5,
        "History Policy": "Keep Last",
        "Reliability Policy": reliability,
        "Durability Policy": durability,
    }


def _named(what: str, body: str) -> str:
    return f"{what} of {body}" if body else what


def _body(graph: ViewedGraph, body: str) -> list[dict[str, Any]]:
    root = _topic(graph.topic("pose"), "Reliable")
    return [
        _display("MarkerArray", _named("Shapes", body), Topic=_topic(graph.topic("markers"), "Reliable"), Namespaces={}),
        _robot_model(graph, body),
        _display("PoseWithCovariance", _named("Root", body), Topic=root, Shape="Axes", **_ROOT_LOOK),
    ]


def _robot_model(graph: ViewedGraph, body: str) -> dict[str, Any]:
    """Off at first, since the markers show the true shapes; it needs robot_state_publisher."""
    topic = graph.resolved("/".join(filter(None, (body, "robot_description"))))
    latched = _topic(topic, "Reliable", "Transient Local")
    fields: dict[str, Any] = {"Description Source": "Topic", "Description Topic": latched, "Visual Enabled": True, "Alpha": 0.5}
    return _display("RobotModel", _named("Robot model", body), **fields) | {"Enabled": False, "Value": False}


def _camera(graph: ViewedGraph, name: str) -> dict[str, Any]:
    """The camera's image with the shapes in it, as its calibration and place say."""
    of_bodies = [_named(display, body) for body in graph.each for display in _OF_BODY]
    visible = {display: display.startswith("Shapes") for display in (*_FIXED, *of_bodies)} | {"Value": True}
    fields = {"Image Rendering": "background and overlay", "Overlay Alpha": 0.5, "Visibility": visible, "Zoom Factor": 1}
    return _display("Camera", name, Topic=_topic(graph.resolved(f"{name}/image_raw"), "Best Effort"), **fields)


def _mask(graph: ViewedGraph, name: str, body: str) -> dict[str, Any]:
    mask = _display("Image", _named(f"{name} mask", body), Topic=_topic(graph.topic(f"{name}/mask"), "Reliable"))
    return mask | {"Enabled": False, "Value": False}  # drawn by the tracker only while somebody looks


def _view() -> dict[str, Any]:
    return {
        "Class": "rviz_default_plugins/Orbit",
        "Name": "Current View",
        "Target Frame": "<Fixed Frame>",
        "Distance": 5.0,
        "Pitch": 0.35,
        "Yaw": 0.8,
        "Focal Point": {"X": 0.0, "Y": 0.0, "Z": 1.0},
    }


_STATUS = ("INITIALIZING", "TRACKING", "DEGRADED", "LOST")
_STATUS_COLORS = tuple(STATES[name.lower()] for name in _STATUS)


def write_foxglove_layout(graph: ViewedGraph, path: str | Path) -> None:
    """Write a layout for *Layouts, Import from file*.

    Parameters
    ----------
    graph, path : topics that it shows; ``.json`` file.
    """
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, json.dumps(foxglove_layout(graph), indent=1) + "\n")


def foxglove_layout(graph: ViewedGraph) -> dict[str, Any]:
    """The layout as Foxglove exports and imports it: the panels' settings by their ids, and a tree of the ids."""
    plots: dict[str, Any] = {}
    for name, own in graph.each.items():
        plots |= {f"{key}{name and f' {name}'}": panel for key, panel in _plots(own, name).items()}
    images = {f"Image!{name}": _image(graph, name) for name in graph.cameras}
    states = {name: own.topic("state") for name, own in graph.each.items()}
    said = {f"RawMessages!reason{name and f' {name}'}": {"topicPath": f"{state}.status_reason"} for name, state in states.items()}
    panels = {
        "3D!body": _three_dee(graph),
        **images,
        "StateTransitions!status": _status(states),
        **plots,
        **said,
        "DiagnosticSummary!all": {"topicToRender": "/diagnostics", "minLevel": 0, "sortByLevel": True},
    }
    left = _stacked(["3D!body", "StateTransitions!status", *said, "DiagnosticSummary!all"], [60, 35, *[30] * len(said)])
    right = _stacked(list(plots), [20, 25, 33, 50] if len(plots) == 5 else _even(len(plots)))
    middle = _stacked(list(images), _even(len(images)))
    columns = {"direction": "row", "first": middle, "second": right, "splitPercentage": 45}
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {"direction": "row", "first": left, "second": columns, "splitPercentage": 38},
    }


def _plots(graph: ViewedGraph, name: str) -> dict[str, Any]:
    """Curves of a body; of one of several those that tell most."""
    state, of = graph.topic("state"), f" of {name}" if name else ""
    plots = {
        "Plot!residual": _plot(
            f"Residual{of}, px or gray levels", [(f"{state}.residual", "all cameras"), *_camera_residuals(graph)]
        ),
        "Plot!effort": _plot("Steps of the optimizer", [(f"{state}.iterations", "iterations")]),
        "Plot!timings": _plot(
            "Time for an image set, ms", [(f"{state}.{name}_ms", name) for name in ("observe", "optimize", "total")]
        ),
        "Plot!joints": _plot(
            f"Joint angles{of}, rad", [(f"{graph.topic('joint_states')}.position[{i}]", n) for n, i in graph.joints]
        ),
        "Plot!limbs": _plot(f"Probability that a limb{of} is lost, 0 to 1", [(f"{state}.limb_lost_probability[:]", "limbs")]),
    }
    plots["Plot!limbs"]["paths"][0]["showLine"] = False  # all limbs are one series
    few = ("Plot!residual", "Plot!joints") if graph.joints else ("Plot!residual",)
    return {key: plots[key] for key in few} if name else plots


def _even(n: int) -> list[float]:
    """Percentages by which panels share a column out evenly."""
    return [100.0 / (n - i) for i in range(n - 1)]


def _stacked(panels: list[str], percentages: list[float]) -> Any:
    """Panels below each other; each percentage is the part of what is left that the next one takes."""
    if len(panels) == 1:
        return panels[0]
    rest = _stacked(panels[1:], percentages[1:])
    return {"direction": "column", "first": panels[0], "second": rest, "splitPercentage": percentages[0]}


def _three_dee(graph: ViewedGraph) -> dict[str, Any]:
    return {
        "foxglovePanelTitle": "Body",
        "cameraState": {"distance": 6, "phi": 70, "thetaOffset": 45, "perspective": True, "targetOffset": [0, 0, 1], "fovy": 45},
        "followMode": "follow-none",
        "followTf": graph.world_frame,
        "scene": {"backgroundColor": "#f0f0f0", "transforms": {"visible": False}},
        "layers": {"grid": {"layerId": "foxglove.Grid", "instanceId": "grid", "visible": True, "size": 10, "divisions": 10}},
        "topics": {
            **{topic: settings for name, own in graph.each.items() for topic, settings in _body_in_3d(own, name).items()},
            **{graph.resolved(f"{name}/camera_info"): {"visible": True} for name in graph.cameras},
        },
    }


def _body_in_3d(graph: ViewedGraph, name: str) -> dict[str, Any]:
    robot = {"visible": False, "controlMode": "jointStates", "jointStatesTopic": graph.topic("joint_states")}
    return {
        graph.topic("markers"): {"visible": True},
        graph.topic("pose"): {"visible": True, "type": "axis", "axisScale": 0.2},
        graph.resolved("/".join(filter(None, (name, "robot_description")))): robot,
    }


def _image(graph: ViewedGraph, name: str) -> dict[str, Any]:
    """The tracker's overlay; of several bodies, of which each has an overlay of its own, that of the first."""
    first = next(iter(graph.each.values()))
    topics = {"imageTopic": first.topic(f"{name}/overlay/compressed"), "calibrationTopic": graph.resolved(f"{name}/camera_info")}
    return {"foxglovePanelTitle": name, "imageMode": {**topics, "rectifyImage": False}}


def _status(of_bodies: Mapping[str, str]) -> dict[str, Any]:
    """Of each body, whose topics of states are given by name."""
    states = [
        {"value": str(i), "label": name, "color": color}
        for i, (name, color) in enumerate(zip(_STATUS, _STATUS_COLORS, strict=True))
    ]
    paths = [
        {
            "value": f"{state}.status",
            "label": name or "status",
            "timestampMethod": "receiveTime",
            "enabled": True,
            "customStates": {"type": "discrete", "states": states},
        }
        for name, state in of_bodies.items()
    ]
    return {"foxglovePanelTitle": "Status", "isSynced": True, "paths": paths}


def _camera_residuals(graph: ViewedGraph) -> list[tuple[str, str]]:
    return [(f"{graph.topic('state')}.camera_residuals[{i}]", name) for i, name in enumerate(graph.cameras)]


def _plot(title: str, curves: list[tuple[str, str]]) -> dict[str, Any]:
    paths = [
        {"value": path, "label": label, "color": color_of(i), "enabled": True, "timestampMethod": "receiveTime"}
        for i, (path, label) in enumerate(curves)
    ]
    return {
        "foxglovePanelTitle": title,
        "paths": paths,
        "isSynced": True,
        "xAxisVal": "timestamp",
        "showLegend": True,
        "legendDisplay": "floating",
        "showXAxisLabels": True,
        "showYAxisLabels": True,
    }


def write_plotjuggler_layout(graph: ViewedGraph, path: str | Path) -> None:
    """Write a layout for *Layout, Load* or ``plotjuggler --layout FILE``.

    Parameters
    ----------
    graph, path : topics that it shows; ``.xml`` file.
    """
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, plotjuggler_layout(graph))


def plotjuggler_layout(graph: ViewedGraph) -> str:
    """The layout as XML; PlotJuggler names fields ``/topic/field``, items of arrays ``[i]``, joints by their names."""
    root = ElementTree.Element("root")
    tabs = ElementTree.SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    for body, own in graph.each.items():
        for name, plots in _tabs(own).items():
            _add_tab(tabs, f"{name} of {body}" if body else name, plots)
    ElementTree.SubElement(tabs, "currentTabIndex", index="0")
    ElementTree.SubElement(root, "use_relative_time_offset", enabled="1")
    for empty in ("Plugins", "customMathEquations", "snippets"):
        ElementTree.SubElement(root, empty)
    ElementTree.indent(root)
    return "<?xml version='1.0' encoding='UTF-8'?>\n" + ElementTree.tostring(root, encoding="unicode") + "\n"


def _tabs(graph: ViewedGraph) -> dict[str, list[tuple[str, list[str]]]]:
    """Name of a tab to its plots, one below the other, each a title with its unit and the curves."""
    state, joints = graph.topic("state"), graph.topic("joint_states")
    half, n_cameras = (len(graph.joints) + 1) // 2, len(graph.cameras)
    names = [name for name, _ in graph.joints]
    return {
        "Fit": [
            ("residual, px or gray levels", [f"{state}/residual", *(f"{state}/camera_residuals[{i}]" for i in range(n_cameras))]),
            ("status: 1 tracking, 2 degraded, 3 lost", [f"{state}/status"]),
            ("steps of the optimizer", [f"{state}/iterations", f"{state}/evaluations"]),
        ],
        "Timings": [("time for an image set, ms", [f"{state}/{name}_ms" for name in ("observe", "optimize", "total")])],
        "Joint angles": [
            ("angle, rad", [f"{joints}/{name}/position" for name in part]) for part in (names[:half], names[half:]) if part
        ],
        "Root": [
            ("position, m", [f"{state}/root_pose/position/{axis}" for axis in "xyz"]),
            ("velocity, m/s", [f"{state}/velocities[{i}]" for i in range(3)]),
        ],
        "Cameras": [("samples in the fit", [f"{state}/camera_samples[{i}]" for i in range(n_cameras)])],
    }


def _add_tab(tabs: ElementTree.Element, name: str, plots: list[tuple[str, list[str]]]) -> None:
    tab = ElementTree.SubElement(tabs, "Tab", tab_name=name, containers="1")
    container = ElementTree.SubElement(tab, "Container")
    sizes = ";".join(f"{1.0 / len(plots):.6g}" for _ in plots)
    splitter = ElementTree.SubElement(container, "DockSplitter", orientation="-", count=str(len(plots)), sizes=sizes)
    for title, curves in plots:
        area = ElementTree.SubElement(splitter, "DockArea", name=title)
        plot = ElementTree.SubElement(area, "plot", mode="TimeSeries", style="Lines", flip_x="false", flip_y="false")
        ElementTree.SubElement(plot, "limitY")
        for i, curve in enumerate(curves):
            ElementTree.SubElement(plot, "curve", name=curve, color=color_of(i))
