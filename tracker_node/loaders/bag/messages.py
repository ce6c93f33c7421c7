"""Messages of a bag's types from plain mappings of field -> value."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from .message_types import typestore

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
