"""A layout of PlotJuggler: residuals, steps, timings, joint angles, the root and the limbs, a tab each."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from ..whole_file import write_whole
from .viewed_graph import ViewedGraph, color_of


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
