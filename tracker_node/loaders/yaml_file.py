"""YAML at the door: strict reading, errors that name file and field, compact writing.

Strict: a key given twice is refused, numbers follow YAML 1.2 (``1e-3`` is a number, which YAML 1.1 takes for text), and a
mapping may hold only the fields that its format knows.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
import yaml
from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from ..errors import FileFormatError
from .whole_file import write_whole

LARGEST = 1e12  # no length, angle or pixel of a real scene is beyond
MOST_VALUES = 1_000_000  # of a file, each alias counted as often as it is used
_FLOAT = re.compile(r"^[-+]?(\d+\.?\d*([eE][-+]?\d+)?|\.\d+([eE][-+]?\d+)?|\.(inf|Inf|INF)|\.(nan|NaN|NAN))$")


class _StrictLoader(yaml.SafeLoader):
    """Safe loader that refuses repeated keys, and aliases of aliases that stand for more than a machine can hold."""

    def construct_document(self, node: yaml.Node) -> Any:
        if _size(node, {}) > MOST_VALUES:
            too_many = f"aliases stand for more than {MOST_VALUES} values"
            raise yaml.constructor.ConstructorError(None, None, too_many, node.start_mark)
        return super().construct_document(node)


def _size(node: yaml.Node, sizes: dict[int, int]) -> int:
    """Values in a node, aliases written out; a node within itself counts once and is refused by PyYAML."""
    if isinstance(node, yaml.ScalarNode):
        return 1
    if id(node) not in sizes:
        sizes[id(node)] = 1
        children = [child for item in node.value for child in (item if isinstance(item, tuple) else (item,))]
        sizes[id(node)] = 1 + sum(_size(child, sizes) for child in children)
    return sizes[id(node)]


class _DuplicateKey(yaml.YAMLError):
    def __init__(self, key: object, line: int):
        self.key, self.line = key, line
        super().__init__(f"key {key!r} is given twice (line {line})")


def _construct_mapping(loader: yaml.SafeLoader, node: yaml.MappingNode) -> dict:
    loader.flatten_mapping(node)
    result: dict = {}
    for key_node, value_node in node.value:
        key = loader.construct_object(key_node, deep=True)
        if not isinstance(key, (str, int, float, bool, type(None))):
            raise yaml.constructor.ConstructorError(None, None, "a key must be text", key_node.start_mark)
        if key in result:
            raise _DuplicateKey(key, key_node.start_mark.line + 1)
        result[key] = loader.construct_object(value_node, deep=True)
    return result


_StrictLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _construct_mapping)
# A copy, so that the resolvers of other users of PyYAML stay as they are; ints keep their place before floats.
_StrictLoader.yaml_implicit_resolvers = {
    first: [entry for entry in entries if entry[0] not in ("tag:yaml.org,2002:float", "tag:yaml.org,2002:timestamp")]
    for first, entries in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_StrictLoader.add_implicit_resolver("tag:yaml.org,2002:float", _FLOAT, list("-+.0123456789"))


class _Dumper(yaml.SafeDumper):
    """Block style, except that lists of plain values stand on one line."""

    def ignore_aliases(self, data: object) -> bool:
        return True


def _represent_list(dumper: yaml.SafeDumper, data: list | tuple) -> yaml.Node:
    plain = all(not isinstance(item, (list, tuple, dict)) for item in data)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=plain)


class Inline(dict):
    """A mapping that is written on one line."""


_Dumper.add_representer(list, _represent_list)
_Dumper.add_representer(tuple, _represent_list)
_Dumper.add_representer(Inline, lambda dumper, data: dumper.represent_mapping("tag:yaml.org,2002:map", data, flow_style=True))


def read_text(path: str | Path) -> str:
    """Text of a file; a missing, unreadable or binary file is a `FileFormatError`."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise FileFormatError(path, "(file)", "an existing file", "no such file") from None
    except UnicodeDecodeError as error:
        raise FileFormatError(path, "(file)", "UTF-8 text", f"byte {error.start} is not") from None
    except OSError as error:
        raise FileFormatError(path, "(file)", "a readable file", error.strerror or str(error)) from None


def read_mapping(path: str | Path) -> dict[str, Any]:
    """Top-level mapping of a YAML file.

    Raises
    ------
    FileFormatError : missing file, YAML syntax (with line and column), a repeated key, or no mapping at the top.
    """
    try:
        values = yaml.load(read_text(path), Loader=_StrictLoader)
    except _DuplicateKey as error:
        raise FileFormatError(path, str(error.key), "each key once", f"a second one in line {error.line}") from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}" if mark else "(file)"
        raise FileFormatError(path, where, "YAML", error.problem or error.context or str(error)) from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise FileFormatError(path, "(file)", "YAML", str(error)) from None
    if not isinstance(values, dict):
        raise FileFormatError(path, "(top level)", "a mapping", values)
    return values


def parse_value(text: str) -> Any:
    """A value as it might stand in a file: ``4e-3`` is a number, ``[1, 2]`` a list; what is no YAML stays text."""
    try:
        return yaml.load(text, Loader=_StrictLoader)
    except (yaml.YAMLError, ValueError, RecursionError):
        return text


def write_mapping(values: Mapping[str, Any], path: str | Path, comment: str = "") -> None:
    """Write a mapping as YAML, whole or not at all; ``comment`` lines go on top."""
    text = "".join(f"# {line}".rstrip() + "\n" for line in comment.splitlines())
    text += yaml.dump(dict(values), Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=110)
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, text)


class FileModel(BaseModel):
    """Base of every validated part of a file: closed set of fields, no coercion of text to numbers."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=False, arbitrary_types_allowed=False)

    @model_validator(mode="before")
    @classmethod
    def _known_fields_only(cls, values: Any) -> Any:
        if isinstance(values, dict):
            for key in values:
                if key not in cls.model_fields:
                    raise problem(f"one of {sorted(cls.model_fields)}", key, field=str(key))
        elif not isinstance(values, BaseModel):
            raise problem("a mapping", values)
        return values


def problem(expected: str, got: object, field: str = "") -> PydanticCustomError:
    """What a validator raises; ``field`` is relative to where the validator stands."""
    context = {"expected": expected, "got": got, "field": field}
    return PydanticCustomError("format", "expected {expected}", context)


def is_number(value: Any) -> bool:
    """True for a number that a file may hold; beyond `LARGEST` squares and cosines lose their meaning."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= LARGEST


def _checked_numbers(value: Any, shape: tuple[int | None, ...], what: str) -> Any:
    array = value.tolist() if isinstance(value, np.ndarray) else value
    if not shape:
        if not is_number(array):
            raise ValueError
        return float(array)
    if not isinstance(array, (list, tuple)) or (shape[0] is not None and len(array) != shape[0]):
        raise ValueError
    return tuple(_checked_numbers(item, shape[1:], what) for item in array)


def numbers(*shape: int | None, what: str = "") -> Any:
    """Type of finite numbers of this shape, e.g. ``numbers(3, 3)``; ``None`` stands for any length; ``numbers()`` is one."""
    sizes = " x ".join("n" if size is None else str(size) for size in shape)
    expected = what or (f"{sizes} finite numbers" if shape else "a finite number")

    def check(value: Any) -> Any:
        try:
            return _checked_numbers(value, shape, expected)
        except (ValueError, OverflowError):
            raise problem(expected, value) from None

    inner: Any = float
    for _ in shape:
        inner = tuple[inner, ...]
    return Annotated[inner, BeforeValidator(check)]


Number = numbers()
PositiveNumber = Annotated[float, BeforeValidator(lambda v: _positive(v))]


def _positive(value: Any) -> float:
    if not is_number(value) or not value > 0.0:
        raise problem("a positive number", value)
    return float(value)


T = TypeVar("T", bound=BaseModel)


def validate(format_class: type[T], values: dict[str, Any], path: str | Path) -> T:
    """``values`` checked against a format.

    Raises
    ------
    FileFormatError : for the first thing that is wrong (and how many more there are).
    """
    try:
        return format_class.model_validate(values)
    except ValidationError as error:
        errors = error.errors(include_url=False)
        first = errors[0]
        context = first.get("ctx", {})
        field = _dotted(first["loc"], values, first["type"])
        if first["type"] == "format":
            field = ".".join(part for part in (field, context["field"]) if part)
            expected, got = context["expected"], context["got"]
        else:
            expected, got = _expected_and_got(first)
        if len(errors) > 1:
            expected += f" (and {len(errors) - 1} more problems in this file)"
        raise FileFormatError(path, field or "(top level)", expected, got) from None


def _expected_and_got(error: Any) -> tuple[str, object]:
    if error["type"] == "missing":
        return "a value", "nothing"
    if error["type"] == "union_tag_not_found":
        return f"a field {error['ctx']['discriminator']}", "none"
    if error["type"] == "union_tag_invalid":
        return f"{error['ctx']['discriminator']} to be one of {error['ctx']['expected_tags']}", error["ctx"]["tag"]
    message = error["msg"]
    for prefix in ("Input should be ", "Value error, "):
        message = message.removeprefix(prefix)
    return message, error["input"]


def _dotted(location: tuple[int | str, ...], values: Any, kind: str) -> str:
    """Dotted path of an error in the file's own terms: tags that pydantic adds for unions are left out."""
    parts, here = [], values
    for i, part in enumerate(location):
        last = i == len(location) - 1
        if isinstance(here, dict) and part in here:
            here = here[part]
        elif isinstance(here, (list, tuple)) and isinstance(part, int) and part < len(here):
            here = here[part]
        elif not (last and kind == "missing"):
            continue
        parts.append(str(part))
    return ".".join(parts)
