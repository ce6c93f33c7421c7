"""A bag once more, for RViz or for another tracker, on the bag's own clock.

    ros2 launch tracker_node replay.launch.py bag:=out/run1/bag rate:=0.5 rviz:=true
    ros2 launch tracker_node replay.launch.py bag:=out/run1/bag track:=true rig:=rig.yaml model:=person.yaml

A tracker that is run on the bag is called ``again``, so that its topics stand beside those recorded.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node

from tracker_node.ros.launch_files import SWITCH, argument, included, value_of

AGAIN = "again"
TRACKER = ("initial_state", "occluders", "params_file", "calibration", "keypoints_table")


def generate_launch_description() -> LaunchDescription:
    arguments = [
        DeclareLaunchArgument("bag", description="folder or .mcap file"),
        DeclareLaunchArgument("rate", default_value="1.0", description="speed"),
        DeclareLaunchArgument("start", default_value="0.0", description="seconds to leave out at the beginning"),
        argument("loop", description="begin again at the end"),
        DeclareLaunchArgument(
            "track", default_value="false", choices=SWITCH, description="run a tracker on the bag's images: needs rig and model"
        ),
        argument("rig", default_value=""),
        argument("model", default_value=""),
        *map(argument, TRACKER),
        argument("rviz"),
        argument("layout"),
    ]
    own = {"name": AGAIN, "link_frames": "false", "lossless": "true", "use_sim_time": "true"}
    tracker = included("tracker", ("rig", "model", *TRACKER), own, only_if="track")
    rviz = included("rviz", ("layout", "rig"), {"use_sim_time": "true"}, only_if="rviz")
    return LaunchDescription([*arguments, tracker, rviz, OpaqueFunction(function=_player)])


def _player(context) -> list:
    arguments = [value_of(context, "bag"), "--rate", value_of(context, "rate"), "--start", value_of(context, "start")]
    arguments += ["--loop"] if value_of(context, "loop") == "true" else []
    # Nothing may have gone by before the tracker listens, which takes seconds, and nothing may get lost on the way.
    arguments += ["--wait-for-node", AGAIN, "--reliable"] if value_of(context, "track") == "true" else []
    return [Node(package="tracker_node", executable="player", name="player", arguments=arguments, output="screen")]
