"""Recorded cameras of a rig: ros2 launch tracker_node camera_ingest.launch.py rig:=rig.yaml."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    arguments = [
        DeclareLaunchArgument("rig", description="rig.yaml with cameras and their sources"),
        DeclareLaunchArgument("rate", default_value="30.0", description="images per second"),
        DeclareLaunchArgument("namespace", default_value="", description="before every relative topic"),
    ]
    ingest = Node(
        package="tracker_node",
        executable="camera_ingest",
        name="camera_ingest",
        namespace=LaunchConfiguration("namespace"),
        arguments=["--rig", LaunchConfiguration("rig"), "--rate", LaunchConfiguration("rate"), "--loop"],
        output="screen",
    )
    return LaunchDescription([*arguments, ingest])
