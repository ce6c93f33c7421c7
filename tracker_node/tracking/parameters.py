"""Parameters as frozen dataclasses: default, unit, range and meaning of each, and mappings checked against them.

Nested dataclasses (sections) become dotted names: ``chamfer.canny_high``. The metadata of a field, or of a whole section, may say
``of`` which modalities it is; it is a parameter where one of them is in use, and refused elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, field, fields
from typing import Any

from ..errors import FileFormatError


def parameter(
    default: Any,
    doc: str,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    choices: tuple = (),
    of: tuple[str, ...] = (),
):
    """A dataclass field that carries what a parameter declaration needs.

    Parameters
    ----------
    default, doc, unit : value, meaning and unit.
    low, high : range of numbers; of a text, that of the numbers in it.
    choices : values that it may have; empty: any.
    of : modalities that it belongs to; empty: those of its section.

    Returns
    -------
    The field.
    """
    metadata = {"doc": doc, "unit": unit, "low": low, "high": high, "choices": choices}
    return field(default=default, metadata={**metadata, "of": of})


def is_section(f: Field) -> bool:
    """Whether a field holds parameters and is none itself."""
    return f.default_factory is not MISSING


def named(cls: type, prefix: str = "", of: tuple[str, ...] = ()) -> Iterator[tuple[str, Field, tuple[str, ...]]]:
    """All parameters of a dataclass and its sections.

    Parameters
    ----------
    cls : the dataclass.
    prefix : of the dotted names.
    of : modalities that the dataclass belongs to.

    Yields
    ------
    Dotted name, field, and the modalities that it belongs to; empty: none in particular.
    """
    for f in fields(cls):
        belongs = f.metadata.get("of", ()) or of
        if is_section(f):
            yield from named(f.default_factory, f"{prefix}{f.name}.", belongs)  # type: ignore[arg-type]
        else:
            yield prefix + f.name, f, belongs


def value_of(config: Any, name: str) -> Any:
    """The value of a dotted name.

    Parameters
    ----------
    config : dataclass with sections.
    name : dotted.

    Returns
    -------
    The value.
    """
    for part in name.split("."):
        config = getattr(config, part)
    return config


def nested(values: Mapping[str, Any], source: str) -> dict[str, Any]:
    """A mapping of mappings from one whose keys may be dotted.

    Parameters
    ----------
    values : by names, some of them dotted.
    source : names the file, or what stands for it, in errors.

    Returns
    -------
    No key is dotted.

    Raises
    ------
    FileFormatError : a key is both a value and a section.
    """
    result: dict[str, Any] = {}
    for key, value in values.items():
        *path, last = str(key).split(".")
        here = result
        for i, part in enumerate(path):
            here = _group(here, part, source, ".".join(path[: i + 1]))
        if isinstance(value, dict):
            _group(here, last, source, str(key)).update(nested(value, source))
        elif isinstance(here.get(last), dict):
            raise FileFormatError(source, str(key), "a mapping", value)
        else:
            here[last] = value
    return result


def _group(values: dict[str, Any], name: str, source: str, key: str) -> dict[str, Any]:
    group = values.setdefault(name, {})
    if not isinstance(group, dict):
        raise FileFormatError(source, key, "a mapping", group)
    return group


def built(cls: type, values: Mapping[str, Any], source: str, prefix: str = "") -> Any:
    """A dataclass from a mapping of mappings.

    Parameters
    ----------
    cls : the dataclass.
    values : by name of its fields.
    source : names the file, or what stands for it, in errors.
    prefix : of the dotted names in errors.

    Returns
    -------
    With defaults where nothing is given.

    Raises
    ------
    FileFormatError : an unknown key, a wrong type, or a value out of range.
    """
    known = {f.name: f for f in fields(cls)}
    for key in values:
        if key not in known:
            raise FileFormatError(source, prefix + key, f"one of {sorted(known)}", key)
    arguments: dict[str, Any] = {}
    for name, value in values.items():
        f = known[name]
        if is_section(f):
            if not isinstance(value, dict):
                raise FileFormatError(source, prefix + name, "a mapping", value)
            arguments[name] = built(f.default_factory, value, source, f"{prefix}{name}.")  # type: ignore[arg-type]
        else:
            arguments[name] = _checked(value, f, source, prefix + name)
    return cls(**arguments)


def numbers(text: str) -> tuple[float, ...]:
    """Of a parameter that lists some, separated by spaces."""
    return tuple(float(part) for part in text.split())


def _are_numbers(text: str, low: float, high: float) -> bool:
    try:
        values = numbers(text)
    except ValueError:
        return False
    return len(values) > 0 and all(low <= value <= high for value in values)


def _checked(value: Any, f: Field, source: str, name: str) -> Any:
    kind, choices = type(f.default), f.metadata["choices"]
    if kind is tuple:
        if not isinstance(value, (list, tuple)) or not all(isinstance(item, str) for item in value):
            raise FileFormatError(source, name, f"a list of some of {sorted(choices)}", value)
        for item in value:
            if item not in choices:
                raise FileFormatError(source, name, f"some of {sorted(choices)}", item)
        return tuple(value)
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if type(value) is not kind:
        raise FileFormatError(source, name, f"a {kind.__name__}", value)
    low, high = f.metadata["low"], f.metadata["high"]
    if kind in (int, float) and not ((low is None or value >= low) and (high is None or value <= high)):
        raise FileFormatError(source, name, f"a number in [{low}, {high}] {f.metadata['unit']}".rstrip(), value)
    if kind is str and low is not None and not _are_numbers(str(value), low, high):
        raise FileFormatError(source, name, f"numbers in [{low}, {high}] {f.metadata['unit']}, separated by spaces", value)
    if choices and value not in choices:
        raise FileFormatError(source, name, f"one of {sorted(choices)}", value)
    return value
