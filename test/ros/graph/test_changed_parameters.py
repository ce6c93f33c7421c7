"""Parameters of a running tracker, changed from another process by the standard services."""

import pytest
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from tracker_msgs.msg import TrackedState

from helpers.ros.cameras import Cameras, files_of, options_of


class Client:
    """Asks the parameter services of a node."""

    def __init__(self, probe, node: str = "tracker"):
        self._probe, self._node = probe, node

    def set(self, **values) -> str:
        """Empty when all of them were accepted, and are in effect; else why not."""
        before = self._changes()
        parameters = [Parameter(name.replace("__", "."), value=value).to_parameter_msg() for name, value in values.items()]
        request = SetParametersAtomically.Request(parameters=parameters)
        result = self._probe.ask(SetParametersAtomically, f"{self._node}/set_parameters_atomically", request).result
        assert result.successful or result.reason
        if result.successful:
            self._probe.spin_until(lambda: self._changes() > before, f"{values} in effect")
        return "" if result.successful else result.reason

    def _changes(self) -> int:
        return int(_values(self._probe, f"{self._node}: parameters").get("changes", 0))

    def get(self, *names: str) -> list:
        values = self._probe.ask(GetParameters, f"{self._node}/get_parameters", GetParameters.Request(names=list(names))).values
        return [Parameter.from_parameter_msg(_message(name, value)).value for name, value in zip(names, values, strict=True)]

    def names(self) -> list[str]:
        answer = self._probe.ask(ListParameters, f"{self._node}/list_parameters", ListParameters.Request())
        return list(answer.result.names)

    def describe(self, names: list[str]) -> dict:
        request = DescribeParameters.Request(names=names)
        descriptors = self._probe.ask(DescribeParameters, f"{self._node}/describe_parameters", request).descriptors
        return {descriptor.name: descriptor for descriptor in descriptors}


def _message(name, value):
    from rcl_interfaces.msg import Parameter as Message

    return Message(name=name, value=value)


@pytest.fixture
def running(probe, launch, recording):
    """A client of an active tracker, its states, and cameras."""
    states = probe.listen(TrackedState, "tracker/state")
    tracker = launch("tracker", *files_of(recording), "--lossless", "--wait-for", "state=1")
    yield Client(probe), states, Cameras(probe, recording, options_of(recording).rig)
    tracker.interrupt()
    assert tracker.wait() == 0 and "Traceback" not in tracker.err


NUMBERS = (ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_INTEGER)


def test_everything_is_described_and_wrong_values_are_refused_with_the_reason(probe, running):
    client, _, _ = running
    descriptors = client.describe(client.names())
    own = {name: d for name, d in descriptors.items() if not name.startswith("qos_overrides.") and name not in ROS_OWN}
    assert len(own) > 60 and all(d.description for d in own.values())
    for name, descriptor in own.items():
        if descriptor.type in NUMBERS:
            assert descriptor.floating_point_range or descriptor.integer_range, name
        if descriptor.type == ParameterType.PARAMETER_DOUBLE:
            assert descriptor.description.endswith("]"), f"{name} has no unit"
    reasons = [(names, said, client.set(**names)) for names, said in REFUSED]
    assert not [(names, said, reason) for names, said, reason in reasons if said not in reason]
    assert client.get("modalities", "region.repeats", "cameras") == [["region"], 2, ["cam1", "cam2", "cam3"]]


ROS_OWN = ("use_sim_time", "start_type_description_service")
REFUSED = [
    ({"region__nonsense": 1}, "region.nonsense"),  # not declared
    ({"region__repeats": -1}, "region.repeats"),  # out of range
    ({"region__repeats": "six"}, "expected 'Type.INTEGER'"),  # of another type
    ({"region__robust_sigmas": float("nan")}, "region.robust_sigmas"),
    ({"region__scales": "wide"}, "region.scales"),
    ({"modalities": ["guess"]}, "color_over_background"),  # the valid ones
    ({"engine": "color"}, "modalities"),  # an earlier version's
    ({"chamfer__max_iterations": 3}, "modalities with chamfer"),  # of a modality that is not in use
    ({"modalities": ["texture"]}, "no box with a texture"),  # does not suit the body
    ({"cameras": ["cam1", "cam9"]}, "cam9"),
    ({"cameras": ["cam1", "cam1"]}, "each once"),
    ({"lossless": False}, "read-only"),
    ({"calibration": "camera_info"}, "read-only"),
    ({"autostart": False}, "read-only"),
    ({"region__repeats": 5, "modalities": ["guess"]}, "modalities"),  # nothing of it is taken
]


def test_a_deleted_parameter_is_refused(probe, running):
    client, _, _ = running
    request = SetParameters.Request(parameters=[Parameter("cameras", Parameter.Type.NOT_SET).to_parameter_msg()])
    (result,) = probe.ask(SetParameters, "tracker/set_parameters", request).results
    assert not result.successful and result.reason
    assert client.get("cameras") == [["cam1", "cam2", "cam3"]]


def test_cameras_come_and_go(probe, running):
    client, states, cameras = running
    cameras.send(0)
    probe.spin_until(lambda: len(states) == 1, "a state of all")
    assert client.set(cameras=["cam3", "cam1"]) == ""
    probe.spin_until(lambda: cameras.images["cam2"].get_subscription_count() == 0, "nobody listens to cam2")
    cameras.send(1, ("cam1", "cam3"))
    probe.spin_until(lambda: len(states) == 2, "a state of two, without waiting for the third")
    assert states[1].cameras == ["cam1", "cam3"] and all(n > 0 for n in states[1].camera_samples)
    probe.spin_until(lambda: _said(probe, "tracker: cam2") == "not in use", "said so")
    assert client.set(cameras=["cam1", "cam2", "cam3"]) == ""
    probe.spin_until(lambda: cameras.images["cam2"].get_subscription_count() == 1, "cam2 is listened to")
    cameras.send(2)
    probe.spin_until(lambda: len(states) == 3, "a state of all again")
    assert states[2].cameras == ["cam1", "cam2", "cam3"] and all(n > 0 for n in states[2].camera_samples[::2])
    cameras.send(3)
    probe.spin_until(lambda: len(states) == 4, "a state with what cam2 has taught")
    assert all(n > 0 for n in states[3].camera_samples)
    probe.spin_until(lambda: _values(probe, "tracker: cam1").get("used") == "4", "all images of cam1 are accounted for")


def _said(probe, name: str) -> str:
    return probe.diagnostics[name].message if name in probe.diagnostics else ""


def _values(probe, name: str) -> dict[str, str]:
    return {value.key: value.value for value in probe.diagnostics[name].values} if name in probe.diagnostics else {}


def test_the_engine_changes_while_it_runs(probe, running):
    client, states, cameras = running
    cameras.send(0)
    probe.spin_until(lambda: len(states) == 1, "a state by contours")
    assert client.set(modalities=["color"]) == ""
    assert "color.levels" in client.names() and "region.repeats" not in client.names()
    cameras.send(1)
    probe.spin_until(lambda: len(states) == 2, "a state by colors")
    assert client.set(modalities=["region"], status__limb_lost=0.4) == ""
    assert "region.repeats" in client.names() and "color.levels" not in client.names()
    cameras.send(2)
    probe.spin_until(lambda: len(states) == 3, "a state by contours again")
    pixels = [sum(state.camera_samples) for state in states]
    assert pixels[1] > 3 * pixels[0] and pixels[2] < pixels[1] / 3  # pixels of the mask there, places on the contour here


def test_qos_overrides_are_taken_and_wrong_ones_refused(probe, launch, recording):
    good = ("-p", "qos_overrides./tracker/state.publisher.reliability:=best_effort")
    tracker = launch("tracker", *files_of(recording), "--ros-args", *good)
    probe.spin_until(lambda: probe.node.get_publishers_info_by_topic("/tracker/state"), "the tracker")
    (end,) = probe.node.get_publishers_info_by_topic("/tracker/state")
    assert end.qos_profile.reliability.name == "BEST_EFFORT"
    tracker.interrupt()
    assert tracker.wait() == 0
    wrong = {"/tracker/state.publisher.reliability": "sometimes", "/tracker/nothing.publisher.depth": "3"}
    for name, value in wrong.items():
        override = f"qos_overrides.{name}:={value}"
        tracker = launch("tracker", *files_of(recording), "--end-on-failure", "--ros-args", "-p", override)
        assert tracker.wait() == 2
        assert value in tracker.err or name in tracker.err, tracker.err
        assert "Traceback" not in tracker.err, tracker.err
