"""Message classes by name, and quality of service between bags and rclpy."""

import pytest
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image
from std_srvs.srv import SetBool

from tracker_node.errors import TrackerError
from tracker_node.loaders.bag.metadata import OfferedQos
from tracker_node.ros.conversions import message_class
from tracker_node.ros.qos import offered_qos, qos_profile


def test_classes_are_found_by_name():
    assert message_class("sensor_msgs/msg/Image") is Image
    assert message_class("std_srvs/srv/SetBool") is SetBool


@pytest.mark.parametrize("name", ["sensor_msgs/msg/Nothing", "no_such_package/msg/Image", "Image", "", "sensor_msgs/Image"])
def test_other_names_are_refused(name):
    with pytest.raises(TrackerError, match="cannot be used here"):
        message_class(name)


@pytest.mark.parametrize(
    "offered",
    [OfferedQos("reliable", "volatile", "keep_last", 7), OfferedQos("best_effort", "transient_local", "keep_all", 3)],
)
def test_a_profile_says_what_is_offered(offered):
    assert offered_qos([qos_profile(offered)], 1) == offered


def test_no_depth_is_one():
    assert qos_profile(OfferedQos("reliable", "volatile", "keep_last", 0)).depth == 1


def profile(reliability="RELIABLE", durability="TRANSIENT_LOCAL", history="KEEP_ALL", depth=5):
    return QoSProfile(
        reliability=ReliabilityPolicy[reliability], durability=DurabilityPolicy[durability], history=HistoryPolicy[history],
        depth=depth,
    )  # fmt: skip


def test_the_weakest_of_several_is_offered_with_the_largest_depth():
    assert offered_qos([profile(), profile()], 2) == OfferedQos("reliable", "transient_local", "keep_all", 5)
    weaker = [profile("BEST_EFFORT"), profile(durability="VOLATILE"), profile(history="KEEP_LAST", depth=20)]
    assert offered_qos([profile(), weaker[0]]).reliability == "best_effort"
    assert offered_qos([profile(), weaker[1]]).durability == "volatile"
    assert offered_qos([profile(), weaker[2]]).history == "keep_last"
    assert offered_qos([profile(), weaker[2]]).depth == 20
    assert offered_qos([profile()]).depth == 10


def test_nobody_offers_a_plain_topic():
    assert offered_qos([]) == OfferedQos("reliable", "volatile", "keep_last", 10)
