"""Accounts of one file of a bag."""

import struct
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode

from tracker_node.errors import FileFormatError
from tracker_node.loaders.bag.file import BagFile
from tracker_node.loaders.bag.mcap_recovery import (
    MAGIC,
    FileContents,
    RawMessage,
    one_text,
    scan,
    survey,
    unpacked,
    unpacked_zstd,
)
from tracker_node.loaders.bag.mcap_writer import McapWriter
from tracker_node.loaders.bag.metadata import BagTopic, OfferedQos


def message(channel, stamp_ns, publish_ns=0):
    return RawMessage(channel, stamp_ns, publish_ns, b"")


def test_messages_are_counted_by_channel_and_span_time():
    contents = FileContents()
    for channel, stamp_ns in ((3, 50), (3, 40), (1, 70), (3, 60)):
        contents.count(message(channel, stamp_ns, 1000))
    assert contents.counts == {3: 3, 1: 1}
    assert contents.message_count == 4
    assert (contents.start_ns, contents.end_ns) == (40, 70)


@pytest.mark.parametrize("stamp_ns", [-5, 0, 5])
def test_the_span_of_one_message(stamp_ns):
    contents = FileContents()
    contents.count(message(1, stamp_ns))
    assert (contents.start_ns, contents.end_ns) == (stamp_ns, stamp_ns)


@pytest.mark.parametrize(
    ("problems", "text"),
    [
        ([], ""),
        (["a"], "a"),
        (["a", "b", "a"], "a; b"),
        (["a", "b", "c", "d"], "a; b; c; d"),
        (["a", "b", "c", "d", "e"], "a; b; c; d; and 1 more"),
        (["a", "b", "c", "d", "e", "f", "a"], "a; b; c; d; and 2 more"),
    ],
)
def test_problems_as_one_text(problems, text):
    assert one_text(problems) == text
    assert FileContents(problems=problems).problem == text


N, SIZE = 6, 40
RECORD = 1 + 8 + 22 + SIZE  # opcode, length, head of a message, data


def written(path: Path, compression: str = "", finish: bool = True) -> list[int]:
    """Six messages in three chunks; where the chunks begin."""
    offsets = []
    with path.open("wb") as stream:
        writer = McapWriter(stream, profile="ros2", library="test", chunk_bytes=10**6, compression=compression)
        channel = writer.add_channel("/a", writer.add_schema("a/msg/A", "ros2msg", b"int8 a"), {"k": "v"})
        for i in range(N):
            writer.add_message(channel, i, 100 + i, 200 + i, bytes([i]) * SIZE)
            if i % 2:
                offsets.append(writer.size)
                writer.finish_chunk()
        if finish:
            writer.finish()
    return offsets


def found(path: Path) -> tuple[list[int], FileContents]:
    contents = FileContents()
    return [message.stamp_ns - 100 for message in scan(path, contents)], contents


def changed(path: Path, at: int, new: bytes) -> None:
    data = bytearray(path.read_bytes())
    data[at : at + len(new)] = new
    path.write_bytes(bytes(data))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "a.mcap"


@pytest.mark.parametrize("compression", ["", "lz4", "zstd"])
def test_a_whole_file(path, compression):
    written(path, compression)
    contents = FileContents()
    messages = list(scan(path, contents))
    assert [(m.channel, m.stamp_ns, m.publish_ns, m.data) for m in messages] == [
        (1, 100 + i, 200 + i, bytes([i]) * SIZE) for i in range(N)
    ]
    assert type(messages[0].data) is bytes
    assert contents.indexed and contents.problems == []
    assert contents.schemas[1].name == "a/msg/A" and contents.channels[1].topic == "/a"


def test_no_mcap_file_and_none(path):
    path.write_bytes(b"\x89MCAP1\r\n" + bytes(100))
    with pytest.raises(FileFormatError, match=r"field '\(start\)': expected the magic bytes of an MCAP file, got 'something"):
        found(path)
    with pytest.raises(FileFormatError, match=r"field '\(file\)': expected a readable MCAP file, got .*No such file"):
        found(path.with_name("b.mcap"))


def test_only_the_start_of_a_file(path):
    path.write_bytes(MAGIC)
    numbers, contents = found(path)
    assert numbers == [] and not contents.indexed
    assert contents.problems == ["the file breaks off between two records, without an index"]


def test_an_unfinished_file_is_read_to_its_end(path):
    written(path, finish=False)
    numbers, contents = found(path)
    assert numbers == list(range(N)) and not contents.indexed
    assert contents.problems == ["the file breaks off between two records, without an index"]


def test_a_chunk_that_breaks_off_is_read_as_far_as_it_goes(path):
    offsets = written(path, finish=False)
    head = 9 + 28 + 4 + 8  # of a chunk without compression; its records follow
    whole = path.read_bytes()
    for extra, wanted in ((2 * RECORD, [0, 1, 2, 3, 4, 5]), (2 * RECORD - 1, [0, 1, 2, 3, 4]), (RECORD - 1, [0, 1, 2, 3])):
        path.write_bytes(whole[: offsets[2] + head + extra])
        numbers, contents = found(path)
        assert numbers == wanted
        said = "without an index" if extra == 2 * RECORD else f"in the middle of a record of {28 + 12 + 2 * RECORD} bytes"
        assert len(contents.problems) == 1 and contents.problems[0].endswith(said)


@pytest.mark.parametrize("more", [0, 3, 9, 40])
def test_a_file_that_grows_meanwhile_is_read_as_far_as_it_was(path, more):
    """Its recorder still writes; when it was opened it ended between two records, or within the head or the body of one."""
    size = written(path, finish=False)[2] + more
    whole = path.read_bytes()
    path.write_bytes(whole[:size])
    contents = FileContents()
    numbers = []
    for message in scan(path, contents):
        numbers.append(message.stamp_ns - 100)
        path.write_bytes(whole)
    assert numbers == [0, 1, 2, 3]
    assert len(contents.problems) == 1 and contents.problems[0].startswith("the file breaks off")


def test_a_compressed_chunk_that_breaks_off_is_left_out(path):
    offsets = written(path, "zstd", finish=False)
    path.write_bytes(path.read_bytes()[: offsets[2] + 60])
    numbers, contents = found(path)
    assert numbers == [0, 1, 2, 3] and len(contents.problems) == 1
    assert contents.problems[0].startswith("the file breaks off in the middle of a record of")


def test_damaged_content_of_a_chunk_is_left_out(path):
    offsets = written(path)
    changed(path, offsets[1] + 9 + 28 + 12 + RECORD - 5, b"!")
    numbers, contents = found(path)
    assert numbers == [0, 1, 4, 5]
    assert contents.problems == [f"the chunk at byte {offsets[1]} is damaged and was left out"]


def test_a_chunk_without_a_checksum_is_read_in_part(path):
    offsets = written(path)
    changed(path, offsets[1] + 9 + 24, bytes(4))
    assert found(path)[0] == list(range(N))
    changed(path, offsets[1] + 9 + 28 + 12 + RECORD + 1, struct.pack("<Q", 22 + SIZE + 1))  # one byte too long
    numbers, contents = found(path)
    assert numbers == [0, 1, 2, 4, 5]
    assert contents.problems == [f"the chunk at byte {offsets[1]} is damaged and was read in part"]


@pytest.mark.parametrize(("at", "new"), [(0, b"\0"), (0, b"\x10"), (1, struct.pack("<Q", 10**9))])
def test_after_a_damaged_record_the_next_chunk_of_the_index_is_read(path, at, new):
    offsets = written(path)
    changed(path, offsets[1] + at, new)
    numbers, contents = found(path)
    assert numbers == [0, 1, 4, 5]
    assert contents.problems == [f"the record at byte {offsets[1]} is damaged and was left out"]
    changed(path, offsets[2] + at, new)
    numbers, contents = found(path)
    assert numbers == [0, 1] and [problem[:19] for problem in contents.problems] == ["the record at byte "] * 2


def test_after_a_damaged_record_nothing_is_read_without_an_index(path):
    offsets = written(path, finish=False)
    changed(path, offsets[1], b"\0")
    numbers, contents = found(path)
    assert numbers == [0, 1] and contents.problems == [f"nothing can be read from byte {offsets[1]} on"]


def test_records_of_other_programs_are_passed_over(path):
    offsets = written(path, finish=False)
    data = path.read_bytes()
    own = b"\x80" + struct.pack("<Q", 3) + b"abc"
    path.write_bytes(data[: offsets[1]] + own + data[offsets[1] :])
    assert found(path)[0] == list(range(N))
    path.write_bytes(data[: offsets[1]] + b"\x7f" + own[1:] + data[offsets[1] :])
    assert found(path)[0] == [0, 1]


def test_a_damaged_index_is_said_and_chunks_are_read_all_the_same(path):
    written(path)
    data = path.read_bytes()
    changed(path, data.rindex(b"a/msg/A"), b"b")  # in the summary
    numbers, contents = found(path)
    assert numbers == list(range(N)) and contents.indexed and contents.problems == ["the index is damaged"]
    path.write_bytes(data[:-12] + bytes(4) + data[-8:])  # a checksum of zero is none
    changed(path, data.rindex(b"a/msg/A"), b"b")
    assert found(path)[1].problems == []


def test_an_index_that_is_none(path):
    written(path)
    data = path.read_bytes()
    for at, new in ((-8, b"x"), (-37, b"\x03"), (-36, b"\x15"), (-28, struct.pack("<Q", len(data))), (-28, bytes(8))):
        path.write_bytes(data)
        changed(path, len(data) + at, new)
        assert not found(path)[1].indexed
    path.write_bytes(data)
    assert found(path)[1].indexed


def test_messages_of_unknown_channels_and_damaged_schemas(path):
    def record(opcode: int, body: bytes) -> bytes:
        return bytes([opcode]) + struct.pack("<Q", len(body)) + body

    def message(channel: int, data: bytes = b"") -> bytes:
        return record(Opcode.MESSAGE, struct.pack("<HIQQ", channel, 0, 100, 200) + data)

    name = struct.pack("<I", 1)
    schema = record(Opcode.SCHEMA, struct.pack("<H", 1) + name + b"A" + name + b"e" + struct.pack("<I", 0))
    channel = record(Opcode.CHANNEL, struct.pack("<HH", 3, 1) + name + b"a" + name + b"c" + struct.pack("<I", 0))
    short = record(Opcode.MESSAGE, bytes(21))
    path.write_bytes(MAGIC + schema + message(3) + channel + message(3) + message(4) + short)
    contents = FileContents()
    (one,) = scan(path, contents)
    assert (one.channel, one.stamp_ns, one.publish_ns, one.data) == (3, 100, 200, b"")
    assert contents.schemas[1].name == "A" and contents.channels[3].topic == "a"
    assert len(contents.problems) == 1
    path.write_bytes(MAGIC + record(Opcode.SCHEMA, b"\1") + channel + message(3))
    contents = FileContents()
    assert len(list(scan(path, contents))) == 1 and contents.problems[0] == "a damaged record was left out"


def test_compressions():
    data = bytes(range(200))
    assert unpacked("", data) is data
    assert unpacked("zstd", zstandard.compress(data)) == unpacked_zstd(zstandard.compress(data)) == data
    assert unpacked("lz4", lz4.frame.compress(data)) == data
    with pytest.raises(ValueError, match="bz2"):
        unpacked("bz2", data)
    with pytest.raises(ValueError, match="too large, or not whole"):
        unpacked("lz4", lz4.frame.compress(data)[:-6])
    large = b"\0" * (5 * 2**20)  # more than a piece
    assert unpacked_zstd(zstandard.compress(large)) == large


@pytest.fixture
def small_bag(tmp_path):
    file = BagFile(tmp_path / "a.mcap", chunk_bytes=1000, compression="")
    for name in ("/a", "/b"):
        file.add_topic(BagTopic(name, "std_msgs/msg/String", "", OfferedQos()))
    for name, stamp in (("/a", 90), ("/b", 50), ("/a", 70)):
        file.write(name, 0, stamp, stamp, name.encode())
    file.finish({})
    return file.path


def test_a_survey_counts_the_messages_of_each_topic(small_bag):
    contents = survey(small_bag)
    assert contents.counts == {1: 2, 2: 1} and contents.message_count == 3
    assert (contents.start_ns, contents.end_ns) == (50, 90)
    assert contents.channels[1].topic == "/a" and contents.problems == []


def test_messages_come_in_the_order_of_the_file_and_topics_go_where_asked(small_bag):
    assert [message.data for message in scan(small_bag)] == [b"/a", b"/b", b"/a"]
    mine = FileContents()
    assert len(list(scan(small_bag, mine))) == 3 and sorted(mine.channels) == [1, 2]


def test_another_kind_of_file_is_refused(small_bag):
    small_bag.write_bytes(b"SQLite format 3\0")
    with pytest.raises(FileFormatError, match="the magic bytes of an MCAP file"):
        survey(small_bag)
