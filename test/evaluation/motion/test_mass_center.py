"""The center of mass: of one who stands, of one who jumps and falls as everything does, and how it moves with parts."""

import numpy as np
import pytest
from scipy.signal import savgol_filter

from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.masses import mass_center
from tracker_node.synthesis.motions.deepmimic import load_motion
from tracker_node.synthesis.subjects.mannequin import LANDMARKS, MannequinSubject

HUMAN = human_model(ankles=True)
RATE_HZ = 100.0


def of(state):
    return mass_center(HUMAN.landmark_names, Configuration(HUMAN, state).landmarks_world)


def test_of_one_who_stands_it_is_at_57_percent_of_the_height_and_in_the_middle():
    state = State.neutral(HUMAN)
    points = Configuration(HUMAN, state).landmarks_world
    soles, top = points[HUMAN.landmark_index("left_heel"), 2], points[HUMAN.landmark_index("head"), 2]
    assert (of(state)[2] - soles) / (top - soles) == pytest.approx(0.57, abs=0.02)
    assert of(state)[1] == pytest.approx(0.0, abs=1e-6)


def test_a_leg_moves_it_by_its_share_of_the_mass():
    lifted = State.neutral(HUMAN)
    lifted.joint_positions[HUMAN.chain.axis_index("left_hip_flexion")] = np.pi / 2
    moved = of(lifted) - of(State.neutral(HUMAN))
    assert 0.05 < moved[0] < 0.12 and 0.05 < moved[2] < 0.12 and abs(moved[1]) < 0.01


def test_who_jumps_falls_at_g(shared_data):
    """A captured jump, in the middle of its flight; the mannequin has no feet of its own there, which weigh little."""
    motion = load_motion("jump", RATE_HZ, None, shared_data / "bullet_motions")
    points = np.array([body.landmarks for body in MannequinSubject().follow(motion)])
    names = list(LANDMARKS)
    for side in ("left", "right"):
        ankle = points[:, [names.index(f"{side}_ankle")]]
        points, names = np.concatenate([points, ankle, ankle], axis=1), [*names, f"{side}_heel", f"{side}_big_toe"]
    lowest = np.minimum(points[:, names.index("left_ankle"), 2], points[:, names.index("right_ankle"), 2])
    up = np.flatnonzero(lowest > lowest.min() + 0.08)
    flight = max(np.split(up, np.flatnonzero(np.diff(up) > 1) + 1), key=len)
    middle = flight[len(flight) // 4 : -len(flight) // 4]
    height = mass_center(names, points)[:, 2]
    fall = savgol_filter(height, 21, 3, deriv=2, delta=1.0 / RATE_HZ)[middle].mean()
    assert fall == pytest.approx(-9.81, abs=0.7)


def test_of_a_body_that_is_no_person_there_is_none():
    assert mass_center(("tip",), np.zeros((3, 1, 3))) is None
