"""A rig at work: its cameras, the tracker, a recorder and RViz, each if asked for.

    ros2 launch tracker_node rig.launch.py rig:=rig.yaml model:=person.yaml bag:=out/run1/bag rviz:=true
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, PythonExpression
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

SWITCH = ["true", "false"]
LAYOUT = PathJoinSubstitution([FindPackageShare("tracker_node"), "config", "rviz", "tracker.rviz"])
TRACKER = ("rig", "model", "initial_state", "occluders", "params_file", "calibration", "namespace", "link_frames")


def generate_launch_description() -> LaunchDescription:
    arguments = [
        DeclareLaunchArgument("rig", description="rig.yaml with cameras, their places and their sources"),
        DeclareLaunchArgument("model", description="model.yaml or URDF: the body"),
        DeclareLaunchArgument(
            "initial_state", default_value="", description="state.yaml: where the body is at first; empty: it is looked for"
        ),
        DeclareLaunchArgument("occluders", default_value="", description="model of fixed things that may hide the body"),
        DeclareLaunchArgument("params_file", default_value="", description="parameters of the tracker"),
        DeclareLaunchArgument(
            "calibration", default_value="camera_info", choices=["rig", "camera_info"], description="where lenses come from"
        ),
        DeclareLaunchArgument("namespace", default_value="", description="before every relative topic"),
        DeclareLaunchArgument("link_frames", default_value="true", choices=SWITCH, description="publish the body's links on /tf"),
        DeclareLaunchArgument(
            "ingest", default_value="true", choices=SWITCH, description="false: other packages' drivers publish the cameras"
        ),
        DeclareLaunchArgument("shrink", default_value="1", description="make images so many times smaller"),
        DeclareLaunchArgument("loop", default_value="false", choices=SWITCH, description="recordings begin again at their end"),
        DeclareLaunchArgument("bag", default_value="", description="record to this folder, which must not exist; empty: nothing"),
        DeclareLaunchArgument(
            "record_images", default_value="none", choices=["none", "compressed", "raw", "all"], description="images in the bag"
        ),
        DeclareLaunchArgument("split_mb", default_value="0", description="begin another file of the bag at this size; 0: never"),
        DeclareLaunchArgument(
            "compression", default_value="none", choices=["none", "lz4", "zstd"], description="of the bag's messages"
        ),
        DeclareLaunchArgument("rviz", default_value="false", choices=SWITCH, description="open RViz"),
        DeclareLaunchArgument("layout", default_value=LAYOUT, description="of RViz"),
    ]
    ingest = _included("camera_ingest", ("rig", "shrink", "loop", "namespace"), IfCondition(LaunchConfiguration("ingest")))
    recorder = Node(
        package="tracker_node",
        executable="recorder",
        name="recorder",
        arguments=[
            *("--output", LaunchConfiguration("bag"), "--images", LaunchConfiguration("record_images")),
            *("--split-mb", LaunchConfiguration("split_mb"), "--compression", LaunchConfiguration("compression")),
            *("--all", "--exclude", ".*/markers"),
        ],
        condition=IfCondition(PythonExpression(["'", LaunchConfiguration("bag"), "' != ''"])),
        output="screen",
    )
    rviz = _included("rviz", ("layout",), IfCondition(LaunchConfiguration("rviz")))
    return LaunchDescription([*arguments, recorder, _included("tracker", TRACKER), ingest, rviz])


def _included(name: str, passed: tuple[str, ...], condition: IfCondition | None = None) -> IncludeLaunchDescription:
    """Another launch file of this package, with these arguments of ours."""
    path = PathJoinSubstitution([FindPackageShare("tracker_node"), "launch", f"{name}.launch.py"])
    values = {argument: LaunchConfiguration(argument) for argument in passed}
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(path), launch_arguments=values.items(), condition=condition
    )
