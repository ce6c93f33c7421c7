"""The cameras of a rig as ROS cameras.

    ros2 launch tracker_node camera_ingest.launch.py rig:=rig.yaml
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node

from tracker_node.ros.launch_files import argument, value_of


def generate_launch_description() -> LaunchDescription:
    arguments = [
        argument("rig"),
        DeclareLaunchArgument("rate", default_value="", description="images per second of recordings; empty: what they say"),
        argument("shrink"),
        argument("loop", default_value="true"),
        argument("namespace"),
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_ingest)])


def _ingest(context) -> list:
    rate = value_of(context, "rate")
    arguments = ["--rig", value_of(context, "rig"), "--shrink", value_of(context, "shrink")]
    arguments += ["--rate", rate] if rate else []
    arguments += ["--loop"] if value_of(context, "loop") == "true" else []
    node = Node(
        package="tracker_node",
        executable="camera_ingest",
        name="camera_ingest",
        namespace=value_of(context, "namespace"),
        arguments=arguments,
        output="screen",
    )
    return [node]
