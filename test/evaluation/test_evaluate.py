"""Runs of known error against their truth."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.stick_person import PERIOD_NS, Motion, motion, write_run
from tracker_node.errors import FileFormatError
from tracker_node.evaluation.evaluate import EvaluationOptions, evaluate
from tracker_node.evaluation.truth.files import EVALUATED_JOINTS, LIMBS, offset_links
from tracker_node.loaders.motion.trajectory_file import Trajectories
from tracker_node.runs.load import load_run


def truth_of(tracked: Motion, offset=lambda configuration, positions: positions) -> Trajectories:
    positions = np.array([offset(c, c.landmarks_world) for c in tracked.configurations])
    names = tracked.model.landmark_names
    return Trajectories(names, tracked.stamps_ns, positions, np.ones(positions.shape[:2], dtype=bool))


def judge(tmp_path, tracked, truth, status=None, **options):
    run = load_run(write_run(tmp_path / "run", tracked, status))
    return evaluate(run, tracked.model, truth, EvaluationOptions("x", **options))


def test_a_perfect_run(tmp_path):
    tracked = motion()
    figures = judge(tmp_path, tracked, truth_of(tracked)).metrics()
    assert figures["x.mpjpe_mm"] == pytest.approx(0.0, abs=1e-9)
    assert figures["x.lag_images"] == 0.0
    assert (figures["x.lost_sets"], figures["x.lost_limbs"], figures["x.image_sets"]) == (0, 0, 40)
    assert figures["x.bone_length_std_mm"] == pytest.approx(0.0, abs=1e-9)
    assert figures["x.residual_px"] == pytest.approx(2.5)
    assert len([key for key in figures if key.startswith("x.landmark_mm.")]) == 14


def test_a_constant_offset_in_the_segments(tmp_path):
    tracked = motion()
    model = tracked.model
    names = model.landmark_names
    links = offset_links(model, names)
    local = np.random.default_rng(4).normal(scale=0.02, size=(len(names), 3))

    def moved(configuration, positions):
        return positions + np.einsum("mij,mj->mi", configuration.Ts_world_link[links, :3, :3], local)

    result = judge(tmp_path, tracked, truth_of(tracked, moved), lag_images=0.0)
    figures = result.metrics()
    lengths = 1e3 * np.linalg.norm(local, axis=1)
    assert figures["x.mpjpe_mm"] == pytest.approx(lengths.mean())
    for name, length in zip(names, lengths, strict=True):
        assert figures[f"x.landmark_mm.{name}"] == pytest.approx(length)
    assert figures["x.mpjpe_offset_free_mm"] == pytest.approx(0.0, abs=1e-6)
    assert figures["x.mpjpe_offset_free_world_mm"] > 1.0
    order = [names.index(joint) for joint in EVALUATED_JOINTS]
    assert result.offsets_m == pytest.approx(-local[order])


def test_offsets_of_last_segments_are_those_of_their_parents():
    model = motion(2).model
    links = offset_links(model, ("left_wrist", "right_ankle", "left_knee", "head", "left_shoulder"))
    assert [model.chain.links[i] for i in links] == ["left_forearm", "right_shank", "left_shank", "trunk", "left_upper_arm"]


def test_a_lag_of_one_image_is_taken_out(tmp_path):
    tracked = motion()
    truth = truth_of(tracked)
    early = Trajectories(truth.names, truth.stamps_ns[:-1], truth.positions_m[1:], truth.valid[1:])
    stated = judge(tmp_path, tracked, early, lag_images=1.0).metrics()
    assert stated["x.mpjpe_mm"] == pytest.approx(0.0, abs=1e-6)
    assert stated["x.judged_sets"] == 39
    assert stated["x.mpjpe_no_lag_correction_mm"] > 1.0
    estimated = judge(tmp_path, tracked, early).metrics()
    assert estimated["x.lag_images"] == pytest.approx(1.0, abs=0.011)


def test_lost_sets_for_every_reason(tmp_path):
    tracked = motion()
    wrist = tracked.model.landmark_index("left_wrist")
    truth = truth_of(tracked)
    positions = truth.positions_m.copy()
    positions[20, wrist] += [0.0, 0.21, 0.0]  # one joint far off
    truth = Trajectories(truth.names, truth.stamps_ns, positions, truth.valid)
    status = ["TRACKING"] * 40
    status[5] = "LOST"
    gap = [i for i in range(40) if i not in (30, 31, 32)]  # three sets without a state
    kept = Motion(tracked.model, tracked.stamps_ns[gap], tuple(tracked.states[i] for i in gap))
    result = judge(tmp_path, kept, truth, [status[i] for i in gap], lag_images=0.0)
    assert result.missing_sets == 3
    assert result.metrics()["x.lost_sets"] == 5
    assert result.metrics()["x.lost_limbs"] == 0


def test_limbs_of_which_no_end_is_compared_are_not_counted(tmp_path):
    tracked = motion()
    truth = truth_of(tracked)
    rows = [i for i, name in enumerate(truth.names) if name not in LIMBS.values()]
    names = tuple(truth.names[i] for i in rows)
    part = Trajectories(names, truth.stamps_ns, truth.positions_m[:, rows], truth.valid[:, rows])
    assert np.isnan(judge(tmp_path, tracked, part, lag_images=0.0).metrics()["x.lost_limbs"])


def test_a_limb_that_goes_astray(tmp_path):
    tracked = motion()
    ankle = tracked.model.landmark_index("right_ankle")
    truth = truth_of(tracked)
    positions = truth.positions_m.copy()
    positions[10:15, ankle] += [0.0, 0.16, 0.0]
    result = judge(tmp_path, tracked, Trajectories(truth.names, truth.stamps_ns, positions, truth.valid), lag_images=0.0)
    assert result.lost_limbs == ("right leg",)
    assert result.metrics()["x.lost_sets"] == 0


def test_expected_sets_are_counted_as_missing(tmp_path):
    tracked = motion(20)
    assert judge(tmp_path, tracked, truth_of(tracked), image_sets=23).metrics()["x.lost_sets"] == 3
    (tmp_path / "run" / "run.json").write_text('{"expected_image_sets": 25, "options": {}}')
    run = load_run(tmp_path / "run")
    assert evaluate(run, tracked.model, truth_of(tracked), EvaluationOptions("x")).missing_sets == 5
    stopped = replace(run, info={"expected_image_sets": 25, "options": {"max_sets": 20}})
    assert evaluate(stopped, tracked.model, truth_of(tracked), EvaluationOptions("x")).missing_sets == 0


@pytest.mark.parametrize(("align", "shift_s", "is_trc"), [("first", 5, False), ("auto", 1_700_000_000, False), ("auto", 0, True)])
def test_truth_on_another_clock(tmp_path, align, shift_s, is_trc):
    tracked = motion(20)
    truth = truth_of(tracked).shifted(shift_s * 10**9 + (3 * PERIOD_NS if is_trc else 0))
    run = load_run(write_run(tmp_path / "run", tracked))
    result = evaluate(run, tracked.model, truth, EvaluationOptions("x", 0.0, align), own_time=is_trc)
    assert result.metrics()["x.mpjpe_mm"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("align", "is_right"), [("auto", True), ("stamp", True), ("first", False)])
def test_a_file_that_was_trimmed_keeps_its_times(tmp_path, align, is_right):
    tracked = motion(40)
    truth = truth_of(tracked)
    trimmed = Trajectories(truth.names, truth.stamps_ns[10:], truth.positions_m[10:], truth.valid[10:])
    run = load_run(write_run(tmp_path / "run", tracked))
    result = evaluate(run, tracked.model, trimmed, EvaluationOptions("x", None, align), own_time=True)
    assert (result.raw.mean_mm < 1e-6) == is_right
    said = " ".join(result.doubts)
    assert ("put on image 10.0" in said) == (align == "auto")
    assert is_right or "at the end of the range" in said


def test_a_run_that_begins_later_meets_its_own_rows(tmp_path):
    tracked = motion(30)
    later = Motion(tracked.model, tracked.stamps_ns[8:] + 10**12, tracked.states[8:])
    figures = judge(tmp_path, later, truth_of(tracked), lag_images=0.0, align="first", first_image=8).metrics()
    assert figures["x.mpjpe_mm"] == pytest.approx(0.0, abs=1e-6)
    assert figures["x.judged_sets"] == 22


def test_truth_at_another_time_is_refused(tmp_path):
    tracked = motion(20)
    with pytest.raises(FileFormatError, match="times"):
        judge(tmp_path, tracked, truth_of(tracked).shifted(10**12), align="stamp")


def test_truth_of_something_else_is_refused(tmp_path):
    tracked = motion(5)
    truth = truth_of(tracked)
    other = Trajectories(tuple(f"marker_{i}" for i in range(14)), truth.stamps_ns, truth.positions_m, truth.valid)
    with pytest.raises(FileFormatError, match="left_wrist"):
        judge(tmp_path, tracked, other)


def test_partial_truth_is_judged_where_it_is(tmp_path):
    tracked = motion()
    truth = truth_of(tracked).select(["left_wrist", "head"])
    valid = truth.valid.copy()
    valid[:, 0] = False
    result = judge(tmp_path, tracked, Trajectories(truth.names, truth.stamps_ns, truth.positions_m, valid), lag_images=0.0)
    figures = result.metrics()
    assert result.joints == ("head", "left_wrist")
    assert np.isnan(figures["x.landmark_mm.left_wrist"]) and figures["x.landmark_mm.head"] == pytest.approx(0.0, abs=1e-9)
