"""From an unfinished bag to one that everybody can open."""

from pathlib import Path

import bag_samples
import pytest
from rosbags.highlevel import AnyReader

from tracker_node.cli.main import main
from tracker_node.loaders.bag_reader import BagReader


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


def test_nothing_is_written_over(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    bag = bag_samples.write_bag(tmp_path / "run", 2)
    assert main(["bag", "repair", str(bag), "--output", str(bag)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["bag", "repair", str(tmp_path / "missing"), "--output", str(tmp_path / "new")]) == 2
    assert not (tmp_path / "new").exists()
