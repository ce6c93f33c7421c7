"""A configuration of RViz: the body's shapes, the robot model, frames, and every camera's image with the body in it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..yaml_file import write_mapping
from .viewed_graph import ViewedGraph

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
