"""Sequences of a model in given states, and what tells them apart."""

import numpy as np
import pytest

from helpers.bodies.bodies import crane, random_state
from tracker_node.model.configuration import Configuration, State
from tracker_node.synthesis.dataset import digest, mannequin_sequence, model_sequence
from tracker_node.synthesis.motions.motion import swing
from tracker_node.synthesis.subjects.cones import ModelSubject

MODEL = crane()
STATES = [random_state(MODEL, np.random.default_rng(i), 0.4) for i in range(3)]


def test_a_model_s_truth_is_its_landmarks_in_every_state():
    sequence = model_sequence(MODEL, iter(STATES), 25.0, "arm")
    assert (sequence.name, sequence.n_images, sequence.rate_hz) == ("arm", 3, 25.0)
    assert sequence.landmark_names == MODEL.landmark_names
    assert sequence.dof_names == MODEL.chain.dof_names
    assert sequence.static_landmarks is None
    time_steps = list(sequence.time_steps)
    assert len(time_steps) == 3
    for time_step, state in zip(time_steps, STATES, strict=True):
        body = Configuration(MODEL, state)
        assert np.array_equal(time_step.landmarks, body.landmarks_world)
        assert np.array_equal(time_step.mesh.vertices, ModelSubject(MODEL).mesh(body).vertices)
    assert [one.to_values().tolist() for one in sequence.states] == [one.to_values().tolist() for one in STATES]


def test_fingerprints_tell_motions_apart():
    def content(states, model=MODEL):
        return model_sequence(model, states, 25.0).parameters["motion"]

    assert content(STATES) == content(list(STATES))
    assert len({content(STATES), content(STATES[::-1]), content(STATES[:2]), content([State.neutral(MODEL)])}) == 4


def test_a_mannequin_s_fingerprint_is_of_its_motion_and_its_clothes():
    motion = swing(30.0, 3)
    plain = mannequin_sequence(motion)
    assert plain.name == f"mannequin_{motion.name}"
    assert (plain.n_images, plain.rate_hz) == (3, 30.0)
    assert set(plain.parameters) == {"stature", "motion"}
    assert plain.parameters["stature"] == 1.75
    assert len(plain.static_landmarks) == len(plain.landmark_names)
    longer = mannequin_sequence(swing(30.0, 4), 1.6)
    assert longer.parameters["motion"] != plain.parameters["motion"]
    assert longer.parameters["stature"] == 1.6
    assert np.ptp(longer.static_landmarks[:, 2]) < np.ptp(plain.static_landmarks[:, 2])


def test_fingerprints_do_not_hang_on_the_last_bits():
    some = np.array([0.1, 2.0])
    assert digest(some) == digest(some + 1e-9)
    assert digest(some) != digest(some + 2e-6)
    assert digest(some, some) != digest(some)
    assert len(digest(some)) == 16
    assert digest([0.1], [2.0]) == digest([0.1, 2.0])


@pytest.mark.parametrize("n", [1, 2])
def test_time_steps_are_made_as_they_are_asked_for(n):
    time_steps = iter(model_sequence(MODEL, STATES, 25.0).time_steps)
    assert len([next(time_steps) for _ in range(n)]) == n
