"""Bags read without ROS: rosbag2 folders or single MCAP files, ours or anybody's, finished or not.

An MCAP bag whose recorder was killed has no ``metadata.yaml`` and no index; it is read as far as it goes, and says so. SQLite
bags are read if they are finished and undamaged.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import zstandard
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.storage_mcap import DECOMPRESSORS
from rosbags.serde import SerdeError

from ...closing import Closing
from ...errors import FileFormatError, UnknownNameError
from .mcap_recovery import ZSTD_MAGIC, FileContents, one_text, scan, survey, unpacked, unpacked_zstd
from .message_types import typestore_of
from .metadata import METADATA_FILE, SCANNED_SUFFIX, BagTopic, check_room, offered_by, offered_in, storage_files, unclosed


def _unpacked_chunk(compression: str, data: bytes, _size: int) -> bytes:
    return unpacked(compression, data)


# rosbags unpacks chunks whatever their size; here nothing becomes larger than `MOST_BYTES`.
DECOMPRESSORS.update({name: partial(_unpacked_chunk, name) for name in ("lz4", "zstd")})

REPAIR = "`tracker_node bag repair` copies what can be read"
REPAIR_SQLITE = "`ros2 bag reindex`, then `ros2 bag convert`, copies what can be read of a SQLite bag"


@dataclass(frozen=True, eq=False)
class BagMessage:
    """A message of a bag: ``data`` are its serialized bytes (CDR), ``stamp_ns`` the time of recording.

    ``publish_ns`` is when it was sent; None where that is not known, which is so unless the bag is ``scanned``.
    """

    topic: str
    type_name: str
    stamp_ns: int
    data: bytes
    publish_ns: int | None = None


class BagReader(Closing):
    """Reads one bag; use it in a ``with`` statement.

    Parameters
    ----------
    path : bag folder, or a file of one.
    scanned : read MCAP files from their beginning even if they are finished, so that damage costs no more than what is damaged;
        messages come in the order of writing. Other files are read as ever.

    Attributes
    ----------
    topics : `BagTopic` by name.
    files : that hold its messages, in the order of recording.
    problem : why the bag had to be recovered; empty for a finished bag.
    start_ns, end_ns : stamps of the first and the last message, 0 for an empty bag.

    Raises
    ------
    FileFormatError : no bag, nothing in it can be read, or a SQLite bag that is unfinished or damaged.
    """

    def __init__(self, path: str | Path, scanned: bool = False):
        self.path = Path(path)
        self.problem = ""
        self.custom: dict[str, str] = {}
        self._reader: Reader | None = None
        self._unfinished: list[tuple[Path, FileContents]] = []
        self.files = storage_files(self.path)
        try:
            self._open_finished()
        except Exception as error:  # what rosbags raises for damaged files has no common base
            if self._sqlite or not any(file.suffix == SCANNED_SUFFIX for file in self.files):
                raise FileFormatError(self.path, "(content)", f"a finished, undamaged bag ({self.remedy})", str(error)) from None
            self._open_unfinished(f"{METADATA_FILE} is missing or wrong ({error})")
        else:
            if scanned and self.scannable:
                self.close()
                self._open_unfinished("")
        self._store = typestore_of({t.type_name: t.definition for t in self.topics.values()})

    @property
    def scannable(self) -> bool:
        """Whether all files can be read from their beginning, without an index."""
        return all(file.suffix == SCANNED_SUFFIX for file in self.files)

    @property
    def remedy(self) -> str:
        """What makes a finished bag of this one where it is damaged."""
        return REPAIR_SQLITE if self._sqlite else REPAIR

    @property
    def recovered(self) -> bool:
        """Whether the bag is unfinished, and was read as far as it goes."""
        return bool(self.problem)

    @property
    def message_count(self) -> int:
        return sum(topic.message_count for topic in self.topics.values())

    def topic(self, name: str) -> BagTopic:
        """The topic, or `UnknownNameError` with the names that there are."""
        if name not in self.topics:
            raise UnknownNameError(f"topic in {self.path}", name, self.topics)
        return self.topics[name]

    def topics_of_type(self, type_name: str) -> tuple[str, ...]:
        return tuple(topic.name for topic in self.topics.values() if topic.type_name == type_name)

    def messages(
        self, topics: Collection[str] | None = None, start_ns: int | None = None, stop_ns: int | None = None
    ) -> Iterator[BagMessage]:
        """Messages in the order of recording.

        Parameters
        ----------
        topics : names; None for all.
        start_ns, stop_ns : stamps of recording, the latter exclusive; None for the bag's.

        Returns
        -------
        Iterator of messages.

        Raises
        ------
        UnknownNameError : a topic that the bag does not have.
        FileFormatError : the file is damaged in the middle.
        """
        for name in topics or ():
            self.topic(name)
        wanted = set(self.topics if topics is None else topics)
        return self._finished(wanted, start_ns, stop_ns) if self._reader else self._recovered(wanted, start_ns, stop_ns)

    def decode(self, message: BagMessage) -> Any:
        """The message as an object with the fields of its type (numpy arrays for sequences of numbers).

        Raises
        ------
        FileFormatError : the bytes are not a message of this type.
        """
        if message.type_name not in self._store.fielddefs:
            raise FileFormatError(self.path, message.topic, "a type whose definition is known", message.type_name)
        try:
            return self._store.deserialize_cdr(message.data, message.type_name)
        except (SerdeError, struct.error, ValueError, IndexError, KeyError) as error:
            where = f"{message.topic} at {message.stamp_ns}"
            raise FileFormatError(self.path, where, f"a {message.type_name}", str(error)) from None

    def decoded(self, topic: str) -> Iterator[tuple[int, Any]]:
        """(stamp of recording, message object) of one topic."""
        for message in self.messages([topic]):
            yield message.stamp_ns, self.decode(message)

    def close(self) -> None:
        if self._reader is not None and self._reader.is_open:
            self._reader.close()
        self._reader = None

    @property
    def _sqlite(self) -> bool:
        return any(".db3" in file.suffixes for file in self.files)

    def _open_finished(self) -> None:
        has_metadata = self.path.is_dir() and (self.path / METADATA_FILE).exists()
        if self.path.is_dir() and not has_metadata and len(self.files) > 1:
            raise ValueError("no such file")
        if names := unclosed(self.files):
            raise ValueError(f"its writer has not closed it: {', '.join(names)}")
        reader = Reader(self.path if has_metadata or self.path.is_file() else self.files[0])
        if has_metadata:
            check_room(file for file in self.path.iterdir() if not file.is_dir())
        reader.open()
        self.topics = {}
        for name, info in reader.topics.items():
            connection = info.connections[0]
            self.topics[name] = BagTopic(
                name, connection.msgtype, connection.digest, offered_by(connection), info.msgcount, connection.msgdef.data
            )
        count = reader.message_count
        self.start_ns, self.end_ns = (reader.start_time, reader.end_time - 1) if count else (0, 0)
        metadata = reader.storage.metadata
        self.custom = dict(metadata.custom or {})
        if metadata.compression_mode == "message":  # unpacked here, with a limit
            reader.storage.metadata = metadata._replace(compression_mode=None)
        self._reader = reader

    def _open_unfinished(self, why: str) -> None:
        """``why`` stands in where nothing is wrong with the files themselves."""
        self.topics = {}
        problems: list[str] = []
        for path in (file for file in self.files if file.suffix == SCANNED_SUFFIX):
            contents = survey(path)
            self._unfinished.append((path, contents))
            problems += contents.problems or [why] * bool(why)
            for number in contents.channels:
                self._add_topic(contents, number)
        found = [contents for _, contents in self._unfinished if contents.message_count]
        self.start_ns = min((contents.start_ns for contents in found), default=0)
        self.end_ns = max((contents.end_ns for contents in found), default=0)
        self.problem = one_text(problems)

    def _add_topic(self, contents: FileContents, number: int) -> None:
        channel = contents.channels[number]
        schema = contents.schemas.get(channel.schema_id)
        known = self.topics.get(channel.topic)
        self.topics[channel.topic] = BagTopic(
            channel.topic,
            schema.name if schema else "",
            channel.metadata.get("topic_type_hash", ""),
            offered_in(channel.metadata.get("offered_qos_profiles", "")),
            contents.counts.get(number, 0) + (known.message_count if known else 0),
            schema.data.decode(errors="replace") if schema else "",
        )

    def _finished(self, wanted: set[str], start_ns: int | None, stop_ns: int | None) -> Iterator[BagMessage]:
        assert self._reader is not None
        chosen = [connection for connection in self._reader.connections if connection.topic in wanted]
        if not chosen:
            return
        for connection in chosen:  # else what is decoded would lack the fields that are asked for
            stated = self.topics[connection.topic].type_name
            if connection.msgtype != stated:
                expected = f"messages of one type, {stated} as {METADATA_FILE} says"
                raise FileFormatError(self.path, connection.topic, expected, connection.msgtype)
        messages = self._reader.messages(chosen, start_ns, stop_ns)
        while True:
            try:
                connection, stamp_ns, data = next(messages)
                if not (isinstance(stamp_ns, int) and isinstance(data, (bytes, memoryview))):  # SQLite columns hold any type
                    raise ValueError(f"a damaged message of {connection.topic}")
            except StopIteration:
                return
            except Exception as error:  # of rosbags, SQLite and two decompressors, without a common base
                raise FileFormatError(self.path, "(messages)", f"an undamaged bag ({self.remedy})", str(error)) from None
            yield BagMessage(connection.topic, connection.msgtype, stamp_ns, self._unpacked(data))

    def _recovered(self, wanted: set[str], start_ns: int | None, stop_ns: int | None) -> Iterator[BagMessage]:
        for path, contents in self._unfinished:
            topics = {number: self.topics[channel.topic] for number, channel in contents.channels.items()}
            for message in scan(path):
                topic = topics[message.channel]
                early = start_ns is not None and message.stamp_ns < start_ns
                late = stop_ns is not None and message.stamp_ns >= stop_ns
                if topic.name in wanted and not early and not late:
                    data = self._unpacked(message.data)
                    yield BagMessage(topic.name, topic.type_name, message.stamp_ns, data, message.publish_ns)

    def _unpacked(self, data: bytes) -> bytes:
        """A message of a bag in which each was compressed: serialized ones do not begin like this."""
        if data[:4] != ZSTD_MAGIC:
            return data
        try:
            return unpacked_zstd(data)
        except (ValueError, zstandard.ZstdError) as error:
            raise FileFormatError(self.path, "(messages)", "undamaged compressed messages", str(error)) from None
