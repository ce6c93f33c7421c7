"""What can be read from an unfinished MCAP file: its writer was killed, the disk was full, a copy broke off.

Such a file has no index at its end, so it is read from its beginning up to where it breaks off; of an unfinished chunk the
messages that are there in full are read too.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema
from mcap.stream_reader import breakup_chunk

from ..errors import FileFormatError

MAGIC = b"\x89MCAP0\r\n"
_RECORD_HEAD = struct.Struct("<BQ")  # opcode, length
_MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CHUNK_HEAD = struct.Struct("<QQQI")  # start, end, uncompressed size, crc
_DAMAGED_CHUNK = "a damaged chunk was left out"
_NO_COMPRESSION = b"\0\0\0\0"  # length of its name


@dataclass(frozen=True)
class RawMessage:
    """A message as it stands in the file."""

    channel: int
    stamp_ns: int
    publish_ns: int
    data: bytes


@dataclass
class FileContents:
    """What a file holds; ``problem`` says how it ends when it is not finished, empty if it is."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    start_ns: int = 0
    end_ns: int = 0
    problem: str = ""

    @property
    def message_count(self) -> int:
        return sum(self.counts.values())


def survey(path: str | Path) -> FileContents:
    """Topics and numbers of messages, found by reading the whole file.

    Raises
    ------
    FileFormatError : not an MCAP file, or not readable.
    """
    contents = FileContents()
    for message in scan(path, contents):
        count = contents.counts.get(message.channel, 0)
        if contents.message_count == 0:
            contents.start_ns = contents.end_ns = message.stamp_ns
        contents.counts[message.channel] = count + 1
        contents.start_ns = min(contents.start_ns, message.stamp_ns)
        contents.end_ns = max(contents.end_ns, message.stamp_ns)
    return contents


def scan(path: str | Path, contents: FileContents | None = None) -> Iterator[RawMessage]:
    """All messages in the order of the file; schemas, channels and the problem found go to ``contents`` as they come.

    Raises
    ------
    FileFormatError : not an MCAP file, or not readable.
    """
    contents = FileContents() if contents is None else contents
    try:
        with Path(path).open("rb") as stream:
            if stream.read(len(MAGIC)) != MAGIC:
                raise FileFormatError(path, "(start)", "the magic bytes of an MCAP file", "something else")
            yield from _scan_records(stream, Path(path).stat().st_size, contents)
    except OSError as error:
        raise FileFormatError(path, "(file)", "a readable MCAP file", str(error)) from None


def _scan_records(stream: BinaryIO, size: int, contents: FileContents) -> Iterator[RawMessage]:
    while True:
        head = stream.read(_RECORD_HEAD.size)
        if len(head) < _RECORD_HEAD.size:
            contents.problem = "the file breaks off between two records, without an index"
            return
        opcode, length = _RECORD_HEAD.unpack(head)
        body = stream.read(min(length, size - stream.tell()))
        whole = len(body) == length
        if opcode == Opcode.CHUNK:
            yield from _scan_chunk(body, whole, contents)
        if not whole:
            contents.problem = f"the file breaks off in the middle of a record of {length} bytes"
            return
        if opcode == Opcode.FOOTER:
            return
        yield from _take(opcode, memoryview(body), contents)


def _scan_chunk(body: bytes, whole: bool, contents: FileContents) -> Iterator[RawMessage]:
    if len(body) < _CHUNK_HEAD.size + len(_NO_COMPRESSION) + 8:
        return
    if body[_CHUNK_HEAD.size : _CHUNK_HEAD.size + 4] != _NO_COMPRESSION:
        if whole:
            yield from _scan_compressed(body, contents)
        return
    records = memoryview(body)[_CHUNK_HEAD.size + len(_NO_COMPRESSION) + 8 :]
    crc = _CHUNK_HEAD.unpack_from(body)[3]
    if whole and crc and zlib.crc32(records) != crc:
        contents.problem = _DAMAGED_CHUNK
        return
    at = 0
    while at + _RECORD_HEAD.size <= len(records):
        opcode, length = _RECORD_HEAD.unpack_from(records, at)
        at += _RECORD_HEAD.size
        if at + length > len(records):
            return
        yield from _take(opcode, records[at : at + length], contents)
        at += length


def _scan_compressed(body: bytes, contents: FileContents) -> Iterator[RawMessage]:
    try:
        records = breakup_chunk(Chunk.read(ReadDataStream(BytesIO(body))), validate_crc=True)
    except Exception:  # decompressors have their own kinds of errors
        contents.problem = _DAMAGED_CHUNK
        return
    for record in records:
        if isinstance(record, Schema):
            contents.schemas[record.id] = record
        elif isinstance(record, Channel):
            contents.channels[record.id] = record
        elif isinstance(record, Message):
            yield RawMessage(record.channel_id, record.log_time, record.publish_time, record.data)


def _take(opcode: int, body: memoryview, contents: FileContents) -> Iterator[RawMessage]:
    try:
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(ReadDataStream(BytesIO(body)))
            contents.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(ReadDataStream(BytesIO(body)))
            contents.channels[channel.id] = channel
    except (McapError, UnicodeDecodeError, struct.error):
        contents.problem = "a damaged record was left out"
    if opcode == Opcode.MESSAGE and len(body) >= _MESSAGE_HEAD.size:
        channel_id, _, stamp_ns, publish_ns = _MESSAGE_HEAD.unpack_from(body)
        if channel_id in contents.channels:
            yield RawMessage(channel_id, stamp_ns, publish_ns, bytes(body[_MESSAGE_HEAD.size :]))
