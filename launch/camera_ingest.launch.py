"""The cameras of a rig as ROS cameras.

    ros2 launch tracker_node camera_ingest.launch.py rig:=rig.yaml
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

SWITCH = ["true", "false"]


def generate_launch_description() -> LaunchDescription:
    arguments = [
        DeclareLaunchArgument("rig", description="rig.yaml with cameras and their sources"),
        DeclareLaunchArgument("rate", default_value="", description="images per second of recordings; empty: what they say"),
        DeclareLaunchArgument("shrink", default_value="1", description="make images so many times smaller"),
        DeclareLaunchArgument("loop", default_value="true", choices=SWITCH, description="recordings begin again at their end"),
        DeclareLaunchArgument("namespace", default_value="", description="before every relative topic"),
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_ingest)])


def _ingest(context) -> list:
    def value(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    arguments = ["--rig", value("rig"), "--shrink", value("shrink")]
    arguments += ["--rate", value("rate")] if value("rate") else []
    arguments += ["--loop"] if value("loop") == "true" else []
    node = Node(
        package="tracker_node",
        executable="camera_ingest",
        name="camera_ingest",
        namespace=value("namespace"),
        arguments=arguments,
        output="screen",
    )
    return [node]
