"""Angles, velocities, ranges and symmetry of a walk whose angles are sines."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.stick_person import Motion
from helpers.motion import known_motions as known
from tracker_node.evaluation.motion.joint_motion import (
    NO_FILTER,
    SMOOTHED,
    UNFILTERED,
    JointMotion,
    joint_motion,
    ranges,
    symmetry_index,
)
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain
from tracker_node.runs.motion import RunMotion

OMEGA = 2.0 * np.pi / known.STRIDE_S


def of(motion: Motion, valid: np.ndarray | None = None, rate_hz: float = 60.0) -> RunMotion:
    values = np.array([state.to_values() for state in motion.states])
    valid = np.ones(len(values), dtype=bool) if valid is None else valid
    return RunMotion(motion.model, motion.stamps_ns, np.where(valid[:, None], values, 0.0), valid, 1e9 / rate_hz, uniform=True)


@pytest.mark.parametrize("cutoff_hz", [6.0, "auto", NO_FILTER])
def test_angles_and_velocities_are_those_of_the_walk(cutoff_hz):
    found = joint_motion(of(known.walk()), cutoff_hz)
    for side, late, k in (("left", 0.0, 0), ("right", 0.5, 1)):
        phase = OMEGA * found.times_s - 2.0 * np.pi * late
        column, amplitude = found.names.index(f"{side}_hip_flexion"), known.HIP_DEG[k]
        assert found.units[column] == "deg" and found.joints[column] == f"{side} hip"
        inner = slice(30, -30)
        assert found.values[inner, column] == pytest.approx((known.HIP_MEAN_DEG + amplitude * np.cos(phase))[inner], abs=0.1)
        assert found.velocities[inner, column] == pytest.approx((-amplitude * OMEGA * np.sin(phase))[inner], abs=0.6)


def test_noise_is_filtered_and_the_filter_is_named():
    noisy = of(known.walk(noise_deg=1.0))
    exact = known.HIP_MEAN_DEG + known.HIP_DEG[0] * np.cos(OMEGA * noisy.times_s)
    rms = {}
    for cutoff_hz in (6.0, "auto", NO_FILTER):
        found = joint_motion(noisy, cutoff_hz)
        rms[cutoff_hz] = np.sqrt(np.mean((found.of("left_hip_flexion") - exact) ** 2)), found.filter
    assert rms[NO_FILTER][0] == pytest.approx(1.0, abs=0.1) and rms[NO_FILTER][1] == UNFILTERED
    assert rms[6.0] == (pytest.approx(0.45, abs=0.1), "Butterworth, 4th order, no lag, 6 Hz")  # of 30 Hz a fifth of the power
    assert rms["auto"][0] < 0.5 and rms["auto"][1].endswith("Hz (residual analysis)")
    assert joint_motion(noisy, "auto", smoothed=True).filter == SMOOTHED
    assert joint_motion(noisy, 6.0, smoothed=True).filter.startswith("Butterworth") is True


def test_a_fast_motion_keeps_its_speed_where_the_filter_is_chosen():
    walk = known.walk(seconds=4.0)
    omega, high = 2.0 * np.pi * 4.0, 30.0
    fast = [replace(state, joint_positions=state.joint_positions.copy()) for state in walk.states]
    for t, state in zip(walk.stamps_ns * 1e-9, fast, strict=True):
        state.joint_positions[walk.model.chain.axis_index("left_elbow_flexion")] = np.radians(60.0 + high * np.sin(omega * t))
    motion = of(Motion(walk.model, walk.stamps_ns, tuple(fast)))
    chosen, fixed = (ranges(joint_motion(motion, cutoff))["left_elbow_flexion"].fastest[0] for cutoff in ("auto", 4.0))
    assert chosen == pytest.approx(high * omega, rel=0.03)
    assert fixed < 0.8 * high * omega  # of what lies at the cutoff, half of the power is left


def test_ranges_over_strides_and_over_all():
    found = joint_motion(of(known.walk()), 6.0)
    cycles = {"left": [(1.0, 1.0 + known.STRIDE_S), (3.0, 3.0 + known.STRIDE_S)], "right": [(2.0, 2.0 + known.STRIDE_S)]}
    over = ranges(found, cycles)
    left, right, turn = over["left_knee_flexion"], over["right_knee_flexion"], over["spine_turn_left"]
    assert left.widths == pytest.approx([2.0 * known.KNEE_DEG[0]] * 2, abs=0.3) and len(right.widths) == 1
    assert right.highest == pytest.approx([known.KNEE_MEAN_DEG + known.KNEE_DEG[1]], abs=0.2)
    assert left.fastest == pytest.approx([known.KNEE_DEG[0] * OMEGA] * 2, rel=0.01)
    assert turn.widths == pytest.approx([2.0 * known.TURN_DEG] * 2, abs=0.1)  # the left foot's strides
    everything = ranges(found)
    assert everything["left_knee_flexion"].lowest == pytest.approx([known.KNEE_MEAN_DEG - known.KNEE_DEG[0]], abs=0.3)
    assert len(ranges(found, {"left": [(50.0, 51.0)]})["left_knee_flexion"].widths) == 0


def test_gaps_stay_gaps_and_a_short_stretch_has_no_velocity():
    walk = known.walk(seconds=3.0)
    valid = np.ones(len(walk.states), dtype=bool)
    valid[[60, 66]] = False  # five sets between them
    unfiltered = joint_motion(of(walk, valid), NO_FILTER)
    hip = unfiltered.names.index("left_hip_flexion")
    assert np.isnan(unfiltered.values[[60, 66], hip]).all() and np.isfinite(unfiltered.values[61:66, hip]).all()
    assert np.isnan(unfiltered.velocities[60:67, hip]).all() and np.isfinite(unfiltered.velocities[67:, hip]).all()
    short = joint_motion(of(Motion(walk.model, walk.stamps_ns[:8], walk.states[:8])), 6.0)
    assert short.filter == UNFILTERED and np.isfinite(short.of("left_hip_flexion")).all() and np.isnan(short.velocities).all()


def test_an_arm_that_hangs_has_no_plane_of_elevation():
    walk = known.walk(seconds=1.0)
    axis = walk.model.chain.axis_index("left_shoulder_elevation_front")
    raised = [replace(state, joint_positions=state.joint_positions.copy()) for state in walk.states]
    for state in raised:
        state.joint_positions[axis] = 0.8
    found = joint_motion(of(Motion(walk.model, walk.stamps_ns, tuple(raised))), 6.0)
    assert np.isfinite(found.of("left_shoulder_plane_of_elevation")).all()
    assert (
        np.isnan(found.of("right_shoulder_plane_of_elevation")).all() and np.isfinite(found.of("right_shoulder_elevation")).all()
    )


def test_other_bodies_have_the_angles_of_their_joints():
    turn, slide = Axis("arm_turn", (0.0, 0.0, 1.0)), Axis("left_slide", (1.0, 0.0, 0.0), prismatic=True)
    joints = (Joint("arm", "base", "link", np.eye(4), (turn,)), Joint("left_finger", "link", "finger", np.eye(4), (slide,)))
    model = ArticulatedModel("arm", KinematicChain(("base", "link", "finger"), joints), ())
    values = np.zeros((40, model.chain.n_dof))
    values[:, 6], values[:, 7] = np.radians(np.arange(40.0)), 0.002 * np.arange(40.0)
    stamps = (np.arange(40) * 1e9 / 100.0).astype(np.int64)
    found = joint_motion(RunMotion(model, stamps, values, np.ones(40, dtype=bool), 1e7, uniform=True), NO_FILTER)
    assert (found.names, found.units) == (("arm_turn", "left_slide"), ("deg", "m")) and found.joints == ("arm", "left finger")
    assert found.values[:, 0] == pytest.approx(np.arange(40.0)) and found.velocities[:, 0] == pytest.approx(100.0)
    assert found.of("left_slide") == pytest.approx(0.002 * np.arange(40.0)) and found.velocities[:, 1] == pytest.approx(0.2)


def test_symmetry_is_the_difference_over_the_mean():
    assert symmetry_index(60.0, 40.0) == pytest.approx(40.0) and symmetry_index(40.0, 60.0) == pytest.approx(-40.0)
    assert symmetry_index(30.0, 30.0) == 0.0 and np.isnan(symmetry_index(4.0, 1.0))
    assert symmetry_index(1.2, 1.0, least=0.0) == pytest.approx(100.0 * 0.2 / 1.1) and np.isnan(symmetry_index(np.nan, 40.0))


def test_a_motion_without_a_constant_rate_is_refused():
    with pytest.raises(ValueError, match="constant rate"):
        joint_motion(replace(of(known.walk(seconds=1.0)), uniform=False), 6.0)
    assert isinstance(joint_motion(of(known.walk(seconds=1.0)), 6.0), JointMotion)
