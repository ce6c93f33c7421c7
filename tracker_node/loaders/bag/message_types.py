"""Message types without ROS: their definitions, as bags state them, and messages and stamps as plain values.

The standard messages of ROS 2 Jazzy come with rosbags, those of ``tracker_msgs`` with this package. Definitions of other types
are searched in the ROS installations that the environment names, if any.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.base import TypesysError
from rosbags.typesys.store import Typestore

from ...errors import TrackerError

TRACKED_STATE = "tracker_msgs/msg/TrackedState"
STATE_COVARIANCE = "tracker_msgs/msg/StateCovariance"
KEYPOINTS, KEYPOINT_PERSON = "tracker_msgs/msg/Keypoints", "tracker_msgs/msg/KeypointPerson"
CROPS = "tracker_msgs/msg/Crops"
BODIES = "tracker_msgs/msg/Bodies"
_OWN = (TRACKED_STATE, STATE_COVARIANCE, BODIES, CROPS, KEYPOINT_PERSON, KEYPOINTS)
_OWN_DEFINITIONS = {name: f"definitions/{name.rpartition('/')[2]}.msg" for name in _OWN}
_SEPARATOR = "=" * 80


class UnknownMessageTypeError(TrackerError):
    """A message type whose definition cannot be found."""

    def __init__(self, type_name: str, missing: str = ""):
        self.type_name, self.missing = type_name, missing or type_name
        part = f" (which holds {missing})" if missing and missing != type_name else ""
        super().__init__(
            f"message type '{type_name}'{part} is not known: it is not a standard message of ROS 2 Jazzy, and no"
            " definition of it lies below the folders of AMENT_PREFIX_PATH"
        )


@dataclass(frozen=True)
class MessageType:
    """A message type as a bag states it.

    ``definition`` is the text of the .msg file followed by those of all messages in it, as MCAP's ``ros2msg`` schema;
    ``type_hash`` the ``RIHS01_...`` hash by which ROS 2 tells versions of a type apart.
    """

    name: str
    definition: str
    type_hash: str


@lru_cache(maxsize=1)
def typestore() -> Typestore:
    """The Jazzy types with those of this package, shared by all who write."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name in _OWN_DEFINITIONS:
        store.register(get_types_from_msg(_own_definition(name), name))
    return store


@lru_cache(maxsize=256)
def message_type(type_name: str) -> MessageType:
    """Definition and hash of a type such as ``sensor_msgs/msg/Image``.

    Raises
    ------
    UnknownMessageTypeError : neither standard nor installed.
    """
    store = typestore()
    if type_name not in store.fielddefs:
        _register_installed(store, type_name)
    text, _ = store.generate_msgdef(type_name, ros_version=2)
    if type_name in _OWN_DEFINITIONS:  # with its comments, which give the units, and those of ours in it
        _, *parts = text.split(_SEPARATOR)
        text = _SEPARATOR.join([_own_definition(type_name), *map(_commented, parts)])
    return MessageType(type_name, text, store.hash_rihs01(type_name))


def typestore_of(definitions: dict[str, str]) -> Typestore:
    """The types of a bag, from the definitions embedded in it (type name -> ``ros2msg`` or ``ros2idl`` text).

    Where a definition is missing ours is taken; a type that we do not know either, or cannot read, is left out.
    """
    store = get_typestore(Stores.EMPTY)
    for name, text in definitions.items():
        if not text:
            with suppress(UnknownMessageTypeError):
                text = message_type(name).definition
        try:
            types = _parsed(name, text)
        except (TypesysError, KeyError, ValueError):
            continue  # of a damaged bag: its other types can still be read
        store.register({key: fields for key, fields in types.items() if key not in store.fielddefs})
    return store


def _parsed(name: str, text: str) -> Typesdict:
    if not text:
        return {}
    if not text.startswith(f"{_SEPARATOR}\nIDL: "):
        return get_types_from_msg(text, name)
    types: Typesdict = {}
    for part in text.split(f"{_SEPARATOR}\n")[1:]:
        types.update(get_types_from_idl(part.partition("\n")[2]))
    return types


def _own_definition(type_name: str) -> str:
    return resources.files(__package__).joinpath(_OWN_DEFINITIONS[type_name]).read_text(encoding="utf-8")


def _commented(part: str) -> str:
    """Part of a definition that begins with ``MSG: package/Name``: of our types as their file has it."""
    package, _, name = part.strip().partition("\n")[0].removeprefix("MSG: ").partition("/")
    type_name = f"{package}/msg/{name}"
    return f"\nMSG: {package}/{name}\n{_own_definition(type_name)}" if type_name in _OWN_DEFINITIONS else part


def _register_installed(store: Typestore, type_name: str) -> None:
    """Register a type and all types in it from the .msg files of ROS installations."""
    found: dict[str, Path] = {}
    wanted = [type_name]
    types: Typesdict = {}
    while wanted:
        name = wanted.pop()
        if name in store.fielddefs or name in found:
            continue
        path = next((path for path in _candidates(name) if path.is_file()), None)
        if path is None:
            raise UnknownMessageTypeError(type_name, name)
        found[name] = path
        parsed = get_types_from_msg(path.read_text(encoding="utf-8"), name)
        types.update(parsed)
        wanted += [part for _, fields in parsed.values() for _, field in fields for part in _names_in(field)]
    store.register(types)


def _candidates(type_name: str) -> Iterator[Path]:
    package, kind, name = type_name.split("/") if type_name.count("/") == 2 else ("", "", "")
    prefixes = [prefix for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    for prefix in [*prefixes, sys.prefix]:
        if name:
            yield Path(prefix, "share", package, kind, f"{name}.msg")


def _names_in(field: tuple) -> list[str]:
    """Message types that a field of rosbags' type description refers to."""
    _, content = field
    if isinstance(content, str):
        return [content]
    if isinstance(content, tuple) and content and isinstance(content[0], tuple):
        return _names_in(content[0])
    return []


Converter = Callable[[Any], Any]
_SCALARS: dict[str, type] = {"bool": bool, "float32": float, "float64": float, "string": str, "wstring": str}


def message_of(type_name: str, content: Mapping[str, Any]) -> Any:
    """A message of a type such as ``sensor_msgs/msg/Image``; fields that ``content`` leaves out are zero or empty.

    Parameters
    ----------
    type_name : such as ``sensor_msgs/msg/Image``.
    content : field -> number, text, array of numbers, mapping for a message in it, or a list of text or of mappings.

    Returns
    -------
    message : of the class that rosbags makes for the type.

    Raises
    ------
    KeyError : no such type. ValueError : a field that the type does not have.
    """
    class_, fields = _fields(type_name)
    unknown = content.keys() - fields.keys()
    if unknown:
        raise ValueError(f"{type_name} has no field {sorted(unknown)}")
    return class_(*(convert(content.get(name)) for name, convert in fields.items()))


@lru_cache(maxsize=128)
def _fields(type_name: str) -> tuple[type, dict[str, Converter]]:
    store = typestore()
    return store.types[type_name], {name: _converter(kind) for name, kind in store.fielddefs[type_name][1]}


def _converter(kind: tuple) -> Converter:
    """``None`` stands for a field that is left out."""
    form, detail = kind
    if form == Nodetype.NAME:
        return lambda value: message_of(detail, value or {})
    if form == Nodetype.BASE:
        scalar = _SCALARS.get(detail[0], int)
        return lambda value: scalar() if value is None else scalar(value)
    (form_of_items, item), length = detail
    if form_of_items == Nodetype.NAME:
        return lambda value: [message_of(item, each) for each in value or ()]
    if item[0] in ("string", "wstring"):
        return lambda value: list(value or ())
    dtype, n = np.dtype(item[0]), length if form == Nodetype.ARRAY else 0
    return lambda value: np.zeros(n, dtype) if value is None else np.ascontiguousarray(value, dtype=dtype)


NS_PER_S = 1_000_000_000


def time_of(stamp_ns: int) -> dict[str, int]:
    """Fields of the Time; its nanoseconds are never negative, also before 1970."""
    seconds, nanoseconds = divmod(int(stamp_ns), NS_PER_S)
    return {"sec": seconds, "nanosec": nanoseconds}


def stamp_ns_of(stamp: Any) -> int:
    """Integer nanoseconds of a Time, of ROS or of a bag."""
    return int(stamp.sec) * NS_PER_S + int(stamp.nanosec)
