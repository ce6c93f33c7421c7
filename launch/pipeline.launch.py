"""Cameras, tracker and recorder as one launch.

    ros2 launch tracker_node pipeline.launch.py rig:=rig.yaml model:=person.yaml initial_state:=start.yaml bag:=out/run1
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, RegisterEventHandler
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    arguments = [
        DeclareLaunchArgument("rig", description="rig.yaml with cameras and their sources"),
        DeclareLaunchArgument("model", description="model.yaml: the body"),
        DeclareLaunchArgument(
            "initial_state", default_value="", description="state.yaml: where the body is at first; empty: it is looked for"
        ),
        DeclareLaunchArgument("occluders", default_value="", description="model of fixed things that may hide the body"),
        DeclareLaunchArgument("bag", description="folder of the bag; must not exist"),
    ]
    # It starts and ends its three processes in the right order, which separate launch actions could not.
    pipeline = Node(
        package="tracker_node",
        executable="pipeline",
        arguments=[
            "--rig",
            LaunchConfiguration("rig"),
            "--model",
            LaunchConfiguration("model"),
            "--initial-state",
            LaunchConfiguration("initial_state"),
            "--occluders",
            LaunchConfiguration("occluders"),
            "--bag",
            LaunchConfiguration("bag"),
        ],
        output="screen",
    )
    end = RegisterEventHandler(OnProcessExit(target_action=pipeline, on_exit=[EmitEvent(event=Shutdown())]))
    return LaunchDescription([*arguments, pipeline, end])
