"""The tracker's parameters from and to files: where the layers of files and of tracking meet.

Files of version 0.1 under the present names; its bags and runs are refused where they are read.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from ..errors import FileFormatError, TrackerError
from ..loaders.fetched_files import usable_weights
from ..loaders.file_model import BODY, PARAMETERS, RECORDING, RIG, FileModel, check_kind, kind_of, validate
from ..loaders.model.model_file import ModelFile
from ..loaders.recording_yaml import RecordingFile
from ..loaders.rig.rig_yaml import RigFile
from ..loaders.whole_file import read_text, write_whole
from ..loaders.yaml_file import read_mapping, write_mapping
from ..model.articulated import ArticulatedModel
from ..model.humans.keypoints import is_person
from ..tracking.config import KEYPOINTS, REGION, TrackerConfig, describe, flatten, from_dict
from ..tracking.parameters import nested
from ..tracking.renamed import CHOICES, RENAMED, REPRESENTATIONS, flat

_ROS_KEY = "ros__parameters"
# Parameters that rclpy gives every node; they mean nothing to the core.
_ROS_OWN = ("use_sim_time", "qos_overrides", "start_type_description_service")
_NODE = "/tracker"


def load_config(path: str | Path, node: str = _NODE) -> TrackerConfig:
    """Tracker configuration of a plain parameter file, or of a node in one of ROS; what the file leaves out has its default.

    Parameters
    ----------
    path : of the file.
    node : its name, with its namespace.

    Returns
    -------
    The configuration.

    Raises
    ------
    FileFormatError : naming file and parameter, the range or the choices, and the value; no section is the node's.
    """
    return from_dict(load_parameters(path, node), str(path))


def config_for(
    path: str | Path | None,
    model: ArticulatedModel,
    has_points: bool = False,
    tell: Callable[[str], None] = warnings.warn,
    node: str = _NODE,
) -> TrackerConfig:
    """`load_config` for a body whose points a run finds or has; ``modalities`` that the file leaves out suit it.

    Outlines alone lose the arms of people in clothes like the room: people are compared by region and keypoints wherever their
    points can be had.

    Parameters
    ----------
    path : of the file; None: there is none.
    model : the body.
    has_points : the run is given points, whatever the body is.
    tell : called with why people go without points.
    node : name of the tracker, with its namespace.

    Returns
    -------
    The configuration.

    Raises
    ------
    FileFormatError : as `load_config`.
    """
    source, values = (str(path), load_parameters(path, node)) if path else ("tracker config", {})
    if "modalities" in values or not (has_points or is_person(model)):
        return from_dict(values, source)
    if not has_points:
        try:
            usable_weights()
        except TrackerError as error:
            tell(f"outlines alone, without points of people: {error}")
            return from_dict(values, source)
    return from_dict({"modalities": [REGION, KEYPOINTS], **values}, source)


def dump_config(config: TrackerConfig, path: str | Path) -> None:
    """Write every parameter.

    Parameters
    ----------
    config : of the tracker.
    path : of the file.
    """
    _write_parameters(flatten(config), path, "Parameters of the tracker.")


def load_parameters(path: str | Path, node: str = _NODE) -> dict[str, Any]:
    """Parameters of a file, nested as they stand there: a plain mapping, or the parameter file of ROS nodes.

    That may hold sections for several nodes. Those of the node are taken, by name or by pattern (``*`` is one part of a name,
    ``**`` any number), a later one over an earlier one. A name without a slash counts in every namespace.

    Parameters
    ----------
    path : of the file.
    node : the node's name, with its namespace.

    Returns
    -------
    The parameters.

    Raises
    ------
    FileFormatError : naming file and section; no section is the node's.
    """
    values = read_mapping(path)
    check_kind(values, PARAMETERS, path)
    return _ros_parameters(dict(_sections(values, path)), node, path) if _is_of_ros(values) else values


def _write_parameters(parameters: Mapping[str, Any], path: str | Path, comment: str) -> None:
    """As a file that ``--params-file`` reads, too."""
    write_mapping({"/**": {_ROS_KEY: nested(parameters, str(path))}}, path, comment)


def _ros_parameters(sections: Mapping[str, Any], node: str, path: str | Path) -> dict[str, Any]:
    own = {name: section for name, section in sections.items() if _is_of(node, name)}
    if not own:
        raise FileFormatError(path, "(sections)", f"one of {node}, or a pattern such as /**", ", ".join(sections))
    merged: dict[str, Any] = {}
    for section in own.values():
        _merge(merged, {key: value for key, value in section.items() if key not in _ROS_OWN})
    return merged


def _sections(values: Mapping[str, Any], path: str | Path, within: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Those of a ROS file, by the names of nodes, which may be within namespaces; none of a plain mapping."""
    for key, section in values.items():
        name = f"{within}/{key}" if within else str(key)
        if not _is_of_ros(section) or (_ROS_KEY in section and len(section) > 1):
            raise FileFormatError(path, name, f"a section with {_ROS_KEY} only", section)
        if _ROS_KEY not in section:
            yield from _sections(section, path, name)
        elif isinstance(section[_ROS_KEY], dict):
            yield name, section[_ROS_KEY]
        else:
            raise FileFormatError(path, f"{name}.{_ROS_KEY}", "a mapping", section[_ROS_KEY])


def _is_of_ros(section: Any) -> bool:
    """Whether a mapping has parameters of a ROS node somewhere."""
    return isinstance(section, dict) and (_ROS_KEY in section or any(map(_is_of_ros, section.values())))


def _is_of(node: str, name: str) -> bool:
    """Whether a section is a node's, by name or by pattern; a name without a slash counts in every namespace."""
    if "/" not in name and "*" not in name:
        return name == node.rpartition("/")[2]
    any_number, one = r"(/[^/]+)*", "[^/]+"
    parts = (any_number if part == "**" else "/" + re.escape(part).replace(r"\*", one) for part in name.strip("/").split("/"))
    return re.fullmatch("".join(parts), node) is not None


def _merge(target: dict[str, Any], source: dict[str, Any]) -> None:
    for key, value in source.items():
        if isinstance(value, dict) and isinstance(target.get(key), dict):
            _merge(target[key], value)
        else:
            target[key] = value


_RENAMED_KEYS: dict[str, tuple[str, str, type[FileModel]]] = {
    RIG: ("plate", "background", RigFile),
    BODY: ("follows", "mimic", ModelFile),
    RECORDING: ("through_masks", "masked_images", RecordingFile),
}


def migrate(path: Path, output: Path) -> list[str]:
    """Write a recording, rig, body, or parameters of the tracker, of version 0.1 under the present names.

    In its own place the old one goes to ``<name>.old``. Comments of recordings, rigs and bodies are kept, those of parameters are
    not.

    Parameters
    ----------
    path, output : the old file and the new one, which may be the same.

    Returns
    -------
    list[str] : present names of parameters that had no effect, and are left out.

    Raises
    ------
    FileFormatError : none of these, no version has one of its names, or ``<name>.old`` is there already.
    """
    if output == path and path.with_name(f"{path.name}.old").exists():
        raise FileFormatError(path.with_name(f"{path.name}.old"), "(file)", "no such file: what is migrated goes there", "a file")
    content = read_mapping(path)
    if kind_of(content) in _RENAMED_KEYS:
        old, new, kind = _RENAMED_KEYS[kind_of(content)]
        validate(kind, _with_key(content, old, new), path)
        text = re.sub(rf"(?m)(^\s*(?:- )?|[{{,]\s*){old}(?=\s*:)", rf"\1{new}", read_text(path))
        _replace(path, output, lambda: write_whole(output, text))
        return []
    values, dropped = migrated(load_parameters(path))
    from_dict(values, str(path))
    comment = "Parameters of the tracker; what is not here has its default."
    _replace(path, output, lambda: _write_parameters(values, output, comment))
    return dropped


def _replace(path: Path, output: Path, write: Callable[[], None]) -> None:
    if output == path:
        path.rename(path.with_name(f"{path.name}.old"))
    write()


def _with_key(content: Any, old: str, new: str) -> Any:
    """The same mappings and lists with another name of a key."""
    if isinstance(content, Mapping):
        return {new if key == old else key: _with_key(value, old, new) for key, value in content.items()}
    return [_with_key(value, old, new) for value in content] if isinstance(content, list) else content


def migrated(values: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Parameters of version 0.1 under their present names, and those of modalities that they do not choose.

    Parameters
    ----------
    values : nested or dotted.

    Returns
    -------
    values, dropped : dotted name -> value; names as given that had no effect.
    """
    old = flat(values)
    if "modalities" in old:
        return old, []
    new: dict[str, Any] = {RENAMED.get(name, name): value for name, value in old.items() if name not in CHOICES}
    if new.get("chamfer.silhouette") == "plate":
        new["chamfer.silhouette"] = "background"
    engine, kind = str(old.get("engine", "contour")), str(old.get("evidence.kind", "region"))
    representation = str(old.get("color.representation", "blend"))
    colors = REPRESENTATIONS.get(representation, "color")
    if colors != "color":
        del new["color.representation"]
        new = {name.replace("color.", f"{colors}.", 1) if name.startswith("color.") else name: v for name, v in new.items()}
    contours = ["region", "chamfer"] if kind == "both" else [kind]
    modalities = [*contours, *([colors] if engine != "contour" else [])] if engine != "color" else [colors]
    choice: dict[str, Any] = {}
    if modalities != ["region"]:
        choice["modalities"] = modalities
    if engine == "color_then_contour":
        choice["combination"] = "sequential"
    known = describe(from_dict(choice)) if choice else describe(TrackerConfig())
    everything = describe()
    once = {name: name.replace(f"{colors}.", "color.", 1) for name in new}
    dropped = [name for name in new if name not in known and {name, once[name]} & everything.keys()]
    return {**choice, **{name: value for name, value in new.items() if name not in dropped}}, dropped
