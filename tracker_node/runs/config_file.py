"""The tracker's parameters from and to files: where the layers of files and of tracking meet."""

from __future__ import annotations

from pathlib import Path

from ..loaders.config_yaml import dump_parameters, load_parameters
from ..tracking.config import TrackerConfig, flatten, from_dict


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
