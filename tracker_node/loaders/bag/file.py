"""One MCAP file of a bag, by topics: room kept on the disk for its end, memory given back, latched messages for the next file."""

from __future__ import annotations

import os
import queue
import struct
import threading
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any

import yaml
from rosbags.serde import SerdeError

from ...version import __version__
from .mcap_writer import McapWriter
from .message_types import typestore
from .metadata import BagTopic, TimeSpan


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

    def add_topic(self, topic: BagTopic) -> None:
        """Announce a topic."""
        if topic.type_name not in self._schemas:
            encoding = "ros2msg" if topic.definition else ""
            self._schemas[topic.type_name] = self._writer.add_schema(topic.type_name, encoding, topic.definition.encode())
        metadata = {"offered_qos_profiles": topic.qos.as_yaml(), "topic_type_hash": topic.type_hash}
        self._channels[topic.name] = self._writer.add_channel(topic.name, self._schemas[topic.type_name], metadata)

    def write(self, topic: str, sequence: int, stamp_ns: int, publish_ns: int, data: bytes) -> None:
        """Write one message.

        Parameters
        ----------
        topic, sequence : a topic that has been announced; number of the message in it.
        stamp_ns, publish_ns : when it was recorded and when it was sent, nanoseconds.
        data : serialized message (CDR).
        """
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


KEPT_BYTES = 64 * 2**20
"""At the end of the file, that stay in memory."""
_AGAIN_BYTES = 512 * 2**20  # before, examined again: what was not on the disk yet the last time


class WrittenPages:
    """Has the operating system forget the beginning of a growing file.

    A recording is not read again soon, yet the system keeps all of it as long as there is memory, and takes fresh memory for
    every page. On a virtual machine writing then took 1.4 s of processor time a gigabyte, five times as much as in memory that is
    used again (its host had to find it first, it seems); and what other programs had read is not pushed out.

    The system begins to write what is not on the disk. That may wait for the disk, so it is done in a thread; where it is not
    possible, memory stays as it is.
    """

    def __init__(self, descriptor: int):
        self._descriptor = descriptor
        self._sizes: queue.SimpleQueue[int | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None

    def grown(self, size: int) -> None:
        """The file has so many bytes now; returns at once."""
        if size <= KEPT_BYTES or not hasattr(os, "posix_fadvise"):
            return
        if self._thread is None:
            try:
                descriptor = os.dup(self._descriptor)  # the file may be closed while the thread is at it
            except OSError:
                return
            self._thread = threading.Thread(target=_forget, args=(descriptor, self._sizes), name="forget pages", daemon=True)
            self._thread.start()
        self._sizes.put(size)

    def close(self) -> None:
        """Nothing more is to be forgotten; does not wait."""
        if self._thread is not None:
            self._sizes.put(None)


def _forget(descriptor: int, sizes: queue.SimpleQueue[int | None]) -> None:
    done = 0
    while (size := sizes.get()) is not None:
        start, done = max(0, done - _AGAIN_BYTES), size - KEPT_BYTES
        with suppress(OSError):
            os.posix_fadvise(descriptor, start, done - start, os.POSIX_FADV_DONTNEED)
    os.close(descriptor)


_TRANSFORMS = "tf2_msgs/msg/TFMessage"


class LatchedMessages:
    """Keeps the last message of every latched topic, which is repeated at the beginning of the next file.

    Of several publishers of one topic only the last that has published is known. Transforms (``/tf_static``) are the exception,
    for there several publishers are the rule: one message holds the last of every child frame, whoever sent it.

    Parameters
    ----------
    wanted : otherwise nothing is kept.

    Attributes
    ----------
    repeated : topics of which this file holds a message again.
    """

    def __init__(self, wanted: bool):
        self._wanted = wanted
        self._last: dict[str, tuple[int, bytes]] = {}  # topic -> when it was sent, and the message
        self._due: dict[str, tuple[int, bytes]] = {}
        self._frames: dict[str, dict[str, Any]] = {}  # topic -> child frame -> its transform
        self.repeated: set[str] = set()

    def keep(self, topic: BagTopic, publish_ns: int, data: bytes) -> None:
        """Take note of a message that has been written.

        Parameters
        ----------
        topic, publish_ns : of the message; nanoseconds when it was sent.
        data : serialized message (CDR).
        """
        if self._wanted and topic.qos.durability == "transient_local":
            self._last[topic.name] = (publish_ns, self._merged(topic.name, data) if topic.type_name == _TRANSFORMS else data)

    def _merged(self, topic: str, data: bytes) -> bytes:
        """The transforms of a message with those that the topic has published of other frames."""
        try:
            said: Any = typestore().deserialize_cdr(data, _TRANSFORMS)
        except (SerdeError, struct.error, ValueError, IndexError, KeyError):
            return data  # as with any other topic
        frames = self._frames.setdefault(topic, {})
        frames.update({transform.child_frame_id: transform for transform in said.transforms})
        message = typestore().types[_TRANSFORMS](transforms=list(frames.values()))
        return bytes(typestore().serialize_cdr(message, _TRANSFORMS))

    def begin_file(self) -> None:
        """All that is kept is due in it."""
        self._due, self.repeated = dict(self._last), set()

    def take(self, topic: str) -> list[tuple[str, int, bytes]]:
        """Topic, time and bytes of what comes before the first message of a file, which is one of ``topic``."""
        due = [(name, *kept) for name, kept in self._due.items() if name != topic or name in self._frames]
        self._due = {}
        self.repeated.update(name for name, _, _ in due)
        return due
