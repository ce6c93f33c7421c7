"""Calibrations in OpenCV's FileStorage (YAML, XML or JSON): single cameras, stereo pairs, and whole rigs of our own.

Nodes are taken under the names that OpenCV's samples and tools write: ``camera_matrix``, ``cameraMatrix`` or ``K`` with
``distortion_coefficients``, ``distCoeffs`` or ``D``, ``image_width`` and ``image_height`` or ``image_size``; of a pair
``M1 D1 M2 D2`` (or ``cameraMatrix1``...) with ``R`` and ``T`` from the first camera to the second, wherever these are: pairs are
often kept in two files. A rig is a sequence ``cameras`` of maps with ``name``, and ``R`` and ``T`` from the world to the camera.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from ..camera.camera_model import CameraModel
from ..camera.camera_rig import Camera, CameraRig
from ..errors import CalibrationError, FileFormatError
from ..geometry import se3
from .camera_name import identifier
from .whole_file import write_whole

_K = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "M")
_D = ("distortion_coefficients", "distCoeffs", "Distortion_Coefficients", "distortion", "D")
_KINDS = {0: "none", 4: "plumb_bob", 5: "plumb_bob", 8: "rational_polynomial"}


class _Storage:
    """Nodes of one or more files, by their names."""

    def __init__(self, paths: Sequence[str | Path]):
        self.path = ", ".join(map(str, paths))
        self.files = []
        for path in paths:
            if not os.path.isfile(path):
                raise FileFormatError(path, "(file)", "an OpenCV FileStorage (YAML, XML or JSON)", "no such file")
            storage = _opened(path)
            if storage is None:
                raise FileFormatError(path, "(file)", "an OpenCV FileStorage (YAML, XML or JSON)", "something else")
            self.files.append(storage)

    def node(self, name: str):
        """The node of a name, or None."""
        for storage in self.files:
            node = storage.getNode(name)
            if not node.empty():
                return node
        return None


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
    if cameras is not None and cameras.isSeq():
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


def _rig(storage: _Storage, entries, image_size: tuple[int, int] | None) -> CameraRig:
    cameras = tuple(_of_rig(storage, entries.at(i), image_size) for i in range(entries.size()))
    names = [camera.name for camera in cameras]
    if not cameras or len(set(names)) != len(names):
        raise FileFormatError(storage.path, "cameras", "cameras, each with a different name", names or "none")
    return CameraRig(cameras)


def _of_rig(storage: _Storage, entry, image_size: tuple[int, int] | None) -> Camera:
    if not entry.isMap():
        raise FileFormatError(storage.path, "cameras[]", "a map with name, camera_matrix, R and T", "something else")

    def node(name: str):
        found = entry.getNode(name)
        return None if found.empty() else found

    named = node("name")
    if named is None or not named.isString():
        raise FileFormatError(storage.path, "cameras[].name", "a camera's name", "none")
    lens = _lens(storage, node, "", image_size)
    return Camera(identifier(named.string()), lens, se3.inverse(_pose(storage, node)))


def _lens(storage: _Storage, node, suffix: str, image_size: tuple[int, int] | None) -> CameraModel:
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
    fisheye = _integer(node("fisheye_model")) == 1 or _string(node("camera_model")) == "fisheye"
    if coefficients.size > 8 and not coefficients[8:].any():
        coefficients = coefficients[:8]  # thin prism and tilt that are not used
    if (coefficients.size != 4) if fisheye else (coefficients.size not in _KINDS):
        expected = "4 coefficients of a fisheye lens" if fisheye else "0, 4, 5 or 8 coefficients"
        raise FileFormatError(storage.path, field, expected, coefficients.tolist())
    kind = "equidistant" if fisheye else _KINDS[coefficients.size]
    width, height = _image_size(storage, node, image_size)
    try:
        straight = not (fisheye or coefficients.any())
        return CameraModel(width, height, K) if straight else CameraModel(width, height, K, kind, coefficients)
    except ValueError as error:
        raise FileFormatError(storage.path, field, "a lens that can be built", str(error)) from error


def _pose(storage: _Storage, node) -> np.ndarray:
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
    return pose


def _first(storage: _Storage, node, names: tuple[str, ...], suffix: str) -> tuple[np.ndarray, str]:
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


def _numbers(node) -> np.ndarray | None:
    """Of a matrix in its own shape, of a sequence (n,); None for anything else."""
    if node.isSeq():
        items = [node.at(i) for i in range(node.size())]
        return np.array([item.real() for item in items]) if all(item.isInt() or item.isReal() for item in items) else None
    try:
        matrix = node.mat() if node.isMap() else None
    except cv2.error:  # a map of something else
        return None
    return None if matrix is None else np.array(matrix, dtype=np.float64)


def _image_size(storage: _Storage, node, given: tuple[int, int] | None) -> tuple[int, int]:
    width, height = _integer(node("image_width")), _integer(node("image_height"))
    if not (width and height):
        size = node("image_size") or node("imageSize")
        if size is not None and size.isSeq() and size.size() == 2:
            width, height = _integer(size.at(0)), _integer(size.at(1))
    if not (width and height):
        if given is None:
            raise FileFormatError(storage.path, "image_width", "the size of the images, here or with --size", "none")
        return given
    if not (1 <= width <= 100_000 and 1 <= height <= 100_000):
        raise FileFormatError(storage.path, "image_width", "a width and a height of 1 to 100000 pixels", (width, height))
    return width, height


def _integer(node) -> int:
    number = node.real() if node is not None and (node.isInt() or node.isReal()) else 0.0
    return int(number) if np.isfinite(number) else 0


def _string(node) -> str:
    return node.string() if node is not None and node.isString() else ""


def _opened(path: str | Path) -> cv2.FileStorage | None:
    try:
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
        return storage if storage.isOpened() else None
    except (cv2.error, SystemError):  # the binding fails in both ways
        return None
