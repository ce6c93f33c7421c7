"""Camera calibrations of Qualisys Track Manager (``.qca.txt``, which is XML), read and written.

Lengths in the images are 1/64 pixels, places millimeters. The rows r1, r2, r3 of ``transform`` are the camera's axes in the
world, x right, y up and z backward. Distortion coefficients have no unit and are taken as they stand (Pose2Sim divides by 64).
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from ...camera.rig import Camera, CameraRig
from ...errors import CalibrationError, FileFormatError
from ..file_model import is_number
from ..json_values import parse_xml
from ..source_address import identifier
from ..whole_file import read_bytes, whole_file
from .lens import lens_of, pose_of, rig_of, size_of

SUBPIXELS = 64.0
MM = 1000.0
_TO_OPTICAL = np.diag([1.0, -1.0, -1.0])  # x right, y up, z backward <-> x right, y down, z forward
_RADIAL = ("radialDistortion1", "radialDistortion2", "radialDistortion3")
_TANGENTIAL = ("tangentalDistortion1", "tangentalDistortion2")  # sic


def load_qualisys(path: str | Path) -> CameraRig:
    """The rig of a Qualisys calibration: its active cameras, named by their serial numbers.

    Raises
    ------
    FileFormatError : no such file, no XML, or an element or number that is missing or wrong.
    """
    root = parse_xml(read_bytes(path), path)
    found = [element for element in root.findall("cameras/camera") if _is_active(element)]
    if root.tag != "calibration" or not found:
        raise FileFormatError(path, "(file)", "<calibration> with <cameras> of which one is active", f"<{root.tag}>")
    return rig_of(path, "serial", [_camera(path, element) for element in found])


def cameras_in_qualisys(path: str | Path) -> list[tuple[str, bool]]:
    """Name of each camera of a Qualisys calibration, in the order of the file, and whether it is active."""
    found = parse_xml(read_bytes(path), path).findall("cameras/camera")
    return [(identifier(element.get("serial", "")), _is_active(element)) for element in found]


def _is_active(element: ET.Element) -> bool:
    return element.get("active", "1") == "1"


def dump_qualisys(rig: CameraRig, path: str | Path) -> None:
    """Write a rig as a Qualisys calibration.

    Parameters
    ----------
    rig, path : cameras; XML file.

    Raises
    ------
    CalibrationError : a lens that the format cannot hold.
    """
    root = ET.Element("calibration", {"type": "regular", "source": "tracker_node"})
    cameras = ET.SubElement(root, "cameras")
    for camera in rig:
        lens = camera.model
        if lens.distortion_model not in ("none", "plumb_bob"):
            raise CalibrationError(camera.name, f"a Qualisys calibration cannot hold a lens of the kind {lens.distortion_model}")
        element = ET.SubElement(cameras, "camera", {"active": "1", "serial": camera.name, "viewrotation": "0"})
        size = {"left": 0, "top": 0, "right": lens.width - 1, "bottom": lens.height - 1}
        ET.SubElement(element, "fov_video", {key: str(value) for key, value in size.items()})
        rows = _TO_OPTICAL @ camera.T_world_cam[:3, :3].T
        values = {f"r{i + 1}{j + 1}": rows[i, j] for i in range(3) for j in range(3)}
        values |= dict(zip("xyz", MM * camera.center, strict=True))
        ET.SubElement(element, "transform", _texts(values))
        coefficients = np.zeros(5)
        coefficients[: lens.distortion.size] = lens.distortion
        inner = {
            "focalLengthU": lens.K[0, 0], "focalLengthV": lens.K[1, 1], "centerPointU": lens.K[0, 2],
            "centerPointV": lens.K[1, 2], "skew": lens.K[0, 1],
        }  # fmt: skip
        distortion = dict(zip(_RADIAL + _TANGENTIAL, coefficients[[0, 1, 4, 2, 3]], strict=True))
        ET.SubElement(element, "intrinsic", _texts({key: SUBPIXELS * v for key, v in inner.items()} | distortion))
    ET.indent(root)
    with whole_file(path) as draft:
        ET.ElementTree(root).write(draft, encoding="utf-8", xml_declaration=True)


def _texts(values: dict[str, float]) -> dict[str, str]:
    return {key: repr(float(value)) for key, value in values.items()}


def _camera(path: str | Path, element: ET.Element) -> Camera:
    name = identifier(element.get("serial", ""))
    place = f"cameras.{name}"

    def part(tag: str) -> ET.Element:
        found = element.find(tag)
        if found is None:
            raise FileFormatError(path, f"{place}.{tag}", "an element of that name", "none")
        return found

    def number(parent: ET.Element, key: str, default: str | None = None) -> float:
        text = parent.get(key, default)
        try:
            value = float(text or "")
        except ValueError as error:
            raise FileFormatError(path, f"{place}.{parent.tag}.{key}", "a number", text) from error
        if not is_number(value):
            raise FileFormatError(path, f"{place}.{parent.tag}.{key}", "a finite number", text)
        return value

    fov, transform, inner = part("fov_video"), part("transform"), part("intrinsic")
    left, top = number(fov, "left"), number(fov, "top")
    K = np.eye(3)
    K[0, 0], K[1, 1] = number(inner, "focalLengthU") / SUBPIXELS, number(inner, "focalLengthV") / SUBPIXELS
    K[0, 1] = number(inner, "skew", "0") / SUBPIXELS
    K[0, 2] = number(inner, "centerPointU") / SUBPIXELS - left
    K[1, 2] = number(inner, "centerPointV") / SUBPIXELS - top
    k1, k2, k3 = (number(inner, key, "0") for key in _RADIAL)
    p1, p2 = (number(inner, key, "0") for key in _TANGENTIAL)
    rows = np.array([[number(transform, f"r{i}{j}") for j in (1, 2, 3)] for i in (1, 2, 3)])
    center = np.array([number(transform, key) for key in "xyz"]) / MM
    pose = pose_of(path, f"{place}.transform", (_TO_OPTICAL @ rows).T, center, tolerance=1e-4)
    size = size_of(path, f"{place}.fov_video", number(fov, "right") - left + 1, number(fov, "bottom") - top + 1)
    fields = (f"{place}.intrinsic", f"{place}.intrinsic")
    return Camera(name, lens_of(path, fields, name, size, K, np.array([k1, k2, p1, p2, k3])), pose)
