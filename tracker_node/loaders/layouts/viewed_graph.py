"""Topics of one tracker and its cameras that layouts of viewers (RViz, Foxglove, PlotJuggler) show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from ...model.articulated import ArticulatedModel
from ...model.kinematic_chain import N_ROOT_DOF

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
