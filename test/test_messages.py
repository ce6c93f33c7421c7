"""The interface package: constants, fields, and the definitions as tools without ROS read them."""

from array import array
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from tracker_node.tracking.estimate import LimbStatus, Status

STATUS_VALUES = {"INITIALIZING": 0, "TRACKING": 1, "DEGRADED": 2, "LOST": 3}
LIMB_VALUES = {"LIMB_TRACKING": 1, "LIMB_DEGRADED": 2, "LIMB_LOST": 3, "LIMB_UNSEEN": 4}
NAMES = ("TrackedState", "StateCovariance", "Bodies", "Crops", "KeypointPerson", "Keypoints")
TYPES = {name: f"msgs/msg/{name}.msg" for name in NAMES}


def test_tracked_state_of_the_installed_package() -> None:
    messages = pytest.importorskip("tracker_msgs.msg", reason="ROS is not installed")
    for name, value in STATUS_VALUES.items():
        assert getattr(messages.TrackedState, name) == value
    state = messages.TrackedState(dof_names=["root_x"], values=[1.5])
    assert state.status == messages.TrackedState.INITIALIZING
    assert list(state.values) == [1.5]


def test_set_state_of_the_installed_package() -> None:
    services = pytest.importorskip("tracker_msgs.srv", reason="ROS is not installed")
    request = services.SetState.Request(dof_names=["root_x"], values=[0.25])
    assert list(request.values) == [0.25]
    assert services.SetState.Response().success is False


def store_of_ours(repository: Path) -> Typestore:
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, path in TYPES.items():
        store.register(get_types_from_msg((repository / path).read_text(), f"tracker_msgs/msg/{name}"))
    return store


def test_definition_is_read_without_ros(repository: Path) -> None:
    """rosbags, which reads and writes our bags, understands the definition and its constants."""
    tracked_state = store_of_ours(repository).types["tracker_msgs/msg/TrackedState"]
    values = STATUS_VALUES | LIMB_VALUES
    assert {name: getattr(tracked_state, name) for name in values} == values
    assert {status.name: int(status) for status in Status} == STATUS_VALUES
    assert {f"LIMB_{status.name}": int(status) for status in LimbStatus} == LIMB_VALUES


@pytest.mark.parametrize("name", TYPES)
def test_definition_and_installed_package_have_the_same_fields(repository: Path, name: str) -> None:
    messages = pytest.importorskip("tracker_msgs.msg", reason="ROS is not installed")
    _, fields = store_of_ours(repository).fielddefs[f"tracker_msgs/msg/{name}"]
    installed = getattr(messages, name).get_fields_and_field_types()
    assert [name for name, _ in fields] == list(installed)


def test_ros_and_the_reader_without_ros_agree_on_every_field(repository: Path) -> None:
    messages = pytest.importorskip("tracker_msgs.msg", reason="ROS is not installed")
    pytest.importorskip("rclpy.serialization", reason="ROS is not installed")
    state = messages.TrackedState(
        status=messages.TrackedState.DEGRADED,
        status_reason="cam02 gave no image",
        dof_names=["root_x", "root_y"],
        values=[0.1, -0.2],
        residual=2.5,
        residual_unit="gray levels",
        cameras=["cam01", "cam02"],
        camera_samples=[120, 0],
        limbs=["trunk", "left_hand"],
        limb_status=[1, 3],
        limb_lost_probability=[0.0, 0.98],
        limb_reasons=["", "outline not found"],
        total_ms=12.5,
    )
    _assert_same_bytes(state, repository)
    _assert_same_bytes(
        messages.StateCovariance(
            dof_names=["root_x", "root_y"], covariance=[4.0, 1.0, 1.0, 9.0], velocity_covariance=[1.0, 0.5, 0.5, 2.0]
        ),
        repository,
    )


def _assert_same_bytes(message: Any, repository: Path) -> None:
    from rclpy import serialization

    store, type_name = store_of_ours(repository), f"tracker_msgs/msg/{type(message).__name__}"
    without_ros = bytes(store.serialize_cdr(store.types[type_name](**_plain(message, store)), type_name))
    assert serialization.deserialize_message(without_ros, type(message)) == message
    # rclpy's buffer may be longer than the message, which rosbags refuses, and what it holds there and in the
    # padding is noise. What a subscription delivers has the exact length.
    by_ros = bytes(serialization.serialize_message(message))[: len(without_ros)]
    read = store.deserialize_cdr(by_ros, type_name)
    assert store.serialize_cdr(read, type_name) == without_ros


def _plain(message: Any, store: Typestore) -> dict[str, Any]:
    """The fields of a ROS message as rosbags wants them."""
    return {name: _plain_value(getattr(message, name), store) for name in message.get_fields_and_field_types()}


def _plain_value(value: Any, store: Typestore) -> Any:
    if hasattr(value, "get_fields_and_field_types"):
        package = type(value).__module__.partition(".")[0]
        return store.types[f"{package}/msg/{type(value).__name__}"](**_plain(value, store))
    if isinstance(value, array):
        return np.array(value)
    return value
