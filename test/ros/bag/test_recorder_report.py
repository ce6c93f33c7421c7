"""Levels of the recorder's diagnostics, as somebody who records would set them."""

import time
from contextlib import closing

import pytest

pytest.importorskip("rclpy", reason="ROS is not installed")

from rclpy.serialization import serialize_message

from tracker_node.loaders.bag.message_types import TRACKED_STATE
from tracker_node.loaders.bag.queue import BagQueue
from tracker_node.loaders.bag.writer import BagWriter
from tracker_node.ros.bag.recorder import RecorderNode, TopicSelection
from tracker_node.ros.bag.recorder_report import MB, WHILE_KNOWN, RecorderState, TopicPace, topics_status
from tracker_node.ros.conversions import message_class
from tracker_node.ros.diagnostics import ERROR, OK, WARN
from tracker_node.runs.outputs import BODY_OUTPUTS
from tracker_node.tracking.estimate import Status

HEALTHY = {"messages": 100, "size": 50 * MB, "free_bytes": 10**12, "room_bytes": 10**12, "bytes_per_s": 10.0 * MB}


@pytest.mark.parametrize(
    ("differs", "level", "said"),
    [
        ({}, OK, "recording"),
        ({"messages": 0, "bytes_per_s": 0.0}, OK, "waiting for messages"),
        ({"paused": True}, OK, "paused"),
        ({"problem": "stopped: No space left on device", "dropped": 3}, ERROR, "stopped: No space left on device"),
        ({"dropped": 3, "dropping": True}, ERROR, "the disk is too slow: 3 messages dropped so far"),
        ({"dropped": 3}, WARN, "3 messages are missing: the disk was too slow"),
        ({"lost": 2}, WARN, "2 messages are missing: they did not arrive"),
        ({"room_bytes": 300 * MB}, ERROR, "the disk is full in 30 s"),
        ({"room_bytes": 3000 * MB}, WARN, "the disk is full in 5 min"),
        ({"room_bytes": 30_000 * MB}, OK, "recording"),
        ({"waiting": 0.75}, WARN, "the disk falls behind: 75 % of the queue is in use"),
        ({"unsaved_s": 0.6}, OK, "recording"),
        ({"unsaved_s": 5.0}, WARN, "the disk stands still: nothing written for 5 s"),
        ({"refused": {"/x": "several types"}}, WARN, "not recorded: /x"),
    ],
)
def test_levels(differs: dict, level: bytes, said: str) -> None:
    assert RecorderState(**{**HEALTHY, **differs}).status() == (level, said)


def test_figures() -> None:
    values = RecorderState(**HEALTHY, files=3).values()
    assert (values["written [MB/s]"], values["size [MB]"], values["files"]) == (10.0, 50.0, 3)
    assert float(str(values["full in [s]"])) == pytest.approx(10**12 / (10 * MB), rel=1e-4)
    assert RecorderState().values()["full in [s]"] == "inf"


@pytest.mark.parametrize(
    ("pace", "n_publishers", "level"),
    [
        (TopicPace(301, 0.0, 10.0), 1, OK),
        (TopicPace(301, 0.0, 5.0), 1, WARN),
        (TopicPace(301, 0.0, 5.0), 0, OK),  # whoever published has gone
        (TopicPace(1, 0.0, 0.0), 1, OK),  # said once, like a robot description
        (TopicPace(12, 0.0, 1.0), 1, OK),  # a few that were waiting
        (TopicPace(40, 0.0, 50.0), 1, OK),  # rare messages
        (TopicPace(0), 1, OK),
        (TopicPace(301, 0.0, 5.0, on_occasion=True), 1, OK),  # parameter events
        (TopicPace(60, 0.0, 2.0), 1, OK),  # what nodes say as they start
    ],
)
def test_a_topic_that_falls_silent_is_named(pace: TopicPace, n_publishers: int, level: bytes) -> None:
    found, said, values = topics_status({"/cam": pace}, {"/cam": 2}, {"/cam": n_publishers}, now_s=10.0)
    assert found == level
    assert ("/cam for 5 s" in said) == (level == WARN)
    assert f"{pace.count} messages" in str(values["/cam"])
    assert str(values["/cam"]).endswith("2 lost")


def test_topics_of_events_may_be_silent_and_others_not(ros, tmp_path) -> None:
    names = {"/parameter_events": "rcl_interfaces/msg/ParameterEvent", "/rosout": "rcl_interfaces/msg/Log"}
    with closing(BagQueue(BagWriter(tmp_path / "run"))) as bag:
        recorder = RecorderNode(TopicSelection(names | {"/chatter": "std_msgs/msg/String"}), bag)
        paces = {name: recorded.pace.on_occasion for name, recorded in recorder._topics.items()}
        recorder.destroy_node()
    assert paces == {"/parameter_events": True, "/rosout": True, "/chatter": False}


@pytest.mark.parametrize("status", Status)
def test_what_a_tracker_leaves_out_while_the_body_is_not_known_is_not_missed(ros, tmp_path, status) -> None:
    assert set(WHILE_KNOWN) <= {output.name for output in BODY_OUTPUTS}
    names = {f"/tracker/{output.topic}": output.type_name for output in BODY_OUTPUTS}
    with closing(BagQueue(BagWriter(tmp_path / "run"))) as bag:
        recorder = RecorderNode(TopicSelection(names), bag)
        recorder.create_publisher(message_class(names["/tracker/pose"]), "/tracker/pose", 10)
        now_s = time.monotonic()
        recorder._topics["/tracker/pose"].pace = TopicPace(301, now_s - 30.0, now_s - 20.0)
        recorder._topics["/tracker/state"].state = serialize_message(message_class(TRACKED_STATE)(status=int(status)))
        recorder.report()
        said = recorder._diagnostics._statuses["topics"].message
        recorder.destroy_node()
    assert ("/tracker/pose for 2" in said) == status.known


def test_a_pause_is_no_silence() -> None:
    pace = TopicPace(301, 0.0, 5.0)
    pace.begin_again()
    assert topics_status({"/cam": pace}, {}, {"/cam": 1}, now_s=10.0) == (OK, "1 topics", {"/cam": "301 messages, 0.0 Hz"})
    pace.add()
    assert (pace.count, pace.before, pace.rate_hz) == (1, 301, 0.0)
