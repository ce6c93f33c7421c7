"""Sound bags are found sound, damage is named, and repaired bags are sound and hold all that is not damaged."""

import shutil
import sqlite3
import struct
from contextlib import closing, suppress
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import yaml
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from helpers.sources import bag_samples
from tracker_node.cli.main import main
from tracker_node.errors import FileFormatError, TrackerError
from tracker_node.loaders.bag import mcap_recovery
from tracker_node.loaders.bag.check import check_bag, figures_of, repair_bag
from tracker_node.loaders.bag.message_types import typestore
from tracker_node.loaders.bag.metadata import BagTopic, OfferedQos
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.bag.writer import BagWriter
from tracker_node.runs.load import load_run

N_MESSAGES = 90
STRING = "std_msgs/msg/String"


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    return bag_samples.write_bag(tmp_path / "run", chunk_bytes=20_000)


def chunk_offsets(file: Path) -> list[int]:
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    return [index.chunk_start_offset for index in summary.chunk_indexes]


def change(file: Path, offset: int, data: bytes) -> None:
    content = bytearray(file.read_bytes())
    content[offset : offset + len(data)] = data
    file.write_bytes(bytes(content))


def repaired(bag: Path, output: Path) -> list[tuple[str, int, bytes]]:
    """What another reader finds in the repaired bag, which is sound."""
    repair_bag(bag, output)
    assert check_bag(output).sound
    with AnyReader([output]) as reader:
        return [(connection.topic, stamp, bytes(data)) for connection, stamp, data in reader.messages()]


def test_a_sound_bag(bag: Path, capsys: pytest.CaptureFixture) -> None:
    check = check_bag(bag)
    assert (check.sound, check.problems, check.notes, check.message_count, check.files) == (True, [], [], N_MESSAGES, 1)
    assert check.seconds == pytest.approx(29 * bag_samples.PERIOD_NS * 1e-9 + 20e-9)
    assert {each.topic.name: round(each.rate_hz, 2) for each in check.topics}["/chatter"] == 30.0
    assert main(["bag", "check", str(bag)]) == 0
    output = capsys.readouterr().out
    assert "2023-11-14 22:13:20 UTC" in output
    assert "Sound." in output
    assert main(["bag", "info", str(bag)]) == 0
    assert "/tracker/state" in capsys.readouterr().out


def test_times_that_ros_cannot_hold(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """MCAP has room for them: they are a problem of the bag, and a repaired one has none."""
    bag, new = tmp_path / "run", tmp_path / "new"
    with BagWriter(bag) as writer:
        for stamp_ns in (5, 2**63 - 1, 2**63, 2**64 - 1):
            writer.write_message("/a", stamp_ns, bag_samples.text("a"))
    assert main(["bag", "check", str(bag / "run_0.mcap")]) == 1
    assert "problem: /a: 2 messages with a time that ROS cannot hold" in capsys.readouterr().out
    assert main(["bag", "check", str(bag)]) == 1
    assert main(["bag", "info", str(bag)]) == 0
    assert main(["bag", "repair", str(bag), "--output", str(new)]) == 0
    assert "2 messages had a time that ROS cannot hold" in capsys.readouterr().out
    assert main(["bag", "check", str(new)]) == 0
    with BagReader(new) as reader:
        assert [message.stamp_ns for message in reader.messages()] == [5, 2**63 - 1, 2**63 - 1, 2**63 - 1]


def test_a_bag_that_breaks_off(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    file = bag / "run_0.mcap"
    file.write_bytes(file.read_bytes()[:-5000])
    assert main(["bag", "check", str(bag)]) == 1
    output = capsys.readouterr().out
    assert "problem: not finished: the file breaks off" in output
    assert "Not sound. Readable as far as it goes" in output
    with BagReader(bag) as reader:
        before = [(message.topic, message.stamp_ns, message.data) for message in reader.messages()]
    assert repaired(bag, tmp_path / "new") == before


def test_damage_in_a_chunk_costs_that_chunk(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    file = bag / "run_0.mcap"
    offsets = chunk_offsets(file)
    whole = {(topic, stamp) for topic, stamp, _ in repaired(bag, tmp_path / "before")}
    change(file, offsets[5] + 5000, b"\xff\x00\xff\x00")
    assert main(["bag", "check", str(bag)]) == 1
    assert f"problem: run_0.mcap: the chunk at byte {offsets[5]} is damaged and was left out" in capsys.readouterr().out
    rest = {(topic, stamp) for topic, stamp, _ in repaired(bag, tmp_path / "new")}
    assert rest < whole
    assert len(whole - rest) <= N_MESSAGES / len(offsets) + 2
    assert "by the index" in " ".join(check_bag(bag).problems)


def test_a_damaged_length_does_not_hide_the_chunks_behind_it(bag: Path, tmp_path: Path) -> None:
    file = bag / "run_0.mcap"
    offsets = chunk_offsets(file)
    change(file, offsets[3] + 1, struct.pack("<Q", 2**62))
    check = check_bag(bag)
    assert f"run_0.mcap: the record at byte {offsets[3]} is damaged and was left out" in check.problems
    assert len(repaired(bag, tmp_path / "new")) == check.message_count > 0.7 * N_MESSAGES


def test_metadata_that_lies(bag: Path, tmp_path: Path) -> None:
    """Wrong counts, and names of files outside of the bag: said, and nothing outside is read."""
    elsewhere = bag_samples.write_bag(tmp_path / "secret", 3)
    path = bag / "metadata.yaml"
    content = yaml.safe_load(path.read_text())
    information = content["rosbag2_bagfile_information"]
    information["topics_with_message_count"][1]["message_count"] = 31
    information["relative_file_paths"] = ["run_0.mcap", "../secret/secret_0.mcap", "/etc/passwd"]
    path.write_text(yaml.safe_dump(content))
    check = check_bag(bag)
    assert "not finished: metadata.yaml is missing or wrong" in check.problems[0]
    assert check.message_count == N_MESSAGES
    information["relative_file_paths"] = [str(elsewhere / "secret_0.mcap")]
    path.write_text(yaml.safe_dump(content))
    assert check_bag(bag).message_count == N_MESSAGES
    information["relative_file_paths"] = ["../elsewhere/run_0.mcap"]  # another reader takes the name alone
    path.write_text(yaml.safe_dump(content))
    problems = check_bag(bag).problems
    assert problems == [
        "metadata.yaml names files elsewhere, which are not read: ../elsewhere/run_0.mcap",
        "/chatter: 31 messages by the index, 30 found",
    ]


def test_rates_gaps_and_order() -> None:
    topic = BagTopic("/a", STRING, "", OfferedQos())
    stamps = np.arange(100) * 10_000_000
    assert figures_of(topic, stamps).rate_hz == pytest.approx(100.0)
    with_gaps = np.delete(stamps, [20, 21, 22, 50, 51, 52, 53, 54])
    figures = figures_of(topic, with_gaps)
    assert (figures.gaps, figures.longest_s) == (2, pytest.approx(0.06))
    swapped = stamps.copy()
    swapped[[40, 41]] = swapped[[41, 40]]
    assert figures_of(topic, swapped).backwards == 1
    assert figures_of(topic, stamps[:1]).rate_hz == 0.0
    assert figures_of(topic, np.zeros(5, np.int64)).rate_hz == 0.0
    assert figures_of(topic, np.cumsum(np.random.default_rng(1).exponential(1e9, 200).astype(np.int64))).gaps == 0


def theirs(path: Path, storage: StoragePlugin, mode: CompressionMode = CompressionMode.NONE, n: int = 50) -> Path:
    """A bag as rosbag2 lays it out, of another hand."""
    writer = Writer(path, version=9, storage_plugin=storage)
    if mode != CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/a", STRING, typestore=typestore())
        for i in range(n):
            writer.write(connection, i * 10**8, typestore().serialize_cdr(bag_samples.text(f"{i} " * 400), STRING))
    return path


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("mode", [CompressionMode.NONE, CompressionMode.FILE, CompressionMode.MESSAGE])
def test_bags_of_others(tmp_path: Path, storage: StoragePlugin, mode: CompressionMode) -> None:
    bag = theirs(tmp_path / "theirs", storage, mode)
    check = check_bag(bag)
    assert (check.problems, check.message_count) == ([], 50)
    assert [stamp for _, stamp, _ in repaired(bag, tmp_path / "ours")] == [i * 10**8 for i in range(50)]
    with BagReader(bag) as before, BagReader(tmp_path / "ours") as after:
        assert [m.data for _, m in after.decoded("/a")] == [m.data for _, m in before.decoded("/a")] == [
            f"{i} " * 400 for i in range(50)
        ]  # fmt: skip
        assert after.topic("/a").definition


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("mode", [CompressionMode.NONE, CompressionMode.MESSAGE])
def test_bags_of_others_without_metadata(tmp_path: Path, storage: StoragePlugin, mode: CompressionMode) -> None:
    """Their recorder was killed as well; SQLite files are read if they are whole."""
    bag = theirs(tmp_path / "theirs", storage, mode)
    (bag / "metadata.yaml").unlink()
    (file,) = bag.iterdir()
    if storage == StoragePlugin.MCAP:
        file.write_bytes(file.read_bytes()[:-100])
    check = check_bag(bag)
    assert check.message_count == 50
    assert not check.sound
    with BagReader(bag, scanned=True) as reader:
        assert [message.data for _, message in reader.decoded("/a")] == [f"{i} " * 400 for i in range(50)]


REINDEX = r"`ros2 bag reindex`, then `ros2 bag convert`"


def refused(bag: Path, capsys: pytest.CaptureFixture) -> None:
    """It cannot be opened, and one line of every command says what to use."""
    with pytest.raises(FileFormatError, match=REINDEX):
        BagReader(bag)
    for verb in (["check"], ["repair", "--output", str(bag.with_name("new"))], ["info"]):
        assert main(["bag", verb[0], str(bag), *verb[1:]]) == 2
        said = capsys.readouterr().err
        assert REINDEX in said and said.count("\n") == 1
    assert not bag.with_name("new").exists()


def test_a_database_with_damaged_pages_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    bag = theirs(tmp_path / "theirs", StoragePlugin.SQLITE3, n=400)
    (file,) = bag.glob("*.db3")
    size = file.stat().st_size
    change(file, size // 2 // 4096 * 4096, bytes(3 * 4096))
    refused(bag, capsys)


def test_a_database_cut_off_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    bag = theirs(tmp_path / "theirs", StoragePlugin.SQLITE3, n=10)
    (file,) = bag.glob("*.db3")
    file.write_bytes(file.read_bytes()[:6000])
    refused(bag, capsys)


@pytest.mark.parametrize("metadata", [True, False])
def test_a_database_that_was_not_closed_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture, metadata: bool) -> None:
    """A write-ahead log beside it holds the last messages."""
    bag = theirs(tmp_path / "theirs", StoragePlugin.SQLITE3, n=10)
    (file,) = bag.glob("*.db3")
    writer = sqlite3.connect(file)
    writer.execute("PRAGMA journal_mode = WAL")
    writer.execute("INSERT INTO messages (topic_id, timestamp, data) VALUES (1, 77, ?)", (b"\0\1\0\0" + bytes(8),))
    writer.commit()
    killed = tmp_path / "killed"
    shutil.copytree(bag, killed)
    if not metadata:
        (killed / "metadata.yaml").unlink()
    writer.close()
    assert any(name.name.endswith("-wal") for name in killed.iterdir())
    refused(killed, capsys)


def test_a_row_that_is_no_message_is_named(tmp_path: Path) -> None:
    bag = theirs(tmp_path / "theirs", StoragePlugin.SQLITE3, n=3)
    (file,) = bag.glob("*.db3")
    with closing(sqlite3.connect(file)) as writer:
        writer.execute("UPDATE messages SET data = 'text' WHERE id = 2")
        writer.commit()
    with BagReader(bag) as reader, pytest.raises(FileFormatError, match=rf"{REINDEX}.*a damaged message of /a"):
        list(reader.messages())
    check = check_bag(bag)
    assert not check.sound and REINDEX in " ".join(check.problems) and REINDEX in check.advice


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
def test_a_chunk_that_claims_little_and_unpacks_to_much(tmp_path: Path, monkeypatch, compression: str) -> None:
    monkeypatch.setattr(mcap_recovery, "MOST_BYTES", 10**6)
    pack = lz4.frame.compress if compression == "lz4" else zstandard.ZstdCompressor().compress
    bomb, name = pack(bytes(10**8)), compression.encode()
    fields = struct.pack("<QQQI", 0, 1, 1000, 0) + struct.pack("<I", len(name)) + name + struct.pack("<Q", len(bomb)) + bomb
    bag = bag_samples.write_bag(tmp_path / "run", 4)
    file = bag / "run_0.mcap"
    content = file.read_bytes()
    at = chunk_offsets(file)[0]
    record = struct.pack("<BQ", Opcode.CHUNK, len(fields)) + fields
    file.write_bytes(content[:at] + record + content[at:-8])
    check = check_bag(bag)
    assert f"the chunk at byte {at} is damaged and was left out" in " ".join(check.problems)
    assert check.message_count == 12


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_compressed_messages_and_chunks_that_unpack_to_much_are_refused(tmp_path: Path, monkeypatch, storage) -> None:
    mode = CompressionMode.STORAGE if storage == StoragePlugin.MCAP else CompressionMode.MESSAGE
    writer = Writer(tmp_path / "theirs", version=9, storage_plugin=storage)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/a", STRING, typestore=typestore())
        writer.write(connection, 1, b"\0\1\0\0" + bytes(3 * 10**6))
    with BagReader(tmp_path / "theirs") as reader:
        assert len(next(reader.messages()).data) == 3 * 10**6 + 4
    monkeypatch.setattr(mcap_recovery, "MOST_BYTES", 10**6)
    with BagReader(tmp_path / "theirs") as reader, pytest.raises(FileFormatError, match=r"theirs.*\(messages\).*too large"):
        list(reader.messages())


def test_what_is_no_bag_or_exists_already(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / "notes.db3").write_text("not a database at all, only some text that is long enough to be looked at" * 20)
    for path in ("missing", "notes.db3"):
        for verb in (["check"], ["repair", "--output", str(tmp_path / "new")], ["info"]):
            assert main(["bag", verb[0], str(tmp_path / path), *verb[1:]]) == 2
            assert path in capsys.readouterr().err
    before = (bag / "run_0.mcap").read_bytes()
    assert main(["bag", "repair", str(bag), "--output", str(bag)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert (bag / "run_0.mcap").read_bytes() == before
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("storage", ["mcap", "lz4", "zstd", "db3", "messages", "file"])
@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_whatever_is_damaged_ends_in_a_verdict_or_a_message(tmp_path: Path, storage: str, data: st.DataObject) -> None:
    """And what is repaired is sound."""
    bag, whole, new = tmp_path / "run", tmp_path / "whole", tmp_path / "new"
    if not bag.exists():
        modes = {"db3": CompressionMode.NONE, "messages": CompressionMode.MESSAGE, "file": CompressionMode.FILE}
        if storage in modes:
            theirs(bag, StoragePlugin.SQLITE3, modes[storage], n=20)
        else:
            bag_samples.write_bag(bag, 4, chunk_bytes=20_000, compression="none" if storage == "mcap" else storage)
        (file,) = (file for file in bag.iterdir() if file.name != "metadata.yaml")
        shutil.copyfile(file, whole)
    (file,) = (file for file in bag.iterdir() if file.name != "metadata.yaml")
    content = bytearray(whole.read_bytes())
    content = content[: data.draw(st.integers(1, len(content)))] if data.draw(st.booleans()) else content
    for _ in range(data.draw(st.integers(0, 8))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    file.write_bytes(bytes(content))
    shutil.rmtree(new, ignore_errors=True)
    with suppress(TrackerError):
        check_bag(bag)
    with suppress(TrackerError), BagReader(bag) as reader:
        for message in reader.messages():
            with suppress(TrackerError):
                reader.decode(message)
    with suppress(TrackerError):
        repair_bag(bag, new)
        check = check_bag(new)
        assert check.sound, check.problems


def renamed(bag: Path, old: str, new: str) -> Path:
    """The bag with a topic under another name in its metadata alone."""
    path = bag / "metadata.yaml"
    text = path.read_text()
    assert f"name: {old}" in text
    path.write_text(text.replace(f"name: {old}", f"name: {new}"))
    return bag


def test_a_topic_that_was_renamed_in_the_metadata_alone_is_told(bag: Path):
    known = {each.topic.name: each for each in check_bag(bag).topics}
    check = check_bag(renamed(bag, "/tracker/state", "/other/state"))
    problems = " ".join(check.problems)
    assert "/tracker/state: in " in problems and "not in metadata.yaml" in problems and "/other/state: " in problems
    found = {each.topic.name: each for each in check.topics}
    assert found["/tracker/state"].count == known["/tracker/state"].count > 0
    assert found["/tracker/state"].topic.type_name == known["/tracker/state"].topic.type_name
    assert main(["bag", "check", str(bag)]) == 1


def test_messages_of_another_type_than_the_metadata_says_are_not_decoded(bag: Path):
    with BagReader(bag) as reader:
        other = next(topic.name for topic in reader.topics.values() if topic.name != "/tracker/state" and topic.message_count)
    renamed(bag, "/tracker/state", other)
    with BagReader(bag) as reader, pytest.raises(FileFormatError, match=rf"{other}.*messages of one type"):
        list(reader.decoded(other))


def test_states_are_not_looked_for_in_another_topic(bag: Path):
    with BagReader(bag) as reader:
        other = next(topic.name for topic in reader.topics.values() if topic.name != "/tracker/state")
    with pytest.raises(FileFormatError, match=rf"{other}.*expected messages of type tracker_msgs/msg/TrackedState"):
        load_run(bag, topic=other)
