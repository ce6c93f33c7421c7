"""Quality of service as bags of any origin state it, in words or in the numbers of old ones."""

import pytest

from tracker_node.loaders.bag.metadata import OfferedQos
from tracker_node.loaders.bag.qos import offered_in

PROFILE = """
- history: {history}
  depth: {depth}
  reliability: {reliability}
  durability: {durability}
  deadline: {{sec: 0, nsec: 0}}
  lifespan: {{sec: 0, nsec: 0}}
  liveliness: 1
  liveliness_lease_duration: {{sec: 0, nsec: 0}}
  avoid_ros_namespace_conventions: false
"""


def profile(history=1, depth=7, reliability=1, durability=2):
    return PROFILE.format(history=history, depth=depth, reliability=reliability, durability=durability)


@pytest.mark.parametrize(("number", "word"), [(1, "reliable"), (2, "best_effort"), (0, "reliable"), (3, "reliable")])
def test_reliability(number, word):
    assert offered_in(profile(reliability=number)).reliability == word


@pytest.mark.parametrize(("number", "word"), [(1, "transient_local"), (2, "volatile"), (0, "volatile"), (3, "volatile")])
def test_durability(number, word):
    assert offered_in(profile(durability=number)).durability == word


@pytest.mark.parametrize(("number", "word"), [(1, "keep_last"), (2, "keep_all"), (0, "keep_last"), (3, "keep_last")])
def test_history(number, word):
    assert offered_in(profile(history=number)).history == word


@pytest.mark.parametrize(("stated", "depth"), [(7, 7), (0, OfferedQos().depth)])
def test_depth(stated, depth):
    assert offered_in(profile(depth=stated)).depth == depth


def test_the_first_of_several_publishers_counts():
    assert offered_in(profile(reliability=2) + profile(reliability=1)).reliability == "best_effort"


@pytest.mark.parametrize("text", ["", "[]", "{", "- {history: 1}", "- 3", "nonsense"])
def test_what_cannot_be_read_is_the_default(text):
    assert offered_in(text) == OfferedQos()
