"""What can be read from an MCAP file, whatever its condition: its writer was killed, the disk was full, bytes are damaged.

An unfinished file has no index at its end, so it is read from its beginning up to where it breaks off; of an unfinished chunk the
messages that are there in full are read too. Where a record in the middle is damaged, reading goes on at the next chunk that the
index names.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from ...errors import FileFormatError

MOST_BYTES = 2**30
"""Of one chunk or message when it is unpacked: what claims to be larger is taken as damaged."""
LAST_NS = 2**63 - 1
"""The latest time that ROS can hold (in the year 2262); MCAP files have room for later ones."""


@dataclass(frozen=True)
class RawMessage:
    """A message as it stands in the file."""

    channel: int
    stamp_ns: int
    publish_ns: int
    data: bytes


@dataclass
class FileContents:
    """What a file holds.

    Attributes
    ----------
    schemas, channels, counts : message types; topics; messages of each channel, by their numbers in the file.
    problems : what is wrong with it; empty for a finished, undamaged file.
    indexed : whether it has an index.
    """

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    start_ns: int = 0
    end_ns: int = 0
    problems: list[str] = field(default_factory=list)
    indexed: bool = False

    @property
    def message_count(self) -> int:
        return sum(self.counts.values())

    @property
    def problem(self) -> str:
        """The problems as one text."""
        return one_text(self.problems)

    def count(self, message: RawMessage) -> None:
        """Take note of a message."""
        if not self.counts:
            self.start_ns = self.end_ns = message.stamp_ns
        self.counts[message.channel] = self.counts.get(message.channel, 0) + 1
        self.start_ns = min(self.start_ns, message.stamp_ns)
        self.end_ns = max(self.end_ns, message.stamp_ns)


def one_text(problems: Iterable[str]) -> str:
    """Several problems as one text: the first four different ones, and the number of those left out."""
    different = list(dict.fromkeys(problems))
    more = [f"and {len(different) - 4} more"] if len(different) > 4 else []
    return "; ".join([*different[:4], *more])


MAGIC = b"\x89MCAP0\r\n"
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"

_RECORD_HEAD = struct.Struct("<BQ")  # opcode, length
_MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CHUNK_HEAD = struct.Struct("<QQQI")  # start, end, uncompressed size, crc
_FOOTER = struct.Struct("<BQQQI")  # opcode, length, start of the summary, of its offsets, crc
_PIECE = 4 * 2**20
_FIRST_PRIVATE = 0x80  # opcodes from here on are other programs' own


def scan(path: Path, contents: FileContents | None = None) -> Iterator[RawMessage]:
    """Messages of a file in its order, read from its beginning.

    Parameters
    ----------
    path : file.
    contents : gets schemas, channels and the problems found as they come.

    Yields
    ------
    One message that is there in full.

    Raises
    ------
    FileFormatError : not an MCAP file, or not readable.
    """
    contents = FileContents() if contents is None else contents
    try:
        with path.open("rb") as stream:
            if stream.read(len(MAGIC)) != MAGIC:
                raise FileFormatError(path, "(start)", "the magic bytes of an MCAP file", "something else")
            yield from _scan_records(stream, path.stat().st_size, contents)
    except OSError as error:
        raise FileFormatError(path, "(file)", "a readable MCAP file", str(error)) from None


def survey(path: Path) -> FileContents:
    """Topics and numbers of messages, found by reading the whole file.

    Raises
    ------
    FileFormatError : not an MCAP file, or not readable.
    """
    contents = FileContents()
    for message in scan(path, contents):
        contents.count(message)
    return contents


def _scan_records(stream: BinaryIO, size: int, contents: FileContents) -> Iterator[RawMessage]:
    chunks = _indexed_chunks(stream, size, contents)
    while True:
        at = stream.tell()
        head = stream.read(min(_RECORD_HEAD.size, size - at))  # what is written meanwhile is left for another time
        opcode, length = _RECORD_HEAD.unpack(head) if len(head) == _RECORD_HEAD.size else (0, 0)
        known = 0 < opcode <= Opcode.DATA_END or opcode >= _FIRST_PRIVATE
        if contents.indexed and (not known or length > size - stream.tell()):
            contents.problems.append(f"the record at byte {at} is damaged and was left out")
            at = next((chunk for chunk in chunks if chunk > at), size)
            if at == size:
                return
            stream.seek(at)
            continue
        if len(head) < _RECORD_HEAD.size:
            contents.problems.append("the file breaks off between two records, without an index")
            return
        if not known:
            contents.problems.append(f"nothing can be read from byte {at} on")
            return
        body = stream.read(min(length, size - stream.tell()))
        whole = len(body) == length
        if opcode == Opcode.CHUNK:
            yield from _scan_chunk(body, whole, at, contents)
        if not whole:
            contents.problems.append(f"the file breaks off in the middle of a record of {length} bytes")
            return
        if opcode == Opcode.FOOTER:
            return
        yield from _take(opcode, memoryview(body), contents)


def _indexed_chunks(stream: BinaryIO, size: int, contents: FileContents) -> list[int]:
    """Where the chunks begin, in order; none where there is no index, or a damaged one. The stream stays where it is."""
    before, end = stream.tell(), _FOOTER.size + len(MAGIC)
    found: list[int] = []
    try:
        if size < before + end:
            return []
        stream.seek(size - end)
        opcode, length, start, _, crc = _FOOTER.unpack(stream.read(_FOOTER.size))
        complete = stream.read(len(MAGIC)) == MAGIC and (opcode, length) == (Opcode.FOOTER, _FOOTER.size - 9)
        if not complete or not before <= start <= size - end:
            return []
        contents.indexed = True
        stream.seek(start)
        summary = stream.read(size - end - start)
        stream.seek(size - end)
        if crc and zlib.crc32(summary + stream.read(_FOOTER.size - 4)) != crc:
            contents.problems.append("the index is damaged")
        found = _chunk_offsets(summary)
    finally:
        stream.seek(before)
    return sorted(found)


def _chunk_offsets(summary: bytes) -> list[int]:
    found, at = [], 0
    while at + _RECORD_HEAD.size <= len(summary):
        opcode, length = _RECORD_HEAD.unpack_from(summary, at)
        at += _RECORD_HEAD.size
        if opcode == Opcode.CHUNK_INDEX and length >= 24 and at + 24 <= len(summary):
            found.append(struct.unpack_from("<Q", summary, at + 16)[0])
        at += length
    return found


def _scan_chunk(body: bytes, whole: bool, offset: int, contents: FileContents) -> Iterator[RawMessage]:
    """Messages of a chunk; of one that breaks off, or has no checksum, as far as it goes."""
    try:
        crc, compression, content = _chunk_parts(body)
        if compression and not whole:
            return
        records = memoryview(unpacked(compression, content))
        if whole and crc and zlib.crc32(records) != crc:
            raise ValueError("checksum")
    except Exception:  # decompressors have their own kinds of errors
        if whole:
            contents.problems.append(f"the chunk at byte {offset} is damaged and was left out")
        return
    at = 0
    while at + _RECORD_HEAD.size <= len(records):
        opcode, length = _RECORD_HEAD.unpack_from(records, at)
        at += _RECORD_HEAD.size
        if at + length > len(records):
            if whole:
                contents.problems.append(f"the chunk at byte {offset} is damaged and was read in part")
            return
        yield from _take(opcode, records[at : at + length], contents)
        at += length


def _chunk_parts(body: bytes) -> tuple[int, str, memoryview]:
    """Checksum, compression and content."""
    crc = _CHUNK_HEAD.unpack_from(body)[3]
    (length,) = struct.unpack_from("<I", body, _CHUNK_HEAD.size)
    at = _CHUNK_HEAD.size + 4
    compression = body[at : at + length].decode()
    return crc, compression, memoryview(body)[at + length + 8 :]


def unpacked(compression: str, content: bytes | memoryview) -> Any:
    """The records of a chunk.

    Parameters
    ----------
    compression, content : empty, ``zstd`` or ``lz4``; bytes of the chunk.

    Returns
    -------
    Bytes, or ``content`` itself.

    Raises
    ------
    ValueError, or what the decompressor raises : damaged, unknown, or too large.
    """
    if not compression:
        return content
    if compression == "zstd":
        return unpacked_zstd(content)
    if compression != "lz4":
        raise ValueError(compression)
    decompressor = lz4.frame.LZ4FrameDecompressor()
    data = decompressor.decompress(content, max_length=MOST_BYTES)
    if not decompressor.eof:
        raise ValueError("too large, or not whole")
    return data


def unpacked_zstd(data: bytes | memoryview) -> bytes:
    """The content of a zstd frame, whatever size it claims.

    Raises
    ------
    ValueError, zstandard.ZstdError : damaged, or larger than `MOST_BYTES`.
    """
    pieces, size = [], 0
    with zstandard.ZstdDecompressor().stream_reader(data) as stream:
        while piece := stream.read(_PIECE):
            pieces.append(piece)
            size += len(piece)
            if size > MOST_BYTES:
                raise ValueError("too large")
    return b"".join(pieces)


def _take(opcode: int, body: memoryview, contents: FileContents) -> Iterator[RawMessage]:
    try:
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(ReadDataStream(BytesIO(body)))
            contents.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(ReadDataStream(BytesIO(body)))
            contents.channels[channel.id] = channel
    except (McapError, UnicodeDecodeError, struct.error):
        contents.problems.append("a damaged record was left out")
    if opcode == Opcode.MESSAGE and len(body) >= _MESSAGE_HEAD.size:
        channel_id, _, stamp_ns, publish_ns = _MESSAGE_HEAD.unpack_from(body)
        if channel_id in contents.channels:
            yield RawMessage(channel_id, stamp_ns, publish_ns, bytes(body[_MESSAGE_HEAD.size :]))
