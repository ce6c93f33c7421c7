"""What callbacks raise ends no node: real messages, timers and services, and ends of topics that are gone."""

import threading
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Int32
from std_srvs.srv import Trigger

from tracker_node.ros import executor
from tracker_node.ros.bag.player import PlayerNode
from tracker_node.ros.bag.recorder import RecorderNode
from tracker_node.ros.conversions import image_message
from tracker_node.ros.diagnostics import Diagnostics, QosMismatches
from tracker_node.ros.guarded_node import GuardedNode
from tracker_node.ros.ingest.node import CameraIngestNode
from tracker_node.ros.ingest.rectify_node import RectifyNode
from tracker_node.ros.qos import images_published
from tracker_node.ros.tracker.image_inbox import ImageInbox, InboxOptions
from tracker_node.ros.tracker.node import TrackerNode

TIMEOUT_S = 60.0


class Loop:
    """A guarded node in the event loop that every node has."""

    def __init__(self) -> None:
        self.node = GuardedNode("guarded")

    def until(self, predicate: Callable[[], object], what: str) -> None:
        until_s = time.monotonic() + TIMEOUT_S
        executor.spin(self.node, threading.Event(), lambda: bool(predicate()) or time.monotonic() > until_s)
        assert predicate(), what


@pytest.fixture(params=["events", "single-threaded"])
def loop(ros, request, monkeypatch):
    if request.param == "single-threaded":
        monkeypatch.setattr(executor, "make_executor", SingleThreadedExecutor)
    loop = Loop()
    yield loop
    executor._executors.pop(loop.node).shutdown()
    loop.node.destroy_node()


@pytest.mark.parametrize("kind", [TrackerNode, CameraIngestNode, RecorderNode, PlayerNode, RectifyNode])
def test_every_node_is_guarded(kind):
    assert issubclass(kind, GuardedNode)


def test_a_node_outlives_what_its_callbacks_raise_and_says_so(loop, probe, capfd):
    node, came, ticks, asked_times = loop.node, [], [], []

    def receive(message: Int32) -> None:
        came.append(message.data)
        if message.data % 2:
            raise KeyError(f"no such number {message.data}")

    def tick() -> None:
        ticks.append(1)
        raise ZeroDivisionError("of the timer")

    def answer(request, response):
        response.success = True
        asked_times.append(1)
        raise OSError("of the service")

    said: dict[str, DiagnosticStatus] = {}
    Diagnostics(node, "guarded", period_s=0.1)
    probe.node.create_subscription(
        DiagnosticArray, "/diagnostics", lambda array: said.update({status.name: status for status in array.status}), 100
    )
    node.create_subscription(Int32, "numbers", receive, 100)
    node.create_service(Trigger, "ask", answer)
    numbers, client = probe.node.create_publisher(Int32, "numbers", 100), probe.node.create_client(Trigger, "ask")
    loop.until(lambda: numbers.get_subscription_count() and client.service_is_ready(), "a connection")
    for i in range(20):
        numbers.publish(Int32(data=i))
    loop.until(lambda: len(came) == 20, "all messages, those after an error too")
    node.create_timer(0.01, tick)
    loop.until(lambda: len(ticks) >= 3, "the timer goes on")
    asked = client.call_async(Trigger.Request())
    loop.until(lambda: asked_times, "the request")
    probe.spin_until(asked.done, "an answer")
    assert not asked.result().success and "error in the node" in asked.result().message
    assert node.callback_errors.count >= 10 + 3 + 1
    name = "guarded: callbacks"
    loop.until(lambda: probe._executor.spin_once(timeout_sec=0.01) or name in said, "it is said on /diagnostics")
    assert said[name].level == DiagnosticStatus.ERROR
    assert int({pair.key: pair.value for pair in said[name].values}["errors"]) >= 10
    text = "".join(capfd.readouterr())
    assert text.count("KeyError: 'no such number") == 1 and text.count("ZeroDivisionError: of the timer") == 1  # once each


def test_no_image_reaches_a_subscription_that_is_gone(loop, probe):
    """More images than the middleware keeps wait when the camera is taken out of use, so that their numbers have gaps."""
    node = loop.node
    inbox = ImageInbox(node, ["cam1"], InboxOptions(), QosMismatches(node, Diagnostics(node)))
    inbox.subscribe(["cam1"])
    images = probe.node.create_publisher(Image, "cam1/image_raw", images_published(200))
    infos = probe.node.create_publisher(CameraInfo, "cam1/camera_info", images_published(200))
    loop.until(lambda: images.get_subscription_count() and infos.get_subscription_count(), "a connection")
    for use in range(3):
        arrived = inbox.arrived["cam1"]
        loop.until(lambda n=arrived: publish(images, infos) or inbox.arrived["cam1"] > n, f"images, {use}")
        arrived = inbox.arrived["cam1"]
        for _ in range(100):
            publish(images, infos)
        probe.spin_until(lambda: images.wait_for_all_acked(), "delivery")
        inbox.subscribe([])
        ticks = iter(range(1000))
        timer = node.create_timer(0.05, partial(next, ticks))
        loop.until(lambda t=ticks: t.__length_hint__() < 997, "what waits is over")
        node.destroy_timer(timer)
        assert node.callback_errors.count == 0 and inbox.arrived["cam1"] == arrived
        inbox.subscribe(["cam1"])
        loop.until(lambda: images.get_subscription_count() == 1, "a connection")


def test_ends_that_come_and_go_wait_for_no_events(loop, probe):
    """One that is queued when its end is destroyed ends the process: the event loop forgets it without the interpreter's lock."""
    node = loop.node
    inbox = ImageInbox(node, ["cam1"], InboxOptions(), QosMismatches(node, Diagnostics(node)))
    inbox.subscribe(["cam1"])
    node.create_publisher(Int32, "numbers", 1)
    loop.until(lambda: True, "a round")
    assert list(node.waitables) == []


def publish(images, infos) -> None:
    images.publish(image_message(0, "f", np.zeros((4, 4, 3), np.uint8)))
    infos.publish(CameraInfo())


def test_what_the_loop_itself_raises_does_not_end_it(loop, monkeypatch):
    real, raised = executor._executors, []

    class Broken:
        def spin_once(self, timeout_sec):
            raised.append(1)
            raise RuntimeError("failed to take a message")

        def shutdown(self):
            pass

    monkeypatch.setitem(real, loop.node, Broken())
    loop.until(lambda: len(raised) >= 3, "the loop goes on")
    assert loop.node.callback_errors.count >= 3
