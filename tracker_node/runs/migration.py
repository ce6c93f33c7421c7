"""Files, bags and runs of version 0.1 under the present names."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ..errors import FileFormatError
from ..loaders.bag.message_types import STATE_COVARIANCE, TRACKED_STATE, MessageType, message_of, typestore
from ..loaders.bag.metadata import STORAGE_SUFFIXES
from ..loaders.bag.reader import BagMessage, BagReader
from ..loaders.bag.writer import BagExistsError, BagWriter
from ..loaders.config_yaml import dump_parameters, load_parameters
from ..loaders.file_model import BODY, RECORDING, RIG, FileModel, kind_of, validate
from ..loaders.model.model_file import ModelFile
from ..loaders.recording_yaml import RecordingFile
from ..loaders.rig.rig_yaml import RigFile
from ..loaders.whole_file import read_text, write_whole
from ..loaders.yaml_file import read_mapping
from ..tracking.config import CONTOURS, from_dict
from ..tracking.estimate import GRAY_LEVELS, PX, LimbStatus
from ..tracking.renamed import migrated
from .load import is_old, run_info
from .messages import COMPRESSED_IMAGE
from .writer import BAG, SMOOTHED, STATES, SUMMARY

_RENAMED_KEYS: dict[str, tuple[str, str, type[FileModel]]] = {
    RIG: ("plate", "background", RigFile),
    BODY: ("follows", "mimic", ModelFile),
    RECORDING: ("through_masks", "masked_images", RecordingFile),
}
_RENAMED_TOPICS = {"overlay": "overlay/compressed", "target_through_mask": "masked_image/compressed"}
_LIMB_STATUS = np.array([LimbStatus.UNSEEN, LimbStatus.TRACKING, LimbStatus.DEGRADED, LimbStatus.LOST], dtype=np.uint8)
"""By the numbers that version 0.1 wrote."""


def migrate(path: Path, output: Path) -> list[str]:
    """Write a bag, run, recording, rig, body, or parameters of the tracker, of version 0.1 under the present names.

    In its own place the old one goes to ``<name>.old``. Comments of recordings, rigs and bodies are kept, those of parameters are
    not.

    Parameters
    ----------
    path, output : the old file or folder and the new one, which may be the same.

    Returns
    -------
    list[str] : present names of parameters that had no effect, and are left out.

    Raises
    ------
    FileFormatError : none of these, no version has one of its names, or ``<name>.old`` is there already.
    BagExistsError : something is at ``output`` where a bag or a run is to be written.
    """
    if output == path and path.with_name(f"{path.name}.old").exists():
        raise FileFormatError(path.with_name(f"{path.name}.old"), "(file)", "no such file: what is migrated goes there", "a file")
    if path.is_dir() or path.suffix in STORAGE_SUFFIXES:
        with _folder_in_place_of(path, output) as folder:
            (_migrate_run if path.is_dir() and (path / STATES).exists() else _migrate_bag)(path, folder)
        return []
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
    _replace(path, output, lambda: dump_parameters(values, output, comment))
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


@contextmanager
def _folder_in_place_of(path: Path, output: Path) -> Iterator[Path]:
    """A folder of the output's name to be written, which goes there at the end of the block; nothing is left after an error."""
    if output != path and output.exists():
        raise BagExistsError(output)
    output.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=output.parent, prefix=".migrate") as place:
        yield Path(place) / output.name
        if output == path:
            path.rename(path.with_name(f"{path.name}.old"))
        (Path(place) / output.name).rename(output)


def _migrate_run(path: Path, output: Path) -> None:
    bag = path / BAG
    shutil.copytree(path, output, ignore=lambda folder, _: [BAG] if Path(folder) == path and bag.is_dir() else [])
    for states in (output / STATES, output / SMOOTHED / STATES):
        if states.exists():
            write_whole(states, _present_states(read_text(states)))
    info = run_info(path)
    if "residual_px" in info:
        info = {"residual" if key == "residual_px" else key: value for key, value in info.items()}
        counts = info.get("status_counts", {})
        info["status_counts"] = {name.replace("INITIALISING", "INITIALIZING"): count for name, count in counts.items()}
        info["residual_unit"] = _residual_unit(info)
        write_whole(output / SUMMARY, json.dumps(info, indent=2) + "\n")
    if bag.is_dir():
        _migrate_bag(bag, output / BAG)


def _present_states(text: str) -> str:
    header, newline, rows = text.partition("\n")
    rows = re.sub(r"(?m)^(-?\d+),INITIALISING,", r"\1,INITIALIZING,", rows)
    return header.replace(",residual_px,", ",residual,") + newline + rows


def _residual_unit(info: Mapping[str, Any]) -> str:
    """By the parameters of the run; without them that of contours."""
    modalities = migrated(info.get("parameters", {}))[0].get("modalities", CONTOURS)
    return PX if set(CONTOURS) & set(modalities) else GRAY_LEVELS


def _migrate_bag(path: Path, output: Path) -> None:
    unit = _residual_unit(run_info(path))
    with BagReader(path) as reader:
        custom = reader.custom
    with BagReader(path, scanned=True) as reader:
        states = {name for name in reader.topics_of_type(TRACKED_STATE) if is_old(reader, name)}
        names = {topic.name: _present_topic(topic.name, topic.type_name) for topic in reader.topics.values()}
        if not states and all(old == new for old, new in names.items()):
            raise FileFormatError(path, "topics", "a bag of version 0.1", "nothing that has another name now")
        with BagWriter(output, custom=custom) as writer:
            for topic in reader.topics.values():
                kept = MessageType(topic.type_name, topic.definition, topic.type_hash)
                old = topic.name in states
                writer.add_topic(names[topic.name], topic.type_name, topic.qos, None if old else kept)
                if old:
                    writer.add_topic(f"{topic.name}_covariance", STATE_COVARIANCE, topic.qos)
            for message in reader.messages():
                if message.topic in states:
                    _write_state(writer, message, _as_content(reader.decode(message)), unit)
                else:
                    writer.write(names[message.topic], message.stamp_ns, message.data, message.publish_ns)


def _present_topic(name: str, type_name: str) -> str:
    parent, _, end = name.rpartition("/")
    return f"{parent}/{_RENAMED_TOPICS[end]}" if type_name == COMPRESSED_IMAGE and end in _RENAMED_TOPICS else name


def _write_state(writer: BagWriter, message: BagMessage, state: dict[str, Any], unit: str) -> None:
    covariances = {name: state.pop(name, ()) for name in ("covariance", "velocity_covariance")}
    covariance = {"header": state["header"], "dof_names": state["dof_names"], **covariances}
    state["residual"], state["residual_unit"] = state.pop("residual_px"), unit
    state["camera_residuals"] = state.pop("camera_residuals_px")
    state["limb_status"] = _LIMB_STATUS[np.minimum(state.get("limb_status", np.zeros(0, np.uint8)), len(_LIMB_STATUS) - 1)]
    for topic, kind, content in (
        (f"{message.topic}_covariance", STATE_COVARIANCE, covariance),
        (message.topic, TRACKED_STATE, state),
    ):
        data = bytes(typestore().serialize_cdr(message_of(kind, content), kind))
        writer.write(topic, message.stamp_ns, data, message.publish_ns)


def _as_content(value: Any) -> Any:
    """A message of a bag as field -> value; constants have names in capitals."""
    if is_dataclass(value):
        names = [field.name for field in fields(value) if field.name[0].islower()]
        return {name: _as_content(getattr(value, name)) for name in names}
    return [_as_content(item) for item in value] if isinstance(value, list) else value
