"""The tracker on running cameras, with link frames for RViz.

    ros2 launch tracker_node tracker.launch.py rig:=rig.yaml model:=person.yaml initial_state:=start.yaml
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    arguments = [
        DeclareLaunchArgument("rig", description="rig.yaml: places and lenses of the cameras"),
        DeclareLaunchArgument("model", description="model.yaml: the body"),
        DeclareLaunchArgument(
            "initial_state", default_value="", description="state.yaml: where the body is at first; empty: it is looked for"
        ),
        DeclareLaunchArgument("occluders", default_value="", description="model of fixed things that may hide the body"),
        DeclareLaunchArgument("params_file", default_value="", description="parameters of the tracker"),
        DeclareLaunchArgument("calibration", default_value="rig", choices=["rig", "camera_info"]),
        DeclareLaunchArgument("namespace", default_value="", description="before every relative topic"),
        DeclareLaunchArgument("link_frames", default_value="true", description="publish the body's links on /tf"),
    ]
    tracker = Node(
        package="tracker_node",
        executable="tracker",
        name="tracker",
        namespace=LaunchConfiguration("namespace"),
        arguments=[
            "--rig",
            LaunchConfiguration("rig"),
            "--model",
            LaunchConfiguration("model"),
            "--initial-state",
            LaunchConfiguration("initial_state"),
            "--occluders",
            LaunchConfiguration("occluders"),
            "--config",
            LaunchConfiguration("params_file"),
            "--calibration",
            LaunchConfiguration("calibration"),
        ],
        output="screen",
    )
    links = Node(
        package="robot_state_publisher",
        executable="robot_state_publisher",
        namespace=LaunchConfiguration("namespace"),
        remappings=[("joint_states", "tracker/joint_states")],
        condition=IfCondition(LaunchConfiguration("link_frames")),
    )
    return LaunchDescription([*arguments, tracker, links])
