"""One file of a bag: what stands in it, how large it is, and room on the disk for its end."""

from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader

from tracker_node import __version__
from tracker_node.loaders.bag.file import BagFile, DiskReserve
from tracker_node.loaders.bag.metadata import OfferedQos, TimeSpan, TopicRecord

MESSAGE_HEAD = 1 + 8 + 2 + 4 + 8 + 8  # opcode, length, channel, sequence, two stamps


def topic(name: str, kind: str = "std_msgs/msg/String", definition: str = "string data") -> TopicRecord:
    return TopicRecord(name, kind, "RIHS01_ab", OfferedQos(depth=3), definition=definition)


@pytest.fixture
def file(tmp_path: Path) -> BagFile:
    made = BagFile(tmp_path / "a.mcap", chunk_bytes=5000, compression="")
    made.add_topic(topic("/one"))
    made.add_topic(topic("/two"))
    made.add_topic(topic("/three", "a_msgs/msg/Own", ""))
    yield made
    made.close()


def test_the_size_has_what_is_not_written_yet(file):
    before, on_disk = file.size, file.path.stat().st_size
    file.write("/one", 1, 50, 40, b"x" * 100)
    assert file.size == before + MESSAGE_HEAD + 100
    assert file.path.stat().st_size == on_disk and file.index_size == 0
    file.finish_chunk()
    assert file.size == file.path.stat().st_size > before + MESSAGE_HEAD + 100
    assert file.index_size > 0


def test_what_is_in_the_file_by_time_and_topic(file):
    assert file.span == TimeSpan(0, 0, 0) and file.age_ns(99) == 0
    for name, stamp in (("/one", 50), ("/two", 30), ("/one", 80)):
        file.write(name, 1, stamp, stamp, b"x")
    assert file.span.count == 0 and file.counts == {"/one": 0, "/two": 0, "/three": 0}
    file.finish_chunk()
    assert file.span == TimeSpan(30, 80, 3) and file.counts == {"/one": 2, "/two": 1, "/three": 0}
    assert file.age_ns(75) == 25 and file.age_ns(50) == 0  # counts from the first that came
    file.write("/one", 1, 90, 90, b"x")
    file.drop_chunk()
    file.finish_chunk()
    assert file.span == TimeSpan(30, 80, 3)


def test_it_reads_back(file):
    file.write("/one", 7, 50, 40, b"abc")
    assert not file.finished
    file.finish({"version": 9, "files": []})
    assert file.finished
    size = file.path.stat().st_size
    file.finish({"version": 9})  # nothing more
    assert file.path.stat().st_size == size == file.size
    with file.path.open("rb") as stream:
        reader = make_reader(stream)
        header, summary = reader.get_header(), reader.get_summary()
        messages = list(reader.iter_messages())
        metadata = list(reader.iter_metadata())
    assert (header.profile, header.library) == ("ros2", f"tracker_node {__version__}")
    assert [(schema.name, schema.encoding, schema.data) for schema in summary.schemas.values()] == [
        ("std_msgs/msg/String", "ros2msg", b"string data"), ("a_msgs/msg/Own", "", b""),
    ]  # fmt: skip
    channels = list(summary.channels.values())
    assert [(channel.topic, channel.schema_id) for channel in channels] == [("/one", 1), ("/two", 1), ("/three", 2)]
    assert channels[0].metadata["topic_type_hash"] == "RIHS01_ab"
    assert yaml.safe_load(channels[0].metadata["offered_qos_profiles"])[0]["depth"] == 3
    (read,) = messages
    assert (read[1].topic, read[2].sequence, read[2].log_time, read[2].publish_time) == ("/one", 7, 50, 40)
    assert read[2].data == b"abc"
    (described,) = metadata
    assert described.name == "rosbag2"
    assert list(yaml.safe_load(described.metadata["serialized_metadata"]).items()) == [("version", 9), ("files", [])]


def test_a_file_that_is_there_stays_as_it_is(tmp_path):
    (tmp_path / "a.mcap").write_bytes(b"mine")
    with pytest.raises(FileExistsError):
        BagFile(tmp_path / "a.mcap", chunk_bytes=1000, compression="")
    assert (tmp_path / "a.mcap").read_bytes() == b"mine"


def test_compression_is_as_asked(tmp_path):
    file = BagFile(tmp_path / "a.mcap", chunk_bytes=10, compression="lz4")
    file.add_topic(topic("/one"))
    file.write("/one", 1, 5, 5, b"x" * 5000)  # a chunk is full with this one
    assert file.span.count == 1 and file.path.stat().st_size < 1000
    file.sync()
    file.sync()
    file.forget()
    file.finish({})
    with file.path.open("rb") as stream:
        assert [index.compression for index in make_reader(stream).get_summary().chunk_indexes] == ["lz4"]


def test_closed_as_it_is_it_has_no_index(file):
    file.write("/one", 1, 5, 5, b"x")
    file.finish_chunk()
    size = file.path.stat().st_size
    file.close()
    assert file.finished and file.path.stat().st_size == size
    file.finish({"version": 9})
    assert file.path.stat().st_size == size


def test_room_is_held_and_given_back_once(tmp_path):
    path = tmp_path / "reserve"
    reserve = DiskReserve(path)
    assert reserve.size == 0 and not path.exists() and reserve.release() is False
    reserve.grow(5000)
    assert reserve.size == 5000 and path.stat().st_size == 5000 and path.stat().st_mode & 0o777 == 0o644
    assert path.read_bytes() == bytes(5000)
    reserve.grow(8000)
    assert reserve.size == 8000 and path.stat().st_size == 8000
    assert reserve.release() is True
    assert reserve.size == 0 and not path.exists()
    assert reserve.release() is False
    reserve.grow(1)
    path.unlink()  # somebody else's doing
    assert reserve.release() is True
    with pytest.raises(OSError):
        DiskReserve(tmp_path / "no such folder/reserve").grow(10)
