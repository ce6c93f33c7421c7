"""Scenes are what their names say, the counts are those of the poses, and a peer's poses are judged as ours are."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmark.world import robots, things, visp
from benchmark.world._shapes import horned, knot
from helpers.bodies.two_links import two_links
from tracker_node.model.configuration import State
from tracker_node.model.shapes.primitives import is_closed
from tracker_node.observation.image_set import ImageSet
from tracker_node.tracking.estimate import Status


@pytest.mark.parametrize("mesh", [knot(1), horned(2)], ids=["knot", "horned"])
def test_hollow_shapes_are_closed_and_have_many_triangles(mesh):
    assert is_closed(mesh) and len(mesh.faces) >= 50_000
    assert np.ptp(mesh.vertices, axis=0).max() == pytest.approx(0.24)


@pytest.mark.parametrize("name", things.SCENES)
def test_every_seed_has_another_scene_and_the_same_one_twice(name):
    first, again, other = (things.SCENES[name](seed) for seed in (1, 1, 2))
    assert len(first.states) == things.SETS and len(first.rig) == (1 if "1cam" in name else 2)
    same, changed = (one.states[-1].T_world_root - first.states[-1].T_world_root for one in (again, other))
    assert not same.any() and np.abs(changed).max() > 1e-3
    np.testing.assert_array_equal(first.backgrounds[0], again.backgrounds[0])


def test_a_carried_box_rests_at_first_and_its_board_and_shadow_go_with_it():
    scene = things.carried_board(3)
    middles = np.array([state.T_world_root[:3, 3] for state in scene.states])
    steps = np.linalg.norm(np.diff(middles, axis=0), axis=1)
    assert not steps[:5].any() and 0.0005 < steps.max() <= 0.003 + 1e-9 and not middles[:, 2].any()
    assert [shape.link for shape in scene.with_it] == ["thing"]
    shaded = things.sliding_shadow(3)
    table, camera = shaded.backgrounds[0], shaded.rig.cameras[0]
    dark = [shaded.shaded(table, camera, state) < 0.9 * table for state in (shaded.states[0], shaded.states[-1])]
    assert 0.001 < dark[0].mean() < 0.1 and (dark[0] != dark[1]).any()


def test_sets_are_counted_that_are_right_wrong_and_far_and_what_is_said():
    scene = things.cluttered_box(1)

    def estimate(k: int, off_m: float = 0.0, status: Status = Status.TRACKING):
        T = scene.states[k].T_world_root.copy()
        T[0, 3] += off_m
        return SimpleNamespace(state=State.neutral(scene.thing, T), status=status)

    run = [estimate(k) for k in range(things.SETS)]
    run[3], run[4] = estimate(3, 0.02), estimate(4, 0.06)
    run[5], run[6] = estimate(5, 0.06, Status.LOST), estimate(6, 0.0, Status.LOST)
    found = things.judged(run, scene.states)
    assert (found["right"], found["unsaid"], found["lost_unsaid"], found["right_called_lost"]) == (things.SETS - 3, 2, 1, 1)
    assert found["tracked"] == things.SETS - 3
    total = things.summed("x", [found, found])
    assert total["x.wrong"] == 6 and total["x.right"] == pytest.approx(1.0 - 3.0 / things.SETS) and total["x.lost_unsaid"] == 2
    T = [state.T_world_root for state in scene.states]
    position, angle = visp.judged(visp.Poses([None, *T[1:]], np.zeros(things.SETS)), scene.states, scene)
    assert np.isinf(position[0]) and np.isinf(angle[0]) and position[1:].max() < 1e-9


def test_figures_of_a_robot_are_of_all_sets():
    n = robots.SETS
    joints, tool, lost = np.full((n, 7), 1.0), np.full(n, 2.0), np.zeros(n, bool)
    joints[:6], tool[:6], lost[1] = 50.0, 500.0, True
    found = robots.figures("panda", [robots.Run(joints, tool, lost, np.zeros(n, bool), np.full(10, 7.0))])
    assert (found["panda.joint_deg"], found["panda.joint_p95_deg"], found["panda.tcp_mm"]) == (1.0, 50.0, 2.0)
    assert (found["panda.lost_sets"], found["panda.sets"], found["panda.set_ms"]) == (1, n, 7.0)


def test_what_a_robot_says_is_off_by_a_constant_and_its_start_by_five_degrees():
    model = two_links()
    robot = robots.Robot("", {"bend": 10.0}, (("lower", (0.0, 0.0, 0.1)),), robots.ASIDE, 1.9, (0.0, 0.0, 0.0))
    states = robots.states_of(robot, model, 1)
    assert np.ptp([s.joint_positions[0] for s in states]) > 0.5 and not any(s.joint_positions[1] for s in states)
    case = robots.Case(robot, base_off=True, says=True)
    sets = robots.with_joint_states(case, model, states, [ImageSet(k, ()) for k in range(len(states))], 1)
    off = [[one.joint_positions[n] for n in ("bend", "turn")] - s.joint_positions for one, s in zip(sets, states, strict=True)]
    assert np.ptp(off, axis=0).max() < 1e-12 and off[0][1] == 0.0 and 0.0 < abs(off[0][0]) < 5 * robots.SAID_OFF_RAD
    apart = robots.start_of(case, model, states[0], 1).difference(states[0])
    assert np.linalg.norm(apart[:3]) == pytest.approx(robots.BASE_OFF_M) and abs(apart[6]) == pytest.approx(robots.START_OFF_RAD)
