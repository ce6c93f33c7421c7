"""YAML read strictly, with errors that name file and field, and written compactly.

Numbers, truth values and nothing are those of the core schema of YAML 1.2: ``1e-3`` is a number, ``0640`` is 640, ``0o17`` is 15,
``yes``, ``1:30`` and ``2024-05-01`` are text. A key given twice is refused.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar

import yaml

from ..errors import FileFormatError
from .whole_file import read_text, write_whole

MOST_VALUES = 1_000_000  # of a file, each alias counted as often as it is used
MOST_LEVELS = 100  # of lists and mappings within each other
MOST_DIGITS = 1000  # of an integer
_TAG = "tag:yaml.org,2002:"
_CORE = (  # of YAML 1.2, with the characters that each may begin with
    ("null", re.compile(r"^(~|null|Null|NULL|)$"), ["~", "n", "N", ""]),
    ("bool", re.compile(r"^(true|True|TRUE|false|False|FALSE)$"), list("tTfF")),
    ("int", re.compile(r"^([-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+)$"), list("-+0123456789")),
    (
        "float",
        re.compile(r"^([-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN))$"),
        list("-+.0123456789"),
    ),
)


class _StrictLoader(yaml.SafeLoader):
    """Loader of the core schema that refuses repeated keys, and what stands for more than a machine can hold."""

    yaml_implicit_resolvers: ClassVar[dict[str, list]] = {}  # its own: those of other users of PyYAML stay as they are
    yaml_constructors: ClassVar[dict[str | None, Callable]] = {}

    def compose_node(self, parent: Any, index: Any) -> Any:
        self._level = getattr(self, "_level", 0) + 1
        if self._level > MOST_LEVELS:
            raise _refused(f"more than {MOST_LEVELS} levels of lists and mappings", self.peek_event().start_mark)
        try:
            return super().compose_node(parent, index)
        finally:
            self._level -= 1

    def construct_document(self, node: yaml.Node) -> Any:
        if _size(node, {}) > MOST_VALUES:
            raise _refused(f"aliases stand for more than {MOST_VALUES} values", node.start_mark)
        return super().construct_document(node)


def _refused(what: str, mark: yaml.Mark) -> yaml.MarkedYAMLError:
    return yaml.constructor.ConstructorError(None, None, what, mark)


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
    if not isinstance(node, yaml.MappingNode):
        raise _refused("expected a mapping", node.start_mark)
    result: dict = {}
    for key_node, value_node in node.value:
        key = loader.construct_object(key_node, deep=True)
        if not isinstance(key, (str, int, float, bool, type(None))):
            raise _refused("a key must be text", key_node.start_mark)
        if key in result:
            raise _DuplicateKey(key, key_node.start_mark.line + 1)
        result[key] = loader.construct_object(value_node, deep=True)
    return result


class OpenCvMatrix(dict):
    """A mapping that OpenCV marks as a matrix: rows and cols or sizes, dt and data."""


def _construct_list(loader: yaml.SafeLoader, node: yaml.Node) -> list:
    return loader.construct_sequence(node, deep=True)


def _scalar(kind: str, value_of: Callable[[str], Any]) -> Callable[[yaml.SafeLoader, yaml.Node], Any]:
    """A constructor of what `_CORE` says is of this kind; it may be marked so with a tag, too."""
    pattern = next(pattern for name, pattern, _ in _CORE if name == kind)

    def construct(loader: yaml.SafeLoader, node: yaml.Node) -> Any:
        text = loader.construct_scalar(node)
        if not pattern.match(text):
            raise _refused(f"expected what YAML 1.2 takes for !!{kind}", node.start_mark)
        if kind == "int" and len(text) > MOST_DIGITS:
            raise _refused(f"an integer of more than {MOST_DIGITS} digits", node.start_mark)
        return value_of(text)

    return construct


def _integer(text: str) -> int:
    return int(text[2:], 8 if text[1] == "o" else 16) if text[:2] in ("0o", "0x") else int(text)


def _float(text: str) -> float:
    return float(text.replace(".inf", "inf").replace(".nan", "nan"))


_CONSTRUCTORS: dict[str, Callable] = {
    "map": _construct_mapping,
    "seq": _construct_list,
    "str": lambda loader, node: loader.construct_scalar(node),
    **dict.fromkeys(
        ("opencv-matrix", "opencv-nd-matrix"), lambda loader, node: OpenCvMatrix(_construct_mapping(loader, node))
    ),
    "null": _scalar("null", lambda text: None),
    "bool": _scalar("bool", lambda text: text.lower() == "true"),
    "int": _scalar("int", _integer),
    "float": _scalar("float", lambda text: _float(text.lower())),
}
for _kind, _constructor in _CONSTRUCTORS.items():
    _StrictLoader.add_constructor(_TAG + _kind, _constructor)
_StrictLoader.add_constructor(None, yaml.SafeLoader.construct_undefined)  # any other tag is refused
for _kind, _pattern, _first in _CORE:
    _StrictLoader.add_implicit_resolver(_TAG + _kind, _pattern, _first)


class _Dumper(yaml.SafeDumper):
    """Block style, except that lists of plain values stand on one line.

    Text that YAML 1.1 (the ROS command line's) or 1.2 would take for something else is quoted.
    """

    def ignore_aliases(self, data: object) -> bool:
        return True


def _represent_list(dumper: yaml.SafeDumper, data: list | tuple) -> yaml.Node:
    plain = all(not isinstance(item, (list, tuple, dict)) for item in data)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=plain)


def _represent_text(dumper: yaml.SafeDumper, data: str) -> yaml.Node:
    """In double quotes where PyYAML would break lines at what other characters than a line feed end."""
    return dumper.represent_scalar("tag:yaml.org,2002:str", data, style='"' if re.search("[\x85\u2028\u2029]", data) else None)


class Inline(dict):
    """A mapping that is written on one line."""


for _kind, _pattern, _first in _CORE:  # beside those of YAML 1.1
    if _kind in ("int", "float"):
        _Dumper.add_implicit_resolver(_TAG + _kind, _pattern, _first)
_Dumper.add_representer(str, _represent_text)
_Dumper.add_representer(list, _represent_list)
_Dumper.add_representer(tuple, _represent_list)
_Dumper.add_representer(Inline, lambda dumper, data: dumper.represent_mapping("tag:yaml.org,2002:map", data, flow_style=True))


def read_mapping(path: str | Path) -> dict[str, Any]:
    """Top-level mapping of a YAML file.

    Raises
    ------
    FileFormatError : missing file, YAML syntax (with line and column), a repeated key, or no mapping at the top.
    """
    return parse_mapping(read_text(path), path)


def parse_mapping(text: str, path: str | Path) -> dict[str, Any]:
    """Top-level mapping of a YAML text.

    Parameters
    ----------
    text, path : content; file, for messages.

    Returns
    -------
    Key -> value.

    Raises
    ------
    FileFormatError : as `read_mapping`.
    """
    try:
        values = yaml.load(text, Loader=_StrictLoader)
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
    """Write a mapping as YAML, whole or not at all.

    Parameters
    ----------
    values, path : plain values; file.
    comment : lines on top of the file.
    """
    text = "".join(f"# {line}".rstrip() + "\n" for line in comment.splitlines())
    text += yaml.dump(dict(values), Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=110)
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, text)
