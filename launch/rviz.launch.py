"""RViz with the tracker's layout.

    ros2 launch tracker_node rviz.launch.py layout:=layouts/rviz/tracker.rviz
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

SHIPPED = PathJoinSubstitution([FindPackageShare("tracker_node"), "config", "rviz", "tracker.rviz"])


def generate_launch_description() -> LaunchDescription:
    arguments = [
        DeclareLaunchArgument(
            "layout", default_value=SHIPPED, description="for your own cameras: tracker_node layouts --rig rig.yaml ..."
        ),
        DeclareLaunchArgument(
            "use_sim_time", default_value="false", choices=["true", "false"], description="take the time from /clock"
        ),
    ]
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", LaunchConfiguration("layout")],
        parameters=[{"use_sim_time": LaunchConfiguration("use_sim_time")}],
    )
    return LaunchDescription([*arguments, rviz])
