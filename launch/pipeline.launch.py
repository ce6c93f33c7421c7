"""A whole recording, from cameras to a bag and its evaluation, as recording.yaml says.

ros2 launch tracker_node pipeline.launch.py recording:=recording.yaml output:=out/run1
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch_ros.actions import Node

from tracker_node.ros.launch_files import BAG_CLOSED, argument, value_of

FILES = ("rig", "model", "initial_state", "occluders", "keypoints_table", "config", "output")


def generate_launch_description() -> LaunchDescription:
    arguments = [
        DeclareLaunchArgument("recording", default_value="", description="recording.yaml; what follows goes before what it says"),
        *(argument(name, default_value="") for name in ("rig", "model", "initial_state", "occluders", "keypoints_table")),
        DeclareLaunchArgument("config", default_value="", description="parameters of the tracker"),
        argument("keypoints", default_value="auto", choices=["auto", "on", "off"]),
        DeclareLaunchArgument("output", default_value="", description="folder of the run; its bag must not exist"),
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_pipeline)])


def _pipeline(context) -> list:
    given = {name: value_of(context, name) for name in ("recording", *FILES)}
    arguments = [given["recording"]] if given["recording"] else []
    for name in FILES:
        arguments += [f"--{name.replace('_', '-')}", given[name]] if given[name] else []
    arguments += ["--keypoints", value_of(context, "keypoints")]
    # It starts and ends its processes in the right order, which separate launch actions could not.
    pipeline = Node(package="tracker_node", executable="pipeline", arguments=arguments, output="screen", **BAG_CLOSED)
    end = RegisterEventHandler(OnProcessExit(target_action=pipeline, on_exit=[EmitEvent(event=Shutdown())]))
    return [pipeline, end]
