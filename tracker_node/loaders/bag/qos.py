"""Quality of service as bags of any origin state it."""

from __future__ import annotations

from rosbags.interfaces import Connection, Qos
from rosbags.rosbag2 import ReaderError
from rosbags.rosbag2.metadata import parse_qos

from .metadata import OfferedQos


def offered_by(connection: Connection) -> OfferedQos:
    """Of a topic that rosbags has opened; the default where nothing is said."""
    return _first_qos(getattr(connection.ext, "offered_qos_profiles", []))


def offered_in(text: str) -> OfferedQos:
    """Of the YAML text of a channel; the default where it cannot be read."""
    try:
        return _first_qos(parse_qos(text))
    except (ReaderError, KeyError, TypeError, ValueError):
        return OfferedQos()


def _first_qos(profiles: list[Qos]) -> OfferedQos:
    if not profiles:
        return OfferedQos()
    words = [profiles[0].reliability, profiles[0].durability, profiles[0].history]
    reliability, durability, history = (word.name.lower() for word in words)
    default = OfferedQos()
    return OfferedQos(
        reliability=reliability if reliability in ("reliable", "best_effort") else default.reliability,
        durability=durability if durability in ("volatile", "transient_local") else default.durability,
        history=history if history in ("keep_last", "keep_all") else default.history,
        depth=profiles[0].depth or default.depth,
    )
