"""What a survey of an MCAP file counts."""

import pytest

from tracker_node.errors import FileFormatError
from tracker_node.loaders.bag.file import BagFile
from tracker_node.loaders.bag.mcap.contents import FileContents
from tracker_node.loaders.bag.mcap.recovery import scan, survey
from tracker_node.loaders.bag.metadata import OfferedQos, TopicRecord


@pytest.fixture
def path(tmp_path):
    file = BagFile(tmp_path / "a.mcap", chunk_bytes=1000, compression="")
    for name in ("/a", "/b"):
        file.add_topic(TopicRecord(name, "std_msgs/msg/String", "", OfferedQos()))
    for name, stamp in (("/a", 90), ("/b", 50), ("/a", 70)):
        file.write(name, 0, stamp, stamp, name.encode())
    file.finish({})
    return file.path


def test_a_survey_counts_the_messages_of_each_topic(path):
    contents = survey(path)
    assert contents.counts == {1: 2, 2: 1} and contents.message_count == 3
    assert (contents.start_ns, contents.end_ns) == (50, 90)
    assert contents.channels[1].topic == "/a" and contents.problems == []


def test_messages_come_in_the_order_of_the_file_and_topics_go_where_asked(path):
    assert [message.data for message in scan(path)] == [b"/a", b"/b", b"/a"]
    mine = FileContents()
    assert len(list(scan(path, mine))) == 3 and sorted(mine.channels) == [1, 2]


def test_another_kind_of_file_is_refused(path):
    path.write_bytes(b"SQLite format 3\0")
    with pytest.raises(FileFormatError, match="the magic bytes of an MCAP file"):
        survey(path)
