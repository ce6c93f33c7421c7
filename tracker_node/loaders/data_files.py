"""Files that come with the package: models, tracker parameters, layouts."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from ..errors import SourceError

_SOURCE_TREE = Path(__file__).resolve().parents[2]


def data_file(name: str) -> Path:
    """Path of a file that comes with the package, e.g. ``config/balancing.yaml``.

    Looked for in the source tree, in this Python's share/tracker_node, and in every ROS prefix.

    Raises
    ------
    SourceError : when the installation lacks it, naming the places looked at.
    """
    prefixes = [sys.prefix, *os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)]
    places = [_SOURCE_TREE, *(Path(prefix) / "share/tracker_node" for prefix in prefixes if prefix)]
    for place in places:
        if (place / name).exists():
            return place / name
    raise SourceError(name, f"is not in the installation; looked in {', '.join(map(str, places))}")
