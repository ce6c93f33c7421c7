"""From an unfinished bag to one that everybody can open."""

from pathlib import Path

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from helpers.sources import bag_samples
from tracker_node.cli.main import main
from tracker_node.loaders.bag.message_types import typestore
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.bag.writer import BagWriter


def test_the_recovered_bag_has_everything_that_could_be_read(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    bag = bag_samples.write_bag(tmp_path / "run")
    file = bag / "run_0.mcap"
    file.write_bytes(file.read_bytes()[: int(file.stat().st_size * 0.6)])
    (bag / "metadata.yaml").unlink()
    assert main(["bag", "repair", str(bag), "--output", str(tmp_path / "new")]) == 0
    assert "breaks off" in capsys.readouterr().out
    with BagReader(bag) as old, BagReader(tmp_path / "new") as new, AnyReader([tmp_path / "new"]) as others:
        assert (new.recovered, new.message_count) == (False, old.message_count)
        assert {name: t.qos for name, t in new.topics.items()} == {name: t.qos for name, t in old.topics.items()}
        pairs = zip(old.messages(), new.messages(), others.messages(), strict=True)
        for before, after, (connection, stamp_ns, data) in pairs:
            assert (before.topic, before.stamp_ns, before.data) == (after.topic, after.stamp_ns, after.data)
            assert (connection.topic, stamp_ns, data) == (before.topic, before.stamp_ns, before.data)
        assert old.message_count > 40


def test_times_of_publication_are_kept(tmp_path: Path) -> None:
    """By another reader; also those of a bag that was finished."""
    with BagWriter(tmp_path / "run") as writer:
        writer.add_topic("/a", "std_msgs/msg/String")
        data = typestore().serialize_cdr(bag_samples.text("a"), "std_msgs/msg/String")
        for i in range(5):
            writer.write("/a", 1000 + i, data, publish_ns=900 + i)
    assert main(["bag", "repair", str(tmp_path / "run"), "--output", str(tmp_path / "new")]) == 0
    with (tmp_path / "new" / "new_0.mcap").open("rb") as stream:
        times = [(message.log_time, message.publish_time) for _, _, message in make_reader(stream).iter_messages()]
    assert times == [(1000 + i, 900 + i) for i in range(5)]


def test_nothing_is_written_over(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    bag = bag_samples.write_bag(tmp_path / "run", 2)
    assert main(["bag", "repair", str(bag), "--output", str(bag)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["bag", "repair", str(tmp_path / "missing"), "--output", str(tmp_path / "new")]) == 2
    assert not (tmp_path / "new").exists()
