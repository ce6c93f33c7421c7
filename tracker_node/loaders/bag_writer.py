"""Bags in rosbag2's layout with MCAP storage, written without ROS.

Messages are taken as serialized CDR bytes and written as they are, or serialized here. A bag is a folder with
``metadata.yaml`` and ``<folder>_0.mcap``; definitions, type hashes and QoS profiles are inside, so ``ros2 bag``, Foxglove
and PlotJuggler open it without this package.
"""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Any

import yaml

from .. import __version__
from ..errors import FileFormatError, TrackerError
from .bag_metadata import OfferedQos, TimeSpan, TopicRecord, bag_information, write_metadata
from .mcap_writer import McapWriter
from .message_types import MessageType, message_type, typestore

CHUNK_BYTES = 256 * 1024
"""Small, for what is in an unfinished chunk is lost when the process is killed."""


class BagExistsError(TrackerError):
    """A bag is never written over."""

    def __init__(self, path: str | Path):
        self.path = str(path)
        super().__init__(f"output '{path}' exists already and is not overwritten; remove it or choose another name")


class BagWriter:
    """Writes one bag; use it in a ``with`` statement, which closes it also after an error.

    Parameters
    ----------
    path : folder of the bag, made here.
    chunk_bytes : messages are handed to the operating system when this much has come together; see also `flush`.
    custom : short texts for ``custom_data`` of the metadata.

    Raises
    ------
    BagExistsError : something is at ``path``.
    """

    def __init__(self, path: str | Path, *, chunk_bytes: int = CHUNK_BYTES, custom: dict[str, str] | None = None):
        self.path = Path(path)
        try:
            self.path.mkdir(parents=True)
        except FileExistsError:
            raise BagExistsError(path) from None
        except OSError as error:
            raise TrackerError(f"output '{path}' cannot be made: {error.strerror}") from None
        self.custom = dict(custom or {})
        self.span = TimeSpan()
        self.file = self.path / f"{self.path.resolve().name}_0.mcap"
        self._topics: dict[str, TopicRecord] = {}
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._sequence: dict[str, int] = {}
        self._stream = self.file.open("xb")
        library = f"tracker_node {__version__}"
        self._writer = McapWriter(self._stream, profile="ros2", library=library, chunk_bytes=chunk_bytes)
        self._closed = False

    @property
    def topics(self) -> dict[str, TopicRecord]:
        """Topics by name, with their number of messages."""
        return dict(self._topics)

    @property
    def bytes_written(self) -> int:
        """Size of the file so far, without the unfinished chunk."""
        return self._stream.tell() if not self._closed else self.file.stat().st_size

    def add_topic(self, topic: str, type_name: str, qos: OfferedQos | None = None, definition: MessageType | None = None) -> None:
        """Announce a topic; repeating it with the same type does nothing.

        ``definition`` is for types that `message_types.message_type` does not find, for example one with an empty text.

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
        qos = qos or OfferedQos()
        if type_name not in self._schemas:
            encoding = "ros2msg" if known.definition else ""
            self._schemas[type_name] = self._writer.add_schema(type_name, encoding, known.definition.encode())
        metadata = {"offered_qos_profiles": qos.as_yaml(), "topic_type_hash": known.type_hash}
        channel = self._writer.add_channel(topic, self._schemas[type_name], metadata)
        self._channels[topic] = channel
        self._sequence[topic] = 0
        self._topics[topic] = TopicRecord(topic, type_name, known.type_hash, qos)

    def write(self, topic: str, stamp_ns: int, data: bytes | memoryview, publish_ns: int | None = None) -> None:
        """One serialized message, with its CDR header.

        ``stamp_ns`` is when it was received, ``publish_ns`` when it was sent (the same if not given); the format has no
        times before 1970, they become 0.
        """
        channel = self._channels.get(topic)
        if channel is None:
            raise ValueError(f"expected a topic of {sorted(self._channels)}, got {topic!r}")
        sequence = self._sequence[topic] = self._sequence[topic] + 1
        stamp_ns = max(0, stamp_ns)
        publish_ns = stamp_ns if publish_ns is None else max(0, publish_ns)
        self._writer.add_message(channel, sequence, stamp_ns, publish_ns, bytes(data))  # bytes of bytes are no copy
        self._topics[topic].message_count += 1
        self.span.add(stamp_ns)

    def write_message(self, topic: str, stamp_ns: int, message: Any) -> None:
        """One message of a type of `message_types.typestore`; the topic is announced if it is new."""
        type_name = message.__msgtype__
        self.add_topic(topic, type_name)
        self.write(topic, stamp_ns, bytes(typestore().serialize_cdr(message, type_name)))

    def flush(self) -> None:
        """Hand everything so far to the operating system: it survives when this process is killed."""
        self._writer.finish_chunk()
        self._stream.flush()

    def close(self) -> None:
        """Finish the file and write ``metadata.yaml``; a second call does nothing."""
        if self._closed:
            return
        information = bag_information(self.file.name, list(self._topics.values()), self.span, self.custom)
        self._writer.add_metadata("rosbag2", {"serialized_metadata": yaml.safe_dump(information, sort_keys=False)})
        self._writer.finish()
        self._stream.close()
        self._closed = True
        write_metadata(self.path, information)

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()
