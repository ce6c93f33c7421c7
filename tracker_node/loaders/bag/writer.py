"""Bags in rosbag2's layout with MCAP storage, written without ROS.

Messages are taken as serialized CDR bytes and written as they are, or serialized here. A bag is a folder with
``metadata.yaml`` and ``<folder>_0.mcap``, and further files if it is split; definitions, type hashes and QoS profiles are
inside, so ``ros2 bag``, Foxglove and PlotJuggler open it without this package.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...closing import Closing
from ...errors import FileFormatError, TrackerError, UnknownNameError
from .file import BagFile, DiskReserve, LatchedMessages
from .mcap_writer import COMPRESSIONS
from .message_types import MessageType, message_type, typestore
from .metadata import BagTopic, OfferedQos, TimeSpan, bag_information, write_metadata

CHUNK_BYTES = 1024 * 1024
RESERVE_BYTES = 4 * 1024 * 1024
"""Kept free on the disk for the end of the bag."""
_RESERVE_FILE = ".reserve"


class BagExistsError(TrackerError):
    """A bag is never written over."""

    def __init__(self, path: str | Path):
        self.path = str(path)
        super().__init__(f"output '{path}' exists already and is not overwritten; remove it or choose another name")


class BagWriter(Closing):
    """Writes one bag; use it in a ``with`` statement, which closes it also after an error.

    When the disk is full, an OSError is raised, after what had been taken until then was written to room that was kept for
    that; `close` then finishes the bag.

    Parameters
    ----------
    path : folder of the bag, made here.
    chunk_bytes : messages are handed to the operating system when this much has come together; see also `flush`.
    custom : short texts for ``custom_data`` of the metadata.
    split_bytes, split_ns : begin another file when this one has become so large, or spans so much time; 0 for never.
    compression : of the chunks, one of `COMPRESSIONS`.
    repeat_latched : every file after the first begins with what each latched topic has said last, recorded at the time of the
        split and sent when it was, so that the file can be played on its own.

    Attributes
    ----------
    repeated : messages that the bag holds for that reason, by topic; known once it is closed.

    Raises
    ------
    BagExistsError : something is at ``path``.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        chunk_bytes: int = CHUNK_BYTES,
        custom: dict[str, str] | None = None,
        split_bytes: int = 0,
        split_ns: int = 0,
        compression: str = "none",
        repeat_latched: bool = False,
    ):
        if compression not in COMPRESSIONS:
            raise UnknownNameError("compression", compression, COMPRESSIONS)
        self.path = Path(path)
        self.custom = dict(custom or {})
        self._options: dict[str, Any] = {"chunk_bytes": chunk_bytes, "compression": COMPRESSIONS[compression]}
        self._split_bytes, self._split_ns = split_bytes, split_ns
        self._topics: dict[str, BagTopic] = {}
        self._finished: dict[str, TimeSpan] = {}  # earlier files
        self._finished_bytes = 0
        self._in_files: Counter[str] = Counter()  # messages in them
        self._latched = LatchedMessages(repeat_latched)
        self._repeated_bytes = 0  # of this file
        self.repeated: Counter[str] = Counter()
        self._closed = False
        self._make_folder()
        self._reserve = DiskReserve(self.path / _RESERVE_FILE)
        try:
            self._reserve.grow(RESERVE_BYTES)
            self._file = self._next_file()
        except OSError as error:
            self._reserve.release()
            self.path.rmdir()
            raise TrackerError(f"output '{path}' cannot be written: {error.strerror}") from None

    def _make_folder(self) -> None:
        try:
            self.path.mkdir(parents=True)
        except FileExistsError:
            raise BagExistsError(self.path) from None
        except OSError as error:
            raise TrackerError(f"output '{self.path}' cannot be made: {error.strerror}") from None

    @property
    def topics(self) -> dict[str, BagTopic]:
        """Topics by name, with their number of messages."""
        return dict(self._topics)

    @property
    def files(self) -> list[str]:
        """Names of the files so far."""
        return [*self._finished, *([] if self._file.finished else [self._file.path.name])]

    @property
    def bytes_written(self) -> int:
        """Size of all files so far."""
        return self._finished_bytes + (0 if self._file.finished else self._file.size)

    def add_topic(self, topic: str, type_name: str, qos: OfferedQos | None = None, definition: MessageType | None = None) -> None:
        """Announce a topic; repeating it with the same type does nothing.

        Parameters
        ----------
        topic, type_name : such as ``/tracker/state`` and ``tracker_msgs/msg/TrackedState``.
        qos : quality of service that its publisher offers; None for the default.
        definition : of types that `message_types.message_type` does not find, for example one with an empty text.

        Raises
        ------
        FileFormatError : the topic has another type already.
        UnknownMessageTypeError : no definition of the type is known.
        """
        if topic in self._topics:
            if self._topics[topic].type_name != type_name:
                raise FileFormatError(self.path, topic, f"messages of type {self._topics[topic].type_name}", type_name)
            return
        known = definition or message_type(type_name)
        record = BagTopic(topic, type_name, known.type_hash, qos or OfferedQos(), definition=known.definition)
        self._topics[topic] = record
        self._file.add_topic(record)

    def write(self, topic: str, stamp_ns: int, data: bytes | memoryview, publish_ns: int | None = None) -> None:
        """Write one serialized message. The format has no times before 1970, they become 0.

        Parameters
        ----------
        topic, stamp_ns : announced topic; when the message was received, nanoseconds.
        data, publish_ns : CDR bytes with their header; when it was sent, None for the same time.

        Raises
        ------
        OSError : the disk is full; what had come before is in the bag.
        """
        record = self._topics.get(topic)
        if record is None:
            raise ValueError(f"expected a topic of {sorted(self._topics)}, got {topic!r}")
        stamp_ns = max(0, stamp_ns)
        publish_ns = stamp_ns if publish_ns is None else max(0, publish_ns)
        if self._is_full(stamp_ns):
            self.split()
        self._repeat_latched(topic, stamp_ns)
        message = bytes(data)  # bytes of bytes are no copy
        self._put(record, stamp_ns, publish_ns, message)
        self._latched.keep(record, publish_ns, message)

    def _repeat_latched(self, first: str, stamp_ns: int) -> None:
        """Before the first message of a file, which is one of the topic ``first``."""
        due, before = self._latched.take(first), self._file.size
        for name, sent_ns, again in due:
            self._put(self._topics[name], stamp_ns, sent_ns, again)
        if due:
            self._with_reserve(self._file.finish_chunk)  # only then is it known how small they are compressed
            self._repeated_bytes = max(0, self._file.size - before)

    def _put(self, topic: BagTopic, stamp_ns: int, publish_ns: int, message: bytes) -> None:
        topic.message_count += 1
        self._with_reserve(lambda: self._file.write(topic.name, topic.message_count, stamp_ns, publish_ns, message))

    def write_message(self, topic: str, stamp_ns: int, message: Any) -> None:
        """Write one message; its topic is announced if it is new.

        Parameters
        ----------
        topic, stamp_ns : name; when the message was received, nanoseconds.
        message : of a type of `message_types.typestore`.
        """
        type_name = message.__msgtype__
        self.add_topic(topic, type_name)
        self.write(topic, stamp_ns, bytes(typestore().serialize_cdr(message, type_name)))

    def flush(self, to_disk: bool = False) -> None:
        """Hand everything so far to the operating system: it survives when this process is killed, and need not stay in memory.

        With ``to_disk`` wait until it is on the disk, where it survives a power failure too.

        Raises
        ------
        OSError : the disk is full; see `write`.
        """
        self._with_reserve(self._file.finish_chunk)
        if to_disk:
            self._file.sync()
        self._file.forget()
        if self._reserve.size and 2 * self._file.index_size > self._reserve.size:
            self._reserve.grow(2 * self._reserve.size)

    def split(self) -> None:
        """Finish this file and begin another one.

        Raises
        ------
        OSError : the disk is full; see `write`.
        """
        self._with_reserve(self._finish_file)
        self._file = self._next_file()
        self._latched.begin_file()
        self._repeated_bytes = 0
        for record in self._topics.values():
            self._file.add_topic(record)

    def close(self) -> None:
        """Finish the last file and write ``metadata.yaml``; a second call does nothing.

        Raises
        ------
        OSError : there is no room for the index. Everything before can be read, by this package at once, by others after
            `repair.repair_bag`.
        """
        if self._closed:
            return
        self._closed = True
        try:
            self._with_reserve(self._finish_file, again=True)
            self._reserve.release()
            write_metadata(self.path, bag_information(self._finished, self._topics.values(), self.custom))
        finally:
            self._reserve.release()
            self._give_up()

    def _is_full(self, stamp_ns: int) -> bool:
        if 0 < self._split_ns <= self._file.age_ns(stamp_ns):
            return True
        return 0 < self._split_bytes <= self._file.size - self._repeated_bytes

    def _next_file(self) -> BagFile:
        name = f"{self.path.resolve().name}_{len(self._finished)}.mcap"
        return BagFile(self.path / name, **self._options)

    def _finish_file(self) -> None:
        file = self._file
        if file.finished:
            return
        file.finish_chunk()
        counts = file.counts
        topics = [replace(topic, message_count=counts[topic.name]) for topic in self._topics.values()]
        file.finish(bag_information({file.path.name: file.span}, topics, self.custom))
        self._finished[file.path.name] = file.span
        self._finished_bytes += file.path.stat().st_size
        self._add_counts(counts)

    def _add_counts(self, counts: Counter[str]) -> None:
        """Of a file that nothing more comes to."""
        self._in_files.update(counts)
        self.repeated.update(topic for topic in self._latched.repeated if counts[topic])

    def _with_reserve(self, action: Callable[[], None], again: bool = False) -> None:
        """On a full disk give back the room that was kept, and write to it what has come so far, or all of ``action``."""
        try:
            action()
        except OSError as error:
            error.filename = str(self.path)  # a full disk says nothing of where
            if not self._reserve.release():
                raise
            if again:
                action()
                return
            with suppress(OSError):
                self._file.finish_chunk()
            raise

    def _give_up(self) -> None:
        """Count as not written what is not in a file."""
        if not self._file.finished:
            self._file.drop_chunk()
            self._add_counts(self._file.counts)
            self._finished_bytes += self._file.size
            self._file.close()
        for topic in self._topics.values():
            topic.message_count = self._in_files[topic.name]
