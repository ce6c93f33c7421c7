"""The demo, to be watched in RViz: a real recording, tracked and evaluated.

ros2 launch tracker_node demo.launch.py output:=out/demo
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, RegisterEventHandler
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from tracker_node.ros.launch_files import BAG_CLOSED, argument, included


def generate_launch_description() -> LaunchDescription:
    arguments = [
        DeclareLaunchArgument("output", default_value="out/demo", description="folder for the recording and the results"),
        argument("rviz", default_value="true"),
    ]
    demo = Node(
        package="tracker_node",
        executable="tracker_node",
        arguments=["demo", "--output", LaunchConfiguration("output")],
        output="screen",
        **BAG_CLOSED,
    )
    end = RegisterEventHandler(OnProcessExit(target_action=demo, on_exit=[EmitEvent(event=Shutdown())]))
    return LaunchDescription([*arguments, demo, included("rviz", (), only_if="rviz"), end])
