"""Files that the mcap library reads with all its checks on."""

from io import BytesIO

from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.reader import NonSeekingReader, SeekingReader
from mcap.stream_reader import StreamReader

from tracker_node.loaders.mcap_writer import McapWriter

MESSAGES = st.lists(st.tuples(st.integers(1, 3), st.integers(0, 2**60), st.binary(max_size=80)), max_size=40)


def written(messages: list[tuple[int, int, bytes]], chunk_bytes: int) -> bytes:
    stream = BytesIO()
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
