"""The tracker on running cameras, with link frames for RViz.

ros2 launch tracker_node tracker.launch.py rig:=rig.yaml model:=person.yaml initial_state:=start.yaml
"""

from launch import LaunchDescription
from launch.actions import OpaqueFunction
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from tracker_node.ros.launch_files import argument, has_parameter, missing, said_by, value_of


def generate_launch_description() -> LaunchDescription:
    arguments = [
        *map(argument, ("rig", "model", "initial_state", "occluders", "params_file")),
        argument("calibration", default_value="rig"),
        *map(argument, ("name", "namespace", "frame_prefix", "link_frames", "lossless")),
        *map(argument, ("joint_states", "topics", "use_sim_time", "keypoints_table")),
        argument("keypoints", description="a detector runs: compare its points, too, unless params_file has modalities"),
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_nodes)])


def _nodes(context) -> list:
    def value(name: str) -> str:
        return value_of(context, name)

    arguments = ["--rig", value("rig"), "--model", value("model"), "--calibration", value("calibration")]
    for option, name in (
        *(("--initial-state", "initial_state"), ("--occluders", "occluders"), ("--config", "params_file")),
        ("--keypoints-table", "keypoints_table"),
    ):
        arguments += [option, value(name)] if value(name) else []
    arguments += ["--lossless"] if value("lossless") == "true" else []
    arguments += ["--joint-states", value("joint_states")] if value("joint_states") else []
    arguments += ["--topics", *value("topics").split()] if value("topics") else []
    shared = {"use_sim_time": value("use_sim_time") == "true", "frame_prefix": value("frame_prefix")}
    wanted = value("keypoints") == "true" or value("keypoints_table")
    by_points = wanted and not has_parameter(value("params_file"), "modalities")
    compared = {"modalities": ["region", "keypoints"]} if by_points else {}
    tracker = Node(
        package="tracker_node",
        executable="tracker",
        name=value("name"),
        namespace=value("namespace"),
        arguments=arguments,
        parameters=[shared | compared],
        output="screen",
    )
    if value("link_frames") == "false":
        return [tracker]
    absent = missing("robot_state_publisher", "the tracker goes on, /tf has no frames of its links")
    if absent:
        return [*absent, tracker]
    links = Node(
        package="robot_state_publisher",
        executable="robot_state_publisher",
        name=f"{value('name')}_links",
        namespace=value("namespace"),
        # Of Jazzy it wants the description as a parameter.
        parameters=[{"robot_description": ParameterValue(said_by(context, "urdf", value("model")), value_type=str)}, shared],
        # The tracker publishes the description already, on robot_description.
        remappings=[("joint_states", f"{value('name')}/joint_states"), ("robot_description", "~/robot_description")],
    )
    return [tracker, links]
