"""MCAP files written without copying messages: a chunk is kept as the pieces that it consists of.

The record layouts are those of the mcap library; its own writer copies every message several times, which six cameras' raw
images do not forgive. Chunks are not compressed, and what the operating system has of an unfinished one can be recovered.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from typing import BinaryIO

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

_MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # opcode, length; channel, sequence, log time, publish time
_MESSAGE_FIELDS = _MESSAGE_HEAD.size - 9
_CHUNK_HEAD = struct.Struct("<BQQQQIIQ")  # opcode, length; start, end, size, crc, length of compression name (0), size
_CHUNK_FIELDS = _CHUNK_HEAD.size - 9
_FOOTER_START = struct.Struct("<BQQQ")  # the part of a footer that its checksum covers


class McapWriter:
    """Writes one MCAP file to ``stream``, which stays open.

    Parameters
    ----------
    stream : binary file at its beginning.
    chunk_bytes : a chunk is finished when it has become at least so large.
    """

    def __init__(self, stream: BinaryIO, *, profile: str, library: str, chunk_bytes: int):
        self._stream, self._chunk_bytes = stream, chunk_bytes
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._counts: Counter[int] = Counter()
        self._chunk_indexes: list[ChunkIndex] = []
        self._metadata_indexes: list[MetadataIndex] = []
        self._start_ns = self._end_ns = 0
        self._new_chunk()
        stream.write(MAGIC)
        self._write(Header(profile, library))

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Announce a message type; its number."""
        self._schemas.append(Schema(id=len(self._schemas) + 1, data=data, encoding=encoding, name=name))
        self._append(_encoded(self._schemas[-1]))
        return len(self._schemas)

    def add_channel(self, topic: str, schema: int, metadata: dict[str, str]) -> int:
        """Announce a topic; its number."""
        number = len(self._channels) + 1
        self._channels.append(Channel(number, topic, "cdr", metadata, schema))
        self._append(_encoded(self._channels[-1]))
        return number

    def add_message(self, channel: int, sequence: int, log_ns: int, publish_ns: int, data: bytes) -> None:
        """One message; ``data`` is referred to until the chunk is finished, not copied."""
        if not self._counts:
            self._start_ns = self._end_ns = log_ns
        if not self._chunk_messages:
            self._chunk_start_ns = self._chunk_end_ns = log_ns
        self._start_ns, self._end_ns = min(self._start_ns, log_ns), max(self._end_ns, log_ns)
        self._chunk_start_ns, self._chunk_end_ns = min(self._chunk_start_ns, log_ns), max(self._chunk_end_ns, log_ns)
        self._chunk_messages.setdefault(channel, []).append((log_ns, self._chunk_size))
        self._counts[channel] += 1
        length = _MESSAGE_FIELDS + len(data)
        self._append(_MESSAGE_HEAD.pack(Opcode.MESSAGE, length, channel, sequence, log_ns, publish_ns))
        self._append(data)
        if self._chunk_size >= self._chunk_bytes:
            self.finish_chunk()

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Texts about the file as a whole."""
        self.finish_chunk()
        offset = self._stream.tell()
        length = self._write(Metadata(name=name, metadata=values))
        self._metadata_indexes.append(MetadataIndex(offset=offset, length=length, name=name))

    def finish_chunk(self) -> None:
        """Hand what has come together to the stream, with the index of the chunk; nothing while there is no message."""
        if not self._chunk_messages:
            return
        offset = self._stream.tell()
        crc = 0
        for piece in self._chunk:
            crc = zlib.crc32(piece, crc)
        size, span = self._chunk_size, (self._chunk_start_ns, self._chunk_end_ns)
        self._stream.write(_CHUNK_HEAD.pack(Opcode.CHUNK, _CHUNK_FIELDS + size, *span, size, crc, 0, size))
        for piece in self._chunk:
            self._stream.write(piece)
        end, index_offsets = self._stream.tell(), {}
        for channel, entries in self._chunk_messages.items():
            index_offsets[channel] = self._stream.tell()
            self._write(MessageIndex(channel_id=channel, records=entries))
        self._chunk_indexes.append(
            ChunkIndex(
                chunk_start_offset=offset,
                chunk_length=end - offset,
                compression="",
                compressed_size=size,
                uncompressed_size=size,
                message_start_time=span[0],
                message_end_time=span[1],
                message_index_offsets=index_offsets,
                message_index_length=self._stream.tell() - end,
            )
        )
        self._new_chunk()

    def finish(self) -> None:
        """Write the summary that makes it a finished file."""
        self.finish_chunk()
        self._write(DataEnd(0))
        start, groups = self._stream.tell(), RecordBuilder()
        offsets = []
        for records in (self._schemas, self._channels, [self._statistics()], self._chunk_indexes, self._metadata_indexes):
            at = groups.count
            for record in records:
                record.write(groups)
            if groups.count > at:
                opcode = _OPCODES[type(records[0])]
                offsets.append(SummaryOffset(group_opcode=opcode, group_start=start + at, group_length=groups.count - at))
        offsets_start = start + groups.count
        for offset in offsets:
            offset.write(groups)
        summary = groups.end()
        crc = zlib.crc32(_FOOTER_START.pack(Opcode.FOOTER, 8 + 8 + 4, start, offsets_start), zlib.crc32(summary))
        self._stream.write(summary)
        self._write(Footer(summary_start=start, summary_offset_start=offsets_start, summary_crc=crc))
        self._stream.write(MAGIC)
        self._stream.flush()

    def _new_chunk(self) -> None:
        self._chunk: list[bytes] = []
        self._chunk_size = self._chunk_start_ns = self._chunk_end_ns = 0
        self._chunk_messages: dict[int, list[tuple[int, int]]] = {}

    def _append(self, piece: bytes) -> None:
        self._chunk.append(piece)
        self._chunk_size += len(piece)

    def _write(self, record: McapRecord) -> int:
        data = _encoded(record)
        self._stream.write(data)
        return len(data)

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._chunk_indexes),
            message_count=sum(self._counts.values()),
            message_start_time=self._start_ns,
            message_end_time=self._end_ns,
            metadata_count=len(self._metadata_indexes),
            schema_count=len(self._schemas),
        )


_OPCODES = {
    Schema: Opcode.SCHEMA,
    Channel: Opcode.CHANNEL,
    Statistics: Opcode.STATISTICS,
    ChunkIndex: Opcode.CHUNK_INDEX,
    MetadataIndex: Opcode.METADATA_INDEX,
}


def _encoded(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()
