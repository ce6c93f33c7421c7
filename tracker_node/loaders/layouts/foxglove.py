"""A layout of Foxglove: the body in 3D, the cameras with the body drawn over them, status, plots and diagnostics."""

from __future__ import annotations

import json
from collections.abc import Mapping
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
