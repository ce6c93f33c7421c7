"""The tracker node: in this process for what it answers, as a process for what it says of real images."""

import shutil
import signal
from dataclasses import replace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from tracker_msgs.msg import StateCovariance, TrackedState
from tracker_msgs.srv import SetState
from visualization_msgs.msg import MarkerArray

from helpers.ros.cameras import PERIOD_NS, N, image_set_of, options_of, tracker_of
from helpers.ros.estimates import estimate_of
from helpers.ros.graph import stamps
from helpers.ros.samples import moving_state, placed
from tracker_node.loaders.model.urdf_writer import urdf_of
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.configuration import Configuration
from tracker_node.render.raycast.raycaster import render_mask
from tracker_node.ros.conversions import (
    camera_image_of,
    camera_info_message,
    fill,
    image_message,
    transform_of_pose,
)
from tracker_node.ros.qos import LATCHED
from tracker_node.runs.messages import pose_of
from tracker_node.tracking.estimate import Status


@pytest.mark.parametrize("checked", ["0", "1"])  # with 1, rclpy checks the type of every message field
def test_two_processes_say_what_the_tracker_says(probe, launch, recording, checked):
    """All topics of all image sets; the states are those of the same calls in this process, bit for bit."""
    states, poses = probe.listen(TrackedState, "tracker/state"), probe.listen(PoseWithCovarianceStamped, "tracker/pose")
    joints, masks = probe.listen(JointState, "tracker/joint_states"), probe.listen(Image, "tracker/cam2/mask")
    overlays = probe.listen(CompressedImage, "tracker/cam1/overlay/compressed")
    markers, covariances = probe.listen(MarkerArray, "tracker/markers"), probe.listen(StateCovariance, "tracker/state_covariance")
    description = probe.listen(String, "robot_description", LATCHED)
    files = ["--rig", recording / "rig.yaml", "--model", recording / "model.yaml", "--initial-state", recording / "state.yaml"]
    environment = {"ROS_PYTHON_CHECK_FIELDS": checked}
    wait = ("--wait-for", "state=2", "pose=1", "joint_states=1", "state_covariance=1")
    tracker = launch("tracker", *files, "--lossless", *wait, env=environment)
    consumed = ("--as-fast-as-consumed", "--wait-for-subscribers", "1")
    ingest = launch("camera_ingest", "--rig", recording / "rig.yaml", "--rate", "30", *consumed, env=environment)
    probe.spin_until(lambda: len(states) == N, f"{N} states")
    assert ingest.wait() == 0, ingest.err
    probe.spin_until(lambda: all(len(x) == N for x in (poses, covariances, joints, masks, overlays, markers)), "the other topics")
    tracker.interrupt()
    assert tracker.wait() == 0 and "Traceback" not in tracker.err
    options = options_of(recording)
    tracker_here = tracker_of(recording)
    for i, message in enumerate(states):
        expected = tracker_here.step(image_set_of(recording, i))
        assert np.array_equal(np.array(message.values), expected.state.to_values())
        assert np.array_equal(estimate_of(message, covariances[i]).covariance, expected.covariance)
        assert (message.status, message.iterations) == (expected.status, expected.iterations)
        assert estimate_of(message).cameras == expected.cameras
        drawn = render_mask(Configuration(options.model, expected.state), options.rig["cam2"])
        assert np.array_equal(camera_image_of("cam2", masks[i]).pixels, drawn) and drawn.any()
    assert stamps(states) == stamps(covariances)
    assert stamps(states) == stamps(poses) == stamps(joints) == stamps(masks) == [round(i * 1e9 / 30.0) for i in range(N)]
    assert [d.data for d in description] == [urdf_of(options.model)]


def test_state_of_the_body_is_right(probe, recording, start_tracker):
    node, states, cameras = start_tracker()
    for i in range(4):
        cameras.send(i)
    probe.spin_until(lambda: len(states) == 4, "four states")
    truth = moving_state(options_of(recording).model, 3)
    assert np.linalg.norm(estimate_of(states[-1]).state.T_world_root[:3, 3] - truth.T_world_root[:3, 3]) < 0.02
    assert states[-1].status == Status.TRACKING and node.fatal is None


def test_set_state_and_reset(probe, recording, start_tracker):
    _, states, cameras = start_tracker()
    cameras.send(0)
    probe.spin_until(lambda: len(states) == 1, "a state")
    answer = probe.ask(SetState, "tracker/set_state", SetState.Request(dof_names=["elbow_flexion"], values=[9.0]))
    assert answer.success and answer.message.startswith("put at the limit: elbow_flexion: 9 is not in")
    answer = probe.ask(SetState, "tracker/set_state", SetState.Request(dof_names=["root_x"], values=[0.01]))
    assert answer.success and answer.message == ""  # of what this request names there is nothing to say
    answer = probe.ask(SetState, "tracker/set_state", SetState.Request(dof_names=["elbow_flexion"], values=[0.7]))
    assert answer.success and answer.message == ""
    answer = probe.ask(SetState, "tracker/set_state", SetState.Request(dof_names=["knee"], values=[0.7]))
    assert not answer.success and "knee" in answer.message and "elbow_flexion" in answer.message
    answer = probe.ask(SetState, "tracker/set_state", SetState.Request())
    assert not answer.success and answer.message.endswith("got none")
    cameras.send(1)
    probe.spin_until(lambda: len(states) == 2, "a state after set_state")
    assert probe.ask(Trigger, "tracker/reset", Trigger.Request()).success
    cameras.send(0)  # an earlier time is fine after a reset, and gives what it gave at first
    probe.spin_until(lambda: len(states) == 3, "a state after the reset")
    assert np.array_equal(states[2].values, states[0].values)


def test_initial_pose_moves_the_body(probe, recording, start_tracker):
    _, states, cameras = start_tracker()
    publisher = probe.node.create_publisher(PoseWithCovarianceStamped, "initialpose", 10)
    probe.spin_until(lambda: publisher.get_subscription_count() > 0, "subscription to initialpose")
    message = PoseWithCovarianceStamped()
    message.header.frame_id = "world"
    far = placed(5.0, 5.0, 5.0)
    fill(message.pose.pose, pose_of(far))
    publisher.publish(message)
    publisher.wait_for_all_acked()
    cameras.send(0)
    probe.spin_until(lambda: len(states) == 1, "a state")
    assert np.allclose(transform_of_pose(states[0].root_pose)[:3, 3], far[:3, 3], atol=0.5)
    assert states[0].status != Status.TRACKING  # there is no body


def test_a_recording_that_begins_again_is_tracked_again(probe, recording, start_tracker):
    _, states, cameras = start_tracker()
    late_ns = 100_000_000_000
    for i in range(2):
        cameras.send(i, stamp_ns=late_ns + i * PERIOD_NS)
    probe.spin_until(lambda: len(states) == 2, "two states")
    for i in range(2):
        cameras.send(i)
    probe.spin_until(lambda: len(states) == 4, "two states after the jump")
    assert stamps(states[2:]) == [0, round(1e9 / 30.0)]
    assert np.array_equal(states[2].values, states[0].values)  # from the initial state, nothing remembered


def test_unusable_images_are_named_and_do_no_harm(probe, recording, start_tracker):
    _, states, cameras = start_tracker()
    cameras.images["cam2"].publish(image_message(0, "f", np.zeros((10, 20, 3), np.uint8)))
    status = probe.diagnostics
    probe.spin_until(lambda: "tracker: cam2" in status and status["tracker: cam2"].level == DiagnosticStatus.ERROR, "report")
    assert "160x120" in status["tracker: cam2"].message and "20x10" in status["tracker: cam2"].message
    cameras.send(1)
    probe.spin_until(lambda: len(states) == 1, "a state all the same")
    probe.spin_until(lambda: status["tracker: cam2"].level == DiagnosticStatus.OK, "recovery")


def test_image_sets_are_accounted_for(probe, recording, start_tracker):
    """An instant of one camera alone makes no set where two are asked for."""
    options = options_of(recording)
    config = replace(options.config, synchronizer=replace(options.config.synchronizer, min_cameras=2))
    _, states, cameras = start_tracker(config=config)
    cameras.send(0)
    cameras.send(1, ("cam1",))
    cameras.send(2)
    probe.spin_until(lambda: len(states) == 2, "two states")

    def accounts() -> dict[str, str]:
        status = probe.diagnostics.get("tracker: image sets")
        return {value.key: value.value for value in status.values} if status else {}

    probe.spin_until(lambda: accounts().get("complete") == "2", "two sets")
    assert accounts()["not formed, incomplete"] == "1" and accounts()["not formed, ahead"] == "0"


@pytest.mark.long
def test_a_camera_that_stops_is_named_and_the_others_go_on(probe, recording, start_tracker):
    options = options_of(recording)
    config = replace(options.config, synchronizer=replace(options.config.synchronizer, min_cameras=2, queue_s=0.1))
    _, states, cameras = start_tracker(config=config)
    cameras.send(0)
    probe.spin_until(lambda: len(states) == 1, "a state")
    sent = 1
    status = probe.diagnostics

    def named() -> bool:
        nonlocal sent
        cameras.send(sent % N, ("cam1", "cam3"), stamp_ns=sent * PERIOD_NS)
        sent += 1
        return "tracker: cam2" in status and status["tracker: cam2"].level == DiagnosticStatus.ERROR

    probe.spin_until(named, "cam2 named")
    assert "stopped" in status["tracker: cam2"].message
    assert len(states) > 1 and states[-1].camera_samples[1] == 0


def test_calibration_from_topics(probe, recording, start_tracker):
    _, states, cameras = start_tracker(calibration_from_topics=True)
    rig = load_rig(recording / "rig.yaml")
    cameras.send(0)
    cameras.infos["cam1"].publish(CameraInfo(width=160, height=120))  # K[0] = 0
    status = probe.diagnostics
    probe.spin_until(lambda: "uncalibrated" in getattr(status.get("tracker: calibration"), "message", ""), "a report")
    assert "cam1" in status["tracker: calibration"].message
    assert not states
    malformed = camera_info_message(0, "f", rig["cam1"].model)
    malformed.height = 0
    cameras.infos["cam1"].publish(malformed)
    probe.spin_until(lambda: "1 to 16384 pixels" in status["tracker: calibration"].message, "another reason")
    for name in rig.names:
        cameras.infos[name].publish(camera_info_message(0, rig[name].frame_id, rig[name].model))
    probe.spin_until(lambda: len(states) == 1, "the waiting images are tracked")


def test_parameters_change_at_run_time(probe, recording, start_tracker):
    from rcl_interfaces.srv import DescribeParameters, SetParameters
    from rclpy.parameter import Parameter

    node, states, cameras = start_tracker()
    cameras.send(0)
    probe.spin_until(lambda: len(states) == 1, "a state")
    fewer = [Parameter("region.scales", value="1"), Parameter("region.repeats", value=0)]
    request = SetParameters.Request(parameters=[parameter.to_parameter_msg() for parameter in fewer])
    results = probe.ask(SetParameters, "tracker/set_parameters", request).results
    assert len(results) == 2 and all(result.successful for result in results)
    probe.spin_until(lambda: not node._builder.busy, "the new tracker")
    cameras.send(1)
    cameras.send(2)
    probe.spin_until(lambda: len(states) == 3, "states")
    assert states[2].iterations <= 1
    wrong = {"region.repeats": -1, "region.scales": "wide", "region.nonsense": 1, "chamfer.max_iterations": 3}
    for name, value in wrong.items():
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        (result,) = probe.ask(SetParameters, "tracker/set_parameters", request).results
        assert not result.successful and result.reason
    request = DescribeParameters.Request(names=["region.inlier_px"])
    (descriptor,) = probe.ask(DescribeParameters, "tracker/describe_parameters", request).descriptors
    assert "[px]" in descriptor.description and descriptor.floating_point_range[0].to_value == 1000.0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ends_cleanly_on_a_signal(probe, launch, recording, number):
    tracker = launch("tracker", "--rig", recording / "rig.yaml", "--model", recording / "model.yaml")
    probe.spin_until(lambda: probe.node.count_publishers("/tracker/state") == 1, "the tracker")
    tracker.interrupt(number)
    assert tracker.wait() == 0
    assert "Traceback" not in tracker.err


def test_mistakes_are_one_line(launch, recording, tmp_path):
    files = ["--rig", recording / "rig.yaml", "--model", recording / "model.yaml"]
    broken = tmp_path / "broken"
    shutil.copytree(recording, broken)
    (broken / "rig.yaml").write_text((broken / "rig.yaml").read_text().replace("cam1_plate.png", "absent.png"))
    unknown = launch("tracker", *files, "--ros-args", "-p", "region.nonsense:=1")
    out_of_range = launch("tracker", *files, "--ros-args", "-p", "region.inlier_px:=-1.0")
    no_background = launch("tracker", "--rig", broken / "rig.yaml", *files[2:])
    for process, said in ((unknown, "nonsense"), (out_of_range, "inlier_px"), (no_background, "absent.png")):
        assert process.wait() == 2
        assert said in process.err and "Traceback" not in process.err, process.err
