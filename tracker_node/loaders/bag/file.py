"""One MCAP file of a bag, by topics; and room on the disk kept for its end."""

from __future__ import annotations

import os
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any

import yaml

from ...version import __version__
from .mcap.writer import McapWriter
from .mcap.written_pages import WrittenPages
from .metadata import TimeSpan, TopicRecord


class BagFile:
    """Writes one file; nothing is kept in memory but the unfinished chunk.

    Raises
    ------
    OSError : the file cannot be made, or written; what had been written before stays.
    """

    def __init__(self, path: Path, *, chunk_bytes: int, compression: str):
        self.path = path
        self._stream = path.open("xb", buffering=0)
        try:
            library = f"tracker_node {__version__}"
            self._writer = McapWriter(
                self._stream, profile="ros2", library=library, chunk_bytes=chunk_bytes, compression=compression
            )
        except OSError:
            self._stream.close()
            path.unlink(missing_ok=True)
            raise
        self._pages = WrittenPages(self._stream.fileno())
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._first_ns: int | None = None
        self._described = self._named = False
        self.finished = False

    @property
    def size(self) -> int:
        """Bytes, those of the unfinished chunk included."""
        return self._writer.size + self._writer.chunk_size

    @property
    def index_size(self) -> int:
        return self._writer.index_size

    @property
    def span(self) -> TimeSpan:
        """Of what is in the file."""
        return TimeSpan(self._writer.start_ns, self._writer.end_ns, sum(self._writer.counts.values()))

    @property
    def counts(self) -> Counter[str]:
        """Messages that are in the file, by topic."""
        return Counter({topic: self._writer.counts[channel] for topic, channel in self._channels.items()})

    def age_ns(self, stamp_ns: int) -> int:
        """How long after the file's first message a stamp is; 0 while there is none."""
        return 0 if self._first_ns is None else stamp_ns - self._first_ns

    def add_topic(self, topic: TopicRecord) -> None:
        """Announce a topic."""
        if topic.type_name not in self._schemas:
            encoding = "ros2msg" if topic.definition else ""
            self._schemas[topic.type_name] = self._writer.add_schema(topic.type_name, encoding, topic.definition.encode())
        metadata = {"offered_qos_profiles": topic.qos.as_yaml(), "topic_type_hash": topic.type_hash}
        self._channels[topic.name] = self._writer.add_channel(topic.name, self._schemas[topic.type_name], metadata)

    def write(self, topic: str, sequence: int, stamp_ns: int, publish_ns: int, data: bytes) -> None:
        """One message of a topic that has been announced."""
        if self._first_ns is None:
            self._first_ns = stamp_ns
        self._writer.add_message(self._channels[topic], sequence, stamp_ns, publish_ns, data)

    def finish_chunk(self) -> None:
        """Hand everything so far to the operating system."""
        self._writer.finish_chunk()

    def forget(self) -> None:
        """The operating system need not keep what it has been handed in memory once it is on the disk."""
        self._pages.grown(self._writer.size)

    def sync(self) -> None:
        """Have the operating system write what it has to the disk, the first time with the file's name."""
        os.fdatasync(self._stream.fileno())
        if not self._named:
            folder = os.open(self.path.parent, os.O_RDONLY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)
            self._named = True

    def finish(self, information: dict[str, Any]) -> None:
        """Write the index; ``information`` is what ``metadata.yaml`` says. May be tried again after an OSError."""
        if self.finished:
            return
        if not self._described:
            text = yaml.safe_dump(information, sort_keys=False)
            self._writer.add_metadata("rosbag2", {"serialized_metadata": text})
            self._described = True
        self._writer.finish()
        self.close()

    def drop_chunk(self) -> None:
        """Give up what could not be written."""
        self._writer.drop_chunk()

    def close(self) -> None:
        """Leave the file as it is."""
        self.finished = True
        self._pages.close()
        self._stream.close()


class DiskReserve:
    """Room on the disk that is given back when it is full, so that what is being written can be finished."""

    def __init__(self, path: Path):
        self._path, self.size = path, 0

    def grow(self, size: int) -> None:
        """Have room for so many bytes.

        Raises
        ------
        OSError : there is none.
        """
        number = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            os.posix_fallocate(number, 0, size)
        finally:
            os.close(number)
        self.size = size

    def release(self) -> bool:
        """Give the room back; False if there is none any more."""
        held, self.size = self.size > 0, 0
        with suppress(OSError):
            self._path.unlink(missing_ok=True)
        return held
