"""What a running tracker is asked for: look anew, pause, a state; and what it says on /diagnostics meanwhile."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PointStamped, PoseWithCovarianceStamped, TwistWithCovarianceStamped
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image
from std_srvs.srv import SetBool, Trigger
from tracker_msgs.msg import StateCovariance, TrackedState
from tracker_msgs.srv import SetState

from helpers.ros.cameras import PERIOD_NS, Cameras, N, files_of, image_set_of, options_of, tracker_of
from helpers.ros.estimates import estimate_of
from helpers.ros.graph import stamps
from helpers.ros.samples import moving_state, placed
from tracker_node.model.configuration import State
from tracker_node.observation.image_set import ImageSet
from tracker_node.ros.conversions import camera_info_message
from tracker_node.tracking.estimate import Status


def values_of(probe, name: str) -> dict[str, str]:
    status = probe.diagnostics.get(name)
    return {value.key: value.value for value in status.values} if status else {}


def told(probe, name: str, level: bytes, said: str = "") -> Callable[[], bool]:
    def predicate() -> bool:
        status = probe.diagnostics.get(name)
        return status is not None and status.level == level and said in status.message

    return predicate


def test_paused_images_are_counted_and_not_used(probe, start_tracker):
    node, states, cameras = start_tracker()
    cameras.send(0)
    probe.spin_until(lambda: len(states) == 1, "a state")
    answer = probe.ask(SetBool, "tracker/enable", SetBool.Request(data=False))
    assert answer.success and "not used" in answer.message
    for part in ("rate", "status", "latency", "observability", *(f"limb {limb}" for limb in states[0].limbs)):
        probe.spin_until(told(probe, f"tracker: {part}", DiagnosticStatus.OK, "paused by request"), f"{part} says so")
    for i in (1, 2):
        cameras.send(i)
    probe.spin_until(lambda: values_of(probe, "tracker: cam1").get("paused") == "2", "two images of cam1 left out")
    assert len(states) == 1 and node.fatal is None
    assert probe.ask(SetBool, "tracker/enable", SetBool.Request(data=True)).success
    stamp_ns = cameras.send(3)
    probe.spin_until(lambda: len(states) == 2, "a state after the pause")
    assert stamps(states) == [0, stamp_ns] and states[1].status == Status.TRACKING
    probe.spin_until(lambda: values_of(probe, "tracker: cam1").get("used") == "2", "the accounts")
    counts = values_of(probe, "tracker: cam1")
    assert (counts["received"], counts["paused"], counts["refused"]) == ("2", "2", "0")


@pytest.mark.long
def test_the_body_is_looked_for_anew(probe, recording, start_tracker):
    """Put far away, it is found without a word about where it is."""
    options = options_of(recording)
    _, states, cameras = start_tracker(
        config=replace(options.config, initialization=replace(options.config.initialization, after_lost_sets=10**6))
    )
    far = State(placed(0.05, 3.0, 0.2), np.zeros(options.model.chain.n_axes)).to_values()
    names = list(options.model.chain.dof_names)
    assert probe.ask(SetState, "tracker/set_state", SetState.Request(dof_names=names, values=far.tolist())).success
    cameras.send(0)
    probe.spin_until(lambda: len(states) == 1, "a state")
    assert states[0].status != Status.TRACKING
    assert probe.ask(Trigger, "tracker/reinitialize", Trigger.Request()).success
    for i in range(1, N):
        cameras.send(i)
    probe.spin_until(lambda: len(states) == N, "the other states")
    truth = moving_state(options.model, N - 1).T_world_root[:3, 3]
    assert np.linalg.norm(estimate_of(states[-1]).state.T_world_root[:3, 3] - truth) < 0.05, states[-1].status_reason


def test_looking_anew_is_refused_where_the_body_is_not_looked_for(probe, recording, start_tracker):
    config = options_of(recording).config
    start_tracker(config=replace(config, initialization=replace(config.initialization, enabled=False)))
    answer = probe.ask(Trigger, "tracker/reinitialize", Trigger.Request())
    assert not answer.success and "initialization.enabled" in answer.message


def test_limbs_times_and_spread_are_told(probe, start_tracker):
    _, states, cameras = start_tracker()
    for i in range(4):
        for k, camera in enumerate(("cam1", "cam2", "cam3")):
            cameras.send(i, (camera,), stamp_ns=i * PERIOD_NS + k * 2_000_000)
    probe.spin_until(lambda: len(states) == 4, "four states")
    probe.spin_until(told(probe, "tracker: latency", DiagnosticStatus.OK, "not of this clock"), "times")
    assert float(values_of(probe, "tracker: latency")["processing p50 [ms]"]) > 0.0
    probe.spin_until(lambda: values_of(probe, "tracker: image sets").get("spread of stamps p95 [ms]") == "4.000", "the spread")
    assert probe.diagnostics["tracker: lifecycle"].message == "active"
    for limb, status in zip(states[-1].limbs, states[-1].limb_status, strict=True):
        part = probe.diagnostics[f"tracker: limb {limb}"]
        assert part.message.startswith(("UNSEEN", "TRACKING", "DEGRADED", "LOST")[status])
        assert (part.level == DiagnosticStatus.OK) == (status == Status.TRACKING)
    assert probe.diagnostics["tracker: cam1"].hardware_id == "cam1"


def test_velocity_with_covariance(probe, start_tracker):
    """The root's, as in the state; both are the world's axes."""
    _, states, cameras = start_tracker()
    twists = probe.listen(TwistWithCovarianceStamped, "tracker/twist")
    covariances = probe.listen(StateCovariance, "tracker/state_covariance")
    for name in ("twist", "state_covariance"):
        probe.spin_until(lambda name=name: probe.node.count_subscribers(f"/tracker/{name}") == 1, "the subscription")
    for i in range(3):
        cameras.send(i)
    probe.spin_until(lambda: len(states) == 3 and stamps(twists)[-1:] == stamps(states)[-1:], "velocities")
    probe.spin_until(lambda: stamps(covariances)[-1:] == stamps(states)[-1:], "covariances")
    twist, n = twists[-1].twist, len(states[-1].values)
    linear, angular = twist.twist.linear, twist.twist.angular
    assert [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z] == states[-1].velocities[:6].tolist()
    covariance = np.reshape(covariances[-1].velocity_covariance, (n, n))[:6, :6]
    assert np.array_equal(np.reshape(twist.covariance, (6, 6)), covariance) and np.linalg.eigvalsh(covariance).min() > 0.0


def test_latency_is_from_the_stamp_to_the_state(probe, start_tracker):
    _, states, cameras = start_tracker()
    first_ns = probe.node.get_clock().now().nanoseconds - 5_000_000_000
    for i in range(3):
        cameras.send(i, stamp_ns=first_ns + i * PERIOD_NS)
    probe.spin_until(lambda: "latency p50 [ms]" in values_of(probe, "tracker: latency"), "latency")
    assert 4900.0 < float(values_of(probe, "tracker: latency")["latency p50 [ms]"]) < 60000.0 and len(states) == 3


def test_a_calibration_that_disagrees_with_the_rig_is_named(probe, recording, start_tracker):
    node, _, cameras = start_tracker()
    rig = options_of(recording).rig
    lens = rig["cam2"].model
    turned = replace(lens, K=lens.K * np.array([[1.05, 1.0, 1.0], [1.0, 1.05, 1.0], [1.0, 1.0, 1.0]]))
    cameras.infos["cam1"].publish(camera_info_message(0, "f", rig["cam1"].model))
    cameras.infos["cam2"].publish(camera_info_message(0, "f", turned))
    cameras.infos["cam3"].publish(CameraInfo(width=160, height=120))
    part = "tracker: calibration of cam{}".format
    probe.spin_until(told(probe, part(2), DiagnosticStatus.WARN, "px apart"), "cam2 named")
    probe.spin_until(told(probe, part(1), DiagnosticStatus.OK, "agree"), "cam1 agrees")
    probe.spin_until(told(probe, part(3), DiagnosticStatus.OK, "uncalibrated"), "cam3 said to be uncalibrated")
    corner = np.array([0.0, 0.0]) - lens.K[:2, 2]  # the corner's ray moves by 5 % of its distance from the middle
    expected = 0.05 * np.linalg.norm(corner)
    assert f"{expected:.1f} px" in probe.diagnostics[part(2)].message
    (result,) = node.set_parameters([Parameter("cameras", value=["cam1", "cam3"])])
    assert result.successful
    probe.spin_until(told(probe, part(2), DiagnosticStatus.OK, "not in use"), "cam2 is not in use")


def test_a_mismatch_of_quality_is_over_when_its_end_has_left(probe, start_tracker):
    start_tracker()  # lossless: asks for reliable images
    name = "tracker: quality of service of cam2"
    unreliable = probe.node.create_publisher(Image, "cam2/image_raw", qos_profile_sensor_data)
    probe.spin_until(told(probe, name, DiagnosticStatus.WARN, "reliability"), "the mismatch")
    probe.node.destroy_publisher(unreliable)
    probe.spin_until(told(probe, name, DiagnosticStatus.OK), "its end")


def _tick(clock, second: int, left) -> bool:
    """Says the time, and whether that was the last of ``left`` times."""
    clock.publish(Clock(clock=Time(sec=second)))
    return next(left, None) is None


def _went_back(tracker) -> bool:
    return "time went back by 40.000 s" in tracker.err


def test_simulated_time_that_stands_still_keeps_nobody_silent(probe, launch, recording):
    """Images are tracked and /diagnostics go out before the first /clock, and time may go back.

    The tracker begins again when stamps go back, and only then: the clock's message comes at any time between the images.
    """
    states = probe.listen(TrackedState, "tracker/state")
    tracker = launch("tracker", *files_of(recording), "--lossless", "--ros-args", "-p", "use_sim_time:=true")
    clock = probe.node.create_publisher(Clock, "/clock", 10)
    probe.spin_until(lambda: clock.get_subscription_count() > 0, "the clock's subscriber")
    cameras = Cameras(probe, recording, options_of(recording).rig)
    late_ns = 50_000_000_000
    cameras.send(0, stamp_ns=late_ns)
    probe.spin_until(lambda: len(states) == 1, "a state")
    probe.spin_until(told(probe, "tracker: lifecycle", DiagnosticStatus.OK, "active"), "diagnostics")
    # Who follows a clock keeps its newest message only, so one alone may never be seen.
    for second, ticks in ((50, 20), (10, 1000)):
        left = iter(range(ticks))
        probe.spin_until(lambda s=second, left=left: _tick(clock, s, left) or _went_back(tracker), "the jump is noticed")
    probe.spin_until(told(probe, "tracker: clock", DiagnosticStatus.WARN, "the simulated clock went back"), "said so")
    cameras.send(1, stamp_ns=late_ns + PERIOD_NS)
    probe.spin_until(lambda: len(states) == 2, "a state after the clock's jump")
    here = tracker_of(recording)
    for i in range(2):
        stamp_ns = late_ns + i * PERIOD_NS
        images = tuple(replace(image, stamp_ns=stamp_ns) for image in image_set_of(recording, i).images)
        assert np.array_equal(states[i].values, here.step(ImageSet(stamp_ns, images)).state.to_values())
    cameras.send(0)
    probe.spin_until(lambda: len(states) == 3, "a state after the stamps' jump")
    assert np.array_equal(states[2].values, states[0].values)
    tracker.interrupt()
    assert tracker.wait() == 0


def test_two_subjects_in_one_graph(probe, launch, recording):
    """A namespace with the cameras remapped into it, and another name: each has its own pose, topics and services."""
    files = [*files_of(recording), "--lossless"]
    shared = [arg for i in (1, 2, 3) for arg in ("-r", f"cam{i}/image_raw:=/cam{i}/image_raw")]
    infos = [arg for i in (1, 2, 3) for arg in ("-r", f"cam{i}/camera_info:=/cam{i}/camera_info")]
    launch("tracker", *files, "--ros-args", "-r", "__ns:=/anna", *shared, *infos)
    launch("tracker", *files, "--ros-args", "-r", "__node:=bert", "-r", "robot_description:=bert/robot_description")
    anna, bert = probe.listen(TrackedState, "/anna/tracker/state"), probe.listen(TrackedState, "/bert/state")
    rig = options_of(recording).rig
    cameras = Cameras(probe, recording, rig)
    images = list(cameras.images.values())
    probe.spin_until(lambda: all(p.get_subscription_count() == 2 for p in images), "both listen")
    assert probe.ask(Trigger, "/anna/tracker/reset", Trigger.Request()).success
    assert probe.ask(SetState, "/bert/set_state", SetState.Request(dof_names=["elbow_flexion"], values=[0.7])).success
    cameras.send(0)
    probe.spin_until(lambda: len(anna) == len(bert) == 1, "a state of each")
    assert not np.array_equal(anna[0].values, bert[0].values)  # they began from different states
    assert probe.ask(SetBool, "/bert/enable", SetBool.Request(data=False)).success
    cameras.send(1)
    probe.spin_until(lambda: len(anna) == 2, "one goes on")
    assert len(bert) == 1
    wanted = {"anna/tracker: status", "bert: status", "anna/tracker: cam1", "bert: cam1"}
    probe.spin_until(lambda: wanted <= set(probe.diagnostics), "each under its own name")
    probe.spin_until(told(probe, "bert: status", DiagnosticStatus.OK, "paused"), "one is paused")
    assert "paused" not in probe.diagnostics["anna/tracker: status"].message


def test_a_state_that_no_body_can_have_is_refused(probe, start_tracker):
    """So it is by the topic; the tracker goes on from where it was."""
    node, states, cameras = start_tracker()
    cameras.send(0)
    probe.spin_until(lambda: len(states) == 1, "a state")
    for name, value in zip(states[0].dof_names, (1e300, -2e4, 1e5, 1e300, 30.0, float("inf"), 1e300), strict=False):
        answer = probe.ask(SetState, "tracker/set_state", SetState.Request(dof_names=[name], values=[value]))
        assert not answer.success and ("expected at most" in answer.message or "finite" in answer.message), (name, answer.message)
        assert "finite" in answer.message or name in answer.message
    pose = probe.node.create_publisher(PoseWithCovarianceStamped, "initialpose", 10)
    probe.spin_until(lambda: pose.get_subscription_count() == 1, "the subscription")
    far = PoseWithCovarianceStamped()
    far.pose.pose.position.x, far.pose.pose.orientation.w = 1e300, 1.0
    said = []
    node.get_logger().error = said.append
    pose.publish(far)
    probe.spin_until(lambda: said, "the refusal")
    assert "initialpose" in said[0] and "expected at most 10000 m" in said[0]
    cameras.send(1)
    probe.spin_until(lambda: len(states) == 2, "a state after")
    assert states[1].status == Status.TRACKING


def test_a_click_where_nobody_can_be_chosen_is_refused(probe, start_tracker):
    node, _, _ = start_tracker()
    clicks = probe.node.create_publisher(PointStamped, "clicked_point", 10)
    probe.spin_until(lambda: clicks.get_subscription_count() == 1, "the subscription")
    said = []
    node.get_logger().error = said.append
    elsewhere = PointStamped()
    elsewhere.header.frame_id = "cam1"
    for message in (PointStamped(), elsewhere):
        clicks.publish(message)
    probe.spin_until(lambda: len(said) == 2, "two refusals")
    assert "clicked_point: a person is chosen by points" in said[0] and "expected frame 'world', got 'cam1'" in said[1]
