"""The bag that a thread writes: nothing waits, nothing is lost in silence."""

import shutil
import threading
import time
from pathlib import Path

import pytest

from tracker_node.errors import TrackerError
from tracker_node.loaders.bag.message_types import message_type
from tracker_node.loaders.bag.metadata import OfferedQos
from tracker_node.loaders.bag.queue import FLUSH_S, BagQueue
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.bag.writer import BagWriter

STRING = "std_msgs/msg/String"


class SlowWriter(BagWriter):
    """A disk that stands still until it is released."""

    def __init__(self, path: Path):
        super().__init__(path)
        self.released = threading.Event()

    def write(self, *arguments) -> None:
        assert self.released.wait(20.0)
        super().write(*arguments)


class FullDisk(BagWriter):
    def write(self, *arguments) -> None:
        raise OSError(28, "No space left on device")


def queue_of(writer: BagWriter, **options) -> BagQueue:
    bag = BagQueue(writer, **options)
    bag.add_topic("/a", STRING, OfferedQos(), message_type(STRING))
    return bag


def test_everything_put_in_is_in_the_bag(tmp_path: Path) -> None:
    bag = queue_of(BagWriter(tmp_path / "run"))
    messages = [bytes([0, 1, 0, 0, i]) for i in range(200)]
    assert all(bag.put("/a", i, data) for i, data in enumerate(messages))
    bag.close()
    with BagReader(tmp_path / "run") as reader:
        assert [message.data for message in reader.messages()] == messages
    assert (bag.written["/a"], bag.dropped["/a"], bag.waiting_bytes) == (200, 0, 0)


def test_what_does_not_fit_is_counted_and_does_not_block(tmp_path: Path) -> None:
    writer = SlowWriter(tmp_path / "run")
    bag = queue_of(writer, limit_bytes=5000)
    began = time.monotonic()
    taken = sum(bag.put("/a", i, bytes(1000)) for i in range(50))
    assert time.monotonic() - began < 5.0
    assert 5 <= taken <= 6
    assert bag.dropped["/a"] == 50 - taken
    writer.released.set()
    bag.close()
    assert bag.written["/a"] == taken


def test_one_message_larger_than_the_limit_is_still_taken(tmp_path: Path) -> None:
    bag = queue_of(BagWriter(tmp_path / "run"), limit_bytes=10)
    assert bag.put("/a", 0, bytes(1000))
    bag.close()


def test_old_messages_are_on_disk_before_the_bag_is_closed(tmp_path: Path) -> None:
    bag = queue_of(BagWriter(tmp_path / "run"))
    bag.put("/a", 1, bytes([0, 1, 0, 0]))
    (file,) = (tmp_path / "run").glob("*.mcap")
    deadline = time.monotonic() + 20 * FLUSH_S
    while file.stat().st_size < 200 and time.monotonic() < deadline:
        time.sleep(0.02)
    with BagReader(tmp_path / "run") as reader:
        assert reader.message_count == 1
    bag.close()


def test_what_a_kill_would_cost_is_known(tmp_path: Path) -> None:
    writer = SlowWriter(tmp_path / "run")
    bag = queue_of(writer, flush_s=0.05)
    assert bag.unsaved_s == 0.0
    bag.put("/a", 0, bytes(1000))
    time.sleep(0.3)
    assert bag.unsaved_s > 0.25
    writer.released.set()
    deadline = time.monotonic() + 10.0
    while bag.unsaved_s and time.monotonic() < deadline:
        time.sleep(0.01)
    assert bag.unsaved_s == 0.0
    assert bag.size > 1000
    bag.close()


def test_everything_is_synced_if_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[int] = []
    monkeypatch.setattr("os.fdatasync", synced.append)
    bag = queue_of(BagWriter(tmp_path / "run"), flush_s=0.01, to_disk=True)
    bag.put("/a", 0, bytes(1000))
    deadline = time.monotonic() + 10.0
    while not synced and time.monotonic() < deadline:
        time.sleep(0.01)
    bag.close()
    assert synced


def test_a_bag_whose_folder_is_removed_says_so(tmp_path: Path) -> None:
    bag = queue_of(BagWriter(tmp_path / "run"), flush_s=0.01)
    shutil.rmtree(tmp_path / "run")
    deadline = time.monotonic() + 10.0
    while not bag.problem and time.monotonic() < deadline:
        time.sleep(0.01)
    with pytest.raises(TrackerError, match="stopped: its folder has been removed"):
        bag.close()
    assert not (tmp_path / "run").exists()


def test_a_full_disk_is_reported(tmp_path: Path) -> None:
    bag = queue_of(FullDisk(tmp_path / "run"))
    bag.put("/a", 1, b"\0\1\0\0")
    with pytest.raises(TrackerError, match=r"run.*No space left on device"):
        bag.close()
    assert not bag.put("/a", 2, b"\0\1\0\0")
    assert (tmp_path / "run/metadata.yaml").exists()


def test_messages_come_after_their_topic(tmp_path: Path) -> None:
    bag = queue_of(BagWriter(tmp_path / "run"))
    with pytest.raises(ValueError, match="/b"):
        bag.put("/b", 0, b"")
    bag.close()
    bag.close()
