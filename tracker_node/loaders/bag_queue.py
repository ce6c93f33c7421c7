"""A bag written by a thread of its own, so that whoever receives messages never waits for the disk."""

from __future__ import annotations

import queue
import threading
import time
from collections import Counter
from pathlib import Path

from ..errors import TrackerError
from .bag_metadata import OfferedQos
from .bag_writer import BagWriter
from .message_types import MessageType

FLUSH_S = 0.5
"""What is older than this survives when the process is killed."""


class BagQueue:
    """Takes messages for a bag; bounded by memory, and what does not fit is counted, not waited for.

    Parameters
    ----------
    writer : the bag; from now on only this object may use it.
    limit_bytes : largest size of all messages that wait.
    """

    def __init__(self, writer: BagWriter, limit_bytes: int = 512 * 2**20):
        self._writer, self._limit_bytes = writer, limit_bytes
        self._queue: queue.SimpleQueue = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._waiting_bytes = 0
        self._topics: set[str] = set()
        self.written: Counter[str] = Counter()
        self.dropped: Counter[str] = Counter()
        self.problem = ""
        self._thread = threading.Thread(target=self._run, name="write bag", daemon=True)
        self._thread.start()

    @property
    def path(self) -> Path:
        return self._writer.path

    @property
    def waiting_bytes(self) -> int:
        """Size of the messages that are not written yet."""
        return self._waiting_bytes

    def add_topic(self, topic: str, type_name: str, qos: OfferedQos, definition: MessageType) -> None:
        """Announce a topic; it must come before its messages."""
        if topic not in self._topics:
            self._topics.add(topic)
            self._queue.put((topic, type_name, qos, definition))

    def put(self, topic: str, stamp_ns: int, data: bytes, publish_ns: int | None = None) -> bool:
        """Hand over one serialized message; False if there was no room for it.

        Raises
        ------
        ValueError : the topic has not been announced.
        """
        if topic not in self._topics:
            raise ValueError(f"expected a topic of {sorted(self._topics)}, got {topic!r}")
        with self._lock:
            full = self._waiting_bytes + len(data) > self._limit_bytes and self._waiting_bytes > 0
            if full or self.problem:
                self.dropped[topic] += 1
                return False
            self._waiting_bytes += len(data)
        self._queue.put((topic, stamp_ns, data, publish_ns))
        return True

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

    def _run(self) -> None:
        try:
            self._write_all()
        except Exception as error:  # a thread must not end in silence
            self.problem = f"cannot be written: {error}"
        try:
            self._writer.close()
        except Exception as error:
            self.problem = self.problem or f"cannot be finished: {error}"

    def _write_all(self) -> None:
        flush_at = time.monotonic() + FLUSH_S
        while True:
            try:
                item = self._queue.get(timeout=max(0.0, flush_at - time.monotonic()))
            except queue.Empty:
                item = ()
            if item is None:
                return
            if item:
                self._write(item)
            if time.monotonic() >= flush_at:
                self._writer.flush()
                flush_at = time.monotonic() + FLUSH_S

    def _write(self, item: tuple) -> None:
        if isinstance(item[1], str):
            self._writer.add_topic(*item)
            return
        topic, stamp_ns, data, publish_ns = item
        with self._lock:
            self._waiting_bytes -= len(data)
        self._writer.write(topic, stamp_ns, data, publish_ns)
        self.written[topic] += 1
