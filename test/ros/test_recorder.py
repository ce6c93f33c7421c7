"""The recorder as a process of its own, on a real graph."""

import re
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from ros_processes import send, wait_until

rclpy = pytest.importorskip("rclpy", reason="ROS is not installed")

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from rclpy.context import Context  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy  # noqa: E402
from rosbags.highlevel import AnyReader  # noqa: E402
from sensor_msgs.msg import Image  # noqa: E402
from std_msgs.msg import String  # noqa: E402

from tracker_node.cli.main import main  # noqa: E402
from tracker_node.loaders.bag_reader import BagReader  # noqa: E402
from tracker_node.ros.conversions import image_message  # noqa: E402

BEST_EFFORT = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


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
    early = node.create_publisher(String, "/early", 10)
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


def test_a_killed_recorder_leaves_what_it_had_flushed(node: Node, tmp_path: Path, start) -> None:
    recorder = start("recorder", "--output", str(tmp_path / "run"), "--topics", "/early:std_msgs/msg/String")
    recorder.wait_for("recorder: ready")
    states: list[dict[str, str]] = []
    node.create_subscription(
        DiagnosticArray, "/diagnostics", lambda m: states.extend({v.key: v.value for v in s.values} for s in m.status), 10
    )
    early = node.create_publisher(String, "/early", 10)
    send(early, [String(data=str(i)) for i in range(20)])
    executor = rclpy.executors.SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    deadline = time.monotonic() + 20.0
    while not any(state.get("messages") == "20" for state in states) and time.monotonic() < deadline:
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()
    assert states[-1]["lost"] == "0"
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
    assert not (tmp_path / "new").exists()


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
