"""One file of a bag: what stands in it, how large it is, and room on the disk for its end."""

import os
import threading
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader

from tracker_node import __version__
from tracker_node.loaders.bag import file as bag_file
from tracker_node.loaders.bag.file import BagFile, DiskReserve, LatchedMessages, WrittenPages
from tracker_node.loaders.bag.message_types import typestore
from tracker_node.loaders.bag.metadata import BagTopic, OfferedQos, TimeSpan
from tracker_node.loaders.bag.writer import BagWriter

MESSAGE_HEAD = 1 + 8 + 2 + 4 + 8 + 8  # opcode, length, channel, sequence, two stamps


def topic(name: str, kind: str = "std_msgs/msg/String", definition: str = "string data") -> BagTopic:
    return BagTopic(name, kind, "RIHS01_ab", OfferedQos(depth=3), definition=definition)


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


MB = 2**20


@pytest.fixture
def advised(monkeypatch):
    """(descriptor, start, end, advice) of what the system was told."""
    calls = []

    def advise(descriptor, start, length, advice):
        os.fstat(descriptor)  # it is open
        calls.append((descriptor, start, start + length, advice))

    monkeypatch.setattr(os, "posix_fadvise", advise)
    monkeypatch.setattr(bag_file, "KEPT_BYTES", 4 * MB)
    monkeypatch.setattr(bag_file, "_AGAIN_BYTES", 8 * MB)
    return calls


def grow(file, sizes):
    """Threads that were at it, ended."""
    pages = WrittenPages(file.fileno())
    for size in sizes:
        pages.grown(size)
    threads = at_it()
    file.close()
    pages.close()
    wait_for(threads)
    return threads


def at_it():
    return [thread for thread in threading.enumerate() if thread.name == "forget pages"]


def wait_for(threads):
    for thread in threads:
        thread.join(timeout=30.0)
        assert not thread.is_alive()


def test_all_but_the_end_is_forgotten_and_some_of_it_looked_at_again(tmp_path, advised):
    assert len(grow((tmp_path / "bag").open("wb"), [3 * MB, 6 * MB, 20 * MB, 21 * MB])) == 1
    assert [(start, end) for _, start, end, _ in advised] == [(0, 2 * MB), (0, 16 * MB), (8 * MB, 17 * MB)]
    assert {advice for *_, advice in advised} == {os.POSIX_FADV_DONTNEED}
    with pytest.raises(OSError):
        os.fstat(advised[0][0])  # closed again


def test_a_small_file_needs_no_thread(tmp_path, advised):
    assert not grow((tmp_path / "bag").open("wb"), [1 * MB, 4 * MB])
    assert not advised


def test_a_system_that_does_not_forget_is_no_error(tmp_path, advised, monkeypatch):
    def refuse(*_):
        advised.append(_)
        raise OSError

    monkeypatch.setattr(os, "posix_fadvise", refuse)
    grow((tmp_path / "bag").open("wb"), [20 * MB, 30 * MB])
    assert len(advised) == 2
    monkeypatch.delattr(os, "posix_fadvise")
    assert not grow((tmp_path / "bag").open("ab"), [20 * MB])


def test_of_a_bag_what_has_been_flushed_is_forgotten(tmp_path, advised):
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic("/camera", "sensor_msgs/msg/Image")
        for stamp in range(1, 4):
            bag.write("/camera", stamp, bytes(3 * MB))
        assert not at_it()
        bag.flush()
        size, threads = bag.bytes_written, at_it()
    wait_for(threads)
    assert [(start, end) for _, start, end, _ in advised] == [(0, size - 4 * MB)]


LATCHED = OfferedQos(durability="transient_local")
TRANSFORMS = "tf2_msgs/msg/TFMessage"


def latched_topic(name, kind="std_msgs/msg/String", qos=LATCHED):
    return BagTopic(name, kind, "", qos)


def transforms(*frames, x=0.0):
    types = typestore().types
    stamp = types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    listed = [
        types["geometry_msgs/msg/TransformStamped"](
            header=types["std_msgs/msg/Header"](stamp=stamp, frame_id="world"), child_frame_id=frame,
            transform=types["geometry_msgs/msg/Transform"](
                translation=types["geometry_msgs/msg/Vector3"](x=x, y=0.0, z=0.0),
                rotation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
            ),
        )
        for frame in frames
    ]  # fmt: skip
    return bytes(typestore().serialize_cdr(types[TRANSFORMS](transforms=listed), TRANSFORMS))


def frames_of(data):
    said = typestore().deserialize_cdr(data, TRANSFORMS)
    return {one.child_frame_id: one.transform.translation.x for one in said.transforms}


def test_the_last_message_is_told_once_in_each_file():
    kept = LatchedMessages(True)
    kept.keep(latched_topic("/a"), 1, b"old")
    kept.keep(latched_topic("/a"), 2, b"new")
    assert kept.take("/b") == []  # the file in which it was said
    for _ in range(2):
        kept.begin_file()
        assert kept.repeated == set()
        assert kept.take("/b") == [("/a", 2, b"new")]
        assert kept.repeated == {"/a"}
        assert kept.take("/b") == []


def test_a_topic_that_speaks_first_itself_is_not_told_before():
    kept = LatchedMessages(True)
    kept.keep(latched_topic("/a"), 1, b"a")
    kept.keep(latched_topic("/b"), 2, b"b")
    kept.begin_file()
    assert kept.take("/a") == [("/b", 2, b"b")]
    assert kept.repeated == {"/b"}


def test_what_is_not_latched_or_not_wanted_is_not_kept():
    for kept, qos in ((LatchedMessages(True), OfferedQos()), (LatchedMessages(False), LATCHED)):
        kept.keep(latched_topic("/a", qos=qos), 1, b"a")
        kept.begin_file()
        assert kept.take("/b") == []


def test_transforms_of_all_frames_are_told_together_the_latest_of_each():
    kept, tf = LatchedMessages(True), latched_topic("/tf_static", TRANSFORMS)
    kept.keep(tf, 1, transforms("left", "right", x=1.0))
    kept.keep(tf, 2, transforms("right", x=2.0))
    kept.keep(latched_topic("/tf_other", TRANSFORMS), 3, transforms("elsewhere"))
    kept.begin_file()
    told = {name: (stamp, frames_of(data)) for name, stamp, data in kept.take("/tf_static")}  # even before its own message
    assert told == {"/tf_static": (2, {"left": 1.0, "right": 2.0}), "/tf_other": (3, {"elsewhere": 0.0})}


def test_transforms_that_cannot_be_read_are_told_as_they_are():
    kept = LatchedMessages(True)
    kept.keep(latched_topic("/tf_static", TRANSFORMS), 1, b"\x00\x01")
    kept.begin_file()
    assert kept.take("/a") == [("/tf_static", 1, b"\x00\x01")]
    kept.begin_file()
    assert kept.take("/tf_static") == []
