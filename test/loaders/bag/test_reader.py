"""Bags of any origin and in any condition."""

from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin, Writer

from helpers.sources import bag_samples
from tracker_node.errors import FileFormatError, TrackerError, UnknownNameError
from tracker_node.loaders.bag.message_types import typestore
from tracker_node.loaders.bag.reader import BagReader


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    return bag_samples.write_bag(tmp_path / "run", chunk_bytes=20_000)


def cut(bag: Path, fraction: float) -> None:
    file = bag / "run_0.mcap"
    file.write_bytes(file.read_bytes()[: int(file.stat().st_size * fraction)])


def test_messages_come_in_order_with_their_topics(bag: Path) -> None:
    with BagReader(bag) as reader:
        assert (reader.recovered, reader.problem, reader.message_count) == (False, "", 90)
        assert reader.start_ns == bag_samples.START_NS
        assert reader.end_ns == bag_samples.START_NS + 29 * bag_samples.PERIOD_NS + 20
        assert reader.topics_of_type("std_msgs/msg/String") == ("/chatter",)
        assert reader.topic("/chatter").qos.durability == "transient_local"
        messages = list(reader.messages())
        assert [message.topic for message in messages[:3]] == ["/cam01/image_raw", "/chatter", "/tracker/state"]
        assert reader.decode(messages[4]).data == "instant 1"


def test_topics_and_times_can_be_chosen(bag: Path) -> None:
    start = bag_samples.START_NS
    with BagReader(bag) as reader:
        chosen = list(reader.messages(["/chatter"], start + 10, start + 3 * bag_samples.PERIOD_NS))
        assert [reader.decode(message).data for message in chosen] == ["instant 0", "instant 1", "instant 2"]
        with pytest.raises(UnknownNameError, match=r"/nothing.*valid: /cam01/image_raw, /chatter"):
            reader.messages(["/nothing"])


def test_decoded_numbers_are_arrays(bag: Path) -> None:
    with BagReader(bag) as reader:
        _, image = next(reader.decoded("/cam01/image_raw"))
    expected = np.random.default_rng(5).integers(0, 256, (48, 64, 3), dtype=np.uint8)
    assert (image.data.reshape(48, 64, 3) == expected).all()


@pytest.mark.parametrize("with_metadata", [True, False])
def test_a_bag_cut_at_60_percent_gives_what_is_in_it(bag: Path, with_metadata: bool) -> None:
    cut(bag, 0.6)
    if not with_metadata:
        (bag / "metadata.yaml").unlink()
    with BagReader(bag) as reader:
        assert reader.recovered
        assert "breaks off" in reader.problem
        texts = [reader.decode(message).data for message in reader.messages(["/chatter"])]
        assert texts == [f"instant {i}" for i in range(len(texts))]
        assert 16 <= len(texts) <= 18
        assert reader.topic("/chatter").message_count == len(texts)
        assert len(list(reader.messages())) == reader.message_count


@pytest.mark.parametrize("fraction", [0.0, 0.001, 0.01, 0.3, 0.97, 0.99, 0.9999])
def test_no_cut_makes_it_fail_badly(bag: Path, fraction: float) -> None:
    cut(bag, fraction)
    try:
        with BagReader(bag) as reader:
            assert reader.recovered
            assert len(list(reader.messages())) == reader.message_count
    except FileFormatError as error:
        assert fraction == 0.0, error


def test_cut_anywhere_in_the_last_chunk_every_whole_message_is_read(bag: Path) -> None:
    whole = (bag / "run_0.mcap").read_bytes()
    previous = 0
    for size in range(len(whole) // 3, len(whole) // 3 + 12_000, 977):
        (bag / "run_0.mcap").write_bytes(whole[:size])
        with BagReader(bag) as reader:
            assert reader.message_count >= previous
            previous = reader.message_count
    assert previous > 0


def test_a_finished_file_without_metadata_is_read(bag: Path) -> None:
    (bag / "metadata.yaml").unlink()
    with BagReader(bag) as reader:
        assert reader.message_count == 90
    with BagReader(bag / "run_0.mcap") as reader:
        assert reader.message_count == 90


def test_wrong_metadata_does_not_hide_the_messages(bag: Path) -> None:
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information: {version: 9\n")
    with BagReader(bag) as reader:
        assert (reader.message_count, reader.recovered) == (90, True)


def test_bytes_that_are_no_message_are_named(bag: Path) -> None:
    with BagReader(bag) as reader:
        message = next(reader.messages(["/tracker/state"]))
        broken = type(message)(message.topic, message.type_name, message.stamp_ns, message.data[:40])
        with pytest.raises(FileFormatError, match=f"/tracker/state at {message.stamp_ns}"):
            reader.decode(broken)


def test_damage_in_the_middle_is_an_error_with_the_file_name(bag: Path) -> None:
    file = bag / "run_0.mcap"
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 0xFF
    file.write_bytes(bytes(content))
    with BagReader(bag) as reader, pytest.raises(FileFormatError, match=r"run.*undamaged"):
        list(reader.messages())


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_bags_of_others_are_read(tmp_path: Path, storage: StoragePlugin) -> None:
    with Writer(tmp_path / "theirs", version=9, storage_plugin=storage) as writer:
        connection = writer.add_connection("/a", "std_msgs/msg/String", typestore=typestore())
        writer.write(connection, 17, typestore().serialize_cdr(bag_samples.text("hello"), "std_msgs/msg/String"))
    with BagReader(tmp_path / "theirs") as reader:
        assert [(stamp, message.data) for stamp, message in reader.decoded("/a")] == [(17, "hello")]


def test_what_is_no_bag_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.mcap").write_text("not a bag at all")
    (tmp_path / "notes.txt").write_text("")
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty.mcap").write_text("")
    for name in ("notes.mcap", "notes.txt", "empty", "missing", "empty.mcap"):
        with pytest.raises(FileFormatError, match=name):
            BagReader(tmp_path / name)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_bytes_end_in_messages_or_in_a_message_about_the_file(tmp_path: Path, data: st.DataObject) -> None:
    bag = tmp_path / "run"
    if not bag.exists():
        bag_samples.write_bag(bag, 4, chunk_bytes=20_000)
        (tmp_path / "whole").write_bytes((bag / "run_0.mcap").read_bytes())
    content = bytearray((tmp_path / "whole").read_bytes())
    content = content[: data.draw(st.integers(1, len(content)))]
    for _ in range(data.draw(st.integers(0, 5))):
        content[data.draw(st.integers(0, min(len(content), 8000) - 1))] = data.draw(st.integers(0, 255))
    (bag / "run_0.mcap").write_bytes(bytes(content))
    try:
        with BagReader(bag) as reader:
            for message in reader.messages():
                with suppress(TrackerError):
                    reader.decode(message)
    except TrackerError as error:
        assert "run" in str(error)
