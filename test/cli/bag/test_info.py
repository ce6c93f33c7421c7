"""``tracker_node bag info``."""

from helpers.sources.bag_samples import PERIOD_NS, write_bag
from tracker_node.cli.main import main
from tracker_node.loaders.bag.writer import BagWriter


def test_topics_sizes_and_times(tmp_path, capsys):
    bag = write_bag(tmp_path / "bag", 31)
    assert main(["bag", "info", str(bag)]) == 0
    first, times, *topics = capsys.readouterr().out.splitlines()
    size = sum(file.stat().st_size for file in bag.glob("*.mcap"))
    assert first == f"{bag}: 1 file(s), {size / 1e6:.1f} MB, 93 messages"
    assert times.startswith("from ") and times.endswith(f" on, {30 * PERIOD_NS / 1e9:.3f} s")
    assert [line.split()[:2] for line in topics] == [["/cam01/image_raw", "31"], ["/chatter", "31"], ["/tracker/state", "31"]]
    assert topics[0].startswith(f"  {'/cam01/image_raw':40}       31 sensor_msgs/msg/Image")


def test_a_bag_without_messages_has_no_times(tmp_path, capsys):
    with BagWriter(tmp_path / "bag"):
        pass
    assert main(["bag", "info", str(tmp_path / "bag")]) == 0
    out = capsys.readouterr().out
    assert "0 messages" in out and "from " not in out and "not finished" not in out and out.count("\n") == 1


def test_a_bag_that_is_gone_is_an_error(tmp_path, capsys):
    assert main(["bag", "info", str(tmp_path / "gone")]) == 2
    assert "tracker_node bag: error: " in capsys.readouterr().err
