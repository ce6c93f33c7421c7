"""OpenCV's FileStorage (YAML, XML or JSON) read without OpenCV, whose parser a damaged file can crash.

A storage is a map of nodes. A node is a number, a text, a list, a map, or a matrix, which is an array. What OpenCV alone writes
otherwise is known here: the head ``%YAML:1.0``, the tag ``!!opencv-matrix``, ``type_id`` in XML and JSON, and sequences in XML,
whose items are elements ``_`` or words. Sparse and many-dimensional matrices, and base64, are refused.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, TypeAlias
from xml.etree import ElementTree

import numpy as np

from ...errors import FileFormatError
from ..json_values import parse_json
from ..whole_file import read_text
from ..yaml_file import OpenCvMatrix, parse_mapping

Node: TypeAlias = Any  # None, int, float, str, list, dict or np.ndarray
LARGEST = 1e9  # no number of a calibration is beyond
_MOST_LEVELS = 20
_WHAT = "an OpenCV FileStorage (YAML, XML or JSON)"
_HEAD = re.compile(r"\s*%YAML[: ]\s*\d\.\d[^\n]*\n")
_KIND = re.compile(r"(\d{0,2})[ucwsifdh]")  # channels and kind of number of a matrix
_NO_NUMBER = re.compile(r"[-+]?\.(nan|inf)", re.IGNORECASE)
_MATRIX = "opencv-matrix"


def read_storage(path: str | Path) -> dict[str, Node]:
    """The nodes of a file.

    Raises
    ------
    FileFormatError : no such file, none of the three formats, damaged, or more deeply nested than any calibration.
    """
    text = read_text(path).lstrip("\ufeff")
    start = text.lstrip()
    nodes: Node = None
    if start.startswith("<"):
        nodes = _of_xml(_root(start, path), path, 0)
    elif start.startswith("{"):
        nodes = parse_json(text, path)
    elif start.startswith("%YAML"):
        nodes = parse_mapping("\n" + _HEAD.sub("", text, count=1), path)  # the empty line keeps the numbers of lines
    if not isinstance(nodes, dict):
        raise FileFormatError(path, "(file)", _WHAT, "something else")
    return {name: _with_matrices(node, path, str(name), 0) for name, node in nodes.items()}


def _with_matrices(node: Node, path: str | Path, field: str, level: int) -> Node:
    if level > _MOST_LEVELS:
        raise FileFormatError(path, field, f"at most {_MOST_LEVELS} levels of maps and sequences", "more")
    if isinstance(node, OpenCvMatrix) or (isinstance(node, dict) and node.get("type_id") == _MATRIX):
        return _matrix(node, path, field)
    if isinstance(node, dict):
        return {key: _with_matrices(value, path, f"{field}.{key}", level + 1) for key, value in node.items()}
    if isinstance(node, list):
        return [_with_matrices(value, path, f"{field}[]", level + 1) for value in node]
    return node


def _matrix(node: dict, path: str | Path, field: str) -> np.ndarray:
    rows: Node = node.get("rows")
    columns: Node = node.get("cols")
    data: Node = node.get("data") or []
    kind = _KIND.fullmatch(str(node.get("dt", "")))
    channels = int(kind[1] or 1) if kind else 0
    data = [data] if is_number(data) else data  # of XML, where one word is no list
    consistent = _is_count(rows) and _is_count(columns) and channels and isinstance(data, list) and all(map(is_number, data))
    if not consistent or rows * columns * channels != len(data):
        raise FileFormatError(path, field, "a matrix with rows, cols, dt, and as many numbers as data", "something else")
    shape = (rows, columns) if channels == 1 else (rows, columns, channels)
    return numbers_of(data).reshape(shape)


def is_number(node: Node) -> bool:
    """Whether a node is one number."""
    return isinstance(node, (int, float)) and not isinstance(node, bool)


def numbers_of(values: list) -> np.ndarray:
    """Numbers as an array; those beyond `LARGEST` are infinite, which readers refuse."""
    return np.array([float(value) if abs(value) <= LARGEST else np.inf for value in values])


def _is_count(value: Node) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= LARGEST


def _root(text: str, path: str | Path) -> ElementTree.Element:
    if "<!DOCTYPE" in text or "<!ENTITY" in text:  # no program writes them, and entities can grow without bound
        raise FileFormatError(path, "(file)", "XML without a document type", "one")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        line, column = error.position
        raise FileFormatError(path, f"line {line}, column {column + 1}", "XML", str(error).partition(":")[0]) from None
    except (ValueError, LookupError) as error:  # an encoding that Python does not know
        raise FileFormatError(path, "(file)", "XML", str(error)) from None
    if root.tag != "opencv_storage":
        raise FileFormatError(path, "(top level)", "<opencv_storage>", f"<{root.tag}>")
    return root


def _of_xml(element: ElementTree.Element, path: str | Path, level: int) -> Node:
    if level > _MOST_LEVELS:
        raise FileFormatError(path, element.tag, f"at most {_MOST_LEVELS} levels of elements", "more")
    children = [(child.tag, _of_xml(child, path, level + 1)) for child in element]
    if not children:
        return _of_words(element.text or "")
    if all(tag == "_" for tag, _ in children):
        return [node for _, node in children]
    nodes = dict(children)
    if len(nodes) < len(children):
        raise FileFormatError(path, element.tag, "each name once", "one of them twice")
    return nodes | ({"type_id": element.attrib["type_id"]} if "type_id" in element.attrib else {})


def _of_words(text: str) -> Node:
    """Text, a number, or a list of numbers, as the words of an element without others in it are."""
    text = text.strip()
    words = text.split()
    numbers = [_number(word) for word in words]
    if not words or None in numbers:
        return text.strip('"')
    return numbers[0] if len(numbers) == 1 else numbers


def _number(word: str) -> int | float | None:
    try:
        return int(word) if re.fullmatch(r"[-+]?[0-9]{1,18}", word) else float(word)
    except ValueError:
        return float("nan") if _NO_NUMBER.fullmatch(word) else None
