"""Mismatches are told, told again, and ended once the other end matches or is gone."""

from types import SimpleNamespace

import pytest
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from tracker_node.ros.diagnostics import OK, WARN, Diagnostics, QosMismatches

RELIABLE = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PART = "quality of service of cam1"


@pytest.fixture
def bench(probe):
    diagnostics = Diagnostics(probe.node)
    reports = []
    report = diagnostics.report
    diagnostics.report = lambda *given: (reports.append(given), report(*given))
    return SimpleNamespace(node=probe.node, probe=probe, mismatches=QosMismatches(probe.node, diagnostics), reports=reports)


def ends(bench, publisher, subscriber):
    """A publisher and a subscription on the topic, both the node's own, one of which is watched."""
    made = bench.node.create_publisher(String, "images", publisher)
    bench.node.create_subscription(String, "images", lambda message: None, subscriber)
    return made


def known(bench):
    bench.mismatches.of_subscription("cam1", "images")
    bench.mismatches.recheck()
    bench.reports.clear()


@pytest.mark.parametrize(("end", "other"), [("of_subscription", "a publisher"), ("of_publisher", "a subscriber")])
@pytest.mark.parametrize(("publisher", "policy"), [(BEST_EFFORT, "reliability"), (RELIABLE, "durability")])
def test_a_mismatch_is_told_with_its_policy_and_topic(bench, end, other, publisher, policy):
    getattr(bench.mismatches, end)("cam1", "images")
    bench.mismatches.recheck()
    ends(bench, publisher, RELIABLE if policy == "reliability" else LATCHED)
    assert bench.reports == []
    bench.mismatches.recheck()
    ((part, level, said, values),) = bench.reports
    assert (part, level, values) == (PART, WARN, {"topic": "images", "policy": policy})
    assert said == f"nothing passes between us and {other}: its {policy} does not match ours"


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


def test_ends_that_match_are_looked_at_once(bench):
    ends(bench, RELIABLE, BEST_EFFORT)
    known(bench)
    looked = []
    bench.mismatches._mismatched = lambda topic: looked.append(topic) or ""
    bench.mismatches.recheck()
    bench.node.create_subscription(String, "images", lambda message: None, RELIABLE)
    bench.mismatches.recheck()
    assert bench.reports == [] and looked == ["images"]


@pytest.mark.parametrize("ours", [True, False])
def test_a_mismatch_of_others_is_not_ours(bench, ours):
    other = Node("other")
    try:
        (bench.node if ours else other).create_subscription(String, "images", lambda message: None, RELIABLE)
        other.create_publisher(String, "images", BEST_EFFORT)
        infos = bench.node.get_publishers_info_by_topic, bench.node.get_subscriptions_info_by_topic
        bench.probe.spin_until(lambda: all(get("/images") and get("/images")[0].node_name[0] != "_" for get in infos))
        bench.mismatches.of_subscription("cam1", "images")
        bench.mismatches.recheck()
        assert [report[1] for report in bench.reports] == [WARN] * ours
    finally:
        other.destroy_node()


@pytest.mark.parametrize(
    ("name", "namespace", "ours"),
    [("probe", "/", True), ("_NODE_NAME_UNKNOWN_", "?", True), ("other", "/", False), ("probe", "/robot", False)],
)
def test_an_end_is_ours_by_its_name_and_namespace_or_while_nobody_knows(bench, name, namespace, ours):
    assert bench.mismatches._is_ours(SimpleNamespace(node_name=name, node_namespace=namespace)) is ours
