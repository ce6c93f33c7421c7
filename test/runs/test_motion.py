"""Motions of runs: gaps, constant rates, interpolation."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from helpers.bodies.moving_person import moving, write_run
from helpers.bodies.two_links import two_links
from tracker_node.errors import FileFormatError
from tracker_node.evaluation.motion.isb_angles import isb_angles
from tracker_node.runs.data import RunDetails
from tracker_node.runs.load import load_run
from tracker_node.runs.motion import at_constant_rate, motion_of_run, steady_period_ns, without_gaps
from tracker_node.tracking.estimate import LimbStatus


def test_lost_states_are_gaps_unless_asked_for(tmp_path):
    tracked = moving(8, gaps=(2, 3))
    run = load_run(write_run(tmp_path / "run", tracked))
    motion = motion_of_run(run, tracked.model)
    assert np.flatnonzero(~motion.valid).tolist() == [2, 3]
    assert np.array_equal(motion.values, tracked.values)
    assert motion_of_run(run, tracked.model, lost="keep").valid.all()
    assert not motion.landmarks_m()[2].any() and motion.landmarks_m()[4].any()


def test_lost_and_unseen_limbs_are_gaps_where_asked_for(tmp_path):
    tracked = moving(12, gaps=(2,))
    model, run = tracked.model, load_run(write_run(tmp_path / "run", tracked))
    with pytest.raises(FileFormatError, match="limb"):
        motion_of_run(run, model, lost="limbs")
    status = np.full((12, 2), int(LimbStatus.TRACKING))
    status[5, 0], status[6, 1] = int(LimbStatus.LOST), int(LimbStatus.UNSEEN)
    details = replace(RunDetails.unknown(12, model.n_dof, ("left_hand", "right_foot")), limb_status=status)
    motion = motion_of_run(replace(run, details=details), model, lost="limbs")
    arm = [model.landmark_index(f"left_{name}") for name in ("shoulder", "elbow", "wrist")]
    leg = [model.landmark_index(f"right_{name}") for name in ("knee", "ankle", "heel")]
    for found in (motion, at_constant_rate(motion)[0]):
        valid = found.landmarks_valid()
        assert not valid[2].any() and not valid[5, arm].any() and not valid[6, leg].any()
        assert np.count_nonzero(~valid[5]) == 3 and valid[[0, 1, 3, 4, 7]].all() and valid[5, leg].all()
    doubled = at_constant_rate(motion, 120.0)[0]
    assert np.flatnonzero(~doubled.landmarks_valid()[:, arm[0]]).tolist() == [3, 4, 5, 9, 10, 11]
    joints = isb_angles(motion)
    assert np.flatnonzero(~joints.valid[:, joints.joints.index("LeftElbow")]).tolist() == [2, 5]
    assert np.flatnonzero(~joints.valid[:, joints.joints.index("LeftKnee")]).tolist() == [2]


def test_a_run_without_any_sound_state_is_refused(tmp_path):
    tracked = moving(3, gaps=(0, 1, 2))
    with pytest.raises(FileFormatError, match="not LOST, got '3 LOST'"):
        motion_of_run(load_run(write_run(tmp_path / "run", tracked)), tracked.model)


def test_missing_sets_become_gaps_at_the_runs_own_rate(tmp_path):
    tracked = moving(30)
    run = load_run(write_run(tmp_path / "run", tracked, missing=(4, 11, 12)))
    motion, said = at_constant_rate(motion_of_run(run, tracked.model))
    assert motion.uniform and motion.rate_hz == pytest.approx(60.0, rel=1e-6)
    assert np.flatnonzero(~motion.valid).tolist() == [4, 11, 12]
    assert np.array_equal(motion.values[motion.valid], np.delete(tracked.values, (4, 11, 12), axis=0))
    assert "as they are" in said


def test_jitter_of_stamps_averages_out():
    tracked = moving(200)
    noise = np.random.default_rng(1).integers(-1_000_000, 1_000_000, 200)
    motion = replace(tracked, stamps_ns=tracked.stamps_ns + noise, uniform=False)
    found, said = at_constant_rate(replace(motion, period_ns=steady_period_ns(motion.stamps_ns)))
    assert len(found) == 200 and found.valid.all() and "as they are" in said
    assert found.rate_hz == pytest.approx(60.0, rel=1e-3)


@pytest.mark.parametrize("after", [0, 7, 19])
def test_a_doubled_set_neither_changes_the_rate_nor_counts(tmp_path, after):
    tracked = moving(20)
    twice = np.insert(np.arange(20), after, after)
    stamps = tracked.stamps_ns[twice]
    stamps[after + 1] += 2_000_000
    values = tracked.values[twice]
    values[after + 1, 0] += 1.0
    doubled = replace(tracked, stamps_ns=stamps, values=values, valid=tracked.valid[twice])
    run = load_run(write_run(tmp_path / "run", doubled))
    motion, said = at_constant_rate(motion_of_run(run, tracked.model))
    assert motion.rate_hz == pytest.approx(60.0, rel=5e-3)
    assert "as they are" in said and "1 left out" in said
    assert motion.valid.all() and np.array_equal(motion.values, tracked.values)


@pytest.mark.parametrize("rate_hz", [25.0, 30.0, 120.0, 47.3])
def test_other_rates_interpolate_positions_angles_and_rotations(rate_hz):
    fine = moving(400, rate_hz=600.0)
    coarse = replace(fine, **{name: getattr(fine, name)[::10] for name in ("stamps_ns", "values", "valid")}, period_ns=1e9 / 60.0)
    found, said = at_constant_rate(coarse, rate_hz)
    assert "interpolated" in said and found.valid.all()
    assert np.ptp(np.diff(found.stamps_ns)) <= 1 and found.rate_hz == pytest.approx(rate_hz)
    nearest = np.clip(np.round((found.stamps_ns - fine.stamps_ns[0]) * 600e-9).astype(int), 0, 399)
    errors = found.values - fine.values[nearest]
    between = Rotation.from_rotvec(found.values[:, 3:6]).inv() * Rotation.from_rotvec(fine.values[nearest, 3:6])
    assert np.abs(np.delete(errors, (3, 4, 5), axis=1)).max() < 0.01
    assert between.magnitude().max() < 0.01


def test_a_leap_of_the_clock_does_not_fill_the_memory():
    motion = moving(20)
    stamps = motion.stamps_ns.copy()
    stamps[10:] += 1_700_000_000_000_000_000
    leapt = replace(motion, stamps_ns=stamps, uniform=False)
    with pytest.raises(FileFormatError, match="time steps"):
        at_constant_rate(leapt)
    with pytest.raises(FileFormatError, match="time steps"):
        at_constant_rate(motion, 1e9)


def test_nothing_is_interpolated_across_a_gap():
    motion = moving(30, gaps=(10,))
    found, _ = at_constant_rate(motion, 45.0)
    seconds = np.flatnonzero(~found.valid) / 45.0
    assert len(seconds) > 0 and seconds.min() > 9 / 60.0 and seconds.max() < 11 / 60.0
    per_set = ("stamps_ns", "values", "valid")
    missing = replace(motion, **{name: np.delete(getattr(motion, name), (10,), axis=0) for name in per_set})
    assert np.array_equal(at_constant_rate(missing, 45.0)[0].valid, found.valid)


def test_formats_that_know_no_gaps_get_them_filled():
    whole, motion = moving(30), moving(30, gaps=(0, 10, 11, 29))
    filled = without_gaps(motion)
    assert filled.valid.all()
    assert np.array_equal(filled.values[1:10], whole.values[1:10])
    assert filled.values[[0, 29]] == pytest.approx(whole.values[[1, 28]], abs=1e-12)
    assert np.abs(filled.landmarks_m()[10] - whole.landmarks_m()[10]).max() < 0.02


@given(st.lists(st.booleans(), min_size=2, max_size=30), st.floats(5.0, 200.0))
def test_any_gaps_and_rates_leave_values_only_where_they_are_valid(valid, rate_hz):
    gaps = tuple(i for i, good in enumerate(valid) if not good)
    if len(gaps) == len(valid):
        return
    found, _ = at_constant_rate(moving(len(valid), two_links(), gaps), rate_hz)
    assert np.isfinite(found.values).all() and not found.values[~found.valid].any()
    assert (np.diff(found.stamps_ns) > 0).all()
    assert found.stamps_ns[-1] <= 5_000_000_000 + (len(valid) - 0.7) * 1e9 / 60.0
