"""Flow control: the window holds, opens, and never blocks for ever."""

import threading

import pytest

from tracker_node.ros.ingest.outlet import ConsumerWindow


@pytest.fixture
def make(probe):
    return lambda **options: ConsumerWindow(probe.node, "tracker/state", **options)


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
