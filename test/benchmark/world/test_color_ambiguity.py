"""The clips of ambiguity by colors, and their figures."""

import numpy as np
import pytest

from benchmark.world import ambiguity
from benchmark.world import color_ambiguity as program
from tracker_node.geometry import so3
from tracker_node.model.configuration import State


def test_scenes_are_drawn_in_lights_that_their_rig_does_not_state():
    scene = ambiguity.crosses(1).scene
    lit, other = (program.in_other_light(scene, seed) for seed in (1, 2))
    known, sun, another = (rig.lights[1].direction for rig in (scene.rig, lit.rig, other.rig))
    cosine = np.dot(known, sun) / np.linalg.norm(known) / np.linalg.norm(sun)
    assert 1e-3 < np.arccos(cosine) < program.LIGHT_RAD + 1e-9
    assert not np.allclose(sun, another)
    gains = np.array([camera.gain for camera in lit.rig])
    assert (np.abs(np.log(gains)) <= program.EXPOSURE).all() and np.ptp(gains[:, 0]) > 0.0
    assert [c.gain for c in scene.rig] == [(1.0, 1.0, 1.0)] * 2 and lit.states is scene.states


def test_an_equal_cross_is_right_in_each_of_its_turns():
    truth = program.equal_cross(1).scene.states[0]
    assert len(program.TURNS) == 24
    T = truth.T_world_root.copy()
    T[:3, :3] = T[:3, :3] @ so3.exp(np.array([0.0, np.pi / 2.0, 0.0])) @ so3.exp(np.array([0.02, 0.0, 0.0]))
    found = program.nearest_turned(truth, State(T, truth.joint_positions))
    assert np.linalg.norm(found.difference(State(T, truth.joint_positions))[3:6]) == pytest.approx(0.02)


def test_figures_are_of_the_sets_that_they_are_named_after():
    run = {"right": 6, "wrong": 4, "turned": 0, "wrong_tracking": 1, "right_tracking": 3, "right_lost": 1, "right_degraded": 2}
    more = {"trusted_within": 3, "wrong_shown": 2, "wrong_within": 1, "nees": 36.0, "ms": 5.0}
    figures = program.all_figures("a", [run | more, run | more | {"ms": 9.0}])
    assert figures["a.trusted_within"] == 0.75 and figures["a.wrong_within"] == 0.5
    assert figures["a.nees_factor"] == 2.0 and figures["a.set_ms_p50"] == 7.0
    assert figures["a.wrong_called_tracking"] == 0.25 and figures["a.right_called_tracking"] == 0.5
