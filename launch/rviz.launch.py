"""RViz with the tracker's layout.

    ros2 launch tracker_node rviz.launch.py rig:=rig.yaml
    ros2 launch tracker_node rviz.launch.py layout:=layouts/rviz/tracker.rviz
"""

import tempfile
from pathlib import Path

from launch import LaunchDescription
from launch.actions import OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from tracker_node.ros.launch_files import argument, value_of

SHIPPED_CAMERAS = ("cam01", "cam02", "cam03", "cam04")


def generate_launch_description() -> LaunchDescription:
    arguments = [
        argument("layout"),
        argument("rig", default_value="", description="rig.yaml: whose cameras are shown; empty: cam01 to cam04"),
        argument("namespace", description="of the tracker and its cameras"),
        argument("use_sim_time"),
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_rviz)])


def _rviz(context) -> list:
    layout = value_of(context, "layout") or _layout_for(value_of(context, "rig"), value_of(context, "namespace"))
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", layout],
        parameters=[{"use_sim_time": LaunchConfiguration("use_sim_time")}],
    )
    return [rviz]


def _layout_for(rig_file: str, namespace: str) -> str:
    """A layout in a folder of its own, as `tracker_node layouts` writes it."""
    from tracker_node.loaders.rig_yaml import load_rig
    from tracker_node.loaders.rviz_layout import write_rviz_layout
    from tracker_node.loaders.viewed_graph import ViewedGraph

    rig = load_rig(rig_file) if rig_file else None
    cameras, world = (rig.names, rig.world_frame) if rig else (SHIPPED_CAMERAS, "world")
    path = Path(tempfile.mkdtemp(prefix="tracker_node_")) / "tracker.rviz"
    write_rviz_layout(ViewedGraph(tuple(cameras), (), world, namespace=namespace), path)
    return str(path)
