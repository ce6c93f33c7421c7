"""Transitions: what is done in each, what is undone when it fails, and what is refused."""

import pytest
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn

from tracker_node.errors import TrackerError
from tracker_node.ros.guarded_node import ManagedNode


class Listed(ManagedNode):
    """Lists what it is told to do; fails where told to."""

    def __init__(self):
        self.done, self.failing = [], {}
        super().__init__("listed")

    def _do(self, what):
        self.done.append(what)
        if what in self.failing:
            raise self.failing[what]

    def set_up(self):
        self._do("set up")

    def begin(self):
        self._do("begin")

    def pause(self):
        self._do("pause")

    def tear_down(self):
        self._do("tear down")

    def changed(self):
        self.done.append((self.state, self.failure))


@pytest.fixture
def node(ros):
    node = Listed()
    yield node
    node.destroy_node()


def test_a_life(node):
    assert (node.state, node.failure, node.done) == ("unconfigured", "", [])
    assert node.configure() and node.state == "inactive"
    assert node.activate() and node.state == "active"
    assert node.trigger_deactivate() == TransitionCallbackReturn.SUCCESS and node.state == "inactive"
    assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS and node.state == "unconfigured"
    said = [what for what in node.done if isinstance(what, tuple)]
    assert said == [("inactive", ""), ("active", ""), ("inactive", ""), ("unconfigured", "")]
    assert [what for what in node.done if what not in said] == ["set up", "begin", "pause", "tear down"]


def test_what_the_state_does_not_allow_is_not_even_tried(node):
    assert not node.activate() and node.done == []
    assert node.configure() and not node.configure()
    assert node.activate() and not node.activate() and not node.configure()
    assert [what for what in node.done if isinstance(what, str)] == ["set up", "begin"]


def test_what_failed_in_setting_up_is_torn_down_and_can_be_tried_again(node):
    node.failing = {"set up": TrackerError("no plates")}
    assert not node.configure()
    assert node.done == ["set up", "tear down", ("unconfigured", "configure has failed: no plates")]
    node.failing = {}
    assert node.configure() and (node.state, node.failure) == ("inactive", "")


def test_what_failed_in_beginning_is_paused(node):
    assert node.configure()
    node.failing = {"begin": ValueError("odd")}
    assert not node.activate()
    assert node.done[2:] == ["begin", "pause", ("inactive", "activate has failed: ValueError('odd')")]


def test_what_failed_in_a_rest_is_not_undone(node):
    assert node.configure() and node.activate()
    node.failing = {"pause": TrackerError("busy")}
    assert node.trigger_deactivate() == TransitionCallbackReturn.FAILURE
    assert node.done[-2:] == ["pause", ("active", "deactivate has failed: busy")] and node.state == "active"


def test_what_failed_in_cleaning_up_is_not_undone(node):
    assert node.configure()
    node.failing = {"tear down": TrackerError("busy")}
    assert node.trigger_cleanup() == TransitionCallbackReturn.FAILURE
    assert node.done[-2:] == ["tear down", ("inactive", "cleanup has failed: busy")]


@pytest.mark.parametrize(
    ("id_", "done"), [(State.PRIMARY_STATE_ACTIVE, ["pause", "tear down"]), (State.PRIMARY_STATE_INACTIVE, ["tear down"])]
)
def test_the_end_pauses_what_is_active(node, id_, done):
    assert node.on_shutdown(LifecycleState("", id_)) == TransitionCallbackReturn.SUCCESS
    assert node.done == [*done, ("finalized", "")]


def test_an_end_that_fails_is_an_end(node):
    node.failing = {"pause": TrackerError("busy")}
    assert node.on_shutdown(LifecycleState("active", State.PRIMARY_STATE_ACTIVE)) == TransitionCallbackReturn.FAILURE
    assert node.done[:2] == ["pause", "tear down"]
    assert (node.state, node.failure) == ("finalized", "shutdown has failed: busy")


def change(node, transition):
    return node._service_change_state.callback(ChangeState.Request(transition=transition), ChangeState.Response())


@pytest.mark.parametrize("transition", [Transition(id=Transition.TRANSITION_ACTIVATE), Transition(label="activate")])
def test_a_request_that_is_not_possible_is_answered(node, transition):
    assert not change(node, transition).success
    assert node.done == [] and node.state == "unconfigured"


def test_a_request_that_is_possible_is_followed(node):
    assert change(node, Transition(id=Transition.TRANSITION_CONFIGURE)).success
    assert node.state == "inactive"
