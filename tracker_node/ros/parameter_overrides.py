"""Parameters given at the start: those that a node does not have are refused, and those of quality of service checked."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from difflib import get_close_matches
from itertools import pairwise
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from ..errors import FileFormatError, UnknownNameError
from ..loaders.yaml_file import read_mapping
from .ending import PARENT_VARIABLE

_ROS_OWN = ("use_sim_time", "start_type_description_service")  # that rclpy gives every node
_QOS_PREFIX = "qos_overrides."
_FILE_KEY = "ros__parameters"
_NAMED = 5  # names that one that is not known may have meant
_QOS_CHOICES = {"history": ("keep_last", "keep_all"), "reliability": ("reliable", "best_effort")}


def overrides_of(node: Node) -> dict[str, Parameter]:
    """What ``-p`` and ``--params-file`` have given; to be changed before the parameter is declared."""
    return node._parameter_overrides  # rclpy has no public way to see them


def integers_as_doubles(node: Node, names: Collection[str]) -> None:
    """Make integers floating-point numbers: `-p rate:=8` is an integer to ROS; a user means 8.0.

    Parameters
    ----------
    node : whose parameters are not declared yet.
    names : of floating-point parameters.
    """
    overrides = overrides_of(node)
    for name in set(names) & set(overrides):
        if type(overrides[name].value) is int:
            overrides[name] = Parameter(name, Parameter.Type.DOUBLE, float(overrides[name].value))


def refuse_unknown(node: Node, known: Collection[str], ros_args: Sequence[str]) -> None:
    """Refuse names of parameters given to a node at its start that it does not have.

    What a file says of all nodes may be for others.

    Parameters
    ----------
    node : with its overrides.
    known : names.
    ros_args : of its process, behind ``--ros-args``.

    Raises
    ------
    UnknownNameError : a name that is not ``known``.
    FileFormatError : a file of parameters that cannot be read.
    """
    known = {*known, *_ROS_OWN}
    unknown = [name for name in overrides_of(node) if name not in known and not name.startswith(_QOS_PREFIX)]
    if not unknown:
        return
    files = [path for option, path in pairwise(ros_args) if option == "--params-file"]
    of_all = set[str]().union(*(_said_of_all(read_mapping(path), "") for path in files))
    for name in unknown:
        if name not in of_all:
            raise UnknownNameError("parameter", name, _nearest(name, known))


def refuse_undeclared(node: Node, ros_args: Sequence[str]) -> None:
    """`refuse_unknown` of what a node has not declared; to be called when it has declared all.

    What a pipeline gives to all of its processes may be for others, too.

    Parameters
    ----------
    node : with its overrides.
    ros_args : of its process, behind ``--ros-args``.

    Raises
    ------
    UnknownNameError : a name of which the node has no parameter.
    FileFormatError : a file of parameters that cannot be read.
    """
    if PARENT_VARIABLE not in os.environ:
        refuse_unknown(node, node._parameters, ros_args)


def _said_of_all(content: Mapping[str, Any], node: str) -> set[str]:
    """Names of the parameters that a file has under ``/**`` and the like; the names of nodes may be within namespaces."""
    names = set[str]()
    for key, value in content.items():
        if key == _FILE_KEY:
            names |= set(_flat(value)) if node.endswith("*") else set()
        elif isinstance(value, Mapping):
            names |= _said_of_all(value, str(key))
    return names


def _flat(value: Any, prefix: str = "") -> list[str]:
    if not isinstance(value, Mapping):
        return [prefix]
    return [name for key, each in value.items() for name in _flat(each, f"{prefix}.{key}" if prefix else str(key))]


def _nearest(name: str, known: Collection[str]) -> list[str]:
    """The names most like it: of some 150, and as many qualities of service, nobody reads all."""
    of_its_kind = [other for other in sorted(known) if other.startswith(_QOS_PREFIX) == name.startswith(_QOS_PREFIX)]
    return get_close_matches(name, of_its_kind, _NAMED, cutoff=0.0)


def check_qos_overrides(node: Node) -> None:
    """Before any topic is offered or subscribed to; rclpy would raise errors of several kinds then.

    Raises
    ------
    TrackerError : a policy or value that there is not.
    """
    for name, parameter in overrides_of(node).items():
        if name.startswith(_QOS_PREFIX):
            _check_qos(f"parameters of {node.get_name()}", name, parameter.value)


def _check_qos(source: str, name: str, value: Any) -> None:
    policy = name.rpartition(".")[2]
    choices = _QOS_CHOICES.get(policy)
    if policy != "depth" and choices is None:
        raise UnknownNameError("policy of quality of service", policy, ["depth", *_QOS_CHOICES])
    if choices is not None and value not in choices:
        raise FileFormatError(source, name, one_of(choices), value)
    if policy == "depth" and not (type(value) is int and value > 0):
        raise FileFormatError(source, name, "a positive int", value)


def refuse_unknown_qos(node: Node) -> None:
    """When all topics are there: each has declared the overrides that it takes. Those of topics elsewhere may be for other nodes.

    Raises
    ------
    UnknownNameError : an override of a topic ``~/...`` that there is not.
    """
    own = f"{_QOS_PREFIX}{node.get_fully_qualified_name()}/"
    for name in overrides_of(node):
        if name.startswith(own) and not node.has_parameter(name):
            declared = node.get_parameters_by_prefix(_QOS_PREFIX[:-1])
            raise UnknownNameError("parameter", name, _nearest(name, [_QOS_PREFIX + other for other in declared]))


def unknown_parameters(node: Node, parameters: Sequence[Parameter]) -> SetParametersResult | None:
    """Refusal of parameters that the node does not have, by name; that of rclpy has none.

    Parameters
    ----------
    node : whose parameters they are.
    parameters : to be set.

    Returns
    -------
    refusal : for the first unknown one; None where all are known.
    """
    for parameter in parameters:
        if not node.has_parameter(parameter.name):
            error = UnknownNameError("parameter", parameter.name, _nearest(parameter.name, node._parameters))
            return SetParametersResult(successful=False, reason=str(error))
    return None


def one_of(choices: Sequence[object]) -> str:
    """For people."""
    return "one of " + ", ".join(map(str, choices))
