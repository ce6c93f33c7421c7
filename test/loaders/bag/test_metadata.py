"""What ``metadata.yaml`` of a bag says of its files and topics."""

import pytest
import yaml

from tracker_node.loaders.bag.metadata import BagTopic, OfferedQos, TimeSpan, bag_information, offered_in, write_metadata


def test_a_span_over_several_leaves_out_empty_ones():
    spans = [TimeSpan(50, 70, 2), TimeSpan(0, 0, 0), TimeSpan(40, 60, 3), TimeSpan(900, 900, 0)]
    assert TimeSpan.over(spans) == TimeSpan(40, 70, 5)
    assert TimeSpan.over(iter(spans[:1])) == TimeSpan(50, 70, 2)
    assert TimeSpan.over([]) == TimeSpan.over([TimeSpan(3, 9, 0)]) == TimeSpan(0, 0, 0)
    assert TimeSpan(40, 70, 5).as_dict() == {
        "starting_time": {"nanoseconds_since_epoch": 40}, "duration": {"nanoseconds": 30}, "message_count": 5,
    }  # fmt: skip


def test_qos_without_limits_as_rosbag2_writes_it():
    qos = OfferedQos("best_effort", "transient_local", "keep_all", 7)
    without = {"sec": 9223372036, "nsec": 854775807}  # 2^63 - 1 nanoseconds
    assert without["sec"] * 10**9 + without["nsec"] == 2**63 - 1
    assert qos.as_dict() == {
        "history": "keep_all", "depth": 7, "reliability": "best_effort", "durability": "transient_local", "deadline": without,
        "lifespan": without, "liveliness": "automatic", "liveliness_lease_duration": without,
        "avoid_ros_namespace_conventions": False,
    }  # fmt: skip
    text = qos.as_yaml()
    assert yaml.safe_load(text) == [qos.as_dict()]
    assert text.startswith("- history: keep_all\n  depth: 7\n") and text == text.strip() and "*" not in text
    assert OfferedQos() == OfferedQos("reliable", "volatile", "keep_last", 10)


@pytest.mark.parametrize(("custom", "shown"), [({}, None), ({"a": "b"}, {"a": "b"})])
def test_information_of_a_bag(custom, shown):
    topic = BagTopic("/a", "std_msgs/msg/String", "RIHS01_1", OfferedQos(), 4)
    files = {"b_0.mcap": TimeSpan(10, 20, 3), "b_1.mcap": TimeSpan(25, 40, 1)}
    information = bag_information(files, [topic], custom)
    assert list(information)[:3] == ["version", "storage_identifier", "starting_time"]
    assert (information["version"], information["storage_identifier"], information["ros_distro"]) == (9, "mcap", "jazzy")
    assert information["starting_time"] == {"nanoseconds_since_epoch": 10}
    assert information["duration"] == {"nanoseconds": 30} and information["message_count"] == 4
    assert information["relative_file_paths"] == ["b_0.mcap", "b_1.mcap"]
    assert information["files"][1] == {
        "path": "b_1.mcap", "starting_time": {"nanoseconds_since_epoch": 25}, "duration": {"nanoseconds": 15}, "message_count": 1,
    }  # fmt: skip
    (listed,) = information["topics_with_message_count"]
    assert listed["message_count"] == 4
    assert listed["topic_metadata"] == {
        "name": "/a", "type": "std_msgs/msg/String", "serialization_format": "cdr",
        "offered_qos_profiles": [OfferedQos().as_dict()], "type_description_hash": "RIHS01_1",
    }  # fmt: skip
    assert information["compression_format"] == information["compression_mode"] == ""
    assert information["custom_data"] == shown


def test_the_file_is_replaced_as_a_whole(tmp_path):
    for version in (8, 9):
        write_metadata(tmp_path, {"version": version, "a": "ä"})
    assert [file.name for file in tmp_path.iterdir()] == ["metadata.yaml"]
    text = (tmp_path / "metadata.yaml").read_text(encoding="utf-8")
    assert yaml.safe_load(text) == {"rosbag2_bagfile_information": {"version": 9, "a": "ä"}}
    assert text.index("version") < text.index("a: ")


PROFILE = """
- history: {history}
  depth: {depth}
  reliability: {reliability}
  durability: {durability}
  deadline: {{sec: 0, nsec: 0}}
  lifespan: {{sec: 0, nsec: 0}}
  liveliness: 1
  liveliness_lease_duration: {{sec: 0, nsec: 0}}
  avoid_ros_namespace_conventions: false
"""


def profile(history=1, depth=7, reliability=1, durability=2):
    return PROFILE.format(history=history, depth=depth, reliability=reliability, durability=durability)


@pytest.mark.parametrize(("number", "word"), [(1, "reliable"), (2, "best_effort"), (0, "reliable"), (3, "reliable")])
def test_reliability(number, word):
    assert offered_in(profile(reliability=number)).reliability == word


@pytest.mark.parametrize(("number", "word"), [(1, "transient_local"), (2, "volatile"), (0, "volatile"), (3, "volatile")])
def test_durability(number, word):
    assert offered_in(profile(durability=number)).durability == word


@pytest.mark.parametrize(("number", "word"), [(1, "keep_last"), (2, "keep_all"), (0, "keep_last"), (3, "keep_last")])
def test_history(number, word):
    assert offered_in(profile(history=number)).history == word


@pytest.mark.parametrize(("stated", "depth"), [(7, 7), (0, OfferedQos().depth)])
def test_depth(stated, depth):
    assert offered_in(profile(depth=stated)).depth == depth


def test_the_first_of_several_publishers_counts():
    assert offered_in(profile(reliability=2) + profile(reliability=1)).reliability == "best_effort"


@pytest.mark.parametrize("text", ["", "[]", "{", "- {history: 1}", "- 3", "nonsense"])
def test_what_cannot_be_read_is_the_default(text):
    assert offered_in(text) == OfferedQos()
