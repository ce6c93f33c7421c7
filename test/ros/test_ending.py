"""A node's process ends on a signal with status 0 whatever it is doing, and its bag is sound."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from helpers.ros.graph import files_in_use, shared_memory_files
from helpers.sources.bag_samples import START_NS, text
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.ros.ending import FINISH, PARENT_VARIABLE

PATIENCE_S = 60.0  # the work below takes longer

# A node whose main thread takes no notice of anything, and one that works until it is told to stop.
BUSY = """
import sys, threading, time
from pathlib import Path
from tracker_node.loaders.bag.metadata import OfferedQos
from tracker_node.loaders.bag.queue import BagQueue
from tracker_node.loaders.bag.writer import BagWriter
from tracker_node.loaders.bag.message_types import message_type
from tracker_node.ros.ending import Ending, hurried
from tracker_node.ros.executor import attach, finished_bag, ros_process

with Ending() as ending:
    bag = BagQueue(BagWriter(Path(sys.argv[2])), flush_s=1000.0)
    with finished_bag(bag):
        bag.add_topic("/chatter", "std_msgs/msg/String", OfferedQos(), message_type("std_msgs/msg/String"))
        bag.put("/chatter", int(sys.argv[3]), bytes.fromhex(sys.argv[4]))
        with ros_process() as stop:
            if sys.argv[1] == "deaf":
                from rclpy.node import Node
                attach(Node("deaf"))
            print("ready", flush=True)
            if sys.argv[1] == "deaf":
                time.sleep(1000.0)
            stop.wait(1000.0)
            if not hurried():
                bag.put("/chatter", int(sys.argv[3]) + 1, bytes.fromhex(sys.argv[4]))
        bag.close()
"""


def serialized() -> str:
    from tracker_node.loaders.bag.message_types import typestore

    return bytes(typestore().serialize_cdr(text("hello"), "std_msgs/msg/String")).hex()


def started(kind: str, bag: Path, **env: str) -> subprocess.Popen:
    command = [sys.executable, "-c", BUSY, kind, str(bag), str(START_NS), serialized()]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, **env})
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    return process


def n_recorded(bag: Path) -> int:
    with BagReader(bag) as reader:
        assert not reader.recovered, reader.problem
        return reader.message_count


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_process_that_takes_no_notice_is_ended_and_its_bag_finished(tmp_path, number):
    before = shared_memory_files()
    process = started("deaf", tmp_path / "bag")
    mine = {path for path in shared_memory_files() - before if "port" not in path.name and path.name.startswith("fastrtps_")}
    process.send_signal(number)
    assert process.wait(PATIENCE_S) == 0
    assert n_recorded(tmp_path / "bag") == 1
    assert mine and not [path for path in mine - files_in_use() if path.exists()]


def test_one_that_is_asked_to_finish_has_time(tmp_path):
    process = started("heedful", tmp_path / "bag")
    process.send_signal(FINISH)
    assert process.wait(PATIENCE_S) == 0
    assert n_recorded(tmp_path / "bag") == 2


def test_a_child_ends_when_its_parent_is_gone(tmp_path):
    """The end of the parent may be noticed before the bag is begun, or after."""
    command = [sys.executable, "-c", BUSY, "deaf", str(tmp_path / "bag"), str(START_NS), serialized()]
    process = subprocess.Popen(command, env={**os.environ, PARENT_VARIABLE: str(os.getpid() + 1)})
    assert process.wait(PATIENCE_S) == 0


def test_before_there_is_anything_to_close_it_ends_at_once():
    program = (
        "import time; from tracker_node.ros.ending import Ending\nwith Ending():\n print('ready', flush=True); time.sleep(1000.0)"
    )
    process = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    process.send_signal(signal.SIGTERM)
    assert process.wait(PATIENCE_S) == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_end_of_the_interpreter_is_not_disturbed(number):
    """A node whose work is done is ended by launch at that moment, too."""
    program = (
        "import sys; from tracker_node.ros.ending import Ending\n"
        "with Ending(last=True):\n pass\n"
        "print('ready', flush=True); sys.stdin.read()"
    )
    process = subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdin is not None and process.stdout is not None and process.stdout.readline() == "ready\n"
    process.send_signal(number)
    process.stdin.close()
    assert process.wait(PATIENCE_S) == 0


@pytest.mark.long
@pytest.mark.parametrize("moment", ["tracker compiling", "tracker looking for the body", "pipeline looking for the body"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_nodes_end_in_the_middle_of_their_work(ros, recording, tmp_path, moment, number):
    from benchmark.ros._stops import scene_in, stopped

    with scene_in(tmp_path / "scene", recording, moment) as scene:
        stop = stopped(moment, number, scene)
    assert stop.status == 0
    assert stop.bags == stop.sound
