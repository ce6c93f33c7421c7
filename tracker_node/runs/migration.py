"""Files of version 0.1 under the present names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import FileFormatError
from ..loaders.config_yaml import dump_parameters, load_parameters
from ..loaders.file_kind import RIG, kind_of
from ..loaders.limited_file import read_text
from ..loaders.rig.rig_yaml import RigFile
from ..loaders.whole_file import write_whole
from ..loaders.yaml_file import read_mapping, validate
from ..tracking.config import from_dict
from ..tracking.renamed import migrated

_PLATE = re.compile(r"(?m)(^\s*|[{,]\s*)plate(?=\s*:)")


def migrate(path: Path, output: Path) -> list[str]:
    """Write a rig, or parameters of the tracker, of version 0.1 under the present names.

    In its own place the old file goes to ``<name>.old``. Comments of rigs are kept, those of parameters are not.

    Parameters
    ----------
    path, output : the old file and the new one, which may be the same.

    Returns
    -------
    list[str] : present names of parameters that had no effect, and are left out.

    Raises
    ------
    FileFormatError : the file is neither, no version has one of its names, or ``<name>.old`` is there already.
    """
    old = path.with_name(f"{path.name}.old")
    if output == path and old.exists():
        raise FileFormatError(old, "(file)", "no such file: what is migrated goes there", "a file")
    content = read_mapping(path)
    if kind_of(content) == RIG:
        validate(RigFile, _with_backgrounds(content), path)
        text = _PLATE.sub(r"\1background", read_text(path))
        if output == path:
            path.rename(old)
        write_whole(output, text)
        return []
    values, dropped = migrated(load_parameters(path))
    from_dict(values, str(path))
    if output == path:
        path.rename(old)
    dump_parameters(values, output, "Parameters of the tracker; what is not here has its default.")
    return dropped


def _with_backgrounds(rig: Mapping[str, Any]) -> dict[str, Any]:
    cameras = {
        name: {"background" if key == "plate" else key: value for key, value in entry.items()}
        if isinstance(entry, dict)
        else entry
        for name, entry in rig["cameras"].items()
    }
    return {**rig, "cameras": cameras}
