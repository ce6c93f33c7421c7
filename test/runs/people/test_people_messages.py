"""People there and back through messages, bit for bit; and messages that say what cannot be."""

from typing import Any

import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg

from tracker_node.errors import CalibrationError
from tracker_node.loaders.bag.message_types import KEYPOINTS, message_of, message_type, stamp_ns_of, typestore
from tracker_node.observation.image_set import CameraImage
from tracker_node.observation.keypoints.people import Person, Silhouette
from tracker_node.runs import messages

NAMES = ("nose", "left_hip", "right_hip")
PIXELS = np.zeros((48, 64, 3), np.uint8)


def person(seed: int = 1, silhouette: bool = True) -> Person:
    random = np.random.default_rng(seed)
    roots = random.normal(0.0, 3.0, (3, 2, 2))
    covariances = np.einsum("nij,nkj->nik", roots, roots)
    covariances[:, 1, 0] = covariances[:, 0, 1]
    probabilities = random.integers(0, 256, (5, 7), dtype=np.uint8)
    return Person(
        NAMES, random.uniform(0.0, 48.0, (3, 2)), covariances, random.uniform(0.0, 1.0, 3), 1.0 / 3.0, (0.1, -2.5, 40.0, 47.3),
        Silhouette(probabilities, (11, 3)) if silhouette else None, random.normal(size=(3, 3)) if silhouette else None,
    )  # fmt: skip


def content(*people: Person) -> messages.Content:
    image = CameraImage("cam01", 1_500_000_001, PIXELS, people=people)
    return messages.keypoints(image, "cam01_optical", "BlazePose full")


def there_and_back(said: messages.Content) -> Any:
    return typestore().deserialize_cdr(typestore().serialize_cdr(message_of(KEYPOINTS, said), KEYPOINTS), KEYPOINTS)


def assert_same(after: Person, before: Person) -> None:
    assert (after.names, after.score, after.box) == (before.names, before.score, before.box)
    for name in ("pixels", "covariances", "scores"):
        assert getattr(after, name).tobytes() == np.ascontiguousarray(getattr(before, name)).tobytes(), name
    assert (after.skeleton is None) == (before.skeleton is None)
    if before.skeleton is not None and after.skeleton is not None:
        np.testing.assert_array_equal(after.skeleton, before.skeleton)
    assert (after.silhouette is None) == (before.silhouette is None)
    if before.silhouette is not None and after.silhouette is not None:
        assert after.silhouette.origin == before.silhouette.origin
        assert np.array_equal(after.silhouette.probabilities, before.silhouette.probabilities)


def test_people_are_the_same_after_a_message() -> None:
    before = (person(1), person(2, silhouette=False))
    message = there_and_back(content(*before))
    assert (stamp_ns_of(message.header.stamp), message.header.frame_id) == (1_500_000_001, "cam01_optical")
    assert (message.camera, message.detector) == ("cam01", "BlazePose full")
    after = messages.people_of(message)
    for one, other in zip(after, before, strict=True):
        assert_same(one, other)


def test_nobody_is_not_the_same_as_nothing() -> None:
    assert messages.people_of(there_and_back(content())) == ()


def test_nodes_say_the_same_in_the_same_bytes() -> None:
    pytest.importorskip("rclpy", reason="ROS is not installed")
    pytest.importorskip("tracker_msgs.msg", reason="ROS is not installed")
    from rclpy.serialization import deserialize_message, serialize_message

    from tracker_node.ros import conversions
    from tracker_node.ros.conversions import message_class

    said = content(person(1), person(2, silhouette=False), person(3))
    sent = serialize_message(conversions.message_of(message_class(KEYPOINTS), said))
    expected = bytes(typestore().serialize_cdr(message_of(KEYPOINTS, said), KEYPOINTS))
    read = typestore().deserialize_cdr(sent[: len(expected)], KEYPOINTS)
    assert bytes(typestore().serialize_cdr(read, KEYPOINTS)) == expected
    for one, other in zip(messages.people_of(deserialize_message(sent, message_class(KEYPOINTS))), (1, 2, 3), strict=True):
        assert_same(one, person(other, silhouette=other != 2))


def test_the_definition_in_a_bag_has_its_units_and_its_parts() -> None:
    definition = message_type(KEYPOINTS).definition
    assert "center of the first one" in definition
    assert "probability that the point is there, 0..1" in definition
    types = get_types_from_msg(definition, KEYPOINTS)
    assert {name for name in types if name.startswith("tracker_msgs")} == {KEYPOINTS, "tracker_msgs/msg/KeypointPerson"}
    assert "MSG: tracker_msgs/KeypointPerson" in definition and "MSG: sensor_msgs/Image" in definition


@pytest.mark.parametrize(
    ("field", "index", "value"),
    [("u", 1, np.nan), ("v", 1, 1e9), ("scores", 1, 1.5), ("scores", 1, np.nan), ("covariance_uu", 1, -1.0),
     ("covariance_uv", 1, 1e9), ("covariance_vv", 1, np.inf)],
)  # fmt: skip
def test_an_impossible_point_was_not_found(field: str, index: int, value: float) -> None:
    message = message_of(KEYPOINTS, content(person()))
    getattr(message.persons[0], field)[index] = value
    (after,) = messages.people_of(message)
    assert after.scores[index] == 0.0
    assert np.isfinite(after.pixels).all() and np.isfinite(after.covariances).all()
    others = [i for i in range(3) if i != index]
    assert np.array_equal(after.pixels[others], person().pixels[others])
    assert np.array_equal(after.scores[others], person().scores[others])


@pytest.mark.parametrize(
    ("change", "said"),
    [({"u": np.zeros(2)}, "expected 3 numbers in u"), ({"covariance_uv": np.zeros(4)}, "expected 3 numbers in covariance_uv"),
     ({"skeleton_y": np.zeros(0)}, "expected 3 numbers in skeleton_y"),
     ({"score": float("nan")}, "finite numbers for score"), ({"box": np.full(4, np.inf)}, "finite numbers for score and box")],
)  # fmt: skip
def test_a_person_who_is_none_is_refused_with_the_camera(change: dict[str, Any], said: str) -> None:
    message = message_of(KEYPOINTS, content(person()))
    for field, value in change.items():
        setattr(message.persons[0], field, value)
    with pytest.raises(CalibrationError, match=rf"camera 'cam01': keypoints at 1500000001 ns: .*{said}"):
        messages.people_of(message)


def test_a_silhouette_that_is_no_image_is_refused() -> None:
    for field, value in (("encoding", "rgb8"), ("step", 3), ("height", 600)):
        message = message_of(KEYPOINTS, content(person()))
        setattr(message.persons[0].silhouette, field, value)
        with pytest.raises(CalibrationError, match="silhouette: expected mono8"):
            messages.people_of(message)


def test_a_name_that_comes_twice_is_refused() -> None:
    message = message_of(KEYPOINTS, content(person()))
    message.names[1] = "nose"
    with pytest.raises(CalibrationError, match="each name of a point once"):
        messages.people_of(message)
