"""``metadata.yaml`` of a rosbag2 bag, as ROS 2 Jazzy writes it (version 9), and the quality of service that bags state.

Which files a bag consists of.
"""

from __future__ import annotations

import re
import shutil
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
import zstandard
from rosbags.interfaces import Connection, Qos
from rosbags.rosbag2 import ReaderError
from rosbags.rosbag2.metadata import parse_qos

from ...errors import FileFormatError
from ..whole_file import MB, check_regular, write_whole

METADATA_FILE = "metadata.yaml"
METADATA_VERSION = 9
ROS_DISTRO = "jazzy"  # whose message definitions the bag holds
_INFINITE = {"sec": 9223372036, "nsec": 854775807}


@dataclass(frozen=True)
class OfferedQos:
    """Quality of service that a topic's publisher offered; ``ros2 bag play`` publishes with it.

    The words are those of rosbag2: ``keep_last``, ``keep_all``; ``reliable``, ``best_effort``; ``volatile``,
    ``transient_local``.
    """

    reliability: str = "reliable"
    durability: str = "volatile"
    history: str = "keep_last"
    depth: int = 10

    def as_dict(self) -> dict[str, Any]:
        return {
            "history": self.history,
            "depth": self.depth,
            "reliability": self.reliability,
            "durability": self.durability,
            "deadline": dict(_INFINITE),
            "lifespan": dict(_INFINITE),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_INFINITE),
            "avoid_ros_namespace_conventions": False,
        }

    def as_yaml(self) -> str:
        """For the channel of an MCAP file: a list of profiles as text."""
        return yaml.safe_dump([self.as_dict()], sort_keys=False).strip()


@dataclass
class BagTopic:
    """A topic of a bag, with its number of messages (so far)."""

    name: str
    type_name: str
    type_hash: str
    qos: OfferedQos
    message_count: int = 0
    definition: str = ""


@dataclass(frozen=True)
class TimeSpan:
    """Earliest and latest stamp (integer nanoseconds) and number of messages."""

    start_ns: int = 0
    end_ns: int = 0
    count: int = 0

    @staticmethod
    def over(spans: Iterable[TimeSpan]) -> TimeSpan:
        """From the first to the last of several."""
        found = [span for span in spans if span.count]
        if not found:
            return TimeSpan()
        start_ns, end_ns = min(span.start_ns for span in found), max(span.end_ns for span in found)
        return TimeSpan(start_ns, end_ns, sum(span.count for span in found))

    def as_dict(self) -> dict[str, Any]:
        return {
            "starting_time": {"nanoseconds_since_epoch": self.start_ns},
            "duration": {"nanoseconds": self.end_ns - self.start_ns},
            "message_count": self.count,
        }


def bag_information(files: dict[str, TimeSpan], topics: Iterable[BagTopic], custom: dict[str, str]) -> dict[str, Any]:
    """Content of ``metadata.yaml`` below its top key.

    Parameters
    ----------
    files, topics : files by name in the order of recording; topics with their numbers of messages.
    custom : texts for ``custom_data``.

    Returns
    -------
    Mapping of plain values.
    """
    return {
        "version": METADATA_VERSION,
        "storage_identifier": "mcap",
        **TimeSpan.over(files.values()).as_dict(),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type_name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": [topic.qos.as_dict()],
                    "type_description_hash": topic.type_hash,
                },
                "message_count": topic.message_count,
            }
            for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": list(files),
        "files": [{"path": name, **span.as_dict()} for name, span in files.items()],
        "custom_data": custom or None,
        "ros_distro": ROS_DISTRO,
    }


def write_metadata(folder: Path, information: dict[str, Any]) -> None:
    """Write ``metadata.yaml``, whole or not at all.

    Parameters
    ----------
    folder, information : of the bag; see `bag_information`.
    """
    write_whole(folder / METADATA_FILE, yaml.safe_dump({"rosbag2_bagfile_information": information}, sort_keys=False))


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


SCANNED_SUFFIX = ".mcap"
"""Of files that are read from their beginning, and so in whatever condition."""
STORAGE_SUFFIXES = (SCANNED_SUFFIX, ".db3")
_PIECE, _ZSTD = 1 << 20, b"\x28\xb5\x2f\xfd"
PACKED = ".zstd"  # after the suffix, of files that are compressed as a whole
_UNFINISHED = ("-wal", "-journal")  # what stands beside a SQLite file until its writer has closed it


def storage_files(path: Path) -> list[Path]:
    """Files of a bag, in the order of recording.

    Raises
    ------
    FileFormatError : there are none.
    """
    if path.is_dir():
        files = sorted((file for file in path.iterdir() if _is_storage(file)), key=_in_order)
        if not files:
            raise FileFormatError(path, "(folder)", f"a bag: a folder with {' or '.join(STORAGE_SUFFIXES)} files", "none")
        return files
    if not path.exists():
        raise FileFormatError(path, "(path)", "a bag", "nothing there")
    if path.suffix not in STORAGE_SUFFIXES:
        raise FileFormatError(path, "(path)", f"a bag folder or a {' or '.join(STORAGE_SUFFIXES)} file", path.name)
    return [path]


def unclosed(files: Iterable[Path]) -> list[str]:
    """Names of open transactions beside SQLite ``files``: their last messages are not in the files themselves yet."""
    beside = [Path(f"{file}{end}") for file in files for end in _UNFINISHED]
    return [path.name for path in beside if path.is_file() and path.stat().st_size]


def check_room(files: Iterable[Path]) -> None:
    """Refuse files that are compressed as a whole and, unpacked, need more than half of the room for temporary files.

    Raises
    ------
    FileFormatError : naming the file, the room and the size.
    """
    room = shutil.disk_usage(tempfile.gettempdir()).free // 2
    total = 0
    for file in files:
        check_regular(file, sys.maxsize)
        try:
            with file.open("rb") as stream:
                if stream.read(len(_ZSTD)) != _ZSTD:  # whatever its name is
                    continue
                stream.seek(0)
                reader = zstandard.ZstdDecompressor().stream_reader(stream, read_across_frames=True)
                while total <= room and (piece := reader.read(_PIECE)):
                    total += len(piece)
        except (zstandard.ZstdError, OSError) as error:
            raise FileFormatError(file, "(file)", "an undamaged compressed file", str(error)) from None
        if total > room:
            half = f"at most {room // MB} MB unpacked, half of the room in {tempfile.gettempdir()} (TMPDIR chooses another)"
            raise FileFormatError(file, "(file)", half, "more")


def _is_storage(file: Path) -> bool:
    return file.is_file() and Path(file.name.removesuffix(PACKED)).suffix in STORAGE_SUFFIXES


def _in_order(file: Path) -> tuple[int, str]:
    """Split bags are numbered: ``run_2.mcap`` comes before ``run_10.mcap``."""
    number = re.search(r"_(\d+)\.", file.name)
    return (int(number[1]) if number else 0, file.name)
