"""The recorder as a process of its own, on a real graph."""

import re
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from helpers.ros.processes import send, wait_until
from helpers.sources.small_disk import small_disk

rclpy = pytest.importorskip("rclpy", reason="ROS is not installed")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from rclpy.context import Context  # noqa: E402
from rclpy.event_handler import PublisherEventCallbacks  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy  # noqa: E402
from rosbags.highlevel import AnyReader  # noqa: E402
from sensor_msgs.msg import Image  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import SetBool, Trigger  # noqa: E402

from tracker_node.cli.main import main  # noqa: E402
from tracker_node.loaders.bag.reader import BagReader  # noqa: E402
from tracker_node.ros.conversions import image_message  # noqa: E402

__all__ = ["small_disk"]

BEST_EFFORT = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
SEVERAL_LATCHED = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def node() -> Iterator[Node]:
    context = Context()
    rclpy.init(context=context)
    node = Node("sender", context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


def test_topics_are_recorded_as_they_appear_and_sigint_finishes_the_bag(node: Node, tmp_path: Path, start) -> None:
    recorder = start("recorder", "--output", str(tmp_path / "run"), "--namespace", "test", "--exclude", "/test/secret")
    recorder.wait_for("recorder: ready")
    reliable = node.create_publisher(String, "/test/reliable", 10)
    hurried = node.create_publisher(String, "/test/hurried", BEST_EFFORT)
    latched = node.create_publisher(String, "/test/latched", LATCHED)
    secret = node.create_publisher(String, "/test/secret", LATCHED)
    elsewhere = node.create_publisher(String, "/other/topic", LATCHED)
    latched.publish(String(data="said before you came"))
    secret.publish(String(data="secret"))
    elsewhere.publish(String(data="elsewhere"))
    send(reliable, [String(data=f"r{i}") for i in range(50)])
    send(hurried, [String(data=f"h{i}") for i in range(50)])
    assert recorder.end() == 0, recorder.text
    assert "101 messages of 3 topics" in recorder.text

    with AnyReader([tmp_path / "run"]) as reader:
        found: dict[str, list[str]] = {}
        for connection, _, data in reader.messages():
            found.setdefault(connection.topic, []).append(reader.deserialize(data, connection.msgtype).data)
    assert found["/test/latched"] == ["said before you came"]
    assert found["/test/reliable"] == [f"r{i}" for i in range(50)]
    assert found["/test/hurried"] == [f"h{i}" for i in range(50)]
    assert set(found) == {"/test/latched", "/test/reliable", "/test/hurried"}
    with BagReader(tmp_path / "run") as own:
        assert own.topic("/test/hurried").qos.reliability == "best_effort"
        assert own.topic("/test/latched").qos.durability == "transient_local"
        assert own.topic("/test/reliable").qos.reliability == "reliable"


def test_images_by_choice_and_sigterm(node: Node, tmp_path: Path, start) -> None:
    recorders = {
        choice: start("recorder", "--output", str(tmp_path / choice), "--regex", "/pic/.*", "--images", choice)
        for choice in ("all", "none")
    }
    for recorder in recorders.values():
        recorder.wait_for("recorder: ready")
    images = node.create_publisher(Image, "/pic/cam01/image_raw", 10)
    texts = node.create_publisher(String, "/pic/note", 10)
    rng = np.random.default_rng(2)
    pixels = [rng.integers(0, 256, (480, 640, 3), dtype=np.uint8) for _ in range(8)]
    wait_until(lambda: texts.get_subscription_count() == 2)
    send(images, [image_message(i, "cam01_optical_frame", p) for i, p in enumerate(pixels)])
    send(texts, [String(data="note")])
    for recorder in recorders.values():
        assert recorder.end(signal.SIGTERM) == 0, recorder.text
    with BagReader(tmp_path / "all") as reader:
        recorded = [message.data.reshape(480, 640, 3) for _, message in reader.decoded("/pic/cam01/image_raw")]
        assert len(recorded) == len(pixels)
        assert all((a == b).all() for a, b in zip(recorded, pixels, strict=True))
    with BagReader(tmp_path / "none") as reader:
        assert set(reader.topics) == {"/pic/note"}


def test_a_topic_with_its_type_is_subscribed_before_it_exists(node: Node, tmp_path: Path, start) -> None:
    """Whoever waits for one subscriber can publish at once and misses nothing, whatever quality of service it offers."""
    recorder = start(
        "recorder", "--output", str(tmp_path / "run"),
        "--topics", "/early:std_msgs/msg/String", "hurried:std_msgs/msg/String", "/never:std_msgs/msg/String",
        "/x:zoo_msgs/msg/X",
    )  # fmt: skip
    recorder.wait_for("recorder: ready, 3 topics")
    early = node.create_publisher(String, "/early", 100)
    hurried = node.create_publisher(String, "/hurried", BEST_EFFORT)
    send(early, [String(data=str(i)) for i in range(20)])
    send(hurried, [String(data=str(i)) for i in range(20)])
    time.sleep(1.0)  # the last ones may still be on their way
    assert recorder.end() == 0, recorder.text
    with BagReader(tmp_path / "run") as reader:
        assert [message.data for _, message in reader.decoded("/early")] == [str(i) for i in range(20)]
        assert reader.topic("/hurried").message_count == 20
        assert reader.topic("/hurried").qos.reliability == "best_effort"
        assert set(reader.topics) == {"/early", "/hurried"}
    assert "no message on /never" in recorder.text
    assert "/x was not recorded: message type 'zoo_msgs/msg/X' cannot be used here" in recorder.text


def test_a_topic_with_its_type_has_what_was_latched(node: Node, tmp_path: Path, start) -> None:
    """Said once before the recorder was there, or just as its publisher appeared: each is in the bag, and none twice."""
    before = node.create_publisher(String, "/latched/before", LATCHED)
    before.publish(String(data="a"))
    names = ("/latched/before", "/latched/later")
    recorder = start("recorder", "--output", str(tmp_path / "run"), "--topics", *(f"{n}:std_msgs/msg/String" for n in names))
    recorder.wait_for("recorder: ready, 2 topics")
    later = node.create_publisher(String, "/latched/later", LATCHED)
    later.publish(String(data="b"))
    wait_until(lambda: before.get_subscription_count() == later.get_subscription_count() == 1)  # none is left behind
    time.sleep(1.0)  # what is said to a new subscriber may still be on its way
    assert recorder.end() == 0, recorder.text
    with BagReader(tmp_path / "run") as reader:
        assert [message.data for _, message in reader.decoded("/latched/before")] == ["a"]
        assert [message.data for _, message in reader.decoded("/latched/later")] == ["b"]
        assert reader.topic("/latched/before").qos.durability == "transient_local"


class Heard:
    """The latest diagnostics of the recorder, and all that it has ever said."""

    def __init__(self, node: Node):
        self.parts: dict[str, DiagnosticStatus] = {}
        self.said: list[tuple[bytes, str]] = []
        self._node = node
        self._subscription = node.create_subscription(DiagnosticArray, "/diagnostics", self._on_array, 100)

    def _on_array(self, array: DiagnosticArray) -> None:
        for status in array.status:
            self.parts[status.name.removeprefix("recorder: ")] = status
            self.said.append((status.level, status.message))

    def value(self, part: str, key: str) -> str:
        status = self.parts.get(part)
        return next((v.value for v in status.values if v.key == key), "") if status else ""

    def until(self, predicate) -> None:
        executor = SingleThreadedExecutor(context=self._node.context)
        executor.add_node(self._node)

        def step() -> bool:
            executor.spin_once(timeout_sec=0.05)
            return predicate()

        wait_until(step, 30.0, lambda: str(self.said))
        executor.shutdown()


def test_a_killed_recorder_leaves_what_it_had_flushed(node: Node, tmp_path: Path, start) -> None:
    recorder = start("recorder", "--output", str(tmp_path / "run"), "--topics", "/early:std_msgs/msg/String")
    recorder.wait_for("recorder: ready")
    heard = Heard(node)
    early = node.create_publisher(String, "/early", 100)
    send(early, [String(data=str(i)) for i in range(20)])
    heard.until(lambda: heard.value("bag", "messages") == "20")
    assert heard.value("bag", "lost") == "0"
    heard.until(lambda: heard.value("topics", "/early").startswith("20 messages, "))
    time.sleep(1.0)  # longer than a flush may take
    assert recorder.end(signal.SIGKILL) == -9
    with BagReader(tmp_path / "run") as reader:
        assert reader.recovered
        assert [message.data for _, message in reader.decoded("/early")] == [str(i) for i in range(20)]


def test_mistakes_are_named(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / "there").mkdir()
    assert main(["recorder", "--output", str(tmp_path / "there"), "--all"]) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["recorder", "--output", str(tmp_path / "new")]) == 2
    assert "nothing to record" in capsys.readouterr().err
    assert main(["recorder", "--output", str(tmp_path / "new"), "--regex", "("]) == 2
    assert "regular expression '('" in capsys.readouterr().err
    for option, problem in (
        ("--split-mb=-1", "expected 0 or more, got -1"),
        ("--flush-s=0", "expected a positive number, got 0"),
    ):
        assert main(["recorder", "--output", str(tmp_path / "new"), "--all", option]) == 2
        assert f"{option.partition('=')[0]}: {problem}" in capsys.readouterr().err
    assert main(["recorder", "--output", str(tmp_path / "new"), "--topics", "/a b:std_msgs/msg/String"]) == 2
    error = capsys.readouterr().err
    assert "--topics: expected names of topics, got '/a b'" in error
    assert error.count("\n") == 1
    assert not (tmp_path / "new").exists()


def test_files_as_asked_for(node: Node, tmp_path: Path, start) -> None:
    recorder = start(
        "recorder", "--output", str(tmp_path / "run"), "--topics", "/a:std_msgs/msg/String", "--split-mb", "0.01", "--sync",
        "--compression", "lz4", "--flush-s", "0.1",
    )  # fmt: skip
    recorder.wait_for("recorder: ready")
    texts = [np.random.default_rng(i).bytes(250).hex() * 100 for i in range(40)]
    send(node.create_publisher(String, "/a", 100), [String(data=text) for text in texts])
    assert recorder.end() == 0, recorder.text
    files = sorted((tmp_path / "run").glob("*.mcap"))
    assert len(files) > 1
    assert sum(file.stat().st_size for file in files) < 0.5 * sum(map(len, texts))
    with BagReader(tmp_path / "run") as reader:
        assert [message.data for _, message in reader.decoded("/a")] == texts


def test_what_does_not_arrive_is_counted(node: Node, tmp_path: Path, start) -> None:
    """A recorder that stands still for a while cannot have everything, and says so.

    How many it lacks is what the middleware reports: never too many, but on a busy machine it does not notice all.
    """
    recorder = start("recorder", "--output", str(tmp_path / "run"), "--topics", "/large")
    recorder.wait_for("recorder: ready")
    large = node.create_publisher(String, "/large", BEST_EFFORT)
    message = String(data="x" * 200_000)
    send(large, [message] * 10)
    recorder.process.send_signal(signal.SIGSTOP)
    send(large, [message] * 400)
    recorder.process.send_signal(signal.SIGCONT)
    time.sleep(3.0)  # what waits in memory is taken in first
    send(large, [message] * 10)
    assert recorder.end() == 0, recorder.text
    lost = re.search(r"/large: (\d+) messages lost on their way", recorder.text)
    assert lost, recorder.text
    with BagReader(tmp_path / "run") as reader:
        recorded = reader.topic("/large").message_count
    assert recorded < 420
    assert 0 < int(lost[1]) <= 420 - recorded


def test_a_full_disk_ends_the_recording_cleanly(node: Node, start, small_disk) -> None:
    """What had come is in a finished bag; log, diagnostics and exit status say that it ended, and why."""
    bag = small_disk(20) / "run"
    recorder = start("recorder", "--output", str(bag), "--topics", "/large:std_msgs/msg/String", "--min-free-mb", "0")
    recorder.wait_for("recorder: ready")
    heard = Heard(node)
    large = node.create_publisher(String, "/large", 10)
    wait_until(lambda: large.get_subscription_count() > 0)
    numbers = iter(range(10**6))

    def publish() -> bool:
        large.publish(String(data=f"{next(numbers)} " + "x" * 300_000))
        return recorder.process.poll() is not None

    heard.until(publish)
    assert recorder.process.wait() == 1
    wait_until(lambda: "messages of 1 topics" in recorder.text)
    assert "error: bag" in recorder.text
    assert "stopped: No space left on device" in recorder.text
    assert (DiagnosticStatus.ERROR, "stopped: No space left on device") in heard.said
    with AnyReader([bag]) as reader:
        texts = [reader.deserialize(data, connection.msgtype).data for connection, _, data in reader.messages()]
    assert [int(text.split()[0]) for text in texts] == list(range(len(texts)))
    assert len(texts) > 40
    dropped = re.search(r"/large: (\d+) messages dropped because they could not be written", recorder.text)
    assert f"{len(texts)} messages of 1 topics" in recorder.text
    assert dropped is None or len(texts) + int(dropped[1]) <= next(numbers)


def test_too_little_room_is_refused_at_the_start(small_disk, capsys: pytest.CaptureFixture) -> None:
    disk = small_disk(20)
    assert main(["recorder", "--output", str(disk / "new" / "run"), "--all"]) == 2
    assert "--min-free-mb asks for 200 MB of free room, there are 20" in capsys.readouterr().err
    assert list(disk.iterdir()) == []


def test_pause_and_split_by_service(node: Node, tmp_path: Path, start) -> None:
    recorder = start("recorder", "--output", str(tmp_path / "run"), "--topics", "/a:std_msgs/msg/String", "/model")
    recorder.wait_for("recorder: ready")
    model = node.create_publisher(String, "/model", LATCHED)
    model.publish(String(data="person"))
    heard = Heard(node)
    pause, split = node.create_client(SetBool, "/recorder/pause"), node.create_client(Trigger, "/recorder/split")
    wait_until(lambda: pause.service_is_ready() and split.service_is_ready())
    heard.until(lambda: heard.value("bag", "messages") == "1")

    def call(client, request) -> str:
        answer = client.call_async(request)
        heard.until(answer.done)
        return answer.result().message

    a = node.create_publisher(String, "/a", 100)
    send(a, [String(data="before")] * 40)  # a steady rate, of which silence would be told
    heard.until(lambda: heard.value("bag", "messages") == "41")
    assert call(pause, SetBool.Request(data=True)) == "paused"
    send(a, [String(data="meanwhile")])
    heard.until(lambda: (DiagnosticStatus.OK, "paused") in heard.said)
    until_s = time.monotonic() + 4.0  # and longer than a topic may be silent
    heard.until(lambda: time.monotonic() > until_s)
    assert call(pause, SetBool.Request(data=False)) == "recording"
    until_s = time.monotonic() + 1.5
    heard.until(lambda: time.monotonic() > until_s)
    assert not [message for _, message in heard.said if "nothing comes" in message]
    heard.until(lambda: heard.value("topics", "/a").startswith("40 messages, "))
    assert call(split, Trigger.Request()) == "file 1 ends here"
    send(a, [String(data="after")])
    assert recorder.end() == 0, recorder.text
    assert sorted(file.name for file in (tmp_path / "run").glob("*.mcap")) == ["run_0.mcap", "run_1.mcap"]
    with BagReader(tmp_path / "run") as reader:
        assert [message.data for _, message in reader.decoded("/a")] == ["before"] * 40 + ["after"]
    with BagReader(tmp_path / "run" / "run_1.mcap") as alone:
        assert [message.data for _, message in alone.decoded("/model")] == ["person"]
    assert "42 messages of 2 topics" in recorder.text  # each once


# Of a depth for all that is sent: a publisher forgets what is older, whether it has arrived or not.
@pytest.mark.parametrize("qos", [BEST_EFFORT, SEVERAL_LATCHED, QoSProfile(depth=10)], ids=["best effort", "latched", "usual"])
def test_no_reader_is_left_that_does_not_match(node: Node, tmp_path: Path, start, qos: QoSProfile) -> None:
    """A publisher that appears later has one subscriber in the end, and only one that offers less is told of a mismatch."""
    mismatches = []
    recorder = start("recorder", "--output", str(tmp_path / "run"), "--topics", "/later:std_msgs/msg/String")
    recorder.wait_for("recorder: ready, 1 topic")
    events = PublisherEventCallbacks(incompatible_qos=mismatches.append)
    publisher = node.create_publisher(String, "/later", qos, event_callbacks=events)
    wait_until(lambda: [s.qos_profile.reliability for s in node.get_subscriptions_info_by_topic("/later")] == [qos.reliability])
    send(publisher, [String(data=str(i)) for i in range(5)])
    told = []
    node.create_subscription(DiagnosticArray, "/diagnostics", lambda m: told.extend(s.values for s in m.status), 100)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)

    def arrived() -> bool:
        executor.spin_once(timeout_sec=0.1)
        return any(v.key == "/later" and v.value.startswith("5 messages") for values in told for v in values)

    wait_until(arrived, explain=lambda: recorder.text)
    executor.shutdown()
    assert bool(mismatches) == (qos is BEST_EFFORT)
    assert recorder.end() == 0, recorder.text
    with BagReader(tmp_path / "run") as reader:
        assert [message.data for _, message in reader.decoded("/later")] == [str(i) for i in range(5)]


def test_publishers_that_offer_less_than_was_expected(node: Node, tmp_path: Path, start) -> None:
    """Subscribed to before it exists, again and again: nothing comes twice, and the event loop survives."""
    names = [f"/hurried{i}" for i in range(6)]
    topics = [f"{name}:std_msgs/msg/String" for name in names]
    recorder = start("recorder", "--output", str(tmp_path / "run"), "--topics", *topics)
    recorder.wait_for("recorder: ready, 6 topics")
    publishers = [node.create_publisher(String, name, BEST_EFFORT) for name in names]
    reliable = [node.create_publisher(String, name, 10) for name in names]
    for one, other in zip(publishers, reliable, strict=True):
        send(one, [String(data=str(i)) for i in range(10)])
        send(other, [String(data=str(i)) for i in range(10, 20)])
    time.sleep(1.0)  # the last ones may still be on their way
    assert recorder.end() == 0, recorder.text
    with BagReader(tmp_path / "run") as reader:
        for name in names:
            assert [message.data for _, message in reader.decoded(name)] == [str(i) for i in range(20)]
