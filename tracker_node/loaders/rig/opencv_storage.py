"""Calibrations in OpenCV's FileStorage (YAML, XML or JSON): single cameras, stereo pairs, and whole rigs of our own.

Three layouts are read, under the names of OpenCV's own samples:

- one camera: ``camera_matrix``, ``distortion_coefficients``, ``image_width``, ``image_height`` (``calibration``);
- a stereo pair: ``M1 D1 M2 D2``, and ``R``, ``T`` from the first camera to the second, in one file or two (``stereo_calib``);
- a rig: a sequence ``cameras`` of maps with ``name``, a camera's nodes, and ``R``, ``T`` from the world to the camera.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np

from ...camera.model import CameraModel
from ...camera.rig import Camera, CameraRig
from ...errors import FileFormatError
from ...geometry import se3
from ..whole_file import write_whole
from .lens import identifier, lens_of, pose_of, rig_of
from .opencv_nodes import LARGEST, Node, is_number, numbers_of, read_storage

Nodes = Callable[[str], Node]  # the node of a name, or None

_LENS = ("camera_matrix", "distortion_coefficients")
_PAIR = (("M1", "D1"), ("M2", "D2"))


class _Storage:
    """Nodes of one or more files, by their names."""

    def __init__(self, paths: Sequence[str | Path]):
        self.path = ", ".join(map(str, paths))
        self.files = [read_storage(path) for path in paths]

    def node(self, name: str) -> Node:
        """The node of a name, or None."""
        return next((file[name] for file in self.files if file.get(name) is not None), None)


def load_opencv(paths: Sequence[str | Path], image_size: tuple[int, int] | None = None) -> CameraRig:
    """The rig of one file, or of several that belong together (lenses and places of a stereo pair).

    Parameters
    ----------
    paths : YAML, XML or JSON files.
    image_size : (width, height), for files that do not say it.

    Returns
    -------
    Cameras; one camera, or the left one of a pair, is the world's origin.

    Raises
    ------
    FileFormatError : naming the node.
    """
    storage = _Storage(paths)
    cameras = storage.node("cameras")
    if isinstance(cameras, list):
        return rig_of(storage.path, "cameras", [_of_rig(storage, entry, image_size) for entry in cameras])
    if storage.node("M1") is None:
        lens = _lens(storage, storage.node, _LENS, image_size)
        return CameraRig((Camera(identifier(Path(paths[0]).stem), lens, np.eye(4)),))
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
    fisheye = _integer(node("fisheye_model")) == 1 or node("camera_model") == "fisheye"
    if coefficients.size > 8 and not coefficients[8:].any():
        coefficients = coefficients[:8]  # thin prism and tilt that are not used
    if not fisheye and coefficients.size in (4, 5, 8) and not coefficients.any():
        coefficients = np.zeros(0)
    return lens_of(storage.path, names, field, _image_size(storage, node, image_size), K, coefficients, fisheye)


def _pose(storage: _Storage, node: Nodes) -> np.ndarray:
    return pose_of(storage.path, "R", _matrix(storage, node, "R"), _matrix(storage, node, "T"))


def _matrix(storage: _Storage, node: Nodes, name: str) -> np.ndarray:
    """The matrix of a name, or the numbers (n,) of a sequence of that name."""
    found = node(name)
    if found is None:
        raise FileFormatError(storage.path, name, "a matrix of that name", "none")
    if isinstance(found, list) and all(map(is_number, found)):
        found = numbers_of(found)
    if not isinstance(found, np.ndarray):
        raise FileFormatError(storage.path, name, "a matrix, or a sequence of its numbers", "something else")
    if not np.all(np.abs(found) <= LARGEST):  # nor not-a-number
        raise FileFormatError(storage.path, name, "finite numbers", found.tolist())
    return found


def _image_size(storage: _Storage, node: Nodes, given: tuple[int, int] | None) -> tuple[int, int]:
    width, height = _integer(node("image_width")), _integer(node("image_height"))
    if not (width and height):
        if given is None:
            raise FileFormatError(storage.path, "image_width", "the size of the images, here or with --size", "none")
        return given
    if not (1 <= width <= 100_000 and 1 <= height <= 100_000):
        raise FileFormatError(storage.path, "image_width", "a width and a height of 1 to 100000 pixels", (width, height))
    return width, height


def _integer(node: Node) -> int:
    return int(node) if is_number(node) and abs(node) <= LARGEST else 0
