"""Bags as other programs see them: the layout of rosbag2, readable by rosbags and by the mcap library."""

import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

from helpers.sources import bag_samples
from tracker_node.errors import FileFormatError
from tracker_node.loaders.bag.message_types import TRACKED_STATE, MessageType, UnknownMessageTypeError, message_type
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.bag.writer import BagExistsError, BagWriter

TOPIC_TYPES = {
    "/cam01/image_raw": "sensor_msgs/msg/Image",
    "/chatter": "std_msgs/msg/String",
    "/tracker/state": TRACKED_STATE,
}


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    return bag_samples.write_bag(tmp_path / "run")


def test_metadata_has_what_rosbag2_of_jazzy_writes(bag: Path) -> None:
    assert sorted(path.name for path in bag.iterdir()) == ["metadata.yaml", "run_0.mcap"]
    information = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert set(information) == {
        "version", "storage_identifier", "duration", "starting_time", "message_count", "topics_with_message_count",
        "compression_format", "compression_mode", "relative_file_paths", "files", "custom_data", "ros_distro",
    }  # fmt: skip
    assert (information["version"], information["storage_identifier"], information["ros_distro"]) == (9, "mcap", "jazzy")
    assert information["message_count"] == 90
    assert information["starting_time"]["nanoseconds_since_epoch"] == bag_samples.START_NS
    assert information["duration"]["nanoseconds"] == 29 * bag_samples.PERIOD_NS + 20
    assert information["relative_file_paths"] == ["run_0.mcap"]
    assert information["files"][0]["path"] == "run_0.mcap"
    assert set(information["files"][0]) == {"path", "starting_time", "duration", "message_count"}
    topics = {entry["topic_metadata"]["name"]: entry for entry in information["topics_with_message_count"]}
    assert {name: entry["topic_metadata"]["type"] for name, entry in topics.items()} == TOPIC_TYPES
    assert {entry["message_count"] for entry in topics.values()} == {30}
    metadata = topics["/chatter"]["topic_metadata"]
    assert metadata["serialization_format"] == "cdr"
    assert metadata["type_description_hash"] == message_type("std_msgs/msg/String").type_hash
    (profile,) = metadata["offered_qos_profiles"]
    assert set(profile) == {
        "history", "depth", "reliability", "durability", "deadline", "lifespan", "liveliness",
        "liveliness_lease_duration", "avoid_ros_namespace_conventions",
    }  # fmt: skip
    assert (profile["reliability"], profile["durability"], profile["depth"]) == ("best_effort", "transient_local", 1)


def test_rosbags_reads_every_message(bag: Path) -> None:
    with AnyReader([bag]) as reader:
        assert {connection.topic: connection.msgtype for connection in reader.connections} == TOPIC_TYPES
        read = [(c.topic, reader.deserialize(data, c.msgtype)) for c, _, data in reader.messages()]
    texts = [message.data for topic, message in read if topic == "/chatter"]
    assert texts == [f"instant {i}" for i in range(30)]
    residuals = [message.residual for topic, message in read if topic == "/tracker/state"]
    assert residuals == [float(i) for i in range(30)]


def test_the_mcap_library_finds_schemas_and_channels(bag: Path) -> None:
    with (bag / "run_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == 90
        schemas = {schema.name: schema for schema in summary.schemas.values()}
        assert set(schemas) == set(TOPIC_TYPES.values())
        assert {schema.encoding for schema in schemas.values()} == {"ros2msg"}
        assert schemas[TRACKED_STATE].data.decode() == message_type(TRACKED_STATE).definition
        for channel in summary.channels.values():
            assert channel.message_encoding == "cdr"
            assert channel.metadata["topic_type_hash"] == message_type(TOPIC_TYPES[channel.topic]).type_hash
            assert yaml.safe_load(channel.metadata["offered_qos_profiles"])[0]["history"] == "keep_last"
        assert [record.name for record in reader.iter_metadata()] == ["rosbag2"]
        log_times = [message.log_time for _, _, message in reader.iter_messages()]
    assert len(log_times) == 90
    assert log_times == sorted(log_times)


def test_bytes_are_written_as_they_are(tmp_path: Path) -> None:
    data = bytes([0, 1, 0, 0, 2, 0, 0, 0, 65, 0])
    with BagWriter(tmp_path / "run") as writer:
        writer.add_topic("/a", "std_msgs/msg/String")
        writer.write("/a", 5, data, publish_ns=3)
        writer.write("/a", 6, memoryview(data))
    with BagReader(tmp_path / "run") as reader:
        assert [message.data for message in reader.messages()] == [data, data]


def test_an_existing_output_is_left_alone(bag: Path) -> None:
    before = (bag / "run_0.mcap").read_bytes()
    with pytest.raises(BagExistsError, match=r"run' exists already"):
        BagWriter(bag)
    assert (bag / "run_0.mcap").read_bytes() == before


def test_a_topic_has_one_type(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run") as writer:
        writer.add_topic("/a", "std_msgs/msg/String")
        writer.add_topic("/a", "std_msgs/msg/String")
        with pytest.raises(FileFormatError, match="/a"):
            writer.add_topic("/a", "std_msgs/msg/Header")
        with pytest.raises(UnknownMessageTypeError):
            writer.add_topic("/b", "zoo_msgs/msg/Unheard")
        with pytest.raises(ValueError, match="/c"):
            writer.write("/c", 0, b"")


def test_a_type_without_definition_can_be_recorded(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run") as writer:
        writer.add_topic("/a", "zoo_msgs/msg/Unheard", definition=MessageType("zoo_msgs/msg/Unheard", "", "RIHS01_0"))
        writer.write("/a", 1, b"\0\1\0\0")
    with Reader(tmp_path / "run") as reader:
        assert [c.msgtype for c in reader.connections] == ["zoo_msgs/msg/Unheard"]
    with BagReader(tmp_path / "run") as own:
        (message,) = own.messages()
        assert message.data == b"\0\1\0\0"
        with pytest.raises(FileFormatError, match="definition is known"):
            own.decode(message)


def test_after_an_error_the_bag_is_closed_and_complete(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), BagWriter(tmp_path / "run") as writer:
        bag_samples.fill(writer, 4)
        raise RuntimeError("the source broke")
    with BagReader(tmp_path / "run") as reader:
        assert (reader.message_count, reader.recovered) == (12, False)


def test_an_empty_bag_is_a_bag(tmp_path: Path) -> None:
    BagWriter(tmp_path / "run").close()
    with AnyReader([tmp_path / "run"]) as reader:
        assert reader.connections == []
    with BagReader(tmp_path / "run") as own:
        assert (own.message_count, list(own.messages())) == (0, [])


KILLED = """
import os, signal, sys
sys.path.insert(0, sys.argv[2])
from helpers.sources import bag_samples
from tracker_node.loaders.bag.writer import BagWriter
writer = BagWriter(sys.argv[1])
bag_samples.fill(writer, 20)
writer.flush()
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_was_flushed_survives_a_kill(repository: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-c", KILLED, str(tmp_path / "run"), str(repository / "test")]
    process = subprocess.run(command, check=False, timeout=60)
    assert process.returncode == -9
    assert not (tmp_path / "run" / "metadata.yaml").exists()
    with BagReader(tmp_path / "run") as reader:
        assert (reader.message_count, reader.recovered) == (60, True)
