"""What the package's launch files share: arguments that several of them take, how one includes another, what our command says.

Launch files are read by the Python of `ros2 launch`; nothing else imports this. Debian's is the system's, whatever environment is
activated: neither this nor a launch file imports what needs numpy or another package, but asks the installed command (`said_by`).
"""

from __future__ import annotations

import re
import shlex
import subprocess
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, LogInfo
from launch.conditions import IfCondition
from launch.launch_context import LaunchContext
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import ExecutableInPackage, FindPackageShare

SWITCH = ["true", "false"]
BAG_CLOSED = {"sigterm_timeout": "30", "sigkill_timeout": "30"}
"""Of nodes that write a bag: they end at once, but a disk that is behind may need this long for what waits."""

_SHARE = FindPackageShare("tracker_node")
_COMMAND = ExecutableInPackage(executable="tracker_node", package="tracker_node")
_SHARED: dict[str, dict[str, Any]] = {
    "rig": {"description": "rig.yaml: cameras, their places and lenses, and their sources"},
    "model": {"description": "model.yaml or URDF: the body"},
    "initial_state": {"default_value": "", "description": "state.yaml: where the body is at first; empty: it is searched"},
    "occluders": {"default_value": "", "description": "model of fixed things that may hide the body"},
    "params_file": {"default_value": "", "description": "parameters of the tracker"},
    "calibration": {
        "default_value": "camera_info",
        "choices": ["rig", "camera_info"],
        "description": "where lenses come from; camera_info suits resampled images",
    },
    "namespace": {"default_value": "", "description": "before every relative topic"},
    "link_frames": {"default_value": "true", "choices": SWITCH, "description": "publish the body's links on /tf"},
    "use_sim_time": {"default_value": "false", "choices": SWITCH, "description": "take the time from /clock"},
    "shrink": {"default_value": "1", "description": "make images so many times smaller"},
    "compressed": {"default_value": "false", "choices": SWITCH, "description": "cameras offer JPEG images, too"},
    "loop": {"default_value": "false", "choices": SWITCH, "description": "recordings begin again at their end"},
    "lossless": {
        "default_value": "false",
        "choices": SWITCH,
        "description": "track every image set in order, however long it takes",
    },
    "keypoints": {"default_value": "false", "choices": SWITCH, "description": "find people and their points in the images"},
    "keypoints_rate": {"default_value": "", "description": "image sets a second with points at most; empty: 5"},
    "keypoints_table": {"default_value": "", "description": "keypoints.yaml: what the points of an own detector are on the body"},
    "weights": {"default_value": "", "description": "of the network that finds points; empty: the full size, fetched once"},
    "joint_states": {"default_value": "", "description": "topic on which a robot says where its joints are; empty: none"},
    "topics": {"default_value": "", "description": "'cam01=/front/image_raw cam02=...': image topics, before what rig.yaml says"},
    "name": {"default_value": "tracker", "description": "the tracker node's name; one for each of several trackers"},
    "frame_prefix": {"default_value": "", "description": "before link frames; one for each of several bodies"},
    "listeners": {"default_value": "0", "description": "recordings begin when so many nodes listen to camera_info; 0: at once"},
    "rate": {"default_value": "", "description": "images per second of recordings; empty: what they say"},
    "rviz": {"default_value": "false", "choices": SWITCH, "description": "open RViz"},
    "layout": {"default_value": "", "description": "of RViz; empty: one for the cameras of rig"},
}


def argument(name: str, **changes: Any) -> DeclareLaunchArgument:
    """An argument that several launch files have, with what is different about it in this one.

    Parameters
    ----------
    name : of the argument.
    **changes : ``default_value``, ``choices`` or ``description`` in place of the usual ones.

    Returns
    -------
    argument : to be declared.
    """
    return DeclareLaunchArgument(name, **(_SHARED[name] | changes))


def value_of(context: LaunchContext, name: str) -> str:
    """Value of an argument in this launch.

    Parameters
    ----------
    context : of the launch.
    name : of the argument.

    Returns
    -------
    value : as text.
    """
    return LaunchConfiguration(name).perform(context)


def has_parameter(path: str, name: str) -> bool:
    """Whether a file of parameters says something of one of them, of whichever node; a look without a parser of YAML.

    Parameters
    ----------
    path : of the file; one that cannot be read says nothing, and the node that gets it says why.
    name : of the parameter.

    Returns
    -------
    said : outside of comments.
    """
    try:
        text = Path(path).read_text()
    except (OSError, ValueError):
        return False
    return re.search(rf"^([^#\n]*[\s{{,\"'])?{re.escape(name)}[\"']?\s*:", text, re.MULTILINE) is not None


def missing(package: str, how_to_go_on: str) -> list[LogInfo]:
    """A line in place of a node whose package is not installed.

    Parameters
    ----------
    package : of another project.
    how_to_go_on : end of the line, for people.

    Returns
    -------
    actions : the line; empty where the package is installed.
    """
    try:
        get_package_prefix(package)
    except (PackageNotFoundError, OSError):  # OSError: without AMENT_PREFIX_PATH
        return [
            LogInfo(msg=f"{package} is not installed (apt install ros-$ROS_DISTRO-{package.replace('_', '-')}): {how_to_go_on}")
        ]
    return []


def said_by(context: LaunchContext, *arguments: str) -> str:
    """Output of `tracker_node`, as it is installed.

    Parameters
    ----------
    context : of the launch.
    *arguments : of the command.

    Returns
    -------
    text : what it prints on stdout.

    Raises
    ------
    RuntimeError : it failed; it has said itself why.
    """
    command = [_COMMAND.perform(context), *arguments]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{shlex.join(command)}: failed with status {done.returncode}")
    return done.stdout


def included(
    name: str, passed: Iterable[str], own: Mapping[str, str] | None = None, only_if: str | None = None
) -> IncludeLaunchDescription:
    """Another launch file of this package.

    Parameters
    ----------
    name : of the file, without ``.launch.py``.
    passed : arguments of ours that it gets as they are.
    own : further arguments of it, with their values.
    only_if : argument of ours that must be ``true``.

    Returns
    -------
    action : that includes the file.
    """
    path = PathJoinSubstitution([_SHARE, "launch", f"{name}.launch.py"])
    values: dict[str, Any] = {argument: LaunchConfiguration(argument) for argument in passed} | dict(own or {})
    condition = None if only_if is None else IfCondition(LaunchConfiguration(only_if))
    return IncludeLaunchDescription(PythonLaunchDescriptionSource(path), launch_arguments=values.items(), condition=condition)
