"""RViz with the tracker's layout.

ros2 launch tracker_node rviz.launch.py rig:=rig.yaml
ros2 launch tracker_node rviz.launch.py layout:=layouts/rviz/tracker.rviz
"""

from tempfile import TemporaryDirectory

from launch import LaunchDescription
from launch.actions import OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnShutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from tracker_node.ros.launch_files import argument, missing, said_by, value_of

SHIPPED_CAMERAS = ("cam01", "cam02", "cam03", "cam04")


def generate_launch_description() -> LaunchDescription:
    arguments = [
        argument("layout"),
        argument("rig", default_value="", description="rig.yaml: whose cameras are shown; empty: cam01 to cam04"),
        argument("namespace", description="of the tracker and its cameras"),
        argument("name"),
        argument("use_sim_time"),
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_rviz)])


def _rviz(context) -> list:
    absent = missing("rviz2", "all else goes on; Foxglove shows the same, see tracker_node layouts --help")
    if absent:
        return absent
    if layout := value_of(context, "layout"):
        return [_showing(layout)]
    folder = TemporaryDirectory(prefix="tracker_node_")
    rig, namespace = value_of(context, "rig"), value_of(context, "namespace")
    options = ["--rig", rig] if rig else ["--cameras", *SHIPPED_CAMERAS]
    options += ["--tracker", value_of(context, "name"), "--namespace", namespace]
    said_by(context, "layouts", *options, "--output", folder.name)
    end = RegisterEventHandler(OnShutdown(on_shutdown=lambda event, context: folder.cleanup()))
    return [_showing(f"{folder.name}/rviz/tracker.rviz"), end]


def _showing(layout: str) -> Node:
    return Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", layout],
        parameters=[{"use_sim_time": LaunchConfiguration("use_sim_time")}],
    )
