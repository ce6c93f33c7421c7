"""MCAP files written without copying messages: a chunk is kept as the pieces that it consists of.

The record layouts are those of the mcap library; its own writer copies every message several times, which six cameras' raw
images do not forgive. Whatever is written is there as a whole or not at all: where the disk has no room for a chunk, the file
ends with the one before, and the chunk can be tried again.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from io import RawIOBase
from typing import BinaryIO

import lz4.frame
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from .mcap_recovery import MAGIC

COMPRESSIONS = {"none": "", "lz4": "lz4", "zstd": "zstd"}
"""Names for people, and as they stand in the file."""

_MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # opcode, length; channel, sequence, log time, publish time
_MESSAGE_FIELDS = _MESSAGE_HEAD.size - 9
_CHUNK_HEAD = struct.Struct("<BQQQQI")  # opcode, length; start, end, size, crc; then the compression's name and its size
_FOOTER_START = struct.Struct("<BQQQ")  # the part of a footer that its checksum covers
_SMALL = 512  # bytes; shorter pieces are joined before they are written


class McapWriter:
    """Writes one MCAP file to ``stream``, which stays open.

    Attributes
    ----------
    size : bytes of the file so far, without the unfinished chunk.
    counts : messages in finished chunks, by channel.
    start_ns, end_ns : their earliest and latest log time.

    Parameters
    ----------
    stream : binary file at its beginning; it may be unbuffered.
    chunk_bytes : a chunk is finished when it has become at least so large.
    compression : of chunks, as it stands in the file: empty, ``lz4`` or ``zstd``.
    """

    def __init__(self, stream: BinaryIO | RawIOBase, *, profile: str, library: str, chunk_bytes: int, compression: str = ""):
        self._stream, self._chunk_bytes, self._compression = stream, chunk_bytes, compression
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self.counts: Counter[int] = Counter()
        self._chunk_indexes = bytearray()  # encoded: there are many in a long recording
        self._chunk_count = 0
        self._metadata_indexes: list[MetadataIndex] = []
        self.start_ns = self.end_ns = self.size = 0
        self._new_chunk()
        self._put([MAGIC, _encoded(Header(profile, library))])

    @property
    def chunk_size(self) -> int:
        """Bytes of the unfinished chunk."""
        return self._chunk_size

    @property
    def index_size(self) -> int:
        """Bytes that the index of the finished chunks will take."""
        return len(self._chunk_indexes)

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Announce a message type.

        Parameters
        ----------
        name, encoding : such as ``sensor_msgs/msg/Image``; ``ros2msg``, or empty where there is no definition.
        data : definition.

        Returns
        -------
        Its number in the file.
        """
        self._schemas.append(Schema(id=len(self._schemas) + 1, data=data, encoding=encoding, name=name))
        self._append(_encoded(self._schemas[-1]))
        return len(self._schemas)

    def add_channel(self, topic: str, schema: int, metadata: dict[str, str]) -> int:
        """Announce a topic.

        Parameters
        ----------
        topic, schema : name; number of its message type.
        metadata : quality of service and hash of the type, as texts.

        Returns
        -------
        Its number in the file.
        """
        number = len(self._channels) + 1
        self._channels.append(Channel(number, topic, "cdr", metadata, schema))
        self._append(_encoded(self._channels[-1]))
        return number

    def add_message(self, channel: int, sequence: int, log_ns: int, publish_ns: int, data: bytes) -> None:
        """Take one message into the chunk, which is finished when it is full.

        Parameters
        ----------
        channel, sequence : number of the topic, and of the message in it.
        log_ns, publish_ns : when it was recorded and when it was sent, nanoseconds.
        data : serialized message; it is referred to until the chunk is finished, not copied.
        """
        self._chunk_messages.setdefault(channel, []).append((log_ns, self._chunk_size))
        length = _MESSAGE_FIELDS + len(data)
        self._append(_MESSAGE_HEAD.pack(Opcode.MESSAGE, length, channel, sequence, log_ns, publish_ns))
        self._append(data)
        if self._chunk_size >= self._chunk_bytes:
            self.finish_chunk()

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Write texts about the file as a whole.

        Parameters
        ----------
        name, values : of the record; its texts by name.
        """
        self.finish_chunk()
        offset, data = self.size, _encoded(Metadata(name=name, metadata=values))
        self._put([data])
        self._metadata_indexes.append(MetadataIndex(offset=offset, length=len(data), name=name))

    def finish_chunk(self) -> None:
        """Hand what has come together to the stream, with the index of the chunk; nothing while there is no message.

        After an OSError the stream is where it was, and the chunk is still here.
        """
        if not self._chunk_messages:
            return
        stamps = [stamp for entries in self._chunk_messages.values() for stamp, _ in entries]
        start_ns, end_ns = min(stamps), max(stamps)
        offset, (pieces, length, stored) = self.size, self._chunk_record(start_ns, end_ns)
        index_offsets, indexes = {}, []
        at = offset + length
        for channel, entries in self._chunk_messages.items():
            index_offsets[channel] = at
            indexes.append(_encoded(MessageIndex(channel_id=channel, records=entries)))
            at += len(indexes[-1])
        self._put([*pieces, *indexes])
        self._chunk_indexes += _encoded(
            ChunkIndex(
                chunk_start_offset=offset,
                chunk_length=length,
                compression=self._compression,
                compressed_size=stored,
                uncompressed_size=self._chunk_size,
                message_start_time=start_ns,
                message_end_time=end_ns,
                message_index_offsets=index_offsets,
                message_index_length=at - offset - length,
            )
        )
        self._chunk_count += 1
        self.start_ns = min(self.start_ns, start_ns) if self.counts else start_ns
        self.end_ns = max(self.end_ns, end_ns) if self.counts else end_ns
        self.counts.update(self.unfinished)
        self._new_chunk()

    @property
    def unfinished(self) -> Counter[int]:
        """Messages in the unfinished chunk, by channel."""
        return Counter({channel: len(entries) for channel, entries in self._chunk_messages.items()})

    def drop_chunk(self) -> None:
        """Give the unfinished chunk up."""
        self._new_chunk()

    def finish(self) -> None:
        """Write the summary that makes it a finished file."""
        self.finish_chunk()
        data_end = _encoded(DataEnd(0))
        start = self.size + len(data_end)
        groups = [
            (Opcode.SCHEMA, _all_encoded(self._schemas)),
            (Opcode.CHANNEL, _all_encoded(self._channels)),
            (Opcode.STATISTICS, _encoded(self._statistics())),
            (Opcode.CHUNK_INDEX, bytes(self._chunk_indexes)),
            (Opcode.METADATA_INDEX, _all_encoded(self._metadata_indexes)),
        ]
        offsets, at = [], start
        for opcode, group in groups:
            if group:
                offsets.append(SummaryOffset(group_opcode=opcode, group_start=at, group_length=len(group)))
            at += len(group)
        summary = b"".join(group for _, group in groups) + _all_encoded(offsets)
        crc = zlib.crc32(_FOOTER_START.pack(Opcode.FOOTER, 8 + 8 + 4, start, at), zlib.crc32(summary))
        footer = _encoded(Footer(summary_start=start, summary_offset_start=at, summary_crc=crc))
        self._put([data_end, summary, footer, MAGIC])
        self._stream.flush()

    def _chunk_record(self, start_ns: int, end_ns: int) -> tuple[list[bytes], int, int]:
        """Pieces of the chunk as they are written, their length, and that of the records in them."""
        crc = 0
        for piece in self._chunk:
            crc = zlib.crc32(piece, crc)
        pieces = self._chunk if not self._compression else [_COMPRESSORS[self._compression](b"".join(self._chunk))]
        stored = sum(map(len, pieces)) if self._compression else self._chunk_size
        name = self._compression.encode()
        fields = struct.pack("<I", len(name)) + name + struct.pack("<Q", stored)
        length = _CHUNK_HEAD.size - 9 + len(fields) + stored
        head = _CHUNK_HEAD.pack(Opcode.CHUNK, length, start_ns, end_ns, self._chunk_size, crc) + fields
        return [head, *pieces], 9 + length, stored

    def _new_chunk(self) -> None:
        self._chunk: list[bytes] = []
        self._chunk_size = 0
        self._chunk_messages: dict[int, list[tuple[int, int]]] = {}

    def _append(self, piece: bytes) -> None:
        self._chunk.append(piece)
        self._chunk_size += len(piece)

    def _put(self, pieces: list[bytes]) -> None:
        """Write all of it, or leave the stream as it was."""
        written = 0
        with self._as_it_was():
            for block in _joined(pieces):
                view = memoryview(block)
                while view:  # an unbuffered file may take a part
                    taken = self._stream.write(view if len(view) < len(block) else block) or 0
                    view = view[taken:]
                written += len(block)
        self.size += written

    @contextmanager
    def _as_it_was(self) -> Iterator[None]:
        try:
            yield
        except OSError:
            with suppress(OSError):
                self._stream.seek(self.size)
                self._stream.truncate()
            raise

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=dict(self.counts),
            chunk_count=self._chunk_count,
            message_count=sum(self.counts.values()),
            message_start_time=self.start_ns,
            message_end_time=self.end_ns,
            metadata_count=len(self._metadata_indexes),
            schema_count=len(self._schemas),
        )


_COMPRESSORS = {
    "lz4": lambda data: lz4.frame.compress(data),
    "zstd": lambda data: zstandard.ZstdCompressor(level=1).compress(data),
}


def _joined(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """The pieces with small ones put together; large ones are handed on as they are."""
    small: list[bytes] = []
    for piece in pieces:
        if len(piece) < _SMALL:
            small.append(piece)
            continue
        if small:
            yield b"".join(small)
            small = []
        yield piece
    if small:
        yield b"".join(small)


def _encoded(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


def _all_encoded(records: Iterable[McapRecord]) -> bytes:
    return b"".join(map(_encoded, records))
