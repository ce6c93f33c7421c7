"""Mismatches are told, told again, and ended once the other end matches or is gone."""

from types import SimpleNamespace

import pytest
from rclpy.node import Node
from rclpy.qos import QoSPolicyKind, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from tracker_node.ros.diagnostics import OK, WARN, Diagnostics, QosMismatches

RELIABLE = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
EVENT = SimpleNamespace(last_policy_kind=QoSPolicyKind.RELIABILITY)
PART = "quality of service of cam1"


@pytest.fixture
def bench(probe):
    diagnostics = Diagnostics(probe.node)
    reports = []
    report = diagnostics.report
    diagnostics.report = lambda *given: (reports.append(given), report(*given))
    return SimpleNamespace(node=probe.node, probe=probe, mismatches=QosMismatches(probe.node, diagnostics), reports=reports)


@pytest.mark.parametrize(("end", "other"), [("of_subscription", "a publisher"), ("of_publisher", "a subscriber")])
def test_a_mismatch_is_told_with_its_policy_and_topic(bench, end, other):
    events = getattr(bench.mismatches, end)("cam1", "images")
    events.incompatible_qos(EVENT)
    ((part, level, said, values),) = bench.reports
    assert (part, level, values["topic"]) == (PART, WARN, "images")
    assert said == f"nothing passes between us and {other}: its {values['policy']} does not match ours"
    assert "reliability" in values["policy"].lower()


def known(bench):
    bench.mismatches.of_subscription("cam1", "images").incompatible_qos(EVENT)
    bench.reports.clear()


def ends(bench, publisher, subscriber, node=None):
    """A publisher and a subscription on the topic; the subscription is the node's own."""
    made = (node or bench.node).create_publisher(String, "images", publisher)
    bench.node.create_subscription(String, "images", lambda message: None, subscriber)
    return made


def test_what_lasts_is_told_again_only_when_asked(bench):
    ends(bench, BEST_EFFORT, RELIABLE)
    known(bench)
    bench.mismatches.recheck(again=False)
    assert bench.reports == []
    bench.mismatches.recheck()
    assert [report[:2] for report in bench.reports] == [(PART, WARN)]


def test_what_is_over_is_told_once(bench):
    publisher = ends(bench, BEST_EFFORT, RELIABLE)
    known(bench)
    bench.node.destroy_publisher(publisher)
    bench.mismatches.recheck()
    bench.mismatches.recheck()
    assert bench.reports == [(PART, OK, "matches", {"topic": "images"})]


def test_ends_that_match_are_no_trouble(bench):
    ends(bench, RELIABLE, BEST_EFFORT)
    known(bench)
    bench.mismatches.recheck()
    assert bench.reports[0][1] == OK


@pytest.mark.parametrize("ours", [True, False])
def test_a_mismatch_of_others_is_not_ours(bench, ours):
    other = Node("other")
    try:
        (bench.node if ours else other).create_subscription(String, "images", lambda message: None, RELIABLE)
        other.create_publisher(String, "images", BEST_EFFORT)
        infos = bench.node.get_publishers_info_by_topic, bench.node.get_subscriptions_info_by_topic
        bench.probe.spin_until(lambda: all(get("/images") and get("/images")[0].node_name[0] != "_" for get in infos))
        known(bench)
        bench.mismatches.recheck()
        assert bench.reports[0][1] == (WARN if ours else OK)
    finally:
        other.destroy_node()


@pytest.mark.parametrize(
    ("name", "namespace", "ours"),
    [("probe", "/", True), ("_NODE_NAME_UNKNOWN_", "?", True), ("other", "/", False), ("probe", "/robot", False)],
)
def test_an_end_is_ours_by_its_name_and_namespace_or_while_nobody_knows(bench, name, namespace, ours):
    assert bench.mismatches._is_ours(SimpleNamespace(node_name=name, node_namespace=namespace)) is ours
