"""A layout of Foxglove: the body in 3D, the cameras with the body drawn over them, status, plots and diagnostics."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ...render.palette import STATES
from ..whole_file import write_whole
from .viewed_graph import ViewedGraph, color_of

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
    state = graph.topic("state")
    plots = {
        "Plot!residual": _plot("Residual, px or gray levels", [(f"{state}.residual", "all cameras"), *_camera_residuals(graph)]),
        "Plot!effort": _plot("Steps of the optimizer", [(f"{state}.iterations", "iterations")]),
        "Plot!timings": _plot(
            "Time for an image set, ms", [(f"{state}.{name}_ms", name) for name in ("observe", "optimize", "total")]
        ),
        "Plot!joints": _plot("Joint angles, rad", [(f"{graph.topic('joint_states')}.position[{i}]", n) for n, i in graph.joints]),
        "Plot!limbs": _plot("Probability that a limb is lost, 0 to 1", [(f"{state}.limb_lost_probability[:]", "limbs")]),
    }
    plots["Plot!limbs"]["paths"][0]["showLine"] = False  # all limbs are one series
    images = {f"Image!{name}": _image(graph, name) for name in graph.cameras}
    panels = {
        "3D!body": _three_dee(graph),
        **images,
        "StateTransitions!status": _status(state),
        **plots,
        "RawMessages!reason": {"topicPath": f"{state}.status_reason"},
        "DiagnosticSummary!all": {"topicToRender": "/diagnostics", "minLevel": 0, "sortByLevel": True},
    }
    left = _stacked(["3D!body", "StateTransitions!status", "RawMessages!reason", "DiagnosticSummary!all"], [60, 35, 30])
    right = _stacked(list(plots), [20, 25, 33, 50])
    middle = _stacked(list(images), [100.0 / (len(images) - i) for i in range(len(images) - 1)])
    columns = {"direction": "row", "first": middle, "second": right, "splitPercentage": 45}
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {"direction": "row", "first": left, "second": columns, "splitPercentage": 38},
    }


def _stacked(panels: list[str], percentages: list[float]) -> Any:
    """Panels below each other; each percentage is the part of what is left that the next one takes."""
    if len(panels) == 1:
        return panels[0]
    rest = _stacked(panels[1:], percentages[1:])
    return {"direction": "column", "first": panels[0], "second": rest, "splitPercentage": percentages[0]}


def _three_dee(graph: ViewedGraph) -> dict[str, Any]:
    robot = {"visible": False, "controlMode": "jointStates", "jointStatesTopic": graph.topic("joint_states")}
    return {
        "foxglovePanelTitle": "Body",
        "cameraState": {"distance": 6, "phi": 70, "thetaOffset": 45, "perspective": True, "targetOffset": [0, 0, 1], "fovy": 45},
        "followMode": "follow-none",
        "followTf": graph.world_frame,
        "scene": {"backgroundColor": "#f0f0f0", "transforms": {"visible": False}},
        "layers": {"grid": {"layerId": "foxglove.Grid", "instanceId": "grid", "visible": True, "size": 10, "divisions": 10}},
        "topics": {
            graph.topic("markers"): {"visible": True},
            graph.topic("pose"): {"visible": True, "type": "axis", "axisScale": 0.2},
            graph.resolved("robot_description"): robot,
            **{graph.resolved(f"{name}/camera_info"): {"visible": True} for name in graph.cameras},
        },
    }


def _image(graph: ViewedGraph, name: str) -> dict[str, Any]:
    topics = {"imageTopic": graph.topic(f"{name}/overlay/compressed"), "calibrationTopic": graph.resolved(f"{name}/camera_info")}
    return {"foxglovePanelTitle": name, "imageMode": {**topics, "rectifyImage": False}}


def _status(state: str) -> dict[str, Any]:
    states = [
        {"value": str(i), "label": name, "color": color}
        for i, (name, color) in enumerate(zip(_STATUS, _STATUS_COLORS, strict=True))
    ]
    path = {
        "value": f"{state}.status",
        "label": "status",
        "timestampMethod": "receiveTime",
        "enabled": True,
        "customStates": {"type": "discrete", "states": states},
    }
    return {"foxglovePanelTitle": "Status", "isSynced": True, "paths": [path]}


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
