"""Parameters as YAML: a plain mapping, or the parameter file of a ROS node. What they mean is not known here."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import FileFormatError
from .file_model import PARAMETERS, check_kind
from .yaml_file import read_mapping, write_mapping

_ROS_KEY = "ros__parameters"
# Parameters that rclpy gives every node; they mean nothing to the core.
_ROS_OWN = ("use_sim_time", "qos_overrides", "start_type_description_service")


def load_parameters(path: str | Path, node: str = "tracker") -> dict[str, Any]:
    """Parameters of a file, nested as they stand there.

    A ROS parameter file may hold sections for several nodes: those named ``/**``, ``node`` or ``/node`` are taken, a later
    one over an earlier one.

    Parameters
    ----------
    path, node : file; name of the node.

    Returns
    -------
    Section -> name -> value.

    Raises
    ------
    FileFormatError : naming file and section.
    """
    values = read_mapping(path)
    check_kind(values, PARAMETERS, path)
    if any(isinstance(section, dict) and _ROS_KEY in section for section in values.values()):
        return _ros_parameters(values, path, node)
    return values


def dump_parameters(parameters: Mapping[str, Any], path: str | Path, comment: str = "") -> None:
    """Write a ROS parameter file, which `load_parameters` and ``--params-file`` both read.

    Parameters
    ----------
    parameters, path : dotted name -> value; file.
    comment : lines on top of the file.
    """
    nested: dict[str, Any] = {}
    for name, value in parameters.items():
        *groups, last = name.split(".")
        here = nested
        for group in groups:
            here = here.setdefault(group, {})
        here[last] = value
    write_mapping({"/**": {_ROS_KEY: nested}}, path, comment)


def _ros_parameters(values: dict[str, Any], path: str | Path, node: str) -> dict[str, Any]:
    merged: dict[str, Any] = {}
    for name, section in values.items():
        if not isinstance(section, dict) or set(section) != {_ROS_KEY}:
            raise FileFormatError(path, str(name), f"a section with {_ROS_KEY} only", section)
        parameters = section[_ROS_KEY]
        if not isinstance(parameters, dict):
            raise FileFormatError(path, f"{name}.{_ROS_KEY}", "a mapping", parameters)
        if name in ("/**", node, f"/{node}"):
            _merge(merged, {key: value for key, value in parameters.items() if key not in _ROS_OWN})
    return merged


def _merge(target: dict[str, Any], source: dict[str, Any]) -> None:
    for key, value in source.items():
        if isinstance(value, dict) and isinstance(target.get(key), dict):
            _merge(target[key], value)
        else:
            target[key] = value
