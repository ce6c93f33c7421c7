"""What a recorder run says that it lost: nothing is left out because nobody has said anything of it."""


import pytest

pytest.importorskip("rclpy", reason="ROS is not installed")

from benchmark.ros.recorder._runs import TOPICS, Streams, losses_s
from tracker_node.errors import TrackerError


def said(counts: dict[str, int]) -> Streams:
    """Streams that have ended, by what they have printed."""
    streams = Streams.__new__(Streams)
    names = {topic: topic if topic.startswith("/tracker") else topic.split("/")[1] for topic in counts}
    streams.lines = [f"{names[topic]}: {n} published" for topic, n in counts.items()]
    return streams


def test_every_publisher_must_say_how_much_it_has_published():
    counts = {topic: 10 + i for i, topic in enumerate(TOPICS)}
    assert said(counts).published == counts
    for topic in ("/cam6/image_raw", "/tracker/pose"):
        for others in ({**counts, topic: 0}, {name: n for name, n in counts.items() if name != topic}):
            with pytest.raises(TrackerError, match=topic):
                _ = said(others).published


def test_a_topic_of_which_nothing_can_be_read_is_lost_without_end():
    last_ns = dict.fromkeys(TOPICS, 10**9)
    assert set(losses_s(last_ns, 3 * 10**9).values()) == {2.0}
    del last_ns[TOPICS[0]]
    assert losses_s(last_ns, 3 * 10**9)[TOPICS[0]] == float("inf")
