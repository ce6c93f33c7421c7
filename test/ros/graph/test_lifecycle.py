"""The tracker as a managed node, in a process of its own: asked by the standard services, as lifecycle managers do."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from tracker_msgs.msg import TrackedState

from helpers.ros.cameras import Cameras, files_of, image_set_of, options_of, tracker_of


class Manager:
    """A client of the standard services."""

    def __init__(self, probe, node: str = "tracker"):
        self._probe, self._node = probe, node
        self.events = probe.listen(TransitionEvent, f"{node}/transition_event")

    def state(self) -> str:
        return self._probe.ask(GetState, f"{self._node}/get_state", GetState.Request()).current_state.label

    def change(self, transition: int) -> bool:
        request = ChangeState.Request(transition=Transition(id=transition))
        return self._probe.ask(ChangeState, f"{self._node}/change_state", request).success

    def possible(self) -> set[str]:
        service = f"{self._node}/get_available_transitions"
        answer = self._probe.ask(GetAvailableTransitions, service, GetAvailableTransitions.Request())
        return {description.transition.label for description in answer.available_transitions}


@pytest.fixture
def manager(probe):
    return Manager(probe)


def test_a_life_from_configure_to_shutdown(probe, launch, recording, manager):
    """What is known outlasts deactivate, bit for bit, and not cleanup."""
    states = probe.listen(TrackedState, "tracker/state")
    tracker = launch("tracker", *files_of(recording), "--lossless", "--no-autostart")
    assert manager.state() == "unconfigured" and manager.possible() == {"configure", "shutdown"}
    assert probe.node.count_publishers("/tracker/state") == 0
    answer = probe.ask(Trigger, "tracker/reset", Trigger.Request())
    assert not answer.success and "not configured" in answer.message
    assert manager.change(Transition.TRANSITION_CONFIGURE) and manager.state() == "inactive"
    probe.spin_until(lambda: probe.node.count_publishers("/tracker/state") == 1, "the topics")
    assert probe.node.count_subscribers("/cam1/image_raw") == 0
    assert manager.change(Transition.TRANSITION_ACTIVATE) and manager.state() == "active"
    cameras = Cameras(probe, recording, options_of(recording).rig)
    for i in range(3):
        cameras.send(i)
    probe.spin_until(lambda: len(states) == 3, "three states")
    assert manager.change(Transition.TRANSITION_DEACTIVATE)
    probe.spin_until(lambda: cameras.images["cam1"].get_subscription_count() == 0, "nobody listens")
    assert manager.change(Transition.TRANSITION_ACTIVATE)
    cameras = Cameras(probe, recording, options_of(recording).rig)
    cameras.send(3)
    probe.spin_until(lambda: len(states) == 4, "a state after the pause")
    here = tracker_of(recording)
    for i in range(4):
        assert np.array_equal(states[i].values, here.step(image_set_of(recording, i)).state.to_values())
    assert manager.change(Transition.TRANSITION_DEACTIVATE) and manager.change(Transition.TRANSITION_CLEANUP)
    assert manager.state() == "unconfigured"
    probe.spin_until(lambda: probe.node.count_publishers("/tracker/state") == 0, "no topics")
    assert manager.change(Transition.TRANSITION_CONFIGURE) and manager.change(Transition.TRANSITION_ACTIVATE)
    cameras = Cameras(probe, recording, options_of(recording).rig)
    cameras.send(0)
    probe.spin_until(lambda: len(states) == 5, "a state of the new life")
    assert np.array_equal(states[4].values, states[0].values)
    assert manager.change(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    assert tracker.wait() == 0 and "Traceback" not in tracker.err
    goals = [event.goal_state.label for event in manager.events if event.goal_state.label in ("inactive", "active")]
    assert goals == ["inactive", "active", "inactive", "active", "inactive", "inactive", "active"]


def test_what_is_not_possible_is_refused_and_nothing_breaks(probe, launch, recording, manager):
    tracker = launch("tracker", *files_of(recording), "--no-autostart")
    for transition in (Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_CLEANUP, Transition.TRANSITION_DEACTIVATE, 99):
        assert not manager.change(transition)
        assert manager.state() == "unconfigured"
    assert manager.change(Transition.TRANSITION_CONFIGURE)
    assert not manager.change(Transition.TRANSITION_CONFIGURE) and manager.state() == "inactive"
    answer = probe.ask(GetAvailableStates, "tracker/get_available_states", GetAvailableStates.Request())
    assert {"unconfigured", "inactive", "active", "finalized"} <= {state.label for state in answer.available_states}
    assert "is not possible while unconfigured" in tracker.err and "Traceback" not in tracker.err


UNSUITABLE = ("-p", "modalities:=[texture]")


def test_a_failed_configure_says_why_and_can_be_mended(probe, launch, recording, manager):
    tracker = launch("tracker", *files_of(recording), "--ros-args", *UNSUITABLE)
    name = "tracker: lifecycle"
    status = probe.diagnostics
    probe.spin_until(lambda: name in status and status[name].level == DiagnosticStatus.ERROR, "the reason")
    assert "configure has failed" in status[name].message and "no box with a texture" in status[name].message
    assert manager.state() == "unconfigured" and "no box with a texture" in tracker.err and "Traceback" not in tracker.err
    change = SetParameters.Request(parameters=[Parameter("modalities", value=["region"]).to_parameter_msg()])
    assert probe.ask(SetParameters, "tracker/set_parameters", change).results[0].successful
    assert manager.change(Transition.TRANSITION_CONFIGURE) and manager.change(Transition.TRANSITION_ACTIVATE)
    probe.spin_until(lambda: status[name].level == DiagnosticStatus.OK and status[name].message == "active", "recovery")


def test_a_failed_automatic_start_can_be_the_end(launch, recording):
    tracker = launch("tracker", *files_of(recording), "--end-on-failure", "--ros-args", *UNSUITABLE)
    assert tracker.wait() == 2
    assert "error: configure has failed" in tracker.err and "Traceback" not in tracker.err


def test_autostart_is_a_parameter_too(probe, launch, recording, manager):
    launch("tracker", *files_of(recording), "--ros-args", "-p", "autostart:=false")
    assert manager.state() == "unconfigured"
