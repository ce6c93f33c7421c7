"""Bags on a disk that becomes full: real file systems, real errors."""

import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from rosbags.rosbag2 import Reader

from helpers.sources.small_disk import small_disk
from tracker_node.errors import TrackerError
from tracker_node.loaders.bag.message_types import message_type
from tracker_node.loaders.bag.metadata import OfferedQos
from tracker_node.loaders.bag.queue import BagQueue
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.bag.writer import BagWriter

__all__ = ["small_disk"]

STRING = "std_msgs/msg/String"
MB = 2**20


def message(i: int, size: int = 100_000) -> bytes:
    return b"\0\1\0\0" + i.to_bytes(4, "little") + bytes(size)


def record(path: Path, limit: int = 1000, **options) -> tuple[BagQueue, int]:
    """Put messages in until they are not taken; the queue, and how many were put."""
    bag = BagQueue(BagWriter(path), **options)
    bag.add_topic("/a", STRING, OfferedQos(), message_type(STRING))
    for i in range(limit):
        while bag.waiting_bytes > MB and not bag.problem:
            time.sleep(0.001)
        if not bag.put("/a", i, message(i)):
            return bag, i + 1
    return bag, limit


def numbers(path: Path) -> list[int]:
    with Reader(path) as reader:  # of another hand
        return [int.from_bytes(data[4:8], "little") for _, _, data in reader.messages()]


def test_a_full_disk_leaves_a_finished_bag_and_everything_is_accounted_for(small_disk) -> None:
    path = small_disk(12) / "run"
    bag, n_put = record(path)
    with pytest.raises(TrackerError, match=r"run: stopped: No space left on device"):
        bag.close()
    assert bag.written["/a"] + bag.dropped["/a"] == n_put
    assert numbers(path) == list(range(bag.written["/a"]))
    assert bag.written["/a"] * 100_000 > 7 * MB  # four were kept for the end
    assert sorted(file.name for file in path.iterdir()) == ["metadata.yaml", "run_0.mcap"]


def test_what_had_come_before_the_disk_was_full_is_written_to_the_room_kept_for_it(small_disk) -> None:
    disk = small_disk(12)
    with pytest.raises(OSError, match="No space") as refused, BagWriter(disk / "run", chunk_bytes=500_000) as writer:
        writer.add_topic("/a", STRING)
        for i in range(1000):
            taken = i
            writer.write("/a", i, message(i))
    assert refused.value.filename == str(disk / "run")
    assert numbers(disk / "run") == list(range(taken + 1))


def test_what_is_told_again_is_not_counted_on_a_full_disk_either(small_disk) -> None:
    path = small_disk(12) / "run"
    bag = BagQueue(BagWriter(path, split_bytes=MB, repeat_latched=True))
    for topic, durability in (("/map", "transient_local"), ("/a", "volatile")):
        bag.add_topic(topic, STRING, OfferedQos(durability=durability), message_type(STRING))
    bag.put("/map", 0, message(0))
    n_put = 0
    while bag.put("/a", n_put, message(n_put)) and n_put < 1000:
        n_put += 1
        while bag.waiting_bytes > MB and not bag.problem:
            time.sleep(0.001)
    with pytest.raises(TrackerError, match="No space left on device"):
        bag.close()
    assert bag.written["/a"] + bag.dropped["/a"] == n_put + 1 and bag.written["/map"] == 1 and not bag.dropped["/map"]
    with BagReader(path) as reader:
        counts = {name: topic.message_count for name, topic in reader.topics.items()}
    assert counts["/a"] == bag.written["/a"] > 30 and counts["/map"] > 3


def test_a_limit_on_free_room_stops_before_the_disk_is_full(small_disk) -> None:
    """The room is looked at after every message: within a hundredth of a second a quick machine writes all that are left."""
    disk = small_disk(40)
    bag, n_put = record(disk / "run", 300, min_free_bytes=10 * MB, flush_s=0.0)
    assert n_put < 300
    with pytest.raises(TrackerError, match=r"stopped: less than 10 MB are free"):
        bag.close()
    assert bag.written["/a"] + bag.dropped["/a"] == n_put
    assert numbers(disk / "run") == list(range(bag.written["/a"]))
    assert shutil.disk_usage(disk).free > 5 * MB


def test_a_disk_that_others_fill_to_the_last_byte(small_disk) -> None:
    """Not even the index fits: the file ends with its last whole chunk, and is read as far as it goes."""
    disk = small_disk(12)
    writer = BagWriter(disk / "run", chunk_bytes=200_000)
    writer.add_topic("/a", STRING)
    for i in range(10):
        writer.write("/a", i, message(i))
    writer._reserve.release()
    with pytest.raises(OSError, match="No space"), (disk / "theirs").open("wb", buffering=0) as other:
        while True:
            other.write(bytes(4096))
    with pytest.raises(OSError, match="No space"):
        writer.close()
    assert writer.topics["/a"].message_count == 10
    with BagReader(disk / "run") as reader:
        assert reader.recovered
        assert [message.stamp_ns for message in reader.messages()] == list(range(10))


LIMITED = """
import resource, sys
from tracker_node.loaders.bag.writer import BagWriter
resource.setrlimit(resource.RLIMIT_FSIZE, (5_000_000, 5_000_000))
writer = BagWriter(sys.argv[1], chunk_bytes=300_000)
writer.add_topic("/a", "std_msgs/msg/String")
try:
    for i in range(100):
        writer.write("/a", i, bytes([0, 1, 0, 0]) + bytes(100_000))
except OSError as error:
    print(error.strerror)
try:
    writer.close()
except OSError as error:
    print(error.strerror)
print(writer.topics["/a"].message_count)
"""


def test_a_limit_on_the_size_of_files(tmp_path: Path) -> None:
    """The same as a full disk, but giving room back does not help."""
    if resource.getrlimit(resource.RLIMIT_FSIZE)[1] not in (-1, resource.RLIM_INFINITY):
        pytest.skip("the size of files is limited here already")
    command = [sys.executable, "-c", LIMITED, str(tmp_path / "run")]
    output = subprocess.run(command, check=True, capture_output=True, text=True, timeout=60).stdout.splitlines()
    assert output[0] == "File too large"
    with BagReader(tmp_path / "run") as reader:
        assert reader.message_count == int(output[-1]) > 45


def test_no_room_at_all_is_one_message(small_disk) -> None:
    disk = small_disk(1)
    with pytest.raises(TrackerError, match=r"output '.*run' cannot be written: No space left on device"):
        BagWriter(disk / "run")
    assert list(disk.iterdir()) == []
