"""A bag written by a thread of its own, so that whoever receives messages never waits for the disk."""

from __future__ import annotations

import queue
import shutil
import threading
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from ...errors import TrackerError
from .message_types import MessageType
from .metadata import OfferedQos
from .writer import BagWriter

FLUSH_S = 0.5
"""What is older than this survives when the process is killed."""


@dataclass(frozen=True)
class _Message:
    """Waits to be written; ``came_s`` is when, on the monotonic clock."""

    topic: str
    stamp_ns: int
    data: bytes
    came_s: float


@dataclass(frozen=True)
class _Topic:
    """Waits to be announced."""

    name: str
    type_name: str
    qos: OfferedQos
    definition: MessageType


_SPLIT = "split"
_REMOVED = "its folder has been removed"


class BagQueue:
    """Takes messages for a bag; bounded by memory, and what does not fit is counted, not waited for.

    When the disk is full, or nearly, the bag is finished with what it has, and `problem` says so.

    Parameters
    ----------
    writer : the bag; from now on only this object may use it.
    limit_bytes : largest size of all messages that wait.
    flush_s : messages are handed to the operating system at least so often.
    min_free_bytes : stop when the disk has less room; what waits then is still written.
    to_disk : also have the operating system write them to the disk each time.

    Attributes
    ----------
    written, dropped : messages by topic, each once; those dropped had come, but there was no room for them.
    problem : why nothing is written any more; empty if it can be.
    """

    def __init__(
        self,
        writer: BagWriter,
        limit_bytes: int = 512 * 2**20,
        *,
        flush_s: float = FLUSH_S,
        min_free_bytes: int = 0,
        to_disk: bool = False,
    ):
        self._writer, self.limit_bytes, self.min_free_bytes = writer, limit_bytes, min_free_bytes
        self._flush_s, self._to_disk = flush_s, to_disk
        self._queue: queue.SimpleQueue = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._waiting_bytes = 0
        self._oldest_s: float | None = None  # arrival of the oldest message that has been taken out but not flushed
        self._topics: set[str] = set()
        self.written: Counter[str] = Counter()
        self.dropped: Counter[str] = Counter()
        self.problem = ""
        self._abandoned = False
        self._thread = threading.Thread(target=self._run, name="write bag", daemon=True)
        self._thread.start()

    @property
    def path(self) -> Path:
        return self._writer.path

    @property
    def n_files(self) -> int:
        return len(self._writer.files)

    @property
    def size(self) -> int:
        """Bytes of the bag so far."""
        return self._writer.bytes_written

    @property
    def waiting_bytes(self) -> int:
        """Size of the messages that are not written yet."""
        return self._waiting_bytes

    @property
    def unsaved_s(self) -> float:
        """Age of the oldest message that would be lost if this process were killed now."""
        oldest_s = self._oldest_s
        return 0.0 if oldest_s is None else time.monotonic() - oldest_s

    @property
    def free_bytes(self) -> int:
        """Room on the disk; 0 if that has gone."""
        try:
            return shutil.disk_usage(self.path).free
        except OSError:
            return 0

    def add_topic(self, topic: str, type_name: str, qos: OfferedQos, definition: MessageType) -> None:
        """Announce a topic; it must come before its messages.

        Parameters
        ----------
        topic, type_name : such as ``/tracker/state`` and ``tracker_msgs/msg/TrackedState``.
        qos, definition : quality of service that its publisher offers; the type as the bag states it.
        """
        if topic not in self._topics:
            self._topics.add(topic)
            self._queue.put(_Topic(topic, type_name, qos, definition))

    def put(self, topic: str, stamp_ns: int, data: bytes) -> bool:
        """Hand over one serialized message.

        Parameters
        ----------
        topic, stamp_ns : announced topic; when the message was received, nanoseconds.
        data : CDR bytes.

        Returns
        -------
        False if there was no room for it.

        Raises
        ------
        ValueError : the topic has not been announced.
        """
        if topic not in self._topics:
            raise ValueError(f"expected a topic of {sorted(self._topics)}, got {topic!r}")
        with self._lock:
            full = self._waiting_bytes + len(data) > self.limit_bytes and self._waiting_bytes > 0
            if full or self.problem:
                self.dropped[topic] += 1
                return False
            self._waiting_bytes += len(data)
            self._queue.put(_Message(topic, stamp_ns, data, time.monotonic()))
        return True

    def split(self) -> None:
        """Begin another file with the messages that come from now on."""
        self._queue.put(_SPLIT)

    def close(self) -> None:
        """Write what waits, and finish the bag.

        Raises
        ------
        TrackerError : the bag could not be written to its end (disk full, for example); `problem` says the same.
        """
        if self._thread.is_alive():
            self._queue.put(None)
            self._thread.join()
        if self.problem:
            raise TrackerError(f"bag {self.path}: {self.problem}")

    def abandon(self) -> None:
        """Leave out what waits, and count it as dropped, so that `close` need not wait for the disk."""
        self._abandoned = True

    def _run(self) -> None:
        try:
            self._write_all()
        except Exception as error:  # a thread must not end in silence
            self._stop(f"stopped: {_reason(error)}")
            self._empty(write=False)
        try:
            self._writer.close()
        except Exception as error:
            if self.path.is_dir():
                self._stop(f"has no index: {_reason(error)}; `tracker_node bag repair` makes one")
            elif not self.problem:
                self._stop(_REMOVED)
        self._oldest_s = None
        in_bag, again = self._writer.topics, self._writer.repeated
        for topic, count in self.written.items():
            self.written[topic] = in_bag[topic].message_count - again[topic]
            self.dropped[topic] += count - self.written[topic]

    def _stop(self, problem: str) -> None:
        """Take nothing more."""
        with self._lock:
            self.problem = f"{self.problem}; {problem}" if self.problem else problem

    def _write_all(self) -> None:
        flush_at = time.monotonic() + self._flush_s
        while True:
            try:
                item = self._queue.get(timeout=max(0.0, flush_at - time.monotonic()))
            except queue.Empty:
                item = ()
            if item is None:
                return
            if item:
                self._take(item)
            if time.monotonic() >= flush_at:
                self._writer.flush(self._to_disk)
                self._oldest_s = None
                flush_at = time.monotonic() + self._flush_s
                problem = self._shortage()
                if problem:
                    self._stop(f"stopped: {problem}")
                    self._empty(write=True)
                    return

    def _shortage(self) -> str:
        if not self.path.is_dir():
            return _REMOVED
        few = self.min_free_bytes and self.free_bytes < self.min_free_bytes
        return f"less than {self.min_free_bytes // 2**20} MB are free on the disk" if few else ""

    def _empty(self, write: bool) -> None:
        """Take out what waits, to be written or to be counted."""
        while True:
            try:
                item = self._queue.get_nowait()
            except queue.Empty:
                return
            if isinstance(item, _Message) and not write:
                self._waiting_bytes -= len(item.data)
                self.dropped[item.topic] += 1
            elif item and write:
                self._take(item)

    def _take(self, item: _Message | _Topic | str) -> None:
        if isinstance(item, _Topic):
            self._writer.add_topic(item.name, item.type_name, item.qos, item.definition)
        elif isinstance(item, _Message):
            self._write(item)
        else:
            self._writer.split()

    def _write(self, message: _Message) -> None:
        with self._lock:
            self._waiting_bytes -= len(message.data)
        if self._abandoned:
            self.dropped[message.topic] += 1
            return
        if self._oldest_s is None:
            self._oldest_s = message.came_s
        self.written[message.topic] += 1
        self._writer.write(message.topic, message.stamp_ns, message.data)


def _reason(error: Exception) -> str:
    return (error.strerror or str(error)) if isinstance(error, OSError) else str(error)
