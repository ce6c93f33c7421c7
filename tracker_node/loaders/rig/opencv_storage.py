"""Calibrations in OpenCV's FileStorage (YAML, XML or JSON): single cameras, stereo pairs, and whole rigs of our own.

Three layouts are read, under the names of OpenCV's own samples:

- one camera a file: ``camera_matrix``, ``distortion_coefficients``, ``image_width``, ``image_height`` (``calibration``), and
  ``rvec``, ``tvec`` or ``R``, ``T`` from the world to the camera, without which a file stands alone;
- a stereo pair: ``M1 D1 M2 D2``, and ``R``, ``T`` from the first camera to the second, in one file or two (``stereo_calib``);
- a rig: a sequence ``cameras`` of maps with ``name``, a camera's nodes, and ``R``, ``T`` from the world to the camera.

OpenCV's FileStorage (YAML, XML or JSON) read without OpenCV, whose parser a damaged file can crash.

A storage is a map of nodes. A node is a number, a text, a list, a map, or a matrix, which is an array. What OpenCV alone writes
otherwise is known here: the head ``%YAML:1.0``, the tags ``!!opencv-matrix`` and ``!!opencv-nd-matrix`` (OpenCV 5 writes arrays
of one dimension so), ``type_id`` in XML and JSON, and sequences in XML, whose items are elements ``_`` or words. Sparse matrices,
those of more than two sizes, and base64, are refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeAlias
from xml.etree import ElementTree

import cv2
import numpy as np

from ...camera.model import CameraModel
from ...camera.rig import Camera, CameraRig
from ...errors import FileFormatError
from ...geometry import se3
from ..file_model import LARGEST, is_number
from ..json_values import parse_json, parse_xml
from ..source_address import identifier
from ..whole_file import read_text, write_whole
from ..yaml_file import OpenCvMatrix, parse_mapping
from .lens import lens_of, pose_of, rig_of, size_of

Node: TypeAlias = Any  # None, int, float, str, list, dict or np.ndarray
_MOST_LEVELS = 20
_WHAT = "an OpenCV FileStorage (YAML, XML or JSON)"
_HEAD = re.compile(r"\s*%YAML[: ]\s*\d\.\d[^\n]*\n")
_KIND = re.compile(r"(\d{0,2})[ucwsifdh]")  # channels and kind of number of a matrix
_NO_NUMBER = re.compile(r"[-+]?\.(nan|inf)", re.IGNORECASE)
_MATRICES = ("opencv-matrix", "opencv-nd-matrix")


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
    if isinstance(node, OpenCvMatrix) or (isinstance(node, dict) and node.get("type_id") in _MATRICES):
        return _listed_matrix(node, path, field)
    if isinstance(node, dict):
        return {key: _with_matrices(value, path, f"{field}.{key}", level + 1) for key, value in node.items()}
    if isinstance(node, list):
        return [_with_matrices(value, path, f"{field}[]", level + 1) for value in node]
    return node


def _listed_matrix(node: dict, path: str | Path, field: str) -> np.ndarray:
    sizes: Node = node.get("sizes", [node.get("rows"), node.get("cols")])
    sizes = sizes if isinstance(sizes, list) else [sizes]
    data: Node = node.get("data") or []
    kind = _KIND.fullmatch(str(node.get("dt", "")))
    channels = int(kind[1] or 1) if kind else 0
    data = data if isinstance(data, list) else [data]  # of XML, where one word is no list
    consistent = len(sizes) in (1, 2) and all(map(_is_count, sizes)) and channels and _are_numerals(data)
    if not consistent or math.prod(sizes) * channels != len(data):
        expected = "a matrix with rows and cols (or one or two sizes), dt, and as many numbers as data"
        raise FileFormatError(path, field, expected, "something else")
    return _numbers_of(data).reshape(sizes if channels == 1 else (*sizes, channels))


def _are_numerals(nodes: list) -> bool:
    """Whether all are numbers, also not-a-number or infinite ones: a matrix that is not used may have them."""
    return all(isinstance(node, (int, float)) and not isinstance(node, bool) for node in nodes)


def _numbers_of(values: list) -> np.ndarray:
    """Numbers as an array; those beyond `LARGEST` are infinite, which readers refuse."""
    return np.array([float(value) if is_number(value) else np.inf for value in values])


def _is_count(value: Node) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= LARGEST


def _root(text: str, path: str | Path) -> ElementTree.Element:
    root = parse_xml(text, path)
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


Nodes = Callable[[str], Node]  # the node of a name, or None

_LENS = ("camera_matrix", "distortion_coefficients")
_PAIR = (("M1", "D1"), ("M2", "D2"))
_POSES = (("rvec", "tvec"), ("R", "T"))


class _Storage:
    """Nodes of one or more files, by their names."""

    def __init__(self, paths: Sequence[str | Path]):
        self.path = ", ".join(map(str, paths))
        self.files = [read_storage(path) for path in paths]

    def node(self, name: str) -> Node:
        """The node of a name, or None."""
        return next(iter(self.nodes(name)), None)

    def nodes(self, name: str) -> list[Node]:
        """The nodes of a name, of all files that have it."""
        return [file[name] for file in self.files if file.get(name) is not None]


def load_opencv(paths: Sequence[str | Path], image_size: tuple[int, int] | None = None) -> CameraRig:
    """The rig of one file, of several that belong together (lenses and places of a stereo pair), or of one file per camera.

    Parameters
    ----------
    paths : YAML, XML or JSON files.
    image_size : (width, height), for files that do not say it.

    Returns
    -------
    Cameras, named by their files; one camera without a pose, or the left one of a pair, is the world's origin.

    Raises
    ------
    FileFormatError : naming the node.
    """
    storage = _Storage(paths)
    for name in ("cameras", "M1"):
        if len(storage.nodes(name)) > 1:
            raise FileFormatError(storage.path, name, "one file with it", f"{len(storage.nodes(name))}")
    if len(storage.nodes(_LENS[0])) > 1:
        return rig_of(storage.path, "(files)", [_single(_Storage([path]), path, image_size, alone=False) for path in paths])
    cameras = storage.node("cameras")
    if isinstance(cameras, list):
        return rig_of(storage.path, "cameras", [_of_rig(storage, entry, image_size) for entry in cameras])
    if storage.node("M1") is None:
        return CameraRig((_single(storage, paths[0], image_size, alone=True),))
    left, right = (_lens(storage, storage.node, names, image_size) for names in _PAIR)
    second_from_first = _pose(storage, storage.node)
    return CameraRig((Camera("left", left, np.eye(4)), Camera("right", right, se3.inverse(second_from_first))))


def dump_opencv(rig: CameraRig, path: str | Path) -> None:
    """Write a rig as a sequence ``cameras``; YAML, XML or JSON by the file's extension.

    Parameters
    ----------
    rig, path : cameras; file.

    Raises
    ------
    FileFormatError : another extension.
    OSError : the file cannot be written.
    """
    extension = Path(path).suffix.lower()
    if extension not in (".yml", ".yaml", ".xml", ".json"):
        raise FileFormatError(path, "(file)", "an extension of .yml, .yaml, .xml or .json", extension or "none")
    storage = cv2.FileStorage(extension, cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)  # to files it writes without a check
    storage.startWriteStruct("cameras", cv2.FILE_NODE_SEQ)
    for camera in rig:
        lens, transform = camera.model, camera.T_cam_world
        storage.startWriteStruct("", cv2.FILE_NODE_MAP)
        storage.write("name", camera.name)
        storage.write("image_width", lens.width)
        storage.write("image_height", lens.height)
        storage.write("camera_matrix", lens.K)
        storage.write("fisheye_model", int(lens.distortion_model == "equidistant"))
        storage.write("distortion_coefficients", lens.distortion[None] if lens.distortion.size else np.zeros((1, 5)))
        storage.write("R", transform[:3, :3].copy())
        storage.write("T", transform[:3, 3:].copy())
        storage.endWriteStruct()
    storage.endWriteStruct()
    write_whole(path, storage.releaseAndGetString())


def _single(storage: _Storage, path: str | Path, image_size: tuple[int, int] | None, alone: bool) -> Camera:
    """The one camera of a file, at the world's origin where it is alone and has no pose."""
    lens, T_world_cam = _lens(storage, storage.node, _LENS, image_size), np.eye(4)
    pose = next((names for names in _POSES if any(storage.node(name) is not None for name in names)), None)
    if pose is not None:
        T_world_cam = se3.inverse(_pose(storage, storage.node, pose))
    elif not alone:
        raise FileFormatError(storage.path, "rvec", "rvec and tvec, or R and T, in each of several cameras' files", "none")
    return Camera(identifier(Path(path).stem), lens, T_world_cam)


def _of_rig(storage: _Storage, entry: Node, image_size: tuple[int, int] | None) -> Camera:
    if not isinstance(entry, dict):
        raise FileFormatError(storage.path, "cameras[]", "a map with name, camera_matrix, R and T", "something else")
    name = entry.get("name")
    if not isinstance(name, str):
        raise FileFormatError(storage.path, "cameras[].name", "a camera's name", "none")
    lens = _lens(storage, entry.get, _LENS, image_size)
    return Camera(identifier(name), lens, se3.inverse(_pose(storage, entry.get)))


def _lens(storage: _Storage, node: Nodes, names: tuple[str, str], image_size: tuple[int, int] | None) -> CameraModel:
    """The lens of the matrix and the coefficients of these names."""
    field, coefficients_field = names
    K, coefficients = _matrix(storage, node, field), _matrix(storage, node, coefficients_field).ravel()
    flag = node("fisheye_model")
    fisheye = (is_number(flag) and flag == 1) or node("camera_model") == "fisheye"
    return lens_of(storage.path, names, field, _image_size(storage, node, image_size), K, coefficients, fisheye)


def _pose(storage: _Storage, node: Nodes, names: tuple[str, str] = ("R", "T")) -> np.ndarray:
    return pose_of(storage.path, names[0], _matrix(storage, node, names[0]), _matrix(storage, node, names[1]))


def _matrix(storage: _Storage, node: Nodes, name: str) -> np.ndarray:
    """The matrix of a name, or the numbers (n,) of a sequence of that name."""
    found = node(name)
    if found is None:
        raise FileFormatError(storage.path, name, "a matrix of that name", "none")
    if isinstance(found, list) and _are_numerals(found):
        found = _numbers_of(found)
    if not isinstance(found, np.ndarray):
        raise FileFormatError(storage.path, name, "a matrix, or a sequence of its numbers", "something else")
    if not np.all(np.abs(found) <= LARGEST):  # nor not-a-number
        raise FileFormatError(storage.path, name, "finite numbers", found.tolist())
    return found


def _image_size(storage: _Storage, node: Nodes, given: tuple[int, int] | None) -> tuple[int, int]:
    sides = node("image_width"), node("image_height")
    if any(side is not None and not (is_number(side) and side == 0) for side in sides):
        return size_of(storage.path, "image_width", *sides)
    if given is None:
        raise FileFormatError(storage.path, "image_width", "the size of the images, here or with --size", "none")
    return given
