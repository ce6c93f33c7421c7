"""Accounts of one file of a bag."""

import pytest

from tracker_node.loaders.bag.mcap.contents import FileContents, RawMessage, one_text


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
