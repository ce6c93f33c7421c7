"""The tracker's parameters from and to files: where the layers of files and of tracking meet."""

from __future__ import annotations

from pathlib import Path

from ..errors import FileFormatError
from ..loaders.config_yaml import dump_parameters, load_parameters
from ..tracking.config import TrackerConfig, flatten, from_dict
from ..tracking.renamed import migrated


def load_config(path: str | Path, node: str = "tracker") -> TrackerConfig:
    """Tracker configuration of a plain or ROS parameter file; what the file leaves out has its default.

    Parameters
    ----------
    path : of the file.
    node : whose parameters, in a ROS parameter file.

    Returns
    -------
    config : checked.

    Raises
    ------
    FileFormatError : naming file and parameter, the range or the choices, and the value.
    """
    return from_dict(load_parameters(path, node), str(path))


def dump_config(config: TrackerConfig, path: str | Path) -> None:
    """Write every parameter.

    Parameters
    ----------
    config : of the tracker.
    path : of the file.
    """
    dump_parameters(flatten(config), path, "Parameters of the tracker.")


def migrate_config(path: Path, output: Path) -> list[str]:
    """Write a parameter file of version 0.1 under the present names; in its own place the old one goes to ``<name>.old``.

    Parameters
    ----------
    path : of the file of version 0.1.
    output : of the new file.

    Returns
    -------
    list[str] : present names of parameters that had no effect, and are left out.

    Raises
    ------
    FileFormatError : a parameter that no version has, or an old file that is there already.
    """
    values, dropped = migrated(load_parameters(path))
    from_dict(values, str(path))
    if output == path:
        old = path.with_name(f"{path.name}.old")
        if old.exists():
            raise FileFormatError(old, "(file)", "no such file: the old parameters go there", "a file")
        path.rename(old)
    dump_parameters(values, output, "Parameters of the tracker; what is not here has its default.")
    return dropped
