"""What a mapping of a file is, told by its keys: who gives the wrong file is told which one it is."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import WrongKindOfFileError

RIG, BODY, STATE, RECORDING, PARAMETERS = "a rig", "a body", "a state", "a recording", "a file of parameters"
_SECTIONS = {
    *("synchronizer", "initialization", "motion", "background", "region", "chamfer", "color", "texture"),
    *("color_over_background", "joint", "collision", "status", "limb_search", "self_check"),
    *("evidence", "optimizer", "start", "together"),  # of version 0.1
}


def kind_of(values: Mapping[Any, Any]) -> str:
    """What it is, with its article; empty where the keys do not tell."""
    if isinstance(values.get("metrics"), dict):
        return "a file of metrics"
    if "image_sets" in values and "status_counts" in values:
        return "the summary of a run"
    if "rosbag2_bagfile_information" in values:
        return "the metadata of a bag"
    if "image_width" in values and ("camera_matrix" in values or "camera_name" in values):
        return "a ROS camera_info file (rig import reads it)"
    cameras = values.get("cameras")
    if isinstance(cameras, dict) and "rig" not in values:
        masks = any(isinstance(entry, dict) and not {"polygons", "still"}.isdisjoint(entry) for entry in cameras.values())
        return "a file of reference masks" if masks else RIG
    if isinstance(values.get("links"), list):
        return BODY
    if isinstance(values.get("rig"), str) and "model" in values:
        return RECORDING
    if isinstance(values.get("root"), dict):
        return STATE
    sections = [value for value in values.values() if isinstance(value, dict)]
    if any("ros__parameters" in section for section in sections):
        return PARAMETERS
    return PARAMETERS if any(key in _SECTIONS and isinstance(value, dict) for key, value in values.items()) else ""


def check_kind(values: Mapping[Any, Any], wanted: str, path: str | Path) -> None:
    """Refuse a file that is known to be of another kind.

    Raises
    ------
    WrongKindOfFileError : saying which.
    """
    found = kind_of(values)
    if found and found != wanted:
        raise WrongKindOfFileError(path, found, wanted)
