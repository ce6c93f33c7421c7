"""Errors per degree of freedom and per segment, of runs whose errors are known, and what covariances say of them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from helpers.bodies.stick_person import PERIOD_NS, Motion, motion, write_run
from tracker_node.errors import FileFormatError
from tracker_node.evaluation.consistency import landmark_nees, state_nees
from tracker_node.evaluation.evaluate import EvaluationOptions
from tracker_node.evaluation.pose_metrics import rigid_errors, segment_errors, state_errors, surface_points
from tracker_node.evaluation.review import Truth, review
from tracker_node.evaluation.truth.files import holds_states, load_true_states, truth_of
from tracker_node.geometry import se3, so3
from tracker_node.loaders.motion.trajectory_file import PosesWriter, StateRow, StateTrajectory, Trajectories, write_states
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import State
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain
from tracker_node.model.shapes.primitives import Box
from tracker_node.runs.data import RunData, RunDetails
from tracker_node.runs.load import load_run
from tracker_node.runs.motion import at_constant_rate, motion_of_run
from tracker_node.tracking.estimate import GRAY_LEVELS


def states_file(path: Path, moving: Motion, status: str = "TRACKING") -> Path:
    rows = [StateRow(int(t), status, "", s.to_values()) for t, s in zip(moving.stamps_ns, moving.states, strict=True)]
    write_states(path, StateTrajectory(moving.model.chain.dof_names, tuple(rows)))
    return path


def moved(moving: Motion, change) -> Motion:
    return Motion(moving.model, moving.stamps_ns, tuple(change(i, state) for i, state in enumerate(moving.states)))


def run_of(folder: Path, moving: Motion) -> RunData:
    return load_run(write_run(folder / "run", moving))


def somersaults(n: int = 30) -> Motion:
    """One and a half turns forward with half a twist; scipy's own Euler angles are the truth."""
    model = motion(2).model
    stamps = np.arange(n, dtype=np.int64) * PERIOD_NS
    states = []
    for share in np.linspace(0.0, 1.0, n):
        R = Rotation.from_euler("YXZ", [540.0 * share, 8.0 * np.sin(3 * share), 180.0 * share], degrees=True).as_matrix()
        states.append(
            State(se3.from_rotation_translation(R, np.array([share, 0.01, 1.0 + 0.79 * share])), np.zeros(model.chain.n_axes))
        )
    return Motion(model, stamps, tuple(states))


def test_somersaults_count_beyond_a_turn_and_errors_have_their_sign(tmp_path):
    truth = somersaults()

    def wrong(i: int, state: State) -> State:
        angles = Rotation.from_matrix(state.T_world_root[:3, :3]).as_euler("YXZ", degrees=True) + np.array(
            [0.4, -0.3, 0.2 * (-1) ** i]
        )
        R = Rotation.from_euler("YXZ", angles, degrees=True).as_matrix()
        return State(se3.from_rotation_translation(R, state.T_world_root[:3, 3] + [0.003, -0.002, 0.004]), state.joint_positions)

    run = run_of(tmp_path, moved(truth, wrong))
    found = state_errors(run, truth.model, load_true_states(states_file(tmp_path / "truth.csv", truth)).at(run.stamps_ns))
    assert found.names[:6] == ("vertical", "A-P", "lateral", "somersault", "tilt", "twist")
    assert found.units[:7] == ("mm", "mm", "mm", "deg", "deg", "deg", "deg")
    ranges = [found.range_of_motion(k) for k in range(6)]
    assert ranges == pytest.approx([790.0, 1000.0, 0.0, 540.0, 8.0 * np.sin(np.linspace(0, 3, 30)).max(), 180.0], abs=1e-6)
    assert [found.offset(k) for k in range(5)] == pytest.approx([4.0, 3.0, -2.0, 0.4, -0.3], abs=1e-6)
    raw, free = found.spreads(5)
    assert raw.row == pytest.approx([0.2] * 4, abs=1e-6) == free.row
    raw, free = found.spreads(0)
    assert raw.rms == pytest.approx(4.0) and free.max == pytest.approx(0.0, abs=1e-6)


def test_rows_between_truth_are_interpolated_and_beyond_it_nothing_is(tmp_path):
    tracked = motion(20)
    truth = load_true_states(
        states_file(tmp_path / "truth.csv", Motion(tracked.model, tracked.stamps_ns[:11:2], tracked.states[:11:2]))
    )
    run = run_of(tmp_path, tracked)
    at = truth.at(run.stamps_ns)
    assert at.valid.all(axis=1).tolist() == [i <= 10 for i in range(20)]
    found = state_errors(run, tracked.model, at)
    assert np.abs(found.errors[:11:2]).max() == pytest.approx(0.0, abs=1e-9)
    assert 0.0 < np.abs(found.errors[1:11:2]).max() < 1.0
    assert np.isnan(found.errors[11:]).all()


def test_between_rows_the_body_turns_the_shortest_way(tmp_path):
    """Tilts near 90 degrees, as of a diver: interpolated angles were degrees beside the turn that a run's export has."""
    model, stamps = motion(2).model, np.arange(2, dtype=np.int64) * PERIOD_NS
    begin = Rotation.from_euler("YXZ", [10.0, 86.0, 20.0], degrees=True)
    turn = Rotation.from_rotvec(begin.apply([0.0, 0.0, 0.2])) * Rotation.from_rotvec([0.1, 0.0, 0.0])
    poses = [se3.from_rotation_translation(R.as_matrix(), np.zeros(3)) for R in (begin, turn * begin)]
    moving = Motion(model, stamps, tuple(State(T, np.zeros(model.chain.n_axes)) for T in poses))
    quarter = stamps[0] + PERIOD_NS // 4
    (state,) = load_true_states(states_file(tmp_path / "true.csv", moving)).at(np.array([quarter])).states(model)
    run = motion_of_run(run_of(tmp_path, moving), model)
    exported = at_constant_rate(run, 4e9 / PERIOD_NS)[0].configuration(1).state
    for found in (state, exported):
        off = Rotation.from_matrix(found.T_world_root[:3, :3]) * (Rotation.from_rotvec(turn.as_rotvec() / 4) * begin).inv()
        assert np.degrees(off.magnitude()) < 1e-6, np.degrees(off.magnitude())


def test_a_segment_with_a_constant_offset(tmp_path):
    truth = motion(25)
    offset = se3.from_rotation_translation(so3.exp(np.array([0.02, -0.05, 0.03])), np.array([0.01, 0.0, -0.02]))
    run = run_of(tmp_path, moved(truth, lambda i, s: State(s.T_world_root @ offset, s.joint_positions)))
    found = segment_errors(run, truth.model, truth.states)
    angle = np.degrees(Rotation.from_matrix(offset[:3, :3]).magnitude())
    assert found.position_mm[:, 0] == pytest.approx(1e3 * np.hypot(0.01, 0.02)) and found.angle_deg[:, 0] == pytest.approx(angle)
    assert found.free_position_mm[:, 0] == pytest.approx(0.0, abs=1e-6) and found.free_angle_deg[:, 0] == pytest.approx(
        0.0, abs=1e-5
    )
    hand = found.names.index("left_hand")
    assert found.angle_deg[:, hand] == pytest.approx(angle) and found.free_position_mm[:, hand].mean() > 1.0


def test_add_of_a_box(tmp_path):
    model = ArticulatedModel("box", KinematicChain(("box",), ()), (Shape("box", "box", Box((0.2, 0.1, 0.3))),), ())
    stamps = np.arange(5, dtype=np.int64) * PERIOD_NS
    poses = [
        se3.from_rotation_translation(so3.exp(np.array([0.1 * i, 0.2, 0.0])), np.array([0.0, 0.1 * i, 1.0])) for i in range(5)
    ]
    truth = Motion(model, stamps, tuple(State(T, np.zeros(0)) for T in poses))
    half_turn = se3.from_rotation_translation(Rotation.from_euler("z", 180, degrees=True).as_matrix(), np.zeros(3))
    run = run_of(tmp_path, moved(truth, lambda i, s: State(s.T_world_root @ half_turn, s.joint_positions)))
    found = rigid_errors(run, model, truth.states)
    points = surface_points(model)
    assert found.add_mm == pytest.approx(2e3 * np.hypot(points[:, 0], points[:, 1]).mean())
    assert found.add_s_mm == pytest.approx(0.0, abs=1e-6)
    assert rigid_errors(run, motion(2).model, truth.states) is None


def test_a_review_with_states_alone_judges_joints_too(tmp_path):
    truth = motion(20)
    run = run_of(
        tmp_path,
        moved(
            truth,
            lambda i, s: State(
                se3.from_rotation_translation(s.T_world_root[:3, :3], s.T_world_root[:3, 3] + [0.03, 0, 0]), s.joint_positions
            ),
        ),
    )
    states = load_true_states(states_file(tmp_path / "truth.csv", truth))
    figures = review(run, truth.model, Truth(states=states), EvaluationOptions("x", 0.0)).metrics()
    assert figures["x.mpjpe_mm"] == pytest.approx(30.0) == figures["x.mpjpe_max_mm"]
    assert figures["x.pa_mpjpe_mm"] == pytest.approx(0.0, abs=1e-6)
    assert (figures["x.pck_50mm"], figures["x.root_5cm_5deg"]) == (1.0, 1.0)
    assert figures["x.segment_direction_deg"] == pytest.approx(0.0, abs=1e-5)
    assert figures["x.dof_rms.A-P_mm"] == pytest.approx(30.0) and figures["x.dof_rms.twist_deg"] == pytest.approx(0.0, abs=1e-9)
    assert figures["x.joint_angle_deg"] == pytest.approx(0.0, abs=1e-9)
    assert figures["x.root_axis_z_deg"] == pytest.approx(0.0, abs=1e-5)


def test_a_review_without_truth_tells_what_the_run_says(tmp_path):
    tracked = motion(10)
    run = load_run(write_run(tmp_path / "run", tracked, ["TRACKING"] * 4 + ["LOST"] * 3 + ["DEGRADED"] * 3))
    figures = review(run, tracked.model, Truth(), EvaluationOptions("x")).metrics()
    assert (figures["x.said_lost_sets"], figures["x.said_degraded_sets"], figures["x.said_losses"]) == (3, 3, 1)
    assert figures["x.said_reacquisition_s_max"] == pytest.approx(3 * PERIOD_NS * 1e-9)
    assert figures["x.residual_px"] == pytest.approx(2.5) and "x.mpjpe_mm" not in figures


def test_a_residual_of_colors_is_in_gray_levels(tmp_path):
    tracked = motion(10)
    run = replace(load_run(write_run(tmp_path / "run", tracked)), residual_unit=GRAY_LEVELS)
    places = np.array([c.landmarks_world for c in tracked.configurations])
    positions = Trajectories(tracked.model.landmark_names, tracked.stamps_ns, places, np.ones(places.shape[:2], dtype=bool))
    for truth in (Truth(), Truth(positions)):
        figures = review(run, tracked.model, truth, EvaluationOptions("x")).metrics()
        assert figures["x.residual_gray_levels"] == pytest.approx(2.5) and "x.residual_px" not in figures


def test_losses_and_reacquisition_from_truth(tmp_path):
    tracked = motion(30)
    positions = tracked.landmarks_m
    positions[10:16, 3] += [0.0, 0.0, 0.5]
    positions[28:, 3] += [0.0, 0.0, 0.5]
    truth = Trajectories(tracked.model.landmark_names, tracked.stamps_ns, positions, np.ones(positions.shape[:2], dtype=bool))
    figures = review(run_of(tmp_path, tracked), tracked.model, Truth(truth), EvaluationOptions("x", 0.0)).metrics()
    assert (figures["x.lost_sets"], figures["x.losses"], figures["x.not_reacquired"]) == (8, 2, 1)
    assert figures["x.reacquisition_s_median"] == pytest.approx(6 * PERIOD_NS * 1e-9)


@pytest.mark.parametrize(("claimed", "within"), [(1.0, True), (0.25, False), (4.0, False)])
def test_nees_of_errors_that_are_drawn_from_a_covariance(tmp_path, claimed, within):
    """Errors with the covariance P, of which the run claims ``claimed`` P: NEES is the reciprocal."""
    truth, rng = motion(300), np.random.default_rng(7)
    n = truth.model.chain.n_dof
    root = rng.normal(size=(n, n))
    P = 1e-6 * (root @ root.T / n + 0.2 * np.eye(n))
    draws = rng.multivariate_normal(np.zeros(n), P, size=300)
    run = run_of(tmp_path, moved(truth, lambda i, state: state.retract(draws[i])))
    details = replace(RunDetails.unknown(300, n), covariances=np.tile((claimed * P).astype(np.float32), (300, 1, 1)))
    run = replace(run, details=details)
    state = state_nees(run, truth.states)
    assert state.means[0] == pytest.approx(1.0 / claimed, rel=0.05)
    assert bool(state.in_bounds[0]) == within
    joints = Trajectories(truth.model.landmark_names, truth.stamps_ns, truth.landmarks_m, np.ones((300, 14), dtype=bool))
    found = review(run, truth.model, Truth(joints), EvaluationOptions("x", 0.0))
    assert found.landmark_nees.means.mean() == pytest.approx(1.0 / claimed, rel=0.1)
    assert (found.landmark_nees.in_bounds.mean() > 0.7) == within


def test_without_covariances_there_is_no_nees(tmp_path):
    truth = motion(5)
    run = run_of(tmp_path, truth)
    assert state_nees(run, truth.states) is None
    silent = replace(run, details=RunDetails.unknown(5, truth.model.chain.n_dof))
    assert state_nees(silent, truth.states) is None
    broken = replace(silent, details=replace(silent.details, covariances=np.full_like(silent.details.covariances, np.nan)))
    assert state_nees(broken, truth.states) is None
    joints = Trajectories(truth.model.landmark_names, truth.stamps_ns, truth.landmarks_m, np.ones((5, 14), dtype=bool))
    found = review(silent, truth.model, Truth(joints), EvaluationOptions("x", 0.0))
    assert landmark_nees(silent, truth.model, found.joints, False) is None


def test_which_files_hold_states(tmp_path):
    assert holds_states(states_file(tmp_path / "states.csv", motion(2)))
    (tmp_path / "joints.csv").write_text("stamp_ns,landmark,x,y,z\n0,head,0,0,0\n")
    assert not holds_states(tmp_path / "joints.csv") and not holds_states(tmp_path / "markers.trc")


def test_lost_rows_of_the_truth_do_not_count(tmp_path):
    truth = load_true_states(states_file(tmp_path / "truth.csv", motion(4), "LOST"))
    assert not truth.valid.any() and truth.states(motion(2).model) == (None,) * 4


def test_truth_may_be_poses_or_a_stamp_and_degrees_of_freedom(tmp_path):
    box = ArticulatedModel("box", KinematicChain(("box",), ()), (Shape("box", "box", Box((0.2, 0.1, 0.3))),), ())
    turns = [so3.exp(np.array([0.1 * i, 0.2, 0.0])) for i in range(3)]
    poses = [se3.from_rotation_translation(R, np.array([0.1 * i, 0.0, 1.0])) for i, R in enumerate(turns)]
    states = [State(T, np.zeros(0)) for T in poses]
    truth = Motion(box, np.arange(3, dtype=np.int64) * PERIOD_NS, tuple(states))
    whole = load_true_states(states_file(tmp_path / "states.csv", truth))
    with PosesWriter(tmp_path / "poses.csv") as writer:
        for stamp, T in zip(truth.stamps_ns, poses, strict=True):
            writer.append(stamp, T)
    rows = [",".join(map(str, [stamp, *s.to_values()])) for stamp, s in zip(truth.stamps_ns, states, strict=True)]
    header = "stamp_ns,root_x_m,root_y_m,root_z_m,root_rx_rad,root_ry_rad,root_rz_rad"
    (tmp_path / "plain.csv").write_text("\n".join([header, *rows]))
    for name in ("poses.csv", "plain.csv"):
        found = truth_of([str(tmp_path / name)], None, box).states
        assert found.names == whole.names and (found.stamps_ns == whole.stamps_ns).all() and found.valid.all()
        np.testing.assert_allclose(found.values, whole.values, atol=1e-12)
    (tmp_path / "other.csv").write_text("stamp_ns,x,y,z\n0,0,0,0\n")
    with pytest.raises(FileFormatError, match=r"joints.csv \(.*\), poses.csv \(.*\) or states.csv \(stamp_ns, root_x_m, …\)"):
        truth_of([str(tmp_path / "other.csv")], None, box)


def test_errors_of_joints_that_slide_are_millimeters(tmp_path):
    """A lift that is 2 mm off, beside a turn that is 1 degree off; it has no full turns to be without."""
    axes = (Axis("turn", (0.0, 0.0, 1.0)), Axis("lift", (0.0, 0.0, 1.0), -9.0, 9.0, prismatic=True))
    chain = KinematicChain(("base", "arm"), (Joint("arm", "base", "arm", np.eye(4), axes),))
    model = ArticulatedModel("lift", chain, tuple(Shape(link, link, Box((0.2, 0.1, 0.3))) for link in chain.links), ())
    stamps = np.arange(4, dtype=np.int64) * PERIOD_NS
    truth = Motion(model, stamps, tuple(State(np.eye(4), np.array([0.1 * i, 7.0 - 0.1 * i])) for i in range(4)))
    off = np.array([np.radians(1.0), 0.002])
    run = run_of(tmp_path, moved(truth, lambda i, s: State(s.T_world_root, s.joint_positions + off)))
    true = load_true_states(states_file(tmp_path / "t.csv", truth))
    figures = review(run, model, Truth(states=true), EvaluationOptions("x", 0.0)).metrics()
    assert figures["x.dof_rms.lift_mm"] == pytest.approx(2.0) and figures["x.dof_rms.turn_deg"] == pytest.approx(1.0)
    assert figures["x.joint_angle_deg"] == pytest.approx(1.0)
