"""What is asked for last is made in a thread, and handed over once."""

import threading

import pytest

from tracker_node.errors import TrackerError
from tracker_node.ros.tracker.setup import SetupBuilder, TrackingSetup
from tracker_node.tracking.config import TrackerConfig


def setup():
    return TrackingSetup(TrackerConfig(), ("a",))


def raising(error):
    def make():
        raise error

    return make


def held(result):
    """Something that is made when the test lets it."""
    begun, go = threading.Event(), threading.Event()

    def make():
        begun.set()
        assert go.wait(20.0)
        return result

    return make, begun, go


def test_nothing_is_made_until_it_is_asked_for():
    builder = SetupBuilder()
    builder.wait()
    assert builder.taken() is None and not builder.busy


def test_what_is_made_is_handed_over_once():
    builder, made = SetupBuilder(), setup()
    builder.ask(lambda: made)
    builder.wait()
    assert builder.busy  # until it is taken
    assert builder.taken() is made and not builder.busy and builder.taken() is None
    other = setup()
    builder.ask(lambda: other)
    builder.wait()
    assert builder.taken() is other


def test_while_it_is_made_there_is_nothing_to_take():
    make, begun, go = held(made := setup())
    builder = SetupBuilder()
    builder.ask(make)
    assert begun.wait(20.0) and builder.taken() is None and builder.busy
    go.set()
    builder.wait()
    assert builder.taken() is made


def test_the_last_that_is_asked_for_is_handed_over_alone():
    first, begun, go = held(setup())
    last, between = setup(), []
    builder = SetupBuilder()
    builder.ask(first)
    assert begun.wait(20.0)
    builder.ask(lambda: between.append(1) or setup())
    builder.ask(lambda: last)
    go.set()
    builder.wait()
    assert builder.taken() is last and between == []


def test_what_was_made_before_another_was_asked_for_is_not_handed_over():
    builder = SetupBuilder()
    builder.ask(setup)
    builder.wait()
    make, begun, go = held(made := setup())
    builder.ask(make)
    assert begun.wait(20.0) and builder.taken() is None
    go.set()
    builder.wait()
    assert builder.taken() is made


def test_one_is_made_at_a_time():
    at_once, most, lock = [], [], threading.Lock()

    def make():
        with lock:
            at_once.append(1)
            most.append(len(at_once))
        threading.Event().wait(0.01)
        with lock:
            at_once.pop()
        return setup()

    builder = SetupBuilder()
    for _ in range(5):
        builder.ask(make)
    builder.wait()
    assert max(most) == 1


@pytest.mark.parametrize("made", [False, True])
def test_what_is_forgotten_is_not_handed_over(made):
    make, begun, go = held(setup())
    builder = SetupBuilder()
    builder.ask(make)
    assert begun.wait(20.0)
    if made:
        go.set()
        builder.wait()
    builder.forget()
    assert not builder.busy and builder.taken() is None
    go.set()
    after = setup()
    builder.ask(lambda: after)
    builder.wait()
    assert builder.taken() is after


def test_errors_of_users_are_raised_once_and_not_told():
    told = []
    builder, error = SetupBuilder(told.append), TrackerError("does not suit")
    builder.ask(raising(error))
    builder.wait()
    with pytest.raises(TrackerError) as raised:
        builder.taken()
    assert raised.value is error and told == [] and builder.taken() is None and not builder.busy


def test_mistakes_are_named_and_told_in_full():
    told = []
    builder = SetupBuilder(told.append)
    builder.ask(raising(KeyError("elbow")))
    builder.wait()
    with pytest.raises(TrackerError, match=r"^KeyError: 'elbow'$"):
        builder.taken()
    assert len(told) == 1 and told[0].startswith("Traceback") and "KeyError: 'elbow'" in told[0]
