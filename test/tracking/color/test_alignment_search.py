"""Which angles are tried for a limb, and which links count once some of them are placed."""

import numpy as np
import pytest

from helpers.ros.samples import arm
from tracker_node.model.configuration import State
from tracker_node.tracking.color.hierarchy import limbs_of
from tracker_node.tracking.color.search import ColorSearch, _own_links
from tracker_node.tracking.config import ColorConfig

MODEL = arm()  # trunk, upper (three axes), fore (one), hand (none)


def search(**options):
    return ColorSearch(MODEL, ColorConfig(**options), None, None)


def test_links_that_a_later_joint_moves_do_not_count_yet():
    (limb,) = limbs_of(MODEL.chain)
    assert _own_links(MODEL.chain, limb, 1, [1, 2]).tolist() == [False, True, False, False]
    assert _own_links(MODEL.chain, limb, 2, [1, 2]).tolist() == [False, True, True, True]
    assert limb.links.tolist() == [False, True, True, True]  # as before


@pytest.mark.parametrize(("link", "turned"), [(1, [0, 1, 2]), (2, [3])])
def test_only_the_angles_of_one_joint_are_turned(link, turned):
    state = State(np.eye(4), np.array([0.1, 0.2, 0.3, 1.0]))
    found = search()._turned(state, link, 0.01, 6, np.random.default_rng(1))
    moved = np.array([other.joint_positions for other in found]) - [0.1, 0.2, 0.3, 1.0]
    assert len(found) == 6 and np.flatnonzero(np.all(moved != 0.0, axis=0)).tolist() == turned
    assert np.abs(moved).max() < 0.05 and all(other.T_world_root is state.T_world_root for other in found)
    assert state.joint_positions.tolist() == [0.1, 0.2, 0.3, 1.0]


def test_angles_are_spread_about_the_present_ones_and_stay_within_limits():
    state = State(np.eye(4), np.array([0.0, 0.5, 0.0, 2.4]))
    angles = np.array([s.joint_positions for s in search()._turned(state, 1, 0.2, 4000, np.random.default_rng(1))])
    assert angles[:, 1].mean() == pytest.approx(0.5, abs=0.02) and angles[:, 1].std() == pytest.approx(0.2, abs=0.02)
    bent = np.array([s.joint_positions[3] for s in search()._turned(state, 2, 0.5, 200, np.random.default_rng(1))])
    assert bent.max() == 2.5 and bent.min() >= 0.0


def test_parts_are_fitted_one_by_one_only_where_asked_for():
    assert len(search(hierarchical=True)._stages) == 3 and search(hierarchical=False)._stages == ()
    assert [limb.name for limb in search().limbs] == ["upper"]
