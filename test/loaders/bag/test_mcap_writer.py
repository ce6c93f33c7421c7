"""Files that the mcap library reads with all its checks on."""

from io import BytesIO

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.reader import NonSeekingReader, SeekingReader
from mcap.stream_reader import StreamReader

from tracker_node.loaders.bag.mcap_writer import McapWriter

MESSAGES = st.lists(st.tuples(st.integers(1, 3), st.integers(0, 2**60), st.binary(max_size=80)), max_size=40)


def written(messages: list[tuple[int, int, bytes]], chunk_bytes: int, stream: BytesIO | None = None) -> bytes:
    stream = BytesIO() if stream is None else stream
    writer = McapWriter(stream, profile="ros2", library="test", chunk_bytes=chunk_bytes)
    schema = writer.add_schema("a_msgs/msg/A", "ros2msg", b"uint8 a\n")
    channels = [writer.add_channel(f"/{name}", schema, {"k": name}) for name in "abc"]
    for sequence, (channel, stamp_ns, data) in enumerate(messages):
        writer.add_message(channels[channel - 1], sequence, stamp_ns, stamp_ns // 2, data)
    writer.add_metadata("rosbag2", {"x": "y"})
    writer.finish()
    return stream.getvalue()


@settings(max_examples=60, deadline=None)
@given(messages=MESSAGES, chunk_bytes=st.integers(1, 500))
def test_everything_is_found_through_the_index_and_without_it(messages, chunk_bytes) -> None:
    content = written(messages, chunk_bytes)
    expected = [(f"/{'abc'[channel - 1]}", stamp_ns, stamp_ns // 2, data) for channel, stamp_ns, data in messages]
    in_order = NonSeekingReader(BytesIO(content), validate_crcs=True).iter_messages(log_time_order=False)
    assert [(c.topic, m.log_time, m.publish_time, m.data) for _, c, m in in_order] == expected
    reader = SeekingReader(BytesIO(content), validate_crcs=True)
    sought = [(c.topic, m.log_time, m.publish_time, m.data) for _, c, m in reader.iter_messages()]
    assert sorted(sought) == sorted(expected)
    assert [stamp for _, stamp, _, _ in sought] == sorted(stamp for _, stamp, _, _ in expected)
    one = [m.data for _, _, m in SeekingReader(BytesIO(content)).iter_messages(topics=["/b"], log_time_order=False)]
    assert sorted(one) == sorted(data for topic, _, _, data in expected if topic == "/b")


@settings(max_examples=30, deadline=None)
@given(messages=MESSAGES, chunk_bytes=st.integers(1, 500))
def test_the_summary_is_right(messages, chunk_bytes) -> None:
    content = written(messages, chunk_bytes)
    summary = SeekingReader(BytesIO(content), validate_crcs=True).get_summary()
    assert summary is not None
    statistics = summary.statistics
    assert statistics is not None
    assert (statistics.message_count, statistics.channel_count, statistics.schema_count) == (len(messages), 3, 1)
    assert statistics.message_start_time == min((stamp for _, stamp, _ in messages), default=0)
    assert statistics.message_end_time == max((stamp for _, stamp, _ in messages), default=0)
    assert len(summary.chunk_indexes) == statistics.chunk_count
    for index in summary.chunk_indexes:
        assert content[index.chunk_start_offset] == Opcode.CHUNK
        for offset in index.message_index_offsets.values():
            assert content[offset] == Opcode.MESSAGE_INDEX
    (metadata,) = summary.metadata_indexes
    assert content[metadata.offset] == Opcode.METADATA
    assert [c.metadata for c in summary.channels.values()] == [{"k": name} for name in "abc"]
    offsets = [r for r in StreamReader(BytesIO(content)).records if type(r).__name__ == "SummaryOffset"]
    assert [content[offset.group_start] for offset in offsets] == [offset.group_opcode for offset in offsets]


def test_messages_are_not_copied() -> None:
    pieces: list[bytes] = []

    class Spy(BytesIO):
        def write(self, data) -> int:
            pieces.append(data)
            return super().write(data)

    writer = McapWriter(Spy(), profile="ros2", library="test", chunk_bytes=10)
    channel = writer.add_channel("/a", writer.add_schema("a", "", b""), {})
    image = bytes(1000)
    writer.add_message(channel, 0, 0, 0, image)
    assert any(piece is image for piece in pieces)


class Sparing(BytesIO):
    """Takes no more than a few bytes at once, as an unbuffered file may."""

    most = 7

    def write(self, data) -> int:
        return super().write(bytes(data)[: self.most])


@pytest.mark.parametrize("most", [1, 7, 600, 10_000])
def test_a_stream_that_takes_parts_gets_the_whole(monkeypatch, most) -> None:
    messages = [(1 + k % 3, 1000 - k, bytes([k]) * size) for k, size in enumerate((3, 511, 512, 513, 2000, 0, 40))]
    expected = written(messages, 1100)
    monkeypatch.setattr(Sparing, "most", most)
    assert written(messages, 1100, Sparing()) == expected


class Full(BytesIO):
    """Has room for so many bytes."""

    room = 10**9

    def write(self, data) -> int:
        taken = bytes(data)[: max(self.room - self.tell(), 0)]
        if not taken and len(data):
            raise OSError(28, "No space left on device")
        return super().write(taken)


@pytest.mark.parametrize("room", [0, 1, 40, 700, 1500])
def test_what_has_no_room_leaves_the_stream_as_it_was_and_can_be_tried_again(room) -> None:
    stream = Full()
    writer = McapWriter(stream, profile="ros2", library="test", chunk_bytes=10_000)
    channel = writer.add_channel("/a", writer.add_schema("a_msgs/msg/A", "ros2msg", b"uint8 a\n"), {})
    for stamp_ns in (5, 3):
        writer.add_message(channel, 0, stamp_ns, 0, bytes(100))
    writer.finish_chunk()
    before = stream.getvalue()
    assert writer.size == len(before) and writer.chunk_size == 0
    for stamp_ns in (9, 4):
        writer.add_message(channel, 0, stamp_ns, 0, bytes(1000))
    stream.room = writer.size + room
    unfinished = writer.unfinished
    with pytest.raises(OSError, match="No space"):
        writer.finish_chunk()
    assert stream.getvalue() == before and writer.size == len(before)
    assert writer.unfinished == unfinished == {channel: 2} and writer.counts == {channel: 2}
    assert (writer.start_ns, writer.end_ns) == (3, 5)
    stream.room = 10**9
    writer.finish()
    assert (writer.start_ns, writer.end_ns) == (3, 9) and writer.counts == {channel: 4}
    assert writer.size == len(stream.getvalue())
    reader = SeekingReader(BytesIO(stream.getvalue()), validate_crcs=True)
    assert [m.log_time for _, _, m in reader.iter_messages()] == [3, 4, 5, 9]


def test_a_chunk_given_up_is_not_in_the_file() -> None:
    stream = BytesIO()
    writer = McapWriter(stream, profile="ros2", library="test", chunk_bytes=10_000)
    channel = writer.add_channel("/a", writer.add_schema("a_msgs/msg/A", "ros2msg", b"uint8 a\n"), {})
    writer.add_message(channel, 0, 7, 0, b"kept")
    assert writer.index_size == 0
    writer.finish_chunk()
    one = writer.index_size
    writer.add_message(channel, 1, 1, 0, b"dropped")
    assert writer.chunk_size > 7 and writer.unfinished == {channel: 1}
    writer.drop_chunk()
    assert writer.chunk_size == 0 and writer.index_size == one > 0
    writer.finish()
    assert [m.data for _, _, m in SeekingReader(BytesIO(stream.getvalue())).iter_messages()] == [b"kept"]


@pytest.mark.parametrize("compression", ["", "lz4", "zstd"])
def test_the_index_says_how_large_a_chunk_is_and_was(compression) -> None:
    stream = BytesIO()
    writer = McapWriter(stream, profile="ros2", library="test", chunk_bytes=3000, compression=compression)
    channel = writer.add_channel("/a", writer.add_schema("a_msgs/msg/A", "ros2msg", b"uint8 a\n"), {})
    for number in range(9):
        writer.add_message(channel, number, number, 0, bytes(999))
    writer.finish()
    content = stream.getvalue()
    summary = SeekingReader(BytesIO(content), validate_crcs=True).get_summary()
    chunks = [r for r in StreamReader(BytesIO(content), emit_chunks=True).records if type(r).__name__ == "Chunk"]
    assert [len(c.data) for c in chunks] == [index.compressed_size for index in summary.chunk_indexes]
    assert [c.uncompressed_size for c in chunks] == [index.uncompressed_size for index in summary.chunk_indexes]
    assert all((c.uncompressed_size == len(c.data)) == (compression == "") for c in chunks)
    assert len(chunks) == 3
    for index in summary.chunk_indexes:
        after = index.chunk_start_offset + index.chunk_length
        assert content[after] == Opcode.MESSAGE_INDEX
        assert content[after + index.message_index_length] in (Opcode.CHUNK, Opcode.DATA_END)
