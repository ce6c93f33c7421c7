"""The live page in a browser: what real publishers say over real DDS, and who may look at it."""

import json
import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import cv2
import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS is not installed")
pytest.importorskip("tracker_msgs", reason="the interface package is not installed")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import CompressedImage, Image
from std_srvs.srv import SetBool, Trigger
from tracker_msgs.msg import TrackedState
from tracker_msgs.srv import SetState
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from helpers.ros.graph import NodeProcess, ros_context
from helpers.ros.samples import write_recording
from helpers.studio.browser import browser_tab
from helpers.studio.studio_process import running_studio
from tracker_node.errors import TrackerError
from tracker_node.ros.conversions import image_message, jpeg_message, stamp_message
from tracker_node.ros.qos import RESULT
from tracker_node.runs.messages import jpeg_of
from tracker_node.studio.live.page import LivePage
from tracker_node.studio.session import StudioFiles, StudioSession

pytestmark = pytest.mark.long  # a browser and a studio for each test

SERVICE_OF = {"Set state": "set_state", "Reinitialize": "reinitialize", "Disable": "enable", "Enable": "enable"}
GREEN_BGR, BLUE_BGR = (40, 200, 60), (220, 60, 30)


class FakeTracker:
    """A node that says what a tracker would, twenty times a second, and remembers what it was asked for."""

    def __init__(self) -> None:
        self.node = Node("fake")
        self.status, self.reason, self.residual = TrackedState.LOST, "the outline is elsewhere", float("nan")
        self.encoding = "bgr8"
        self.dark = False
        self.asked: list[str] = []
        self.images = 0
        self._state = self.node.create_publisher(TrackedState, "~/state", RESULT)
        self._overlay = self.node.create_publisher(CompressedImage, "~/left/overlay/compressed", RESULT)
        self._other_overlay = self.node.create_publisher(CompressedImage, "~/right/overlay/compressed", RESULT)
        self._raw = self.node.create_publisher(Image, "/left/image_raw", RESULT)
        self._diagnostics = self.node.create_publisher(DiagnosticArray, "/diagnostics", RESULT)
        self.node.create_service(Trigger, "~/reset", self._on_reset)
        self.node.create_service(SetBool, "~/enable", self._on_enable)
        self.node.create_service(SetState, "~/set_state", lambda _request, response: response)
        self.node.create_timer(0.05, self._say)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def _spin(self) -> None:
        executor = SingleThreadedExecutor()
        executor.add_node(self.node)
        while not self._stop.is_set():
            executor.spin_once(timeout_sec=0.02)
        executor.shutdown()

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self.node.destroy_node()

    @property
    def overlay_listeners(self) -> int:
        return self._overlay.get_subscription_count()

    def _on_reset(self, _request, response):
        self.asked.append("reset")
        response.success, response.message = True, "as you say"
        return response

    def _on_enable(self, request, response):
        self.asked.append(f"enable {request.data}")
        response.success, response.message = False, "not while resting"
        return response

    def _say(self) -> None:
        state = TrackedState(status=self.status, status_reason=self.reason, model="lamp", residual=self.residual)
        state.residual_unit = "px"
        state.header.stamp = stamp_message(time.time_ns() - 20_000_000)
        state.limbs, state.limb_status, state.limb_reasons = ["left_hand"], [1], [""]
        state.limb_lost_probability = [0.25]
        state.total_ms = 12.5
        self._state.publish(state)
        picture = np.full((48, 64, 3), GREEN_BGR, np.uint8)
        if not self.dark:
            self._overlay.publish(jpeg_message(0, "left", jpeg_of(picture)))
        self._other_overlay.publish(jpeg_message(0, "right", jpeg_of(picture)))
        raw = image_message(0, "left", np.full((48, 64, 3), BLUE_BGR, np.uint8))
        raw.encoding = self.encoding
        self._raw.publish(raw)
        self.images += 1
        bad = DiagnosticStatus(level=DiagnosticStatus.ERROR, name="recorder: bag", message="the disk is full")
        bad.values = [KeyValue(key="free [MB]", value="0")]
        fine = DiagnosticStatus(level=DiagnosticStatus.OK, name="fake: rate", message="tracking")
        self._diagnostics.publish(DiagnosticArray(status=[bad, fine]))


@pytest.fixture(scope="module")
def ros(ros_domain_id) -> Iterator[None]:
    with ros_context():
        yield


@pytest.fixture
def fake(ros) -> Iterator[FakeTracker]:
    tracker = FakeTracker()
    yield tracker
    tracker.close()


@contextmanager
def live_page(*arguments):
    with running_studio(*arguments) as studio, browser_tab() as tab:
        tab.page.set_default_timeout(60_000)
        tab.page.goto(studio.page("live.html"))
        tab.page.wait_for_selector("main:not([hidden])")
        yield studio, tab
        assert tab.errors == []


def wait_for(page, selector, text):
    page.wait_for_function("([s, t]) => document.querySelector(s)?.innerText.includes(t)", arg=[selector, text])


MIDDLE = """() => {
  const canvas = document.querySelector('.view canvas');
  if (!canvas) return null;
  return [...canvas.getContext('2d').getImageData(canvas.width / 2, canvas.height / 2, 1, 1).data].slice(0, 3);
}"""


def wait_for_color(page, bgr):
    """Until the middle of the first view has this color, as JPEG keeps it."""
    deadline = time.monotonic() + 60.0
    while (seen := page.evaluate(MIDDLE)) is None or np.abs(np.array(seen) - bgr[::-1]).max() > 6:
        assert time.monotonic() < deadline, seen
        page.wait_for_timeout(50)


def test_the_page_shows_what_is_published_and_hands_on_what_is_asked(fake):
    with live_page() as (_, tab):
        page = tab.page
        wait_for(page, "#status-name", "LOST")
        wait_for(page, "#reason", "the outline is elsewhere")
        wait_for(page, "#limbs", "left hand")
        wait_for(page, "#figures", "12.5 / 12.5 ms")
        wait_for(page, "#recorder", "the disk is full")
        assert page.locator("#recorder .level2").count() == 1 and page.locator("#diagnostics .level0").count() == 1
        assert "–" in page.inner_text("#figures")  # a residual that is no number
        wait_for_color(page, GREEN_BGR)
        page.select_option("#kind", "camera")
        wait_for_color(page, BLUE_BGR)
        fake.encoding = "magic8"
        wait_for(page, "#connection", "magic8")
        fake.encoding = "bgr8"
        wait_for(page, "#connection", "connected")
        fake.status, fake.reason, fake.residual = TrackedState.TRACKING, "", 1.5
        wait_for(page, "#status-name", "TRACKING")
        wait_for(page, "#figures", "1.5 px")
        page.click("text=Reset")
        wait_for(page, ".message", "as you say")
        page.click("text=Disable")
        wait_for(page, ".message.bad", "not while resting")
        assert fake.asked == ["reset", "enable False"]
        latency = page.inner_text("#figures").split("latency, p50 / p95")[1].split()[0]
        assert 20.0 <= float(latency) < 10_000.0


def test_images_of_a_camera_that_died_are_grey_and_the_others_go_on(fake):
    with live_page() as (_, tab):
        wait_for_color(tab.page, GREEN_BGR)
        tab.page.wait_for_function("() => document.querySelectorAll('.view').length === 2")
        assert tab.page.locator(".view.silent").count() == 0
        fake.dark = True
        wait_for(tab.page, ".view.silent", "silent for 4 s")
        assert tab.page.locator(".view.silent canvas[aria-label='camera left']").count() == 1
        assert tab.page.locator(".view.silent").count() == 1
        fake.dark = False
        tab.page.wait_for_function("() => !document.querySelector('.view.silent')")


def test_a_studio_that_was_started_anew_asks_for_its_new_address(ros):
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with browser_tab() as tab:
        tab.page.set_default_timeout(60_000)
        with running_studio("--port", port) as studio:
            tab.page.goto(studio.page("live.html"))
            wait_for(tab.page, "#connection", "connected")
        wait_for(tab.page, "#connection", "does not answer")
        with running_studio("--port", port):
            wait_for(tab.page, ".notice:not(#no-images)", "open the address")


def test_without_its_facts_the_page_says_why(ros):
    with running_studio() as studio, browser_tab() as tab:
        tab.page.route("**/api/live", lambda route: route.fulfill(status=400, json={"error": "not today"}))
        tab.page.goto(studio.page("live.html"))
        tab.page.wait_for_selector("main .notice:visible")
        assert tab.page.inner_text("main") == "not today"
        assert not [error for error in tab.errors if "TypeError" in error]


def test_a_view_outlives_a_request_that_cannot_be_sent_and_is_made_anew_where_it_has_ended(fake):
    session = StudioSession(StudioFiles())
    desk = LivePage(session)
    try:
        view = desk.view()
        wait_until(lambda: {"/fake/enable", "/fake/set_state"} <= view.services.keys())
        with pytest.raises(TrackerError, match="cannot be asked"):
            view.call("/fake", "set_state", dof_names=["\ud800"], values=[0.0])
        assert view.call("/fake", "enable", data=False) == (False, "not while resting") and desk.view() is view
        view.problem = "ended"
        assert desk.view() is not view and not desk.view().problem
    finally:
        session.closing.close()


def test_images_are_asked_for_only_while_somebody_looks(fake):
    with live_page() as (_, tab):
        wait_for_color(tab.page, GREEN_BGR)
        assert fake.overlay_listeners == 1
        tab.page.select_option("#kind", "none")
        wait_until(lambda: fake.overlay_listeners == 0)
        tab.page.select_option("#kind", "overlay")
        wait_until(lambda: fake.overlay_listeners == 1)
        tab.page.goto("about:blank")
        wait_until(lambda: fake.overlay_listeners == 0)


def test_the_page_asks_again_only_when_it_has_drawn_what_it_got(fake):
    sent, received = [], []

    def listen(socket):
        socket.on("framesent", lambda content: sent.append(len(sent) - sum(isinstance(c, str) for c in received)))
        socket.on("framereceived", lambda content: received.append(content))

    with running_studio() as studio, browser_tab() as tab:
        tab.page.on("websocket", listen)
        tab.page.goto(studio.page("live.html"))
        deadline = time.monotonic() + 60.0
        while sum(isinstance(content, bytes) for content in received) < 20:
            assert time.monotonic() < deadline
            tab.page.wait_for_timeout(100)
        assert tab.page.locator(".view").count() == 2 and tab.errors == []
    assert max(sent) == 0  # answers that were still due when it asked


def test_a_real_tracker_is_seen_and_reset(ros_domain_id, tmp_path):
    write_recording(tmp_path / "arm", 12)
    files = [f"--{name}={tmp_path / 'arm' / file}.yaml" for name, file in [("rig", "rig"), ("model", "model")]]
    pipeline = NodeProcess("pipeline", *files, "--initial-state", tmp_path / "arm/state.yaml", "--loop", "--real-time")
    try:
        named = ("--model", tmp_path / "arm/model.yaml", "--initial-state", tmp_path / "arm/state.yaml")
        with live_page(*named) as (_, tab):
            wait_for(tab.page, "#figures", "arm")
            wait_for(tab.page, "#limbs", "hand")
            tab.page.wait_for_function("() => document.querySelectorAll('.view').length === 3")
            wait_for(tab.page, "#diagnostics", "tracker: rate")
            tab.page.click("text=Reset")
            wait_for(tab.page, ".message", "reset: done")
            for button in ("Set state", "Reinitialize", "Disable", "Enable"):
                tab.page.click(f"button:text-is('{button}')")
                wait_for(tab.page, ".message", f"{SERVICE_OF[button]}: ")
                assert tab.page.locator(".message.bad").count() == 0, tab.page.inner_text(".message")
                tab.page.evaluate("document.querySelector('.message').remove()")
        pipeline.interrupt()
        assert pipeline.wait() == 0, pipeline.err
    finally:
        pipeline.close()


def test_a_page_that_asks_seldom_gets_the_newest_image_only(fake):
    with running_studio() as studio, connect(own_page(studio)[0], **own_page(studio)[1]) as stream:
        wanted = {"topics": {"/fake/left/overlay/compressed": 0}}
        images = []
        while not images:
            images = ask(stream, wanted)
        first, seen_before = images[0][1], fake.images
        wait_until(lambda: fake.images > seen_before + 30)
        later = ask(stream, wanted)
        assert len(later) == 1 and later[0][1] >= first + 20
        picture = cv2.imdecode(np.frombuffer(later[0][2], np.uint8), cv2.IMREAD_COLOR)
        assert np.abs(picture[20, 30].astype(int) - GREEN_BGR).max() < 6


def test_other_sites_and_people_without_the_token_are_refused(ros):
    with running_studio() as studio:
        url, own = own_page(studio)
        for options in (own | {"origin": "http://example.com"}, {"origin": studio.origin}, own | {"origin": None}):
            with pytest.raises(InvalidStatus, match="403"), connect(url, **options):
                pass
        with connect(url, **own) as stream:
            stream.send(json.dumps({"topics": {}, "files": "/etc/passwd"}))
            assert "files" in json.loads(stream.recv())["problem"]
        with connect(url, **own) as stream:
            stream.send("no JSON")
            assert "problem" in json.loads(stream.recv())
        for odd in (b"{}", "[" * 100_000, '{"topics": {"\\ud800": 0}}'):
            with connect(url, **own) as stream:
                stream.send(odd)
                assert "a JSON object" in json.loads(stream.recv())["problem"]


def test_without_ros_the_page_says_so(tmp_path):
    (tmp_path / "rclpy").mkdir()
    (tmp_path / "rclpy/__init__.py").write_text("raise ImportError('there is no ROS here')\n")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    with running_studio(env={"PYTHONPATH": path}) as studio, browser_tab() as tab:
        tab.page.goto(studio.page("live.html"))
        tab.page.wait_for_selector(".notice:not(#no-images)")
        assert "ROS 2" in tab.page.inner_text(".notice") and "there is no ROS here" in tab.page.inner_text(".notice")
        assert tab.errors == []


def own_page(studio):
    """Address of the stream and what a page of the studio would send along."""
    port = studio.origin.rpartition(":")[2]
    token = studio.url.partition("token=")[2]
    address = studio.origin.replace("http://", "ws://") + "/api/live/stream"
    return address, {"origin": studio.origin, "additional_headers": {"Cookie": f"studio_{port}={token}"}}


def ask(stream, wanted):
    """Images of one answer: topic, number, JPEG."""
    stream.send(json.dumps(wanted))
    answer = json.loads(stream.recv(timeout=60))
    return [(topic, number, stream.recv(timeout=60)) for topic, number in answer["images"]]


def wait_until(predicate, timeout_s=240.0):
    deadline = time.monotonic() + timeout_s
    while not predicate():
        assert time.monotonic() < deadline
        time.sleep(0.02)
