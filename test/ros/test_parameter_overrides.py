"""Parameters given at the start: integers for floating point, names that nobody has, and quality of service."""

from types import SimpleNamespace

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String

from tracker_node.errors import FileFormatError, UnknownNameError
from tracker_node.ros import parameter_overrides as overrides
from tracker_node.ros.ending import PARENT_VARIABLE
from tracker_node.ros.qos import RESULT, overridable


@pytest.fixture
def make(ros):
    nodes = []

    def build(**values):
        given = [Parameter(name.replace("__", "."), value=value) for name, value in values.items()]
        nodes.append(Node("tracker", parameter_overrides=given))
        return nodes[-1]

    yield build
    for node in nodes:
        node.destroy_node()


def test_integers_become_floating_point_where_that_is_meant(make):
    node = make(rate=8, count=3, name="x", flag=True)
    overrides.integers_as_doubles(node, ["rate", "flag", "name", "other"])
    values = {name: parameter.value for name, parameter in overrides.overrides_of(node).items()}
    assert values == {"rate": 8.0, "count": 3, "name": "x", "flag": True}
    assert type(values["rate"]) is float
    assert type(values["count"]) is int
    assert values["flag"] is True


def test_names_that_nobody_has_are_refused(make):
    overrides.refuse_unknown(make(rate=8.0, use_sim_time=True), ["rate"], [])
    overrides.refuse_unknown(make(qos_overrides__x=1), [], [])
    with pytest.raises(UnknownNameError, match=r"parameter.*'rat'"):
        overrides.refuse_unknown(make(rat=8.0), ["rate"], [])


@pytest.mark.parametrize(("policy", "value"), [("depth", 1), ("history", "keep_all"), ("reliability", "best_effort")])
def test_qualities_of_service_that_there_are(policy, value):
    overrides._check_qos("here", f"qos_overrides./t.publisher.{policy}", value)


@pytest.mark.parametrize(
    ("policy", "value", "message"),
    [
        ("depth", 0, "a positive int"), ("depth", -1, "a positive int"), ("depth", True, "a positive int"),
        ("depth", 2.0, "a positive int"), ("history", "some", "one of keep_last, keep_all"),
        ("reliability", 1, "one of reliable, best_effort"),
    ],
)  # fmt: skip
def test_values_that_there_are_not(policy, value, message):
    with pytest.raises(FileFormatError, match=message):
        overrides._check_qos("here", f"qos_overrides./t.publisher.{policy}", value)


def test_policies_that_there_are_not():
    with pytest.raises(UnknownNameError, match=r"policy of quality of service.*'durability'"):
        overrides._check_qos("here", "qos_overrides./t.publisher.durability", "volatile")


def test_only_qualities_of_service_are_checked_as_such(make):
    overrides.check_qos_overrides(make(depth="x"))
    with pytest.raises(FileFormatError, match="parameters of tracker"):
        overrides.check_qos_overrides(make(qos_overrides__t__depth="x"))


def own_topic(make, **values):
    node = make(**{f"qos_overrides./tracker/{name}": value for name, value in values.items()})
    node.create_publisher(String, "~/state", **overridable(RESULT))
    return node


def test_overrides_of_topics_that_are_not_there_are_refused(make):
    overrides.refuse_unknown_qos(own_topic(make, state__publisher__depth=7))
    with pytest.raises(UnknownNameError, match=r"stat.publisher.depth"):
        overrides.refuse_unknown_qos(own_topic(make, stat__publisher__depth=7))
    overrides.refuse_unknown_qos(make(**{"qos_overrides./other/stat__publisher__depth": 7}))


def test_what_a_node_has_not_declared_is_refused_at_its_start(make):
    node = make(rat=8.0, use_sim_time=True, qos_overrides__x=1)
    node.declare_parameter("rate", 1.0)
    with pytest.raises(UnknownNameError, match=r"unknown parameter 'rat'; valid: rate, "):
        overrides.refuse_undeclared(node, ["--ros-args", "-p", "rat:=8.0"])
    node.declare_parameter("rat", 1.0)
    overrides.refuse_undeclared(node, [])


FILES = {
    "/**:\n  ros__parameters: {threads: 2, region: {inlier_px: 3}}": "",
    "'*':\n  ros__parameters: {threads: 2, region: {inlier_px: 3}}": "",
    "lab:\n  '**':\n    ros__parameters: {threads: 2, region.inlier_px: 3}": "",
    "/**:\n  ros__parameters: {threads: 2}\n/tracker:\n  ros__parameters: {region: {inlier_px: 3}}": "region.inlier_px",
    "/**:\n  tracker:\n    ros__parameters: {threads: 2, region: {inlier_px: 3}}": "threads",
    "/**/tracker:\n  ros__parameters: {threads: 2, region: {inlier_px: 3}}": "threads",
}


@pytest.mark.parametrize("content", FILES)
def test_what_a_file_says_of_all_nodes_may_be_for_others(make, tmp_path, content):
    file, unknown = tmp_path / "p.yaml", FILES[content]
    file.write_text(content)
    node, ros_args = make(threads=2, region__inlier_px=3), ["--ros-args", "--params-file", str(file)]
    if not unknown:
        overrides.refuse_undeclared(node, ros_args)
        overrides.refuse_unknown(node, ["rate"], ros_args)
        return
    with pytest.raises(UnknownNameError, match=f"'{unknown}'"):
        overrides.refuse_undeclared(node, ros_args)


def test_what_a_pipeline_gives_to_all_its_processes_is_refused_by_none(make, monkeypatch):
    """But by the tracker, which says so."""
    monkeypatch.setenv(PARENT_VARIABLE, "1")
    overrides.refuse_undeclared(make(threads=2), ["--ros-args", "-p", "threads:=2"])


def test_the_first_parameter_that_is_not_there_is_named(make):
    node = make()
    node.declare_parameter("threads", 1)
    assert overrides.unknown_parameters(node, [SimpleNamespace(name="threads")]) is None
    refusal = overrides.unknown_parameters(node, [Parameter("threads", value=1), Parameter("thread", value=2)])
    assert not refusal.successful
    assert "'thread'" in refusal.reason
    assert "threads" in refusal.reason


def test_of_many_names_those_most_like_an_unknown_one_are_told(make):
    node = own_topic(make)
    for i in range(30):
        node.declare_parameter(f"region.scale_{i}", 1)
    refusal = overrides.unknown_parameters(node, [Parameter("region.scale", value=1)])
    assert refusal.reason.count(",") == 4 and "region.scale_9" in refusal.reason and "qos_overrides" not in refusal.reason
    assert overrides.unknown_parameters(node, [Parameter("zzz", value=1)]).reason.count(",") == 4


def test_choices_are_told_with_commas():
    assert overrides.one_of(("a", "b")) == "one of a, b"
