"""A rig at work: its cameras, the tracker, a detector of people, a recorder and RViz, each if asked for.

ros2 launch tracker_node rig.launch.py rig:=rig.yaml model:=person.yaml bag:=out/run1/bag rviz:=true
ros2 launch tracker_node rig.launch.py rig:=rig.yaml model:=person.yaml ingest:=false name:=anna frame_prefix:=anna/
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PythonExpression
from launch_ros.actions import Node

from tracker_node.ros.launch_files import BAG_CLOSED, SWITCH, argument, included

SHARED = ("rig", "namespace", "use_sim_time")
TRACKER = (
    *(*SHARED, "model", "initial_state", "occluders", "params_file", "calibration", "topics"),
    *("name", "frame_prefix", "link_frames", "lossless", "joint_states", "keypoints", "keypoints_table"),
)
INGEST = (*SHARED, "rate", "shrink", "loop", "topics", "compressed", "listeners")
DETECTOR = (*SHARED, "keypoints_rate", "weights", "topics", "name")
RVIZ = (*SHARED, "layout", "name")
STARTED = [  # nodes that listen to all cameras; none where params_file may leave some out
    *("0 if '", LaunchConfiguration("params_file"), "' else 1 + ('", LaunchConfiguration("keypoints"), "' == 'true')"),
    *(" + ('", LaunchConfiguration("bag"), "' != '')"),
]


def generate_launch_description() -> LaunchDescription:
    arguments = [
        *map(argument, TRACKER),
        DeclareLaunchArgument(
            "ingest", default_value="true", choices=SWITCH, description="false: other packages' drivers publish the cameras"
        ),
        *map(argument, ("rate", "shrink", "loop")),
        DeclareLaunchArgument("bag", default_value="", description="record to this folder, which must not exist; empty: nothing"),
        DeclareLaunchArgument(
            "record_images", default_value="none", choices=["none", "compressed", "raw", "all"], description="images in the bag"
        ),
        DeclareLaunchArgument("split_mb", default_value="0", description="begin another file of the bag at this size; 0: never"),
        DeclareLaunchArgument(
            "compression", default_value="none", choices=["none", "lz4", "zstd"], description="of the bag's messages"
        ),
        argument(
            "compressed",
            default_value=PythonExpression(["str('", LaunchConfiguration("record_images"), "' == 'compressed').lower()"]),
            description="the cameras of ingest offer JPEG images, too; true where the bag takes those",
        ),
        argument("listeners", default_value=PythonExpression(STARTED)),
        *map(argument, ("keypoints_rate", "weights", "rviz")),
        argument("layout"),
    ]
    recorder = Node(
        package="tracker_node",
        executable="recorder",
        name="recorder",
        namespace=LaunchConfiguration("namespace"),
        arguments=[
            *("--output", LaunchConfiguration("bag"), "--images", LaunchConfiguration("record_images")),
            *("--split-mb", LaunchConfiguration("split_mb"), "--compression", LaunchConfiguration("compression")),
            *("--all", "--exclude", ".*/markers", ".*/(overlay|masked_image)(/compressed)?"),
        ],
        parameters=[{"use_sim_time": LaunchConfiguration("use_sim_time")}],
        **BAG_CLOSED,
        condition=IfCondition(PythonExpression(["'", LaunchConfiguration("bag"), "' != ''"])),
        output="screen",
    )
    ingest, rviz = included("camera_ingest", INGEST, only_if="ingest"), included("rviz", RVIZ, only_if="rviz")
    detector = included("keypoints", DETECTOR, only_if="keypoints")
    return LaunchDescription([*arguments, recorder, included("tracker", TRACKER), detector, ingest, rviz])
