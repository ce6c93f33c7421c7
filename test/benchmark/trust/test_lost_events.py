"""Events are what they are called: measured on the meshes and states that they hand out."""

import numpy as np
import pytest

from benchmark.trust import _lost_events as events
from tracker_node.geometry import se3
from tracker_node.model.configuration import Configuration
from tracker_node.synthesis.subjects.cones import ModelSubject
from tracker_node.synthesis.subjects.figure import figure_model, figure_motion
from tracker_node.tracking.limbs.tree import limbs_of

MODEL = figure_model()
SUBJECT = ModelSubject(MODEL)
STATES = figure_motion(30.0, 14, seed=5)
LIMBS = {limb.name: limb for limb in limbs_of(MODEL)}
BEGINS, ENDS = 4, 10


def rng():
    return np.random.default_rng(7)


def landmarks(state):
    return Configuration(MODEL, state).landmarks_world


def test_a_crate_is_closed_and_faces_outward():
    low, high = np.array([-0.2, 0.1, 0.0]), np.array([0.4, 0.5, 1.0])
    box = events.crate(low, high, rng())
    corners = box.vertices[box.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ni,ni->n", normals, box.normals[box.faces[:, 0]]) > 0).all()
    volume = np.einsum("ni,ni->n", corners[:, 0], normals).sum() / 6.0  # by Gauss' theorem: only if nothing is missing
    assert volume == pytest.approx(np.prod(high - low))


def test_an_occluded_body_is_in_its_crate_while_it_is_there():
    clip = events.occluded("x", SUBJECT, STATES, BEGINS, ENDS, rng())
    alone = len(SUBJECT.faces)
    meshes = list(clip.meshes(SUBJECT))
    assert [len(mesh.faces) > alone for mesh in meshes] == [BEGINS <= i < ENDS for i in range(len(STATES))]
    for mesh in meshes[BEGINS:ENDS]:
        body, box = mesh.vertices[: mesh.faces[: alone].max() + 1], clip.crate.vertices
        assert (body > box.min(axis=0)).all() and (body < box.max(axis=0)).all()


def test_a_hidden_limb_ends_in_its_crate_and_the_head_does_not():
    clip = events.hidden("x", SUBJECT, STATES, LIMBS["left_forearm"], BEGINS, ENDS, rng())
    low, high = clip.crate.vertices.min(axis=0), clip.crate.vertices.max(axis=0)
    inside = [((landmarks(s) > low) & (landmarks(s) < high)).all(axis=1) for s in STATES[BEGINS:ENDS]]
    assert all(row[MODEL.landmark_index("left_wrist")] and not row[MODEL.landmark_index("head")] for row in inside)


def test_an_exit_goes_beyond_the_ceiling_and_comes_back():
    clip = events.exits("x", STATES, BEGINS, ENDS)
    heights = np.array([s.T_world_root[2, 3] for s in clip.states])
    assert (np.diff(heights[BEGINS - 1 : ENDS]) > 0.2).all() and heights[ENDS - 1] > 5.0
    assert clip.states[ENDS] is STATES[ENDS] and clip.states[BEGINS - 1] is STATES[BEGINS - 1]


def test_a_swapped_limb_reaches_for_its_partner():
    clip = events.swapped("x", MODEL, STATES, LIMBS["left_shank"], LIMBS["right_shank"], BEGINS)
    truth, wrong = landmarks(STATES[BEGINS]), landmarks(clip.handed)
    ankles = [MODEL.landmark_index(f"{side}_ankle") for side in ("left", "right")]
    assert (np.linalg.norm(wrong[ankles] - truth[ankles[::-1]], axis=1) < 0.1).all()
    arms = [i for i, name in enumerate(MODEL.landmark_names) if "wrist" in name or "head" in name]
    np.testing.assert_allclose(wrong[arms], truth[arms], atol=1e-12)


def test_a_mirrored_limb_is_elsewhere_within_the_limits_and_nothing_else_is():
    clip = events.mirrored("x", MODEL, STATES, LIMBS["right_forearm"], BEGINS)
    apart = np.linalg.norm(landmarks(clip.handed) - landmarks(STATES[BEGINS]), axis=1)
    own = LIMBS["right_forearm"].links[MODEL.landmark_links]
    assert apart[own].max() >= 0.2 and apart[~own].max() < 1e-12
    q = clip.handed.joint_positions
    assert (q >= MODEL.chain.lower).all() and (q <= MODEL.chain.upper).all()


def test_wrong_starts_and_other_places_are_far_off():
    clip = events.wrong_start("x", MODEL, STATES, rng())
    assert 0.4 <= np.linalg.norm((clip.handed.T_world_root - STATES[0].T_world_root)[:3, 3]) <= 0.8
    moved = events.placed(STATES, rng())
    first = moved[0].T_world_root @ se3.inverse(STATES[0].T_world_root)
    np.testing.assert_allclose(moved[5].T_world_root, first @ STATES[5].T_world_root, atol=1e-12)
    cut = events.teleports("x", STATES, moved, BEGINS).states
    assert cut[BEGINS - 1] is STATES[BEGINS - 1] and cut[BEGINS] is moved[BEGINS]
