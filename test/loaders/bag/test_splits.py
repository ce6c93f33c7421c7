"""Bags of several files, and compressed ones."""

import random
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from helpers.sources import bag_samples
from tracker_node.errors import UnknownNameError
from tracker_node.loaders.bag.check import check_bag
from tracker_node.loaders.bag.message_types import message_type, typestore
from tracker_node.loaders.bag.metadata import OfferedQos
from tracker_node.loaders.bag.queue import BagQueue
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.bag.writer import BagWriter

PERIOD_NS = bag_samples.PERIOD_NS


def information(bag: Path) -> dict:
    return yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]


def stamps_of_the_mcap_library(file: Path) -> list[int]:
    with file.open("rb") as stream:
        return [message.log_time for _, _, message in make_reader(stream, validate_crcs=True).iter_messages()]


@pytest.mark.parametrize("split", [{"split_ns": 5 * PERIOD_NS}, {"split_bytes": 60_000}])
def test_all_files_are_listed_and_read_by_all(tmp_path: Path, split: dict) -> None:
    bag = bag_samples.write_bag(tmp_path / "run", 60, chunk_bytes=20_000, **split)
    told = information(bag)
    names = [f"run_{i}.mcap" for i in range(len(told["files"]))]
    assert len(names) > 10  # so that the order of numbers is not that of letters
    assert told["relative_file_paths"] == [entry["path"] for entry in told["files"]] == names
    stamps = []
    for entry in told["files"]:
        found = stamps_of_the_mcap_library(bag / entry["path"])
        assert entry["message_count"] == len(found)
        assert entry["starting_time"]["nanoseconds_since_epoch"] == found[0]
        assert entry["duration"]["nanoseconds"] == found[-1] - found[0]
        stamps += found
    assert told["message_count"] == len(stamps) == 180
    assert {topic["message_count"] for topic in told["topics_with_message_count"]} == {60}
    with AnyReader([bag]) as theirs, BagReader(bag) as ours:
        assert [stamp for _, stamp, _ in theirs.messages()] == stamps == sorted(stamps)
        assert [message.stamp_ns for message in ours.messages()] == stamps
    (bag / "metadata.yaml").unlink()
    with BagReader(bag) as ours:
        assert ours.recovered
        assert [message.stamp_ns for message in ours.messages()] == stamps


def test_files_are_as_long_as_asked_for(tmp_path: Path) -> None:
    bag = bag_samples.write_bag(tmp_path / "time", 20, split_ns=4 * PERIOD_NS)
    assert [entry["message_count"] for entry in information(bag)["files"]] == [12, 12, 12, 12, 12]
    bag = bag_samples.write_bag(tmp_path / "size", 30, split_bytes=100_000)
    sizes = [(bag / entry["path"]).stat().st_size for entry in information(bag)["files"]]
    assert all(100_000 <= size < 125_000 for size in sizes[:-1])


def test_a_split_on_request_keeps_every_message(tmp_path: Path) -> None:
    bag = BagQueue(BagWriter(tmp_path / "run"))
    bag.add_topic("/a", "std_msgs/msg/String", OfferedQos(), message_type("std_msgs/msg/String"))
    for i in range(30):
        bag.put("/a", i, bytes([0, 1, 0, 0, i]))
        if i == 9:
            bag.split()
    bag.close()
    assert [entry["message_count"] for entry in information(tmp_path / "run")["files"]] == [10, 20]
    with BagReader(tmp_path / "run") as reader:
        assert [message.data[4] for message in reader.messages()] == list(range(30))


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
def test_compressed_chunks_are_smaller_and_read_by_all(tmp_path: Path, compression: str) -> None:
    def write(path: Path, how: str) -> Path:
        with BagWriter(path, compression=how, chunk_bytes=20_000) as writer:
            for i in range(200):
                writer.write_message("/a", i, bag_samples.text(f"message {i} " * 50))
        return path / f"{path.name}_0.mcap"

    file = write(tmp_path / "run", compression)
    assert file.stat().st_size < 0.5 * write(tmp_path / "plain", "none").stat().st_size
    assert stamps_of_the_mcap_library(file) == list(range(200))
    with AnyReader([tmp_path / "run"]) as theirs, BagReader(tmp_path / "run") as ours:
        assert [data for _, _, data in theirs.messages()] == [message.data for message in ours.messages()]
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2])
    with BagReader(tmp_path / "run") as ours:
        assert ours.recovered
        texts = [message.data for _, message in ours.decoded("/a")]
    assert texts == [f"message {i} " * 50 for i in range(len(texts))]
    assert 60 < len(texts) < 199


def test_an_unknown_compression_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="valid: lz4, none, zstd"):
        BagWriter(tmp_path / "run", compression="zip")
    assert not (tmp_path / "run").exists()


RECORDING = """
import sys, time
from tracker_node.loaders.bag.metadata import OfferedQos
from tracker_node.loaders.bag.queue import BagQueue
from tracker_node.loaders.bag.writer import BagWriter
from tracker_node.loaders.bag.message_types import message_type
bag = BagQueue(BagWriter(sys.argv[1], split_bytes=3_000_000, compression=sys.argv[2]), flush_s=0.05)
for topic in ("/a", "/b"):
    bag.add_topic(topic, "std_msgs/msg/String", OfferedQos(), message_type("std_msgs/msg/String"))
for i in range(10**9):
    for topic in ("/a", "/b"):
        bag.put(topic, time.time_ns(), bytes([0, 1, 0, 0]) + i.to_bytes(4, "little") + bytes(50_000))
    time.sleep(0.001)
"""


@pytest.mark.parametrize(("compression", "megabytes"), [("none", 1), ("none", 10), ("zstd", 0.02)])
def test_a_process_killed_while_it_writes_leaves_all_but_the_last_moment(
    tmp_path: Path, compression: str, megabytes: float
) -> None:
    """Whatever the file was in the middle of: messages are there from the first to some last one, without a gap."""
    process = subprocess.Popen([sys.executable, "-c", RECORDING, str(tmp_path / "run"), compression])
    deadline = time.monotonic() + 60.0
    while sum(file.stat().st_size for file in (tmp_path / "run").glob("*.mcap")) < megabytes * 1e6:
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.005)
    process.kill()
    process.wait()
    found: dict[str, list[int]] = {"/a": [], "/b": []}
    with BagReader(tmp_path / "run") as reader:
        assert reader.recovered
        for message in reader.messages():
            found[message.topic].append(int.from_bytes(message.data[4:8], "little"))
    for numbers in found.values():
        assert numbers == list(range(len(numbers)))
    assert len(found["/b"]) <= len(found["/a"]) <= len(found["/b"]) + 1
    assert len(found["/a"]) > 5 * megabytes


def write_latched(path: Path, **options) -> BagWriter:
    """A hundred messages in files of twenty; of two latched topics one speaks again in the third file."""
    with BagWriter(path, split_ns=20 * PERIOD_NS, repeat_latched=True, **options) as writer:
        for topic, durability in (("/a", "volatile"), ("/model", "transient_local"), ("/map", "transient_local")):
            writer.add_topic(topic, "std_msgs/msg/String", OfferedQos(durability=durability, depth=1))
        said = {("/map", 3): "map", ("/model", 5): "old model", ("/model", 50): "new model"}
        for i in range(100):
            for (topic, at), content in said.items():
                if at == i:
                    writer.write_message(topic, i * PERIOD_NS, bag_samples.text(content))
            writer.write_message("/a", i * PERIOD_NS, bag_samples.text(f"a{i}"))
    return writer


@pytest.mark.parametrize("compression", ["none", "zstd"])
def test_every_file_begins_with_what_latched_topics_said_last(tmp_path: Path, compression: str) -> None:
    writer = write_latched(tmp_path / "run", compression=compression)
    for i, model in enumerate(["old model", "old model", "old model", "new model", "new model"]):
        with (tmp_path / "run" / f"run_{i}.mcap").open("rb") as stream:
            found = [(c.topic, m) for _, c, m in make_reader(stream, validate_crcs=True).iter_messages()]
        if i == 0:
            assert [topic for topic, _ in found].count("/map") == [topic for topic, _ in found].count("/model") == 1
            continue
        begin = dict(found[:3])
        assert set(begin) == {"/map", "/model", "/a"} and model.encode() in begin["/model"].data
        assert begin["/map"].log_time == begin["/model"].log_time == begin["/a"].log_time == 20 * i * PERIOD_NS
        assert begin["/map"].publish_time == 3 * PERIOD_NS
        with BagReader(tmp_path / "run" / f"run_{i}.mcap") as alone:
            assert next(message for _, message in alone.decoded("/model")).data == model
    assert writer.repeated == {"/map": 4, "/model": 4}
    check = check_bag(tmp_path / "run")
    assert check.problems == check.notes == []
    counts = {each.topic.name: each.count for each in check.topics}
    assert counts == {"/a": 100, "/map": 5, "/model": 6} and information(tmp_path / "run")["message_count"] == 111


def test_the_rest_of_a_bag_is_the_same_with_what_is_told_again(tmp_path: Path) -> None:
    write_latched(tmp_path / "run")
    with AnyReader([tmp_path / "run"]) as theirs, BagReader(tmp_path / "run") as ours:
        texts = [theirs.deserialize(data, c.msgtype).data for c, _, data in theirs.messages() if c.topic == "/a"]
        models = [message.data for _, message in ours.decoded("/model")]
    assert texts == [f"a{i}" for i in range(100)]
    assert models == ["old model"] * 3 + ["new model"] * 3  # so whoever keeps the last has the right one


def test_a_message_that_comes_first_in_its_file_takes_the_place_of_the_last_one(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run", repeat_latched=True) as writer:
        writer.add_topic("/model", "std_msgs/msg/String", OfferedQos(durability="transient_local", depth=1))
        writer.write_message("/model", 1, bag_samples.text("old"))
        writer.split()
        writer.split()
        writer.write_message("/model", 2, bag_samples.text("new"))
    assert [entry["message_count"] for entry in information(tmp_path / "run")["files"]] == [1, 0, 1]


def test_large_latched_messages_do_not_fill_every_file(tmp_path: Path) -> None:
    """Their size does not count for where a file ends, or each would end after one message."""
    with BagWriter(tmp_path / "run", split_bytes=10_000, repeat_latched=True) as writer:
        writer.add_topic("/map", "std_msgs/msg/String", OfferedQos(durability="transient_local", depth=1))
        writer.write_message("/map", 0, bag_samples.text("m" * 20_000))
        for i in range(100):
            writer.write_message("/a", i, bag_samples.text("a" * 500))
    counts = [entry["message_count"] for entry in information(tmp_path / "run")["files"]]
    assert counts[0] == 1 and 3 < len(counts) < 12 and all(count > 10 for count in counts[1:-1])


def test_repeated_messages_count_as_small_as_they_are_in_the_file(tmp_path: Path) -> None:
    """A file is not longer by what compression has taken off them."""
    noise = random.Random(1)
    options = {"split_bytes": 30_000, "compression": "zstd", "chunk_bytes": 1000}
    with BagWriter(tmp_path / "run", repeat_latched=True, **options) as writer:
        writer.add_topic("/map", "std_msgs/msg/String", OfferedQos(durability="transient_local", depth=1))
        writer.write_message("/map", 0, bag_samples.text("m" * 200_000))  # a few bytes, compressed
        for i in range(150):
            writer.write_message("/a", i, bag_samples.text(noise.randbytes(500).hex()))
    sizes = [(tmp_path / "run" / entry["path"]).stat().st_size for entry in information(tmp_path / "run")["files"]]
    assert len(sizes) > 2 and max(sizes) < 45_000


def transforms(**frames: float) -> Any:
    """A message of fixed transforms, by the child frame and its x."""
    types = typestore().types
    header = types["std_msgs/msg/Header"](stamp=types["builtin_interfaces/msg/Time"](sec=0, nanosec=0), frame_id="world")
    still = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    return types["tf2_msgs/msg/TFMessage"](
        transforms=[
            types["geometry_msgs/msg/TransformStamped"](
                header=header,
                child_frame_id=child,
                transform=types["geometry_msgs/msg/Transform"](
                    translation=types["geometry_msgs/msg/Vector3"](x=x, y=0.0, z=0.0), rotation=still
                ),
            )
            for child, x in frames.items()
        ]
    )


@pytest.mark.parametrize("first", ["/a", "/tf_static"])
def test_transforms_of_all_publishers_are_told_again(tmp_path: Path, first: str) -> None:
    """The tracker tells the cameras' frames, robot_state_publisher those of fixed joints, and both only once."""
    with BagWriter(tmp_path / "run", repeat_latched=True) as writer:
        writer.add_topic("/tf_static", "tf2_msgs/msg/TFMessage", OfferedQos(durability="transient_local", depth=1))
        writer.write_message("/tf_static", 1, transforms(cam1=1.0, cam2=2.0))
        writer.write_message("/tf_static", 2, transforms(tool=3.0))
        writer.write("/tf_static", 3, bytes([0, 1, 0, 0, 9, 9, 9, 9]))  # not to be read, and no reason to stop
        writer.write_message("/tf_static", 4, transforms(cam1=5.0))
        writer.split()
        writer.write_message(first, 6, transforms(late=7.0) if first == "/tf_static" else bag_samples.text("a"))
    assert writer.repeated == {"/tf_static": 1}
    with BagReader(tmp_path / "run" / "run_1.mcap") as alone:
        stamp_ns, message = next(alone.decoded("/tf_static"))
    told = {each.child_frame_id: each.transform.translation.x for each in message.transforms}
    assert stamp_ns == 6 and told == {"cam1": 5.0, "cam2": 2.0, "tool": 3.0}


def test_a_queue_counts_every_message_once(tmp_path: Path) -> None:
    bag = BagQueue(BagWriter(tmp_path / "run", repeat_latched=True))
    for topic, durability in (("/a", "volatile"), ("/map", "transient_local")):
        qos = OfferedQos(durability=durability)
        bag.add_topic(topic, "std_msgs/msg/String", qos, message_type("std_msgs/msg/String"))
        bag.put(topic, 0, bytes([0, 1, 0, 0, 7]))
    for i in range(1, 4):
        bag.split()
        bag.put("/a", i, bytes([0, 1, 0, 0, i]))
    bag.close()
    assert bag.written == {"/a": 4, "/map": 1} and not bag.dropped.total()
    with BagReader(tmp_path / "run") as reader:
        assert reader.topic("/map").message_count == 4
