"""Colors by alignment: which angles are tried for a limb, which links count by then, and which points each fit is made of."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from helpers.ros.samples import arm
from tracker_node.model.configuration import State
from tracker_node.objective.constraints.prior import Prior
from tracker_node.objective.normal_equations import NormalEquations
from tracker_node.tracking.color.search import AlignmentSearch
from tracker_node.tracking.config import ColorConfig
from tracker_node.tracking.limbs.tree import limbs_of

MODEL = arm()  # trunk, upper (three axes), fore (one), hand (none)
LIMB = limbs_of(MODEL)[1]
HERE = State(np.eye(4), np.array([0.1, 0.2, 0.3, 1.0]))


@dataclass(eq=False)
class Points:
    """Points of the surface that like every state the more, the nearer its joints are to ``goal``; note what is asked."""

    goal: np.ndarray
    links: np.ndarray | None = None
    tried: list = field(default_factory=list)  # (links that count, state) of every cost
    minimized: list = field(default_factory=list)  # links that count, of every linearization

    def on_links(self, links: np.ndarray) -> "Points":
        return replace(self, links=links)

    def cost(self, state: State) -> float:
        self.tried.append((self.links.tolist(), state))
        return float(((state.joint_positions - self.goal) ** 2).sum())

    def linearize(self, state: State) -> NormalEquations:
        self.minimized.append(None if self.links is None else self.links.tolist())
        H, g = np.zeros((MODEL.n_dof, MODEL.n_dof)), np.zeros(MODEL.n_dof)
        return NormalEquations(H, g, Prior(State(np.eye(4), self.goal), np.ones(MODEL.n_dof)).add_to(H, g, state), 1)

    def camera_equations(self, state: State) -> list:
        return []


class Colors:
    """A modality of such points."""

    def __init__(self, goal=HERE.joint_positions):
        self.points, self.asked = Points(np.asarray(goal, dtype=float)), []

    def correspond(self, state: State, detail: int) -> Points:
        self.asked.append(detail)
        return self.points


def searched(goal=HERE.joint_positions, around: State = HERE, **options) -> tuple[Colors, State]:
    colors = Colors(goal)
    found = AlignmentSearch(MODEL, ColorConfig(**options), colors).find_limb(LIMB, around, np.random.default_rng(1))
    return colors, found


def tried_for(colors: Colors, links: list[bool]) -> np.ndarray:
    """(n, n_axes) of all poses that were scored while these links counted."""
    return np.array([state.joint_positions for own, state in colors.points.tried if own == links])


UPPER, WHOLE = [False, True, False, False], [False, True, True, True]


def test_links_that_a_later_joint_moves_do_not_count_yet():
    colors, _ = searched()
    order = [links for links, _ in colors.points.tried]
    assert order == sorted(order)  # those of the upper arm first
    assert [list(x) for x in sorted({tuple(links) for links in order})] == [UPPER, WHOLE]
    assert set(map(tuple, colors.points.minimized)) == {tuple(WHOLE)}  # and all of the limb in the end


@pytest.mark.parametrize(("links", "turned"), [(UPPER, [0, 1, 2]), (WHOLE, [3])])
def test_only_the_angles_of_one_joint_are_turned(links, turned):
    """The upper arm's about where it is; the forearm's about the six best of those."""
    colors, _ = searched(search_angle_deg=1.0, search_states=120)
    poses = tried_for(colors, links)
    own = np.setdiff1d(np.arange(4), turned)
    different = np.unique(poses[:, own], axis=0)
    assert len(different) == (1 if links == UPPER else 6)
    assert len(np.unique(poses, axis=0)) == (1 + 60 if links == UPPER else 6 + 60)  # the beam, and what is drawn about it
    assert np.abs(poses[:, turned] - HERE.joint_positions[turned]).max() < 0.1
    assert all(np.array_equal(state.T_world_root, HERE.T_world_root) for _, state in colors.points.tried)
    assert HERE.joint_positions.tolist() == [0.1, 0.2, 0.3, 1.0]


def test_angles_are_spread_about_the_present_ones_and_stay_within_limits():
    around = State(np.eye(4), np.array([0.0, 0.5, 0.0, 2.4]))
    colors, _ = searched(around.joint_positions, around, search_angle_deg=float(np.degrees(0.2)), search_states=8000)
    angles = tried_for(colors, UPPER)
    assert angles[:, 1].mean() == pytest.approx(0.5, abs=0.02) and angles[:, 1].std() == pytest.approx(0.2, abs=0.02)
    colors, _ = searched(around.joint_positions, around, search_angle_deg=float(np.degrees(0.5)), search_states=400)
    bent = tried_for(colors, WHOLE)[:, 3]
    assert bent.max() == 2.5 and bent.min() >= 0.0


def test_the_limb_is_found_and_the_rest_of_the_body_stays():
    goal = np.array([-0.5, 0.6, -0.4, 0.3])
    _, found = searched(goal, search_states=600)
    np.testing.assert_allclose(found.joint_positions, goal, atol=1e-3)
    np.testing.assert_array_equal(found.T_world_root, HERE.T_world_root)


@pytest.mark.parametrize(("hierarchical", "details"), [(True, [3, 3, 2, 1, 0]), (False, [3, 2, 1, 0])])
def test_parts_are_fitted_one_by_one_only_where_asked_for(hierarchical, details):
    """Then all of them share the points of the coarsest level; three parts, and each later level for all together."""
    colors, goal = Colors([0.2, 0.1, 0.4, 0.8]), State(np.eye(4), np.array([0.2, 0.1, 0.4, 0.8]))
    config = ColorConfig(hierarchical=hierarchical, levels=4, passes=1)
    fit = AlignmentSearch(MODEL, config, colors).run(HERE, [], False)
    assert colors.asked == details
    counted = {tuple(links) for links in colors.points.minimized if links is not None}
    assert counted == ({(True,) * 4, (False, True, True, True), (False, False, True, True)} if hierarchical else set())
    assert np.abs(fit.state.difference(goal)).max() < 1e-3
