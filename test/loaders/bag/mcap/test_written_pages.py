"""What has been written is forgotten but for its end, and in a thread that ends with the file."""

import os
import threading

import pytest

from tracker_node.loaders.bag.mcap import written_pages
from tracker_node.loaders.bag.mcap.written_pages import WrittenPages
from tracker_node.loaders.bag.writer import BagWriter

MB = 2**20


@pytest.fixture
def advised(monkeypatch):
    """(descriptor, start, end, advice) of what the system was told."""
    calls = []

    def advise(descriptor, start, length, advice):
        os.fstat(descriptor)  # it is open
        calls.append((descriptor, start, start + length, advice))

    monkeypatch.setattr(os, "posix_fadvise", advise)
    monkeypatch.setattr(written_pages, "KEPT_BYTES", 4 * MB)
    monkeypatch.setattr(written_pages, "_AGAIN_BYTES", 8 * MB)
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
