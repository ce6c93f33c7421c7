"""What a running tracker is asked for that breaks others: other cameras while images flow, impossible states, endless waiting."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from dataclasses import replace

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from tracker_msgs.srv import SetState

from benchmark.faults._graph import ERROR, OK, Drill, Graph, Outcome, Sender
from benchmark.faults._image_drills import EVERY_S, begun, sound_again
from helpers.ros.cameras import options_of
from helpers.ros.graph import NodeProcess
from tracker_node.ros.conversions import camera_info_message
from tracker_node.ros.tracker.image_inbox import InboxOptions
from tracker_node.ros.tracker.node import TrackerNode

ALL, OTHERS = ("cam1", "cam2", "cam3"), ("cam1", "cam3")
TIMES = 3
HELD_S, FREE_S = 0.3, 0.05  # of a tracker that is busy: nine images of a camera come meanwhile
TRACKING = 1


class _Busy:
    """A tracker that is behind: stopped most of the time, so that images of all cameras and requests wait in it together."""

    def __init__(self, graph: Graph, tracker: NodeProcess):
        self._graph, self._tracker = graph, tracker

    def ask(self, service_type, name: str, request, parts: int = 3):
        """The answer of a service, asked for while the tracker is stopped."""
        client = self._graph.probe.node.create_client(service_type, name)
        self._graph.until(client.service_is_ready, name)
        self._tracker.interrupt(signal.SIGSTOP)
        future = client.call_async(request)
        for _ in range(parts):  # what is asked for takes effect a little later, when images wait again
            self._tracker.interrupt(signal.SIGSTOP)
            self._graph.spin(HELD_S)
            self._tracker.interrupt(signal.SIGCONT)
            self._graph.spin(FREE_S)
        self._graph.until(lambda: future.done() or self._tracker.ended, f"an answer of {name}")
        if self._tracker.ended:
            raise AssertionError(f"the tracker has ended: {self._tracker.err.strip()[-200:]}")
        return future.result()

    def cameras(self, names: tuple[str, ...]) -> None:
        """Use these, and wait until sets of just these are tracked."""
        request = SetParametersAtomically.Request(parameters=[Parameter("cameras", value=list(names)).to_parameter_msg()])
        result = self.ask(SetParametersAtomically, "tracker/set_parameters_atomically", request).result
        assert result.successful, result.reason
        self.tracked(len(names))

    def transition(self, number: int) -> None:
        assert self.ask(ChangeState, "tracker/change_state", ChangeState.Request(transition=Transition(id=number))).success

    def tracked(self, n_cameras: int) -> None:
        mark = len(self._graph.states)

        def found() -> bool:
            new = self._graph.states[mark:]
            right = [s for s in new if s.status == TRACKING and sum(stamp.sec > 0 for stamp in s.camera_stamps) == n_cameras]
            return self._tracker.ended or len(right) >= 3

        self._graph.until(found, f"sets of {n_cameras} cameras tracked")
        assert not self._tracker.ended, f"the tracker has ended: {self._tracker.err.strip()[-200:]}"


def _flowing(graph: Graph) -> tuple[NodeProcess, _Busy]:
    """A tracker, and its cameras at 30 Hz."""
    tracker = graph.tracker()
    rig = ["--rig", graph.recording / "rig.yaml", "--rate", "30", "--loop", "--preload"]
    graph.launch("camera_ingest", *rig, "--wait-for-subscribers", "1")
    graph.wait_for_states(5)
    return tracker, _Busy(graph, tracker)


def _camera_out_of_use(graph: Graph) -> Outcome:
    tracker, busy = _flowing(graph)
    for _ in range(TIMES):
        busy.cameras(OTHERS)
        busy.cameras(ALL)
    seen = f"{TIMES} times taken out of use and into use, at 30 Hz: tracked with 2 cameras, then with 3, by the same process"
    return Outcome(seen, "cam2's images meanwhile", "Traceback" not in tracker.err)


def _deactivated(graph: Graph) -> Outcome:
    tracker, busy = _flowing(graph)
    for _ in range(TIMES):
        busy.transition(Transition.TRANSITION_DEACTIVATE)
        busy.transition(Transition.TRANSITION_ACTIVATE)
        busy.tracked(3)
    return Outcome(
        f"{TIMES} times, at 30 Hz: tracked again by the same process", "images meanwhile", "Traceback" not in tracker.err
    )


def _impossible_state(graph: Graph) -> Outcome:
    sender = begun(graph)
    name = str(graph.states[-1].dof_names[0])
    answer = graph.probe.ask(SetState, "tracker/set_state", SetState.Request(dof_names=[name], values=[1e300]))
    sound_again(graph, sender)
    tracking = all(state.status == TRACKING for state in graph.states)
    seen = f"refused: {answer.message}; {len(graph.states)} of {sender.number} sets tracked"
    return Outcome(seen, "nothing", tracking and not answer.success and name in answer.message and "1e+300" in answer.message)


def _lenses_never_come(graph: Graph) -> Outcome:
    """The tracker is of this process: a process of its own takes 2 GiB before it has no room."""
    options = options_of(graph.recording, calibration_from_topics=True)
    fits = 4 * 160 * 120 * 3  # bytes: three images with what else is in a message
    node = TrackerNode(replace(options, inbox=InboxOptions(lossless=True, most_bytes=fits)))
    graph.probe.add_node(node)
    try:
        assert node.start()
        sender = graph.sender()
        _until_said(graph, ERROR, "images are lost", sender.sets)
        told = str(graph.wait_said("tracker: calibration", ERROR, "images are lost"))
        _until_said(graph, OK, "complete", lambda: _calibrate(sender))
        graph.until(lambda: graph.states, "the state of the set that had waited")
        before = len(graph.states)
        for _ in range(5):
            sender.tracked(1)
    finally:
        node.close()
        node.destroy_node()
    good = all(state.status == TRACKING for state in graph.states[before:])
    return Outcome(
        f"ERROR calibration: {told}; once they come, what had waited and 5 of 5 sets are tracked", "those images", good
    )


def _calibrate(sender: Sender) -> None:
    for camera in sender.rig:
        sender.cameras.infos[camera.name].publish(camera_info_message(10**9, camera.frame_id, camera.model))


def _until_said(graph: Graph, level: bytes, text: str, send: Callable[[], None]) -> None:
    """Send, every now and then, until the tracker says of its calibration what is expected."""
    sent_s = 0.0

    def found() -> bool:
        nonlocal sent_s
        if time.monotonic() - sent_s > EVERY_S:
            send()
            sent_s = time.monotonic()
        return any(name == "tracker: calibration" and at == level and text in said for name, at, said in graph.said)

    graph.until(found, f"'tracker: calibration' says '{text}'")


DRILLS = (
    Drill("a camera taken out of use while images flow", "tracked on with the others, and with it again", _camera_out_of_use),
    Drill("deactivated and activated while images flow", "tracked again by the same process", _deactivated),
    Drill("set_state far beyond the room", "refused, the value named; tracking goes on", _impossible_state),
    Drill(
        "lossless, and camera_info does not come", "images wait up to a limit, the others counted and told", _lenses_never_come
    ),
)
