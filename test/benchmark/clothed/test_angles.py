"""Errors of joint angles: their sigmas are those of random states, one constant offset each is free, and what counts."""

import json
from dataclasses import replace

import numpy as np
import pytest

from benchmark.clothed import _clip
from benchmark.clothed._recording import ROTATIONS, load_clip
from benchmark.clothed._staging import Sources, set_stage
from benchmark.clothed.angles import angles
from benchmark.clothed.angles._angles import AngleErrors, angles_with_sigmas, errors_of, figures
from tracker_node.calibration.pose import fit_state_to_landmarks
from tracker_node.evaluation.motion.isb_angles import angles_of_segments
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import gait_human

BODY = gait_human()


def turned(states):
    rotations = np.array([Configuration(BODY, state).Ts_world_link[:, :3, :3] for state in states])
    return angles_of_segments(dict(zip(BODY.chain.links, rotations.swapaxes(0, 1), strict=True)))


def test_sigmas_are_the_spread_of_states_that_have_the_covariance():
    rng = np.random.default_rng(1)
    state = State.neutral(BODY)
    state.joint_positions[:] = rng.uniform(-0.3, 0.3, BODY.chain.n_axes)
    root = 0.01 * rng.normal(size=(BODY.n_dof, BODY.n_dof))
    covariance = root @ root.T / 50.0
    found = angles_with_sigmas(BODY, [state], [covariance])
    around = turned([state.retract(each) for each in rng.multivariate_normal(np.zeros(BODY.n_dof), covariance, 1500)])
    for name in ("left_hip_flexion", "spine_turn_left", "right_wrist_flexion", "left_elbow_pronation", "right_ankle_inversion"):
        values, sigmas = found[name]
        assert sigmas[0] == pytest.approx(around[name].std(), rel=0.1)
        assert values[0] == pytest.approx(around[name].mean(), abs=0.01)


def test_one_constant_offset_is_free_and_unobservable_turns_do_not_count():
    true = {"left_hip_flexion": np.zeros(4), "left_hip_internal_rotation": np.zeros(4), "left_toes_extension": np.zeros(4)}
    small, large = np.radians(3.0), np.radians(20.0)
    found = {
        "left_hip_flexion": (np.radians([10.0, 12.0]) + 2.0 * np.pi, np.array([small, large])),
        "left_hip_internal_rotation": (np.radians([5.0, 80.0]), np.array([small, large])),
    }
    flexion, rotation = errors_of(found, true, np.array([1, 3]))
    assert (flexion.name, rotation.name) == ("hip_flexion", "hip_internal_rotation")
    together = figures([flexion])
    assert (together.rms_deg, together.raw_deg) == pytest.approx((1.0, np.sqrt(122.0))) and together.fraction == 1.0
    assert figures([rotation]).fraction == 0.5 and figures([rotation]).raw_deg == pytest.approx(5.0)
    two = figures([flexion, replace(flexion, errors=flexion.errors + 1.0)])  # each side of each clip has its own
    assert two.rms_deg == pytest.approx(1.0)
    nothing = figures([AngleErrors("hip_internal_rotation", np.ones(2), np.full(2, large))])
    assert nothing.fraction == 0.0 and np.isnan(nothing.rms_deg)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    folder = tmp_path_factory.mktemp("clips") / "clip_4"
    _clip.write_clip(set_stage(4, Sources(folder, None, body="mannequin", motion="guard"), n_images=2, scale=0.25), folder)
    return folder


def test_the_true_state_of_a_clip_has_the_true_angles(drawn):
    """Fitted to the joints, arms and legs of our body are turned as those of the mannequin, but for constants."""
    clip = load_clip(drawn, BODY)
    assert {"left_index", "right_thumb"} <= set(clip.targets[0])
    states = [fit_state_to_landmarks(clip.model, targets).state for targets in clip.targets]
    found = angles_with_sigmas(clip.model, states, [1e-6 * np.eye(BODY.n_dof)] * 2)
    errors = {e.name: e for e in errors_of(found, angles_of_segments(clip.rotations), np.arange(2))}
    for name in ("elbow_flexion", "knee_flexion", "shoulder_elevation", "elbow_pronation", "wrist_flexion"):
        assert np.degrees(np.abs(errors[name].free).max()) < 1.5, name


def test_a_clip_without_turns_is_refused(drawn, tmp_path, capsys):
    (drawn / ROTATIONS).rename(tmp_path / "kept")
    try:
        assert angles.main(["--clips", str(drawn)]) == 2
    finally:
        (tmp_path / "kept").rename(drawn / ROTATIONS)
    assert "rotations are not known" in capsys.readouterr().err
    assert angles.main(["--drawn", str(tmp_path)]) == 2


def test_what_is_told(capsys):
    errors = [AngleErrors("hip_flexion", np.radians([0.0, 2.0]), np.radians([2.0, 2.0]))]
    expected = {"rms_deg": 1.0, "raw_deg": 2.0**0.5, "within_2_sigma": 1.0}
    found = json.loads(json.dumps(angles.told(errors, "_x")))
    assert found == pytest.approx({f"angles_x.hip_flexion_{name}": value for name, value in expected.items()})
    assert "misses" not in capsys.readouterr().out
