"""Scenes are as ambiguous as their names say, and what is said of sets is counted as it was."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmark.world import ambiguity
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import N_ROOT_DOF
from tracker_node.tracking.estimate import Status


@pytest.mark.parametrize("name", [name for name in ambiguity.CASES if name != "mesh_1cam"])
def test_every_seed_has_other_cases(name):
    first, other = (ambiguity.CASES[name](seed)[0] for seed in (1, 2))
    assert first.scene.thing.n_dof == N_ROOT_DOF
    assert np.abs(first.scene.states[-1].T_world_root - other.scene.states[-1].T_world_root).max() > 1e-3
    assert "1cam" not in name or len(first.scene.rig) == 1


def test_the_other_cross_is_the_same_as_far_away_as_is_said_and_the_start_nearer_to_it():
    case = ambiguity.crosses(1)
    own, twin = case.scene.thing.shapes, case.scene.with_it
    assert [shape.primitive for shape in own] == [shape.primitive for shape in twin]
    aside = twin[0].T_link_shape[:3, 3] - own[0].T_link_shape[:3, 3]
    assert np.linalg.norm(aside) == pytest.approx(ambiguity.BESIDE_M)
    first = case.scene.states[0]
    off = case.start.T_world_root[:3, 3] - first.T_world_root[:3, 3]
    assert np.linalg.norm(off) == pytest.approx(0.05) and off @ first.T_world_root[:3, :3] @ aside > 0.0


def test_starts_are_off_as_is_said_before_one_to_three_cameras():
    cases = ambiguity.CASES["starts"](2)
    assert sorted(len(case.scene.rig) for case in cases) == [1, 1, 2, 2, 3, 3]
    off = np.array([case.start.difference(case.scene.states[0]) for case in cases])
    np.testing.assert_allclose(np.linalg.norm(off[:, :3], axis=1), 0.02, atol=1e-9)
    angles = np.degrees(np.linalg.norm(off[:, 3:], axis=1))
    assert (angles > 10.0).all() and (angles < 20.0).all() and len(set(angles.round(6))) == len(angles)


def test_nothing_is_shown_while_the_box_is_hidden():
    case = ambiguity.hidden(3)
    for number, one in enumerate(case.sets()):
        empty = [i.pixels is b for i, b in zip(one.images, case.scene.backgrounds, strict=True)]
        assert all(empty) if number in ambiguity.HIDDEN else not any(empty)
        if number > ambiguity.HIDDEN[1]:
            break
    turned = case.scene.states[ambiguity.HIDDEN[-1]].difference(case.scene.states[ambiguity.HIDDEN[0]])
    assert np.linalg.norm(turned[3:]) > np.radians(10.0)


def test_sets_are_counted_by_what_is_said_of_them():
    case = ambiguity.hidden(1)
    states = case.scene.states[:8]

    def estimate(k: int, off: tuple[float, float], status: Status) -> SimpleNamespace:
        return SimpleNamespace(state=states[k].retract(np.array([off[0], 0, 0, 0, 0, off[1]])), status=status)

    tracking, degraded, lost = Status.TRACKING, Status.DEGRADED, Status.LOST
    said = [
        ((0.0, 0.0), tracking), ((0.009, 0.0), degraded), ((0.0, 0.03), lost), ((0.02, 0.0), tracking), ((0.0, 2.0), degraded),
        ((0.0, 0.1), lost), ((0.5, 0.0), tracking), ((0.0, 0.0), tracking),
    ]  # fmt: skip
    estimates = [estimate(k, *one) for k, one in enumerate(said)]
    found = ambiguity.counted(estimates, states, range(6, 7))
    assert found == {"right": 4, "wrong": 3, "turned": 1, "wrong_tracking": 1, "right_tracking": 2, "right_lost": 1,
                     "right_degraded": 1}  # fmt: skip
    figures = ambiguity.figures_of("x", [found, found])
    assert figures["x.sets"] == 14 and figures["x.wrong_called_tracking"] == pytest.approx(1 / 3)
    assert figures["x.right_called_tracking"] == 0.5 and figures["x.right_called_lost"] == 0.25


def test_states_of_the_thing_alone_are_judged():
    case = ambiguity.plate(1)
    assert isinstance(case.start, State) and len(Configuration(case.scene.thing, case.start).Ts_world_shape) == 1
