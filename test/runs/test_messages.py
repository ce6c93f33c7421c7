"""Messages made without ROS: estimates and lenses survive them, and nodes say the same in the same bytes."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from helpers.ros.estimates import estimate_of
from helpers.ros.samples import arm, small_rig, some_estimate, tracked_arm
from tracker_node.camera.model import CameraModel
from tracker_node.errors import CalibrationError
from tracker_node.loaders.bag.message_types import STATE_COVARIANCE, TRACKED_STATE, message_of, time_of, typestore
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.model.configuration import Configuration, State
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.runs import messages
from tracker_node.runs.outputs import BODY_OUTPUTS, CAMERA_OUTPUTS, MARKER_ARRAY, Tracked
from tracker_node.runs.writer import RunWriter
from tracker_node.tracking.estimate import GRAY_LEVELS, CameraFault, LimbReport, LimbStatus, Status, TrackEstimate

ENDS = ("state", "state_covariance", "pose", "joint_states")
LENSES = {
    "none": np.zeros(0),
    "plumb_bob": np.array([-0.3, 0.1, 0.002, -0.001]),
    "rational_polynomial": np.linspace(-0.2, 0.2, 8),
    "equidistant": np.array([0.05, -0.01, 0.002, 0.001]),
}


def of_bag(type_name: str, content: messages.Content) -> bytes:
    return bytes(typestore().serialize_cdr(message_of(type_name, content), type_name))


def there_and_back(type_name: str, content: messages.Content) -> Any:
    """Through bytes, as a bag would."""
    return typestore().deserialize_cdr(of_bag(type_name, content), type_name)


def state_there_and_back(estimate: TrackEstimate) -> TrackEstimate:
    state = there_and_back(TRACKED_STATE, messages.tracked_state(estimate, arm(), "world"))
    return estimate_of(state, there_and_back(STATE_COVARIANCE, messages.state_covariance(estimate, arm(), "world")))


def lens(name: str) -> CameraModel:
    K = np.array([[500.0, 0.5, 320.25], [0.0, 510.0, 239.5], [0.0, 0.0, 1.0]])
    return CameraModel(640, 480, K, name, LENSES[name])


def camera_info(name: str) -> messages.Content:
    return messages.camera_info(7, "cam01", lens(name))


def test_an_estimate_survives() -> None:
    before = some_estimate(arm())
    after = state_there_and_back(before)
    for name in (
        "stamp_ns",
        "status",
        "status_reason",
        "score",
        "residual",
        "residual_unit",
        "cameras",
        "iterations",
        "evaluations",
        "timings",
        "limbs",
    ):
        assert getattr(after, name) == getattr(before, name), name
    assert (after.covariance == before.covariance).all()
    assert (after.velocity == before.velocity).all()
    assert (after.velocity_covariance == before.velocity_covariance).all()
    assert (after.state.joint_positions == before.state.joint_positions).all()
    np.testing.assert_allclose(after.state.T_world_root, before.state.T_world_root, atol=1e-14)


def test_a_velocity_of_which_nothing_is_known_survives() -> None:
    assert state_there_and_back(replace(some_estimate(arm()), velocity_covariance=None)).velocity_covariance is None


@pytest.mark.parametrize("name", sorted(LENSES))
def test_a_lens_survives(name: str) -> None:
    before = lens(name)
    after = messages.lens_of("cam01", there_and_back(messages.CAMERA_INFO, camera_info(name)))
    assert (after.width, after.height, after.distortion_model) == (640, 480, name)
    assert (after.K == before.K).all()
    np.testing.assert_array_equal(after.distortion[: before.distortion.size], before.distortion)
    assert not after.distortion[before.distortion.size :].any()


def test_an_uncalibrated_camera_is_named() -> None:
    message = message_of(messages.CAMERA_INFO, camera_info("none"))
    message.k = np.zeros(9)
    with pytest.raises(CalibrationError, match=r"cam01.*uncalibrated"):
        messages.lens_of("cam01", message)
    message = message_of(messages.CAMERA_INFO, camera_info("none"))
    message.distortion_model, message.d = "kannala", np.ones(3)
    with pytest.raises(CalibrationError, match=r"cam01.*camera_info"):
        messages.lens_of("cam01", message)


def test_times_before_1970_have_no_negative_nanoseconds() -> None:
    assert time_of(-1) == {"sec": -1, "nanosec": 999_999_999}


def test_fields_that_a_message_does_not_have_are_refused() -> None:
    with pytest.raises(ValueError, match=r"CameraInfo has no field \['focal'\]"):
        message_of(messages.CAMERA_INFO, {"focal": 1.0})
    with pytest.raises(ValueError, match=r"Header has no field \['time'\]"):
        message_of(messages.CAMERA_INFO, {"header": {"time": 1}})


def estimates() -> dict[str, TrackEstimate]:
    """What trackers say: more, less, and in numbers of other types than those of the messages."""
    plain = some_estimate(tracked_arm())
    limbs = tuple(LimbReport(f"limb {i}", status, "hidden" * i, i / 3) for i, status in enumerate(LimbStatus))
    unknown = replace(plain, velocity_covariance=None, information=None, limbs=())
    numpy_scalars = {"score": np.float32(1.5), "residual": 2, "iterations": np.int64(3), "evaluations": np.uint8(4)}
    fault = CameraFault("cam2", "turned", 0.05, 0.01, 5)
    slices = {"covariance": np.asfortranarray(plain.covariance), "velocity": np.repeat(plain.velocity, 2)[::2]}
    return {
        "degraded": plain,
        "tracking": replace(plain, status=Status.TRACKING, status_reason=""),
        "lost": replace(unknown, status=Status.LOST, status_reason="Arm verloren – ganz"),
        "initializing": replace(unknown, status=Status.INITIALIZING, state=State.neutral(tracked_arm())),
        "limbs": replace(plain, limbs=limbs),
        "faults": replace(plain, status=Status.TRACKING, faults=(fault,)),
        "of colors": replace(plain, residual_unit=GRAY_LEVELS),
        "other numbers": replace(plain, **numpy_scalars),
        "no camera": replace(plain, cameras=()),
        "before 1970": replace(plain, stamp_ns=-1),
        "not contiguous": replace(plain, **slices),
    }


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    return small_rig(tmp_path_factory.mktemp("rig"))


def said(estimate: TrackEstimate, rig) -> list[tuple[str, messages.Content]]:
    """Type and content of all that is said of an estimate."""
    pixels = np.random.default_rng(2).integers(0, 256, (120, 160, 3), dtype=np.uint8)
    images = tuple(CameraImage(name, estimate.stamp_ns + i, pixels) for i, name in enumerate(rig.names[:2]))
    configuration = Configuration(tracked_arm(), estimate.state)
    tracked = Tracked(estimate, ImageSet(estimate.stamp_ns, images), rig, configuration)
    contents = [(output.type_name, output.content(tracked)) for output in BODY_OUTPUTS]
    contents += [(output.type_name, output.content(tracked, camera)) for output in CAMERA_OUTPUTS for camera in rig]
    fixed, changed = messages.markers(tracked.model), messages.changed_markers(estimate, configuration, "world")
    whole = [{**both[0], **both[1]} for both in zip(fixed["markers"], changed["markers"], strict=True)]
    contents.append((MARKER_ARRAY, {"markers": whole}))
    frames = [("world", camera.frame_id, camera.T_world_cam) for camera in rig]
    contents += [("geometry_msgs/msg/TransformStamped", content) for content in messages.transforms(estimate.stamp_ns, frames)]
    return [(type_name, content) for type_name, content in contents if content is not None]


def assert_same_bytes(message: Any, type_name: str, content: messages.Content) -> None:
    """A message of ROS has the bytes of one in a bag, but for those between fields, which the middleware leaves as they were.

    rosbags sets these to 0, and leaves out what aligns an empty array at the end.
    """
    from rclpy.serialization import serialize_message

    expected, data = of_bag(type_name, content), serialize_message(message)
    assert 0 <= len(data) - len(expected) < 8, type_name
    store = typestore()
    assert bytes(store.serialize_cdr(store.deserialize_cdr(data[: len(expected)], type_name), type_name)) == expected, type_name


@pytest.mark.parametrize("name", sorted(estimates()))
def test_nodes_and_offline_runs_say_the_same_in_the_same_bytes(name: str, rig) -> None:
    pytest.importorskip("rclpy", reason="ROS is not installed")
    from tracker_node.ros import conversions
    from tracker_node.ros.conversions import message_class

    estimate = estimates()[name]
    contents = said(estimate, rig)
    for type_name, content in contents:
        assert_same_bytes(conversions.message_of(message_class(type_name), content), type_name, content)
    told = {type_name.rpartition("/")[2] for type_name, _ in contents}
    of_a_known_body = {"TwistWithCovarianceStamped", "PoseWithCovarianceStamped", "JointState"}
    assert of_a_known_body & told == (of_a_known_body if estimate.status.known else set())
    assert ("CompressedImage" in told) == estimate.status.has_state
    assert {"TrackedState", "StateCovariance", "Image", "MarkerArray", "TransformStamped"} <= told


def test_a_message_that_is_filled_again_says_nothing_of_before(rig) -> None:
    """As a node fills one message for every image set."""
    pytest.importorskip("rclpy", reason="ROS is not installed")
    from tracker_node.ros import conversions
    from tracker_node.ros.conversions import message_class

    kept: dict[tuple[str, int], Any] = {}
    for name in (*sorted(estimates()), *sorted(estimates(), reverse=True)):
        of_type: dict[str, int] = {}
        for type_name, content in said(estimates()[name], rig):
            of_type[type_name] = of_type.get(type_name, 0) + 1
            key = type_name, of_type[type_name]
            kept[key] = conversions.fill(kept.get(key) or message_class(type_name)(), content)
            assert_same_bytes(kept[key], type_name, content)


@pytest.mark.parametrize("name", sorted(LENSES))
def test_a_lens_is_the_same_live_and_offline(name: str) -> None:
    pytest.importorskip("rclpy", reason="ROS is not installed")
    from tracker_node.ros import conversions

    theirs = conversions.camera_info_message(7, "cam01", lens(name))
    assert_same_bytes(theirs, messages.CAMERA_INFO, camera_info(name))
    live, offline = (messages.lens_of("cam01", m) for m in (theirs, there_and_back(messages.CAMERA_INFO, camera_info(name))))
    assert (live.K == offline.K).all() and np.array_equal(live.distortion, offline.distortion)


@pytest.mark.parametrize(("shape", "encoding"), [((6, 5), "mono8"), ((6, 5, 3), "bgr8"), ((6, 5, 3), "rgb8")])
@pytest.mark.parametrize("step", [1, -1, 2])
def test_images_are_the_same_live_and_offline(shape: tuple[int, ...], encoding: str, step: int) -> None:
    """Also those whose rows or columns are views of a larger image."""
    pytest.importorskip("rclpy", reason="ROS is not installed")
    from tracker_node.ros import conversions

    pixels = np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)[:, ::step]
    content, live = messages.image(5, "c", pixels, encoding), conversions.image_message(5, "c", pixels, encoding)
    assert_same_bytes(live, messages.IMAGE, content)
    assert bytes(live.data) == pixels.tobytes() and live.step == pixels[0].nbytes


def test_what_cannot_say_that_it_is_wrong_is_not_written_while_the_body_is_not_known(tmp_path):
    """As the node does."""
    rig, model = small_rig(tmp_path), tracked_arm()
    statuses = [Status.INITIALIZING, Status.TRACKING, Status.LOST, Status.DEGRADED]
    with RunWriter(tmp_path / "run", rig, model) as writer:
        for i, status in enumerate(statuses):
            writer.append(replace(some_estimate(model, i), status=status), ImageSet(i, ()))
    with BagReader(tmp_path / "run/bag") as reader:
        stamps = {end: [stamp for stamp, _ in reader.decoded(f"/tracker/{end}")] for end in ENDS}
    assert stamps == {"state": [0, 1, 2, 3], "state_covariance": [0, 1, 2, 3], "pose": [1, 3], "joint_states": [1, 3]}
