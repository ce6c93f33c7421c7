"""The transport profile: ours unless the user has one, and read by Fast DDS."""

from xml.etree import ElementTree

import pytest

from tracker_node.loaders.fetched_files import data_file
from tracker_node.ros.qos import PROFILE_VARIABLE, images_subscribed, use_fastdds_profile

NS = {"dds": "http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"}


def test_the_users_own_profile_wins():
    environment = {PROFILE_VARIABLE: "/some/where.xml"}
    assert use_fastdds_profile(environment) == "/some/where.xml"
    assert use_fastdds_profile({"ROS_AUTOMATIC_DISCOVERY_RANGE": ""}) == str(data_file("config/fastdds_profile.xml"))


@pytest.mark.parametrize(("discovery", "addresses"), [("LOCALHOST", ["127.0.0.1"]), ("SUBNET", []), (None, [])])
def test_the_loopback_only_where_discovery_stays_on_this_machine(discovery, addresses):
    environment = {} if discovery is None else {"ROS_AUTOMATIC_DISCOVERY_RANGE": discovery}
    root = ElementTree.parse(use_fastdds_profile(environment)).getroot()
    assert [element.text for element in root.iterfind(".//dds:interfaceWhiteList/dds:address", NS)] == addresses
    assert environment[PROFILE_VARIABLE].endswith(".xml")


@pytest.mark.parametrize("name", ["fastdds_profile.xml", "fastdds_profile_localhost.xml"])
def test_several_image_sets_fit_into_shared_memory(name):
    root = ElementTree.parse(data_file(f"config/{name}")).getroot()
    segment = int(root.findtext(".//dds:segment_size", namespaces=NS))
    assert segment >= 2 * 4 * 1088 * 1920 * 3
    assert int(root.findtext(".//dds:port_queue_capacity", namespaces=NS)) >= 1024


def test_lossless_is_reliable():
    assert images_subscribed(lossless=True).reliability.name == "RELIABLE"
    assert images_subscribed(lossless=False).reliability.name == "BEST_EFFORT"
