"""The demo, to be watched in RViz: a real recording, tracked and evaluated.

    ros2 launch tracker_node demo.launch.py output:=out/demo
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, IncludeLaunchDescription, RegisterEventHandler
from launch.conditions import IfCondition
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    arguments = [
        DeclareLaunchArgument("output", default_value="out/demo", description="folder for the recording and the results"),
        DeclareLaunchArgument("rviz", default_value="true", choices=["true", "false"], description="open RViz"),
    ]
    demo = Node(
        package="tracker_node",
        executable="tracker_node",
        arguments=["demo", "--out", LaunchConfiguration("output")],
        output="screen",
    )
    source = PathJoinSubstitution([FindPackageShare("tracker_node"), "launch", "rviz.launch.py"])
    rviz = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(source), condition=IfCondition(LaunchConfiguration("rviz"))
    )
    end = RegisterEventHandler(OnProcessExit(target_action=demo, on_exit=[EmitEvent(event=Shutdown())]))
    return LaunchDescription([*arguments, demo, rviz, end])
