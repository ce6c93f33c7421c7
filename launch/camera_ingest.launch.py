"""The cameras of a rig as ROS cameras.

ros2 launch tracker_node camera_ingest.launch.py rig:=rig.yaml
"""

from launch import LaunchDescription
from launch.actions import OpaqueFunction
from launch_ros.actions import Node

from tracker_node.ros.launch_files import argument, value_of


def generate_launch_description() -> LaunchDescription:
    arguments = [
        argument("rig"),
        argument("rate"),
        argument("shrink"),
        argument("loop", default_value="true"),
        argument("namespace"),
        argument("topics"),
        argument("compressed"),
        argument("listeners"),
        argument("use_sim_time"),
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_ingest)])


def _ingest(context) -> list:
    rate = value_of(context, "rate")
    arguments = ["--rig", value_of(context, "rig"), "--shrink", value_of(context, "shrink")]
    arguments += ["--rate", rate] if rate else []
    arguments += [f"--{name}" for name in ("loop", "compressed") if value_of(context, name) == "true"]
    arguments += ["--wait-for-info-subscribers", value_of(context, "listeners")]
    topics = value_of(context, "topics")
    arguments += ["--topics", *topics.split()] if topics else []
    node = Node(
        package="tracker_node",
        executable="camera_ingest",
        name="camera_ingest",
        namespace=value_of(context, "namespace"),
        arguments=arguments,
        parameters=[{"use_sim_time": value_of(context, "use_sim_time") == "true"}],
        output="screen",
    )
    return [node]
