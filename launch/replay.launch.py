"""A bag once more, for RViz or for another tracker, on the bag's own clock.

    ros2 launch tracker_node replay.launch.py bag:=out/run1/bag rate:=0.5 rviz:=true
    ros2 launch tracker_node replay.launch.py bag:=out/run1/bag track:=true rig:=rig.yaml model:=person.yaml

A tracker that is run on the bag is called ``again``, so that its topics stand beside those recorded.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

SWITCH = ["true", "false"]
LAYOUT = PathJoinSubstitution([FindPackageShare("tracker_node"), "config", "rviz", "tracker.rviz"])
TRACKER = ("rig", "model", "initial_state", "occluders", "params_file", "calibration")


def generate_launch_description() -> LaunchDescription:
    arguments = [
        DeclareLaunchArgument("bag", description="folder or .mcap file"),
        DeclareLaunchArgument("rate", default_value="1.0", description="speed"),
        DeclareLaunchArgument("start", default_value="0.0", description="seconds to leave out at the beginning"),
        DeclareLaunchArgument("loop", default_value="false", choices=SWITCH, description="begin again at the end"),
        DeclareLaunchArgument("track", default_value="false", choices=SWITCH, description="run a tracker on the bag's images"),
        DeclareLaunchArgument("rig", default_value="", description="for the tracker: rig.yaml"),
        DeclareLaunchArgument("model", default_value="", description="for the tracker: model.yaml or URDF"),
        DeclareLaunchArgument("initial_state", default_value="", description="for the tracker: state.yaml; empty: it looks"),
        DeclareLaunchArgument("occluders", default_value="", description="for the tracker: fixed things that may hide the body"),
        DeclareLaunchArgument("params_file", default_value="", description="for the tracker: parameters"),
        DeclareLaunchArgument(
            "calibration", default_value="camera_info", choices=["rig", "camera_info"], description="where lenses come from"
        ),
        DeclareLaunchArgument("rviz", default_value="false", choices=SWITCH, description="open RViz"),
        DeclareLaunchArgument("layout", default_value=LAYOUT, description="of RViz"),
    ]
    own = {"name": "again", "link_frames": "false", "use_sim_time": "true"}
    tracker = _included("tracker", TRACKER, own, IfCondition(LaunchConfiguration("track")))
    rviz = _included("rviz", ("layout",), {"use_sim_time": "true"}, IfCondition(LaunchConfiguration("rviz")))
    return LaunchDescription([*arguments, tracker, rviz, OpaqueFunction(function=_player)])


def _player(context) -> list:
    def value(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    arguments = [value("bag"), "--rate", value("rate"), "--start", value("start")]
    arguments += ["--loop"] if value("loop") == "true" else []
    return [Node(package="tracker_node", executable="player", name="player", arguments=arguments, output="screen")]


def _included(name: str, passed: tuple[str, ...], own: dict[str, str], condition: IfCondition) -> IncludeLaunchDescription:
    """Another launch file of this package, with these arguments of ours, and others."""
    path = PathJoinSubstitution([FindPackageShare("tracker_node"), "launch", f"{name}.launch.py"])
    values = {argument: LaunchConfiguration(argument) for argument in passed} | own
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(path), launch_arguments=values.items(), condition=condition
    )
