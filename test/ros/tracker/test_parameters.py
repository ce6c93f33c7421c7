"""Parameters are the fields of the configuration, no more and no less."""

from dataclasses import replace

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter

from tracker_node.errors import FileFormatError, UnknownNameError
from tracker_node.ros.tracker.parameters import ConfigParameters
from tracker_node.tracking.config import TrackerConfig, describe, flatten


@pytest.fixture
def make(ros):
    nodes = []

    def build(overrides=None, defaults=None, on_change=lambda config: None):
        parameters = [Parameter(name, value=value) for name, value in (overrides or {}).items()]
        nodes.append(Node("tracker", parameter_overrides=parameters))
        return nodes[-1], ConfigParameters(nodes[-1], defaults, on_change)

    yield build
    for node in nodes:
        node.destroy_node()


def test_every_field_is_a_parameter_with_its_description(make):
    node, parameters = make()
    assert parameters.config == TrackerConfig()
    for name, value in flatten(TrackerConfig()).items():
        assert node.get_parameter(name).value == value
        descriptor = node.describe_parameter(name)
        assert descriptor.description.startswith(describe()[name]["doc"])


def test_overrides_win_over_a_file_and_a_file_over_the_built_in(make):
    defaults = replace(TrackerConfig(), threads=1)
    _, parameters = make({"region.repeats": 9, "region.robust_sigmas": 7}, defaults)  # 7 means 7.0
    assert parameters.config.threads == 1
    assert parameters.config.region.repeats == 9
    assert parameters.config.region.robust_sigmas == 7.0
    assert parameters.config.background == TrackerConfig().background


def test_unknown_override_is_refused_with_the_valid_ones(make):
    with pytest.raises(UnknownNameError, match=r"repeat'.*region\.repeats"):
        make({"region.repeat": 9})


@pytest.mark.parametrize(
    ("name", "value"),
    [("region.repeats", -1), ("region.repeats", 2.5), ("modalities", ["nonsense"]), ("threads", "two"), ("color.levels", 2)],
)
def test_bad_override_is_named(make, name, value):
    with pytest.raises(FileFormatError, match=name):
        make({name: value})


def test_a_change_arrives_as_a_whole_or_not_at_all(make):
    changes = []
    node, parameters = make(on_change=changes.append)
    good = [Parameter("region.repeats", value=3), Parameter("threads", value=1)]
    assert node.set_parameters_atomically(good).successful
    assert (changes[-1].region.repeats, changes[-1].threads) == (3, 1)
    bad = [Parameter("region.repeats", value=4), Parameter("region.scales", value="nonsense")]
    result = node.set_parameters_atomically(bad)
    assert not result.successful and "scales" in result.reason
    assert len(changes) == 1 and parameters.config.region.repeats == 3
    assert node.set_parameters([Parameter("use_sim_time", value=True)])[0].successful and len(changes) == 1


def test_modalities_are_set_together_with_their_parameters(make):
    node, parameters = make({"modalities": ["color"]})
    change = [Parameter("modalities", value=["region"]), Parameter("region.repeats", value=9)]
    with parameters.declared_with(change):
        assert node.set_parameters_atomically(change).successful
    assert parameters.config.modalities == ("region",) and parameters.config.region.repeats == 9
    assert node.get_parameter("region.repeats").value == 9 and not node.has_parameter("color.levels")


def test_a_refused_change_of_modalities_leaves_the_parameters_as_they_were(make):
    node, parameters = make()
    before = set(node._parameters)
    change = [Parameter("modalities", value=["color"]), Parameter("color.levels", value=-5)]
    with parameters.declared_with(change):
        assert node.has_parameter("color.levels") and not node.set_parameters_atomically(change).successful
    assert parameters.config == TrackerConfig() and set(node._parameters) == before
    with parameters.declared_with([Parameter("modalities", value=["nonsense"])]):
        assert set(node._parameters) == before


def test_more_cameras_than_the_rig_has_are_no_smallest_number(ros):
    node = Node("tracker")
    parameters = ConfigParameters(node, cameras=("a", "b", "c"))
    result = node.set_parameters_atomically([Parameter("synchronizer.min_cameras", value=4)])
    assert not result.successful and "min_cameras': expected at most 3, the cameras of the rig, got 4" in result.reason
    assert node.set_parameters_atomically([Parameter("synchronizer.min_cameras", value=3)]).successful
    assert parameters.config.synchronizer.min_cameras == 3
    node.destroy_node()
