"""ROS parameters of the tracker: the fields of the configuration dataclasses, cameras in use, and what is fixed at the start."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from ...errors import FileFormatError, TrackerError, UnknownNameError
from ...tracking.config import TrackerConfig, chosen, describe, flatten, from_dict, refuse_unused, updated
from ...tracking.renamed import refuse_renamed
from ..parameter_overrides import check_qos_overrides, integers_as_doubles, one_of, overrides_of, refuse_unknown

_INT_MAX = 2**63 - 1
_CAMERAS, _MIN_CAMERAS = "cameras", "synchronizer.min_cameras"


@dataclass(frozen=True)
class FixedParameter:
    """A parameter that can be given at the start and not be changed; texts may be limited to ``choices``."""

    default: bool | str
    doc: str
    choices: tuple[str, ...] = ()


class ConfigParameters:
    """The parameters of a node as one `TrackerConfig`, and some that are not of the configuration.

    ``config``, ``cameras`` (in use) and ``fixed`` (name -> value) hold what is valid now. A change is accepted as a whole, after
    ``check`` has raised no `TrackerError`, and then ``on_change`` is called, in the thread that runs callbacks.

    Parameters
    ----------
    node : its parameter overrides (``--params-file``, ``-p``) win over ``defaults``.
    defaults : usually from a configuration file.
    cameras : all that may be in use; without any there is no parameter of that name.
    fixed : those that cannot be changed while the node runs.
    ros_args : of the process, behind ``--ros-args``.

    Raises
    ------
    TrackerError : an override with an unknown name, of a wrong type, or out of range.
    """

    def __init__(
        self,
        node: Node,
        defaults: TrackerConfig | None = None,
        on_change: Callable[[TrackerConfig], None] = lambda config: None,
        *,
        cameras: Sequence[str] = (),
        fixed: Mapping[str, FixedParameter] | None = None,
        check: Callable[[TrackerConfig, tuple[str, ...]], None] = lambda config, cameras: None,
        ros_args: Sequence[str] = (),
    ):
        self._node, self._on_change, self._check = node, on_change, check
        self._source = f"parameters of {node.get_name()}"
        self._all_cameras, self._known = tuple(cameras), describe()
        fixed, given = fixed or {}, {name: one.value for name, one in overrides_of(node).items()}
        start = chosen(defaults or TrackerConfig(), given, self._source)
        self._refuse_others(start, given)
        self._described = describe(start)
        refuse_unknown(node, {*self._described, *fixed, *([_CAMERAS] if cameras else [])}, ros_args)
        check_qos_overrides(node)
        values = {name: self._declare_field(name, default) for name, default in flatten(start).items()}
        self.config = from_dict(values, self._source)
        self.cameras = self._declare_cameras() if cameras else ()
        self.fixed = {name: self._declare_fixed(name, parameter) for name, parameter in fixed.items()}
        self._declaring = False
        node.add_on_set_parameters_callback(self._validate)
        node.add_post_set_parameters_callback(self._apply)

    def _refuse_others(self, config: TrackerConfig, given: Mapping[str, Any]) -> None:
        """Parameters of other modalities than those in use, and of earlier versions."""
        everything = describe()
        refuse_renamed({name: value for name, value in given.items() if name not in everything}, self._source)
        for name, value in given.items():
            if name in everything:
                refuse_unused(config, name, value, self._source)

    def _declare_field(self, name: str, default: Any) -> Any:
        if isinstance(default, float):
            integers_as_doubles(self._node, [name])
        descriptor = _descriptor_of(name, self._described[name])
        expected = f"a {type(default).__name__} ({descriptor.additional_constraints})"
        return self._declare(name, default, descriptor, expected)

    def _declare(self, name: str, default: Any, descriptor: ParameterDescriptor, expected: str) -> Any:
        try:
            return self._node.declare_parameter(name, default, descriptor).value
        except Exception as error:  # rclpy has several kinds for wrong type and out of range
            given = overrides_of(self._node).get(name)
            raise FileFormatError(self._source, name, expected, given.value if given is not None else default) from error

    def _declare_cameras(self) -> tuple[str, ...]:
        choices = f"some of {', '.join(self._all_cameras)}"
        descriptor = ParameterDescriptor(name=_CAMERAS, description="cameras in use", additional_constraints=choices)
        return self._in_use(self._declare(_CAMERAS, list(self._all_cameras), descriptor, f"a list, {choices}"))

    def _declare_fixed(self, name: str, parameter: FixedParameter) -> bool | str:
        descriptor = ParameterDescriptor(name=name, description=parameter.doc, read_only=True)
        if parameter.choices:
            descriptor.additional_constraints = one_of(parameter.choices)
        expected = f"a {type(parameter.default).__name__} {descriptor.additional_constraints}".rstrip()
        value = self._declare(name, parameter.default, descriptor, expected)
        if parameter.choices and value not in parameter.choices:
            raise FileFormatError(self._source, name, expected, value)
        return value

    def _in_use(self, names: Sequence[str]) -> tuple[str, ...]:
        """In the order of the rig."""
        for name in names:
            if name not in self._all_cameras:
                raise UnknownNameError("camera", name, self._all_cameras)
        if not names or len(set(names)) != len(names):
            raise FileFormatError(self._source, _CAMERAS, "one or more names, each once", list(names))
        return tuple(name for name in self._all_cameras if name in names)

    def _merged(self, parameters: list[Parameter]) -> tuple[TrackerConfig, tuple[str, ...]]:
        own = {p.name: p.value for p in parameters if p.name in self._known}
        cameras = [self._in_use(p.value) for p in parameters if p.name == _CAMERAS and self._all_cameras]
        n = own.get(_MIN_CAMERAS, 0)
        if self._all_cameras and n > len(self._all_cameras):
            raise FileFormatError(self._source, _MIN_CAMERAS, f"at most {len(self._all_cameras)}, the cameras of the rig", n)
        config = updated(self.config, own, self._source) if own else self.config  # every publisher declares some of its own
        return config, cameras[-1] if cameras else self.cameras

    def _validate(self, parameters: list[Parameter]) -> SetParametersResult:
        if self._declaring:
            return SetParametersResult(successful=True)
        try:
            config, cameras = self._merged(parameters)
            if (config, cameras) != (self.config, self.cameras):
                self._check(config, cameras)
        except TrackerError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        if self._declaring:
            return
        before = self.config, self.cameras
        self.config, self.cameras = self._merged(parameters)
        if (self.config, self.cameras) != before:
            self._redeclare(self.config)
            self._on_change(self.config)

    @contextmanager
    def declared_with(self, parameters: list[Parameter]) -> Iterator[None]:
        """Parameters of modalities that these bring into use are there within, so that they can be set in the same call."""
        values = {p.name: p.value for p in parameters if p.name in self._known}
        self._declaring = True  # what is declared is no change
        try:
            with suppress(TrackerError):  # modalities that do not go together: the call is refused
                self._redeclare(chosen(self.config, values, self._source), keep=True)
            self._declaring = False
            yield
        finally:
            self._declaring = False
            self._redeclare(self.config)

    def without_effect(self, parameters: Sequence[Parameter]) -> SetParametersResult | None:
        """Refusal of the first parameter of a modality that is not in use, or of an earlier version, with what mends it."""
        try:
            self._refuse_others(self.config, {p.name: p.value for p in parameters if not self._node.has_parameter(p.name)})
        except FileFormatError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return None

    def _redeclare(self, config: TrackerConfig, keep: bool = False) -> None:
        """There are the parameters of the modalities in use, and no others unless they are to be kept."""
        now, described = flatten(config), describe(config)
        for name in () if keep else self._described.keys() - now.keys():
            self._node.undeclare_parameter(name)
        for name in sorted(now.keys() - self._described.keys()):
            self._node.declare_parameter(name, now[name], _descriptor_of(name, described[name]))
        self._described = {**self._described, **described} if keep else described


def _descriptor_of(name: str, description: Mapping[str, Any]) -> ParameterDescriptor:
    """What ``ros2 param describe`` and rqt show: meaning, unit, range or choices.

    Parameters
    ----------
    name : of the parameter.
    description : its meaning, unit, range, default and choices.

    Returns
    -------
    descriptor : of rcl_interfaces.
    """
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
        descriptor.additional_constraints = one_of(description["choices"])
    elif low is not None or high is not None:
        descriptor.additional_constraints = f"in [{low}, {high}]"
    return descriptor
