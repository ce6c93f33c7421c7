"""The player: what was recorded comes out again, at its times, on a real graph."""

import itertools
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from helpers.ros.processes import wait_until
from helpers.sources import bag_samples

rclpy = pytest.importorskip("rclpy", reason="ROS is not installed")

from rcl_interfaces.srv import SetParameters  # noqa: E402
from rclpy.context import Context  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import SetBool, Trigger  # noqa: E402

from tracker_node.cli.main import main  # noqa: E402
from tracker_node.loaders.bag.message_types import typestore  # noqa: E402
from tracker_node.loaders.bag.metadata import OfferedQos  # noqa: E402
from tracker_node.loaders.bag.reader import BagReader  # noqa: E402
from tracker_node.loaders.bag.writer import BagWriter  # noqa: E402
from tracker_node.ros.bag.player import BagTime  # noqa: E402
from tracker_node.ros.conversions import stamp_ns_of  # noqa: E402

RELIABLE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Listener:
    """What arrives on some topics, with the time of its arrival."""

    def __init__(self):
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node("listener", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.heard: dict[str, list[tuple[float, object]]] = {}

    def listen(self, topic: str, class_, qos=RELIABLE) -> None:
        self.heard[topic] = []
        self.node.create_subscription(class_, topic, lambda m: self.heard[topic].append((time.monotonic(), m)), qos)

    def texts(self, topic: str) -> list[str]:
        return [message.data for _, message in self.heard[topic]]

    def until(self, predicate, timeout_s: float = 30.0) -> None:
        def step() -> bool:
            self.executor.spin_once(timeout_sec=0.05)
            return predicate()

        wait_until(step, timeout_s, lambda: str({topic: len(messages) for topic, messages in self.heard.items()}))

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def listener() -> Iterator[Listener]:
    listener = Listener()
    yield listener
    listener.close()


def text_bag(path: Path, n: int = 21, period_s: float = 0.05) -> Path:
    with BagWriter(path) as writer:
        for i in range(n):
            writer.write_message("/a", bag_samples.START_NS + round(i * period_s * 1e9), bag_samples.text(f"a{i}"))
            writer.write_message("/b", bag_samples.START_NS + round(i * period_s * 1e9), bag_samples.text(f"b{i}"))
    return path


def test_messages_come_at_their_times_with_the_clock(listener: Listener, tmp_path: Path, start) -> None:
    listener.listen("/a", String)
    listener.listen("/clock", Clock)
    player = start("player", str(text_bag(tmp_path / "bag", 41)), "--topics", "a", "--wait-for-subscribers", "1", "--rate", "4")
    listener.until(lambda: len(listener.heard["/a"]) == 41)
    assert listener.texts("/a") == [f"a{i}" for i in range(41)]
    times = [at for at, _ in listener.heard["/a"]]
    assert 0.4 < times[-1] - times[0] < 1.6  # two seconds of bag at four times the speed
    clock = [stamp_ns_of(message.clock) for _, message in listener.heard["/clock"]]
    assert clock == sorted(clock)
    assert len(clock) > 10
    assert bag_samples.START_NS <= clock[0] <= clock[-1] <= bag_samples.START_NS + 2 * 10**9
    wait_until(lambda: player.process.poll() is not None)
    assert player.end(0) == 0
    assert "player: 41 messages published" in player.text


def test_part_of_a_bag_in_a_loop_until_sigint(listener: Listener, tmp_path: Path, start) -> None:
    listener.listen("/a", String)
    listener.listen("/b", String)
    player = start(
        "player", str(text_bag(tmp_path / "bag")), "--start", "0.8", "--duration", "0.12", "--loop", "--exclude", "/b",
        "--wait-for-subscribers", "1",
    )  # fmt: skip
    listener.until(lambda: len(listener.heard["/a"]) >= 9)
    assert listener.texts("/a")[:9] == ["a16", "a17", "a18"] * 3
    assert listener.heard["/b"] == []
    assert player.end(signal.SIGINT) == 0, player.text


def test_it_waits_for_the_node_of_a_name_in_any_namespace_or_in_its_own(listener: Listener, tmp_path: Path, start) -> None:
    listener.listen("/a", String)
    bag = str(text_bag(tmp_path / "bag"))
    for name, begins in (("listener", True), ("/listener", True), ("/lab/listener", False)):
        player = start("player", bag, "--topics", "a", "--rate", "4", "--wait-for-node", name)
        if begins:
            listener.until(lambda ended=player.process: ended.poll() is not None)
            assert player.process.returncode == 0, player.text
        else:
            player.wait_for("waiting for the node /lab/listener to subscribe; so far /listener has")
            assert player.end(signal.SIGINT) == 0, player.text


def test_pause(listener: Listener, tmp_path: Path, start) -> None:
    listener.listen("/a", String)
    player = start("player", str(text_bag(tmp_path / "bag")), "--topics", "a", "--paused", "--wait-for-subscribers", "1")
    client = listener.node.create_client(SetBool, "/player/pause")
    listener.until(client.service_is_ready)
    listener.until(lambda: listener.node.count_publishers("/a") == 1)
    assert listener.heard["/a"] == []
    answer = client.call_async(SetBool.Request(data=False))
    listener.until(answer.done)
    assert answer.result().message == "playing"
    listener.until(lambda: len(listener.heard["/a"]) >= 3)
    answer = client.call_async(SetBool.Request(data=True))
    listener.until(answer.done)
    count, deadline = len(listener.heard["/a"]), time.monotonic() + 0.5
    listener.until(lambda: time.monotonic() > deadline)
    assert len(listener.heard["/a"]) <= count + 1
    answer = client.call_async(SetBool.Request(data=False))
    listener.until(lambda: len(listener.heard["/a"]) == 21)
    assert player.process.wait(20) == 0


def test_steps_and_seeking_while_it_is_paused(listener: Listener, tmp_path: Path, start) -> None:
    """Each step is one message with its time on /clock; seeking goes back as well, and playing goes on from there."""
    listener.listen("/a", String)
    listener.listen("/clock", Clock)
    player = start("player", str(text_bag(tmp_path / "bag")), "--topics", "a", "--paused", "--wait-for-subscribers", "1")
    step = listener.node.create_client(Trigger, "/player/play_next")
    pause = listener.node.create_client(SetBool, "/player/pause")
    parameters = listener.node.create_client(SetParameters, "/player/set_parameters")
    listener.until(lambda: step.service_is_ready() and parameters.service_is_ready() and pause.service_is_ready())

    def call(client, request):
        answer = client.call_async(request)
        listener.until(answer.done)
        return answer.result()

    def set_parameter(name: str, value: float):
        return call(parameters, SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])).results[0]

    def clock_s() -> float:
        return 1e-9 * (stamp_ns_of(listener.heard["/clock"][-1][1].clock) - bag_samples.START_NS)

    listener.until(lambda: len(listener.heard["/clock"]) > 3)
    assert listener.texts("/a") == []
    for i in range(3):
        assert call(step, Trigger.Request()).success
        listener.until(lambda: len(listener.heard["/a"]) == i + 1)  # noqa: B023
    assert listener.texts("/a") == ["a0", "a1", "a2"]
    listener.until(lambda: abs(clock_s() - 0.1) < 1e-6)
    assert set_parameter("position", 0.9).successful
    listener.until(lambda: abs(clock_s() - 0.9) < 1e-6)
    assert call(step, Trigger.Request()).success
    listener.until(lambda: listener.texts("/a")[3:] == ["a18"])
    assert set_parameter("step_s", 0.12).successful
    assert set_parameter("position", 0.3).successful
    assert call(step, Trigger.Request()).success
    listener.until(lambda: listener.texts("/a")[4:] == ["a6", "a7", "a8"])
    refused = set_parameter("position", 5.0)
    assert not refused.successful
    assert "position" in refused.reason
    assert set_parameter("position", 0.5).successful
    assert set_parameter("rate", 5.0).successful
    assert call(pause, SetBool.Request(data=False)).success
    listener.until(lambda: len(listener.heard["/a"]) == 18)
    assert listener.texts("/a")[7:] == [f"a{i}" for i in range(10, 21)]
    assert player.process.wait(20) == 0


def test_what_was_latched_before_the_start_is_told_first(listener: Listener, tmp_path: Path, start) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/latched", "std_msgs/msg/String", OfferedQos("reliable", "transient_local", depth=1))
        writer.write_message("/latched", bag_samples.START_NS, bag_samples.text("old"))
        writer.write_message("/latched", bag_samples.START_NS + 10, bag_samples.text("description"))
        for i in range(20):
            writer.write_message("/a", bag_samples.START_NS + i * 10**8, bag_samples.text(f"a{i}"))
    listener.listen("/latched", String, LATCHED)
    listener.listen("/a", String)
    start("player", str(tmp_path / "bag"), "--start", "1.75", "--wait-for-subscribers", "1")
    listener.until(lambda: len(listener.heard["/a"]) == 2)
    assert listener.texts("/latched") == ["description"]
    assert listener.texts("/a") == ["a18", "a19"]


def test_a_loop_sets_the_clock_back(listener: Listener, tmp_path: Path, start) -> None:
    listener.listen("/clock", Clock)
    player = start("player", str(text_bag(tmp_path / "bag", 5)), "--topics", "a", "--loop")

    def jumps() -> int:
        times = [stamp_ns_of(message.clock) for _, message in listener.heard["/clock"]]
        return sum(after < before for before, after in itertools.pairwise(times))

    listener.until(lambda: jumps() >= 2)
    assert player.end(signal.SIGINT) == 0


@pytest.mark.parametrize(
    ("storage", "mode"),
    [
        (StoragePlugin.SQLITE3, CompressionMode.NONE),
        (StoragePlugin.SQLITE3, CompressionMode.FILE),
        (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
        (StoragePlugin.MCAP, CompressionMode.FILE),
        (StoragePlugin.MCAP, CompressionMode.MESSAGE),
        (StoragePlugin.MCAP, CompressionMode.STORAGE),
    ],
)
def test_bags_of_others_are_played(listener: Listener, tmp_path: Path, start, storage, mode) -> None:
    writer = Writer(tmp_path / "theirs", version=9, storage_plugin=storage)
    if mode != CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/a", "std_msgs/msg/String", typestore=typestore())
        for i in range(10):
            data = typestore().serialize_cdr(bag_samples.text(f"a{i}"), "std_msgs/msg/String")
            writer.write(connection, bag_samples.START_NS + i * 10**7, data)
    listener.listen("/a", String)
    player = start("player", str(tmp_path / "theirs"), "--wait-for-subscribers", "1")
    listener.until(lambda: len(listener.heard["/a"]) == 10)
    assert listener.texts("/a") == [f"a{i}" for i in range(10)]
    assert player.process.wait(20) == 0


def test_recording_what_is_played_gives_the_same_bytes(tmp_path: Path, start) -> None:
    """Player to recorder: topics, types, bytes and quality of service survive, also those of an unfinished bag."""
    bag = bag_samples.write_bag(tmp_path / "bag", 20)
    recorder = start("recorder", "--output", str(tmp_path / "copy"), "--all", "--exclude", "/clock|/rosout|/parameter_events")
    recorder.wait_for("recorder: ready")
    player = start("player", str(bag), "--wait-for-subscribers", "1")
    assert player.process.wait(40) == 0, player.text
    assert recorder.end() == 0, recorder.text
    with BagReader(bag) as before, BagReader(tmp_path / "copy") as after:
        names = set(before.topics)
        assert names <= set(after.topics)
        for name in names:
            old, new = before.topic(name), after.topic(name)
            assert (old.type_name, old.definition, old.type_hash) == (new.type_name, new.definition, new.type_hash)
            assert (old.qos.reliability, old.qos.durability) == (new.qos.reliability, new.qos.durability)
            pairs = zip(before.messages([name]), after.messages([name]), strict=True)
            assert all(_same_but_for_padding(sent.data, received.data) for sent, received in pairs)


def _same_but_for_padding(sent: bytes, received: bytes) -> bool:
    """The middleware fills messages up to a multiple of four bytes."""
    return received[: len(sent)] == sent and len(received) - len(sent) < 4 and not any(received[len(sent) :])


def test_mistakes_are_named(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    bag = text_bag(tmp_path / "bag", 2)
    assert main(["player", str(tmp_path / "missing")]) == 2
    assert "missing" in capsys.readouterr().err
    assert main(["player", str(bag), "--topics", "/c"]) == 2
    assert "valid: /a, /b" in capsys.readouterr().err
    assert main(["player", str(bag), "--rate", "0"]) == 2
    assert "positive" in capsys.readouterr().err
    assert main(["player", str(bag), "--start", "7"]) == 2
    assert "start: expected 0 to 0.050 s, the length of the bag, got 7.0" in capsys.readouterr().err
    assert main(["player", str(bag), "--duration", "-1"]) == 2
    assert "duration: expected a positive number" in capsys.readouterr().err
    for given, said in (
        ("rate:=0.0", "parameter 'rate': expected a number from 0.001 to 1000, got 0.0"),
        ("rate:=fast", "parameter 'rate': expected a number from 0.001 to 1000, got 'fast'"),
        ("rate:=.nan", "parameter 'rate': expected a number from 0.001 to 1000, got nan"),
        ("position:=7", "parameter 'position': expected a number from 0 to 0.05, got 7.0"),
        ("rat:=2.0", "unknown parameter 'rat'; valid: position, rate, "),
    ):
        assert main(["player", str(bag), "--ros-args", "-p", given]) == 2
        error = capsys.readouterr().err
        assert said in error
        assert error.count("\n") == 1


def test_a_topic_with_a_name_that_ros_does_not_take(tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.write_message("/a b", bag_samples.START_NS, bag_samples.text("a"))
    assert main(["player", str(tmp_path / "bag")]) == 2
    error = capfd.readouterr().err
    assert "no topic can be played: Invalid topic name" in error
    assert "Traceback" not in error


def test_a_position_before_the_beginning_and_beyond_the_part_of_a_loop(listener: Listener, tmp_path: Path, start) -> None:
    """It begins where the parameter says, an integer or not; a place set while it waits for subscribers wins over that."""
    bag = text_bag(tmp_path / "bag", 41)
    options = ["--topics", "a", "--duration", "0.52", "--loop", "--wait-for-subscribers", "1"]
    player = start("player", str(bag), *options, "--ros-args", "-p", "position:=0.3", "-p", "rate:=2")
    parameters = listener.node.create_client(SetParameters, "/player/set_parameters")
    listener.until(parameters.service_is_ready)

    def seek(position_s: float) -> None:
        parameter = Parameter("position", value=position_s).to_parameter_msg()
        answer = parameters.call_async(SetParameters.Request(parameters=[parameter]))
        listener.until(answer.done)
        assert answer.result().results[0].successful

    listener.listen("/a", String)
    listener.until(lambda: len(listener.heard["/a"]) > 6)
    assert listener.texts("/a")[:6] == ["a6", "a7", "a8", "a9", "a10", "a0"]
    seek(1.5)  # beyond the part: it begins again
    n = len(listener.heard["/a"])
    listener.until(lambda: "a0" in listener.texts("/a")[n + 1 :])
    assert player.end(signal.SIGINT) == 0, player.text

    waiting = start("player", str(bag), *options[:-1], "2")
    listener.until(lambda: listener.node.count_publishers("/a") == 1 and parameters.service_is_ready())
    seek(0.4)
    listener.listen("/a", String)
    listener.until(lambda: len(listener.heard["/a"]) > 4)
    assert listener.texts("/a")[0] == "a8"
    assert waiting.end(signal.SIGINT) == 0, waiting.text


def test_bag_time_runs_at_its_rate_and_stands_still_when_paused() -> None:
    clock = BagTime(rate=100.0)
    clock.begin(1000)
    time.sleep(0.02)
    clock.pause(True)
    stopped = clock.now_ns()
    assert stopped > 1000 + 100 * 0.02 * 1e9 * 0.9
    time.sleep(0.01)
    assert clock.now_ns() == stopped
    clock.pause(False)
    clock.sleep(stopped + 10**8, 5.0)
    assert clock.now_ns() >= stopped + 10**8
