"""ROS parameters of the tracker, made from the fields of the configuration dataclasses and from nothing else."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from ..errors import FileFormatError, TrackerError, UnknownNameError
from ..tracking.config import TrackerConfig, describe, flatten, from_dict

_INT_MAX = 2**63 - 1
# Parameters that rclpy gives every node.
_ROS_OWN = ("use_sim_time", "start_type_description_service")
_ROS_OWN_PREFIX = "qos_overrides."


class ConfigParameters:
    """The parameters of a node as one `TrackerConfig`.

    ``config`` holds the current one; ``on_change`` is called with each new one after it has been accepted as a whole.

    Parameters
    ----------
    node : its parameter overrides (``--params-file``, ``-p``) win over ``defaults``.
    defaults : usually from a configuration file.
    on_change : called with the new configuration, in the thread that runs callbacks.

    Raises
    ------
    TrackerError : an override with an unknown name, of a wrong type, or out of range.
    """

    def __init__(
        self,
        node: Node,
        defaults: TrackerConfig | None = None,
        on_change: Callable[[TrackerConfig], None] = lambda config: None,
    ):
        self._node, self._on_change = node, on_change
        self._described = describe()
        self._refuse_unknown_overrides()
        values = {name: self._declare(name, default) for name, default in flatten(defaults or TrackerConfig()).items()}
        self.config = from_dict(values, f"parameters of {node.get_name()}")
        node.add_on_set_parameters_callback(self._validate)
        node.add_post_set_parameters_callback(self._apply)

    def _refuse_unknown_overrides(self) -> None:
        for name in self._node._parameter_overrides:  # rclpy has no public way to see them before they are declared
            if name not in self._described and name not in _ROS_OWN and not name.startswith(_ROS_OWN_PREFIX):
                raise UnknownNameError("parameter", name, self._described)

    def _declare(self, name: str, default: Any) -> Any:
        given = self._node._parameter_overrides.get(name)
        if given is not None and isinstance(default, float) and isinstance(given.value, int) and type(given.value) is not bool:
            # `-p optimizer.robust_scale_px:=8` is an integer to ROS; a user means 8.0.
            self._node._parameter_overrides[name] = Parameter(name, Parameter.Type.DOUBLE, float(given.value))
        try:
            return self._node.declare_parameter(name, default, descriptor_of(name, self._described[name])).value
        except Exception as error:  # rclpy has several kinds for wrong type and out of range
            expected = f"a {type(default).__name__} ({descriptor_of(name, self._described[name]).additional_constraints})"
            got = given.value if given is not None else default
            raise FileFormatError(f"parameters of {self._node.get_name()}", name, expected, got) from error

    def _merged(self, parameters: list[Parameter]) -> TrackerConfig:
        own = {p.name: p.value for p in parameters if p.name in self._described}
        return from_dict({**flatten(self.config), **own}, f"parameters of {self._node.get_name()}")

    def _validate(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            self._merged(parameters)
        except TrackerError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        if any(p.name in self._described for p in parameters):
            self.config = self._merged(parameters)
            self._on_change(self.config)


def descriptor_of(name: str, description: Mapping[str, Any]) -> ParameterDescriptor:
    """What ``ros2 param describe`` and rqt show: meaning, unit, range or choices."""
    unit = description.get("unit", "")
    descriptor = ParameterDescriptor(name=name, description=description["doc"] + (f" [{unit}]" if unit else ""))
    low, high, default = description["low"], description["high"], description["default"]
    if type(default) is float and low is not None:
        top = float("inf") if high is None else float(high)
        descriptor.floating_point_range = [FloatingPointRange(from_value=float(low), to_value=top, step=0.0)]
    elif type(default) is int and low is not None:
        top_int = _INT_MAX if high is None else int(high)
        descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=top_int, step=1)]
    if description["choices"]:
        descriptor.additional_constraints = "one of " + ", ".join(description["choices"])
    elif low is not None or high is not None:
        descriptor.additional_constraints = f"in [{low}, {high}]"
    return descriptor
