"""Messages of ROS from plain mappings of field -> value, and states from what messages say.

Message fields are not type-checked by default: an int in a float64 field arrives as garbage, and so does a numpy scalar.
So everything passes through ``float()``, ``int()`` and ``array.array`` here, and nowhere else.
"""

from __future__ import annotations

import array
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose
from rosidl_parser.definition import AbstractGenericString, AbstractNestedType, Array, BasicType, NamespacedType

from ...errors import TrackerError, UnknownNameError
from ...geometry import se3, so3
from ...loaders.bag.message_types import time_of
from ...model.articulated import ArticulatedModel

Setter = Callable[[Any, Any], None]
_SCALARS: dict[str, type] = {"boolean": bool, "float": float, "double": float}
_DTYPES = {"boolean": "?", "octet": "u1", "float": "f4", "double": "f8"}
_CODES = {"?": "B", "f4": "f", "f8": "d", "i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q"}


def message_class(type_name: str) -> Any:
    """Class of a type such as ``sensor_msgs/msg/Image``.

    Raises
    ------
    TrackerError : its package is not installed, or has no such type.
    """
    package, _, rest = type_name.partition("/")
    kind, _, name = rest.partition("/")
    try:
        return getattr(import_module(f"{package}.{kind}"), name)
    except (ImportError, AttributeError, TypeError, ValueError) as error:  # a name without a package is a TypeError
        raise TrackerError(f"message type '{type_name}' cannot be used here: {error}") from None


def stamp_message(stamp_ns: int) -> Time:
    """Time of integer nanoseconds."""
    return Time(**time_of(stamp_ns))


def message_of(class_: Any, content: Mapping[str, Any]) -> Any:
    """A new message; fields that ``content`` leaves out are those of a message that nobody has written to.

    Parameters
    ----------
    class_ : of the message, such as ``sensor_msgs.msg.Image``.
    content : field -> number, text, array of numbers, mapping for a message in it, or a list of text or of mappings.

    Returns
    -------
    message : of that class.
    """
    return fill(class_(), content)


def fill(message: Any, content: Mapping[str, Any]) -> Any:
    """The message with the fields in ``content``; arrays and messages in it that have the right size are written to in place.

    Parameters
    ----------
    message : of any class of ROS.
    content : as of `message_of`.

    Returns
    -------
    message : the same object.
    """
    setters = _setters(message.__class__)
    for name, value in content.items():
        setters[name](message, value)
    return message


@lru_cache(maxsize=128)
def _setters(class_: Any) -> dict[str, Setter]:
    names = class_.get_fields_and_field_types()
    return {name: _setter(name, kind) for name, kind in zip(names, class_.SLOT_TYPES, strict=True)}


def _setter(name: str, kind: Any) -> Setter:
    if isinstance(kind, NamespacedType):
        return _setter_of_message(name, kind)
    if isinstance(kind, AbstractNestedType):
        items = kind.value_type
        if isinstance(items, NamespacedType):
            return _setter_of_messages(name, items)
        if isinstance(items, AbstractGenericString):
            return _converting(name, list)
        return _setter_of_numbers(name, _dtype(items), isinstance(kind, Array))
    if isinstance(kind, AbstractGenericString):
        return _converting(name, str)
    return _converting(name, _SCALARS.get(kind.typename, int))


def _converting(field: str, convert: Callable[[Any], Any]) -> Setter:
    return lambda message, value: setattr(message, field, convert(value))


def _setter_of_message(field: str, kind: NamespacedType) -> Setter:
    setters = _setters(_class_of(kind))

    def set_fields(message: Any, content: Mapping[str, Any]) -> None:
        inner = getattr(message, field)
        for name, value in content.items():
            setters[name](inner, value)

    return set_fields


def _setter_of_messages(field: str, kind: NamespacedType) -> Setter:
    class_ = _class_of(kind)

    def set_messages(message: Any, contents: Sequence[Mapping[str, Any]]) -> None:
        inner = getattr(message, field)
        if len(inner) != len(contents):
            inner = [class_() for _ in contents]
            setattr(message, field, inner)
        for each, content in zip(inner, contents, strict=True):
            fill(each, content)

    return set_messages


def _setter_of_numbers(field: str, dtype: str, fixed: bool) -> Setter:
    """Past the field's public setter, which copies: images are large."""
    code, slot = _CODES[dtype], f"_{field}"

    def set_numbers(message: Any, values: Any) -> None:
        inner = getattr(message, slot)
        if len(inner) == len(values) and len(inner):
            np.frombuffer(inner, dtype)[...] = values
            return
        inner = array.array(code)
        if len(values):
            inner.frombytes(np.ascontiguousarray(values, dtype).view(np.uint8).data)
        setattr(message, slot, inner)

    def set_fixed(message: Any, values: Any) -> None:  # fixed-size fields are numpy arrays in rclpy
        getattr(message, slot)[...] = values

    return set_fixed if fixed else set_numbers


def _dtype(kind: BasicType) -> str:
    name = kind.typename
    if name in _DTYPES:
        return _DTYPES[name]
    return f"{name[0]}{int(name.lstrip('uint')) // 8}"


def _class_of(kind: NamespacedType) -> Any:
    return message_class("/".join([*kind.namespaces, kind.name]))


def transform_of_pose(pose: Pose) -> np.ndarray:
    """(4, 4) of a geometry_msgs/Pose.

    Raises
    ------
    TrackerError : a quaternion of length zero, or numbers that are not finite.
    """
    p, q = pose.position, pose.orientation
    numbers = np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w])
    if not np.all(np.isfinite(numbers)) or np.linalg.norm(numbers[3:]) < 1e-6:
        raise TrackerError(f"pose: expected finite numbers and a quaternion of length one, got {numbers.tolist()}")
    return se3.from_rotation_translation(so3.matrix_from_xyzw(numbers[3:]), numbers[:3])


def values_with_changes(
    model: ArticulatedModel, values: np.ndarray, names: Sequence[str], changes: Sequence[float]
) -> np.ndarray:
    """State values (n_dof,) with the named ones replaced.

    Parameters
    ----------
    model : the body.
    values : (n_dof,) as `model.configuration.State.to_values`.
    names : of degrees of freedom.
    changes : one value for each name, in meters or radians.

    Returns
    -------
    values : (n_dof,), a copy.

    Raises
    ------
    TrackerError : unknown or repeated names, not one value for each, or a value that is not finite.
    """
    if len(names) != len(changes):
        raise TrackerError(f"expected one value for each name, got {len(names)} names and {len(changes)} values")
    if len(set(names)) != len(names):
        raise TrackerError(f"expected each name once, got {list(names)}")
    if not np.all(np.isfinite(np.array(changes, dtype=np.float64))):
        raise TrackerError(f"expected finite values, got {list(changes)}")
    dof_names = model.chain.dof_names
    result = np.array(values, dtype=np.float64)
    for name, value in zip(names, changes, strict=True):
        if name not in dof_names:
            raise UnknownNameError("degree of freedom", name, dof_names)
        result[dof_names.index(name)] = float(value)
    return result
