"""Calibrations in OpenCV's FileStorage (YAML, XML or JSON): single cameras, stereo pairs, and whole rigs of our own.

Nodes are taken under the names that OpenCV's samples and tools write: ``camera_matrix``, ``cameraMatrix`` or ``K`` with
``distortion_coefficients``, ``distCoeffs`` or ``D``, ``image_width`` and ``image_height`` or ``image_size``; of a pair
``M1 D1 M2 D2`` (or ``cameraMatrix1``...) with ``R`` and ``T`` from the first camera to the second, wherever these are: pairs are
often kept in two files. A rig is a sequence ``cameras`` of maps with ``name``, and ``R`` and ``T`` from the world to the camera.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np

from ...camera.model import CameraModel
from ...camera.plausible_lens import plausible
from ...camera.rig import Camera, CameraRig
from ...errors import CalibrationError, FileFormatError
from ...geometry import se3
from ..whole_file import write_whole
from .camera_name import identifier
from .opencv_nodes import LARGEST, Node, is_number, numbers_of, read_storage

Nodes = Callable[[str], Node]  # the node of a name, or None

_K = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "M")
_D = ("distortion_coefficients", "distCoeffs", "Distortion_Coefficients", "distortion", "D")
_KINDS = {0: "none", 4: "plumb_bob", 5: "plumb_bob", 8: "rational_polynomial"}


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
    image_size : (width, height), for files that do not say it.

    Raises
    ------
    FileFormatError : naming the node.
    """
    storage = _Storage(paths)
    cameras = storage.node("cameras")
    if isinstance(cameras, list):
        return _rig(storage, cameras, image_size)
    suffixes = ("1", "2") if any(storage.node(f"{key}1") is not None for key in _K) else ("",)
    lenses = [_lens(storage, storage.node, suffix, image_size) for suffix in suffixes]
    if len(lenses) == 1:
        return CameraRig((Camera(identifier(Path(paths[0]).stem), lenses[0], np.eye(4)),))
    second_from_first = _pose(storage, storage.node)
    return CameraRig((Camera("left", lenses[0], np.eye(4)), Camera("right", lenses[1], se3.inverse(second_from_first))))


def dump_opencv(rig: CameraRig, path: str | Path) -> None:
    """Write a rig as a sequence ``cameras``; YAML, XML or JSON by the file's extension.

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


def _rig(storage: _Storage, entries: list, image_size: tuple[int, int] | None) -> CameraRig:
    cameras = tuple(_of_rig(storage, entry, image_size) for entry in entries)
    names = [camera.name for camera in cameras]
    if not cameras or len(set(names)) != len(names):
        raise FileFormatError(storage.path, "cameras", "cameras, each with a different name", names or "none")
    return CameraRig(cameras)


def _of_rig(storage: _Storage, entry: Node, image_size: tuple[int, int] | None) -> Camera:
    if not isinstance(entry, dict):
        raise FileFormatError(storage.path, "cameras[]", "a map with name, camera_matrix, R and T", "something else")
    name = entry.get("name")
    if not isinstance(name, str):
        raise FileFormatError(storage.path, "cameras[].name", "a camera's name", "none")
    lens = _lens(storage, entry.get, "", image_size)
    return Camera(identifier(name), lens, se3.inverse(_pose(storage, entry.get)))


def _lens(storage: _Storage, node: Nodes, suffix: str, image_size: tuple[int, int] | None) -> CameraModel:
    K, field = _first(storage, node, _K, suffix)
    if K.size != 9:
        raise FileFormatError(storage.path, field, "a 3 x 3 matrix", K.tolist())
    K = K.reshape(3, 3)
    if K[0, 0] == 0.0:
        raise CalibrationError(field, f"uncalibrated: focal length 0 in {storage.path}")
    if K[1, 0] or K[2, 0] or K[2, 1] or K[2, 2] != 1.0:
        raise FileFormatError(storage.path, field, "[[fx, skew, cx], [0, fy, cy], [0, 0, 1]]", K.tolist())
    coefficients, field = _first(storage, node, _D, suffix)
    coefficients = coefficients.ravel()
    fisheye = _integer(node("fisheye_model")) == 1 or node("camera_model") == "fisheye"
    if coefficients.size > 8 and not coefficients[8:].any():
        coefficients = coefficients[:8]  # thin prism and tilt that are not used
    if (coefficients.size != 4) if fisheye else (coefficients.size not in _KINDS):
        expected = "4 coefficients of a fisheye lens" if fisheye else "0, 4, 5 or 8 coefficients"
        raise FileFormatError(storage.path, field, expected, coefficients.tolist())
    kind = "equidistant" if fisheye else _KINDS[coefficients.size]
    width, height = _image_size(storage, node, image_size)
    try:
        straight = not (fisheye or coefficients.any())
        return plausible(CameraModel(width, height, K) if straight else CameraModel(width, height, K, kind, coefficients))
    except ValueError as error:
        raise FileFormatError(storage.path, field, "a lens that can be built", str(error)) from error


def _pose(storage: _Storage, node: Nodes) -> np.ndarray:
    rotation, field = _first(storage, node, ("R", "rotation_matrix"), "")
    translation, _ = _first(storage, node, ("T", "t", "translation_vector"), "")
    if rotation.size == 3:
        rotation = cv2.Rodrigues(rotation)[0]
    elif rotation.size == 9:
        rotation = rotation.reshape(3, 3)
    if rotation.shape != (3, 3) or translation.size != 3:
        raise FileFormatError(storage.path, field, "a rotation (3 x 3 or Rodrigues) and a translation of 3", rotation.tolist())
    pose = se3.from_rotation_translation(rotation, translation.ravel())
    if not se3.is_rigid(pose, tolerance=1e-5):
        raise FileFormatError(storage.path, field, "a proper rotation", rotation.tolist())
    return se3.nearest_rigid(pose)


def _first(storage: _Storage, node: Nodes, names: tuple[str, ...], suffix: str) -> tuple[np.ndarray, str]:
    """The first matrix that is there under one of several names, and its name."""
    for name in names:
        found = node(name + suffix)
        if found is not None:
            values = _numbers(found)
            if values is None:
                raise FileFormatError(storage.path, name + suffix, "a matrix, or a sequence of its numbers", "something else")
            if not np.all(np.abs(values) <= 1e9):  # nor not-a-number
                raise FileFormatError(storage.path, name + suffix, "finite numbers", values.tolist())
            return values, name + suffix
    raise FileFormatError(storage.path, names[0] + suffix, "a matrix of that name", "none")


def _numbers(node: Node) -> np.ndarray | None:
    """Of a matrix in its own shape, of a sequence (n,); None for anything else."""
    if isinstance(node, list) and all(map(is_number, node)):
        return numbers_of(node)
    return node if isinstance(node, np.ndarray) else None


def _image_size(storage: _Storage, node: Nodes, given: tuple[int, int] | None) -> tuple[int, int]:
    width, height = _integer(node("image_width")), _integer(node("image_height"))
    if not (width and height):
        size = node("image_size") if node("image_size") is not None else node("imageSize")
        if isinstance(size, list) and len(size) == 2:
            width, height = _integer(size[0]), _integer(size[1])
    if not (width and height):
        if given is None:
            raise FileFormatError(storage.path, "image_width", "the size of the images, here or with --size", "none")
        return given
    if not (1 <= width <= 100_000 and 1 <= height <= 100_000):
        raise FileFormatError(storage.path, "image_width", "a width and a height of 1 to 100000 pixels", (width, height))
    return width, height


def _integer(node: Node) -> int:
    return int(node) if is_number(node) and abs(node) <= LARGEST else 0
