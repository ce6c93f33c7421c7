"""What ``run.json`` says of every run, live or offline."""

from collections import Counter

import pytest

from tracker_node.runs.writer import asked_of_run, counted_sets
from tracker_node.tracking.config import TrackerConfig, flatten
from tracker_node.tracking.estimate import Status


def test_a_run_begins_with_options_and_parameters():
    config = TrackerConfig(modalities=("chamfer",))
    asked = asked_of_run({"start": 3}, config, 12)
    assert asked["expected_image_sets"] == 12 and asked["options"] == {"start": 3}
    assert asked["parameters"] == flatten(config) != flatten(TrackerConfig())
    assert asked["versions"] and asked["command"] and asked["cpu"]


def test_parameters_that_are_not_known_are_not_told():
    asked = asked_of_run({}, None, None)
    assert "parameters" not in asked and asked["expected_image_sets"] is None


@pytest.mark.parametrize("lost", [0, 2])
def test_image_sets_are_counted_by_status(lost):
    found = counted_sets(Counter({Status.TRACKING: 5, Status.LOST: lost, Status.DEGRADED: 1}))
    assert (found["image_sets"], found["lost_sets"]) == (6 + lost, lost)
    assert found["status_counts"] == {"INITIALIZING": 0, "TRACKING": 5, "DEGRADED": 1, "LOST": lost}
