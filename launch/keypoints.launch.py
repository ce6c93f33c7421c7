"""The detector of people on running cameras, which searches around the body of the tracker beside it.

ros2 launch tracker_node keypoints.launch.py rig:=rig.yaml keypoints_rate:=5
"""

from launch import LaunchDescription
from launch.actions import OpaqueFunction
from launch_ros.actions import Node

from tracker_node.ros.launch_files import argument, value_of


def generate_launch_description() -> LaunchDescription:
    arguments = map(argument, ("rig", "keypoints_rate", "weights", "name", "namespace", "topics", "use_sim_time"))
    return LaunchDescription([*arguments, OpaqueFunction(function=_detector)])


def _detector(context) -> list:
    arguments = ["--rig", value_of(context, "rig"), "--tracker", value_of(context, "name")]
    for option, name in (("--rate", "keypoints_rate"), ("--weights", "weights")):
        arguments += [option, value_of(context, name)] if value_of(context, name) else []
    topics = value_of(context, "topics")
    arguments += ["--topics", *topics.split()] if topics else []
    node = Node(
        package="tracker_node",
        executable="keypoints",
        name="keypoints",
        namespace=value_of(context, "namespace"),
        arguments=arguments,
        parameters=[{"use_sim_time": value_of(context, "use_sim_time") == "true"}],
        output="screen",
    )
    return [node]
