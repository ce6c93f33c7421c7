"""Flow control: the window holds, opens, and never blocks for ever."""

import threading
from types import SimpleNamespace

import pytest
from tracker_msgs.msg import Bodies, TrackedState

from tracker_node.ros.ingest import outlet
from tracker_node.ros.ingest.outlet import ConsumerWindow
from tracker_node.ros.qos import RESULT


@pytest.fixture
def make(probe):
    return lambda **options: ConsumerWindow(probe.node, "tracker", **options)


def waiting(window: ConsumerWindow) -> tuple[threading.Thread, list[bool]]:
    result: list[bool] = []
    thread = threading.Thread(target=lambda: result.append(window.wait()))
    thread.start()
    return thread, result


def test_it_opens_with_the_answer(make):
    window = make(size=2)
    for stamp in (0, 10):
        assert window.wait()
        window.sent(stamp)
    thread, result = waiting(window)
    thread.join(timeout=0.2)
    assert thread.is_alive()  # two are on their way
    window.answer(0)
    thread.join(timeout=5.0)
    assert result == [True]


def test_an_answer_covers_everything_earlier(make):
    window = make(size=2)
    window.sent(0)
    window.sent(10)
    window.answer(10)
    assert window.wait_for_all()


def test_it_grows_when_no_answer_comes(make):
    """A consumer that waits for a silent camera needs to see more of the others before it says anything."""
    window = make(size=1, patience_s=0.05)
    window.answer(-1)
    for stamp in range(6):
        assert window.wait()
        window.sent(stamp)
    assert not window.wait_for_all()  # but says so when they are never answered


def test_close_releases(make):
    window = make(size=1)
    window.sent(0)
    thread, result = waiting(window)
    window.close()
    thread.join(timeout=5.0)
    assert result == [False]


@pytest.mark.parametrize(("kind", "name"), [(TrackedState, "state"), (Bodies, "bodies")])
def test_a_tracker_of_one_body_and_one_of_several_answer(make, probe, kind, name):
    """That of several has no state of its own."""
    window, answers = make(size=1), probe.node.create_publisher(kind, f"tracker/{name}", RESULT)
    window.sent(7)
    probe.spin_until(lambda: answers.get_subscription_count() > 0, "the subscription")
    message = kind()
    message.header.stamp.nanosec = 7
    thread, result = waiting(window)
    answers.publish(message)
    probe.spin_until(lambda: result == [True], "the answer")
    thread.join(timeout=5.0)


@pytest.mark.parametrize("published", [True, False])
def test_that_nobody_has_answered_yet_is_said_once(make, probe, monkeypatch, published):
    monkeypatch.setattr(outlet, "_TELL_S", 0.05)
    said, window = [], make(size=1)
    monkeypatch.setattr(window._node, "count_publishers", lambda topic: published and topic == "tracker/bodies")
    logger = SimpleNamespace(info=lambda text: said.append(("info", text)), warning=lambda text: said.append(("warning", text)))
    monkeypatch.setattr(window._node, "get_logger", lambda: logger)
    window.sent(0)
    thread, result = waiting(window)
    thread.join(timeout=0.5)
    assert thread.is_alive() and len(said) == 1
    level, text = said[0]
    assert text.startswith("waiting for an answer on tracker/state or tracker/bodies")
    assert (level, "--consumer" in text) == (("info", False) if published else ("warning", True))
    window.answer(0)
    thread.join(timeout=5.0)
    assert result == [True]
