"""The tracker's parameters from and to files: where the layers of files and of tracking meet.

Files of version 0.1 under the present names; its bags and runs are refused where they are read.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ..errors import FileFormatError
from ..loaders.config_yaml import dump_parameters, load_parameters
from ..loaders.file_model import BODY, RECORDING, RIG, FileModel, kind_of, validate
from ..loaders.model.model_file import ModelFile
from ..loaders.recording_yaml import RecordingFile
from ..loaders.rig.rig_yaml import RigFile
from ..loaders.whole_file import read_text, write_whole
from ..loaders.yaml_file import read_mapping
from ..tracking.config import TrackerConfig, flatten, from_dict
from ..tracking.migration import migrated


def load_config(path: str | Path) -> TrackerConfig:
    """Tracker configuration of a plain parameter file, or of the node ``tracker`` in one of ROS; what the file leaves out has its
    default.

    Raises
    ------
    FileFormatError : naming file and parameter, the range or the choices, and the value.
    """
    return from_dict(load_parameters(path, "tracker"), str(path))


def dump_config(config: TrackerConfig, path: str | Path) -> None:
    """Write every parameter.

    Parameters
    ----------
    config : of the tracker.
    path : of the file.
    """
    dump_parameters(flatten(config), path, "Parameters of the tracker.")


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
