"""Metrics of clothed people, on trajectories with known answers."""

from dataclasses import replace

import numpy as np
import pytest

from benchmark.clothed._disturbed import AS_FOUND, EXCHANGED, REPLACED, Decisions, decision, disturb
from benchmark.clothed._judged import (
    Accuracy,
    LimbCounts,
    accuracy,
    count_limbs,
    per_joint_mm,
    together_over_best,
    within_sigmas,
    wrong_sets,
)
from benchmark.clothed._recording import CHAINS, ENDS, JOINTS, LIMB_NAMES
from benchmark.clothed._runs import Run
from tracker_node.observation.keypoints.blazepose import NAMES
from tracker_node.observation.keypoints.people import Person
from tracker_node.tracking.estimate import LimbStatus, Status
from tracker_node.tracking.keypoints.people_groups import mirrored

N = 20


def run_of(errors_m, first=0, status=Status.TRACKING, sigma_m=0.01):
    """A run with these errors (n, 12, 3), its first sets without a state."""
    n = len(errors_m)
    truth = np.random.default_rng(1).normal(size=(n, len(JOINTS), 3))
    said = np.full(n, int(status))
    said[:first] = Status.INITIALIZING
    known = said != Status.INITIALIZING
    found = np.where(known[:, None, None], truth + errors_m, np.nan)
    variances = np.full(found.shape, sigma_m**2)
    limbs = np.where(known[:, None], int(LimbStatus.TRACKING), 0) * np.ones(4, dtype=int)
    return Run("clip", "together", np.arange(n), truth, found, variances, said, limbs, np.ones(n), np.ones(n), [], [])


def moved(joint, rows, by_m, n=N):
    errors = np.zeros((n, len(JOINTS), 3))
    errors[rows, JOINTS.index(joint), 0] = by_m
    return errors


def test_limbs_end_where_they_should():
    assert [JOINTS[end] for end in ENDS] == ["left_wrist", "right_wrist", "left_ankle", "right_ankle"]
    assert LIMB_NAMES == ("left_hand", "right_hand", "left_foot", "right_foot")
    assert [JOINTS[j] for j in CHAINS[1]] == ["right_shoulder", "right_elbow", "right_wrist"]
    assert [JOINTS[j] for j in CHAINS[2]] == ["left_hip", "left_knee", "left_ankle"]


def test_a_constant_offset_counts_in_raw_errors_only():
    errors = np.zeros((N, len(JOINTS), 3))
    errors[:, 0, 2] = 0.012
    found = accuracy(run_of(errors))
    assert found.mpjpe12_mm == pytest.approx(1.0) and found.offset_free12_mm == pytest.approx(0.0, abs=1e-9)
    assert found.lost_limbs == () and found.lost_sets == found.first_state_set == 0
    assert per_joint_mm(run_of(errors))[0] == pytest.approx([12.0, 0.0], abs=1e-9)


@pytest.mark.parametrize(
    ("rows", "by_m", "lost"),
    [
        (slice(3, 8), 0.16, ("left_wrist",)),  # five sets running
        (slice(3, 7), 0.16, ()),
        (slice(3, 8), 0.14, ()),
        (slice(N - 1, N), 0.16, ("left_wrist",)),  # at the end
    ],
)
def test_lost_limbs(rows, by_m, lost):
    assert accuracy(run_of(moved("left_wrist", rows, by_m))).lost_limbs == lost


def test_lost_sets_are_those_without_a_state_said_lost_or_with_a_joint_far_off():
    run = run_of(moved("left_knee", slice(10, 13), 0.21), first=4)
    run.status[15] = Status.LOST
    found = accuracy(run)
    assert found.lost_sets == 4 + 3 + 1 and found.first_state_set == 4
    assert found.mpjpe12_mm == pytest.approx(210.0 * 3 / (16 * 12))
    assert wrong_sets(run).tolist() == [10, 11, 12]


def test_without_any_state_all_is_lost():
    found = accuracy(run_of(np.zeros((N, len(JOINTS), 3)), first=N))
    assert len(found.lost_limbs) == 4 and found.lost_sets == found.first_state_set == N
    assert np.isnan(found.mpjpe12_mm)


def test_gaussian_errors_are_within_two_sigmas_as_often_as_they_should():
    rng = np.random.default_rng(2)
    runs = [run_of(0.01 * rng.normal(size=(400, len(JOINTS), 3)) + rng.normal(size=(1, len(JOINTS), 3))) for _ in range(5)]
    within = within_sigmas(runs)
    assert within.shape == (12,) and within.mean() == pytest.approx(0.9545, abs=0.004)
    half = [replace(run, variances_m2=0.25 * run.variances_m2) for run in runs]
    assert within_sigmas(half).mean() == pytest.approx(0.683, abs=0.01)
    assert np.isnan(within_sigmas([])).all()


def test_what_is_said_of_limbs_is_counted_against_the_truth():
    errors = np.array([[0.0, 0.16, 0.2, np.nan], [0.149, 0.0, 0.3, 0.0]])
    said = np.array([[1, 1, 3, 0], [3, 2, 2, 4]])
    shown = np.array([[0.9, 0.9, 0.9, 0.9], [0.9, 0.9, 0.9, 0.4]])
    counts = count_limbs(errors, said, shown)
    assert counts == LimbCounts(
        wrong=3, wrong_tracking=1, wrong_degraded=1, right=4, right_lost=1, right_degraded=1, shown=3, shown_tracking=1
    )
    assert counts.fractions() == pytest.approx(
        {"wrong_called_tracking": 1 / 3, "right_called_lost": 1 / 4, "right_called_tracking": 1 / 3}
    )
    assert (counts + counts).wrong == 6
    assert all(np.isnan(value) for value in LimbCounts().fractions().values())


def test_together_is_compared_with_the_better_one_alone_in_the_worst_clip():
    def made(*errors):
        return [Accuracy(raw, free, (), 0, 0) for raw, free in errors]

    ratios = together_over_best(
        made((20.0, 10.0), (30.0, 9.0)), made((40.0, 10.0), (25.0, 30.0)), made((10.0, 40.0), (np.nan, np.nan))
    )
    assert ratios == pytest.approx({"raw": 2.0, "offset_free": 1.0})


def person_at(pixels):
    """A person whose 12 joints are at these places, other points in their middle."""
    places = np.tile(pixels.mean(axis=0), (len(NAMES), 1))
    for joint, place in zip(JOINTS, pixels, strict=True):
        places[NAMES.index(joint)] = place
    n, box = len(NAMES), (*pixels.min(axis=0).tolist(), *pixels.max(axis=0).tolist())
    return Person(NAMES, places, np.tile(np.eye(2), (n, 1, 1)), np.ones(n), 1.0, box)


PIXELS = np.array([[100.0 + 40.0 * (i % 2) * (-1) ** (i // 4), 50.0 + 30.0 * (i // 2)] for i in range(12)])
ROWS = np.arange(12)


def test_decisions_about_people_are_judged_by_the_truth():
    body, stranger = person_at(PIXELS), person_at(PIXELS + 150.0)
    assert decision((body,), body, PIXELS, ROWS) == Decisions(1)
    assert decision((mirrored(body),), mirrored(body), PIXELS, ROWS) == Decisions(1, left_right_wrong=1)
    assert decision((body, stranger), stranger, PIXELS, ROWS) == Decisions(1, other_taken=1)
    assert decision((stranger,), None, PIXELS, ROWS) == Decisions(1)
    assert decision((stranger, mirrored(body)), None, PIXELS, ROWS) == Decisions(1, body_left_out=1)
    assert decision((body,), body, PIXELS[:3], ROWS[:3]) == Decisions()  # hardly anything of it is in the image
    total = Decisions(8, 1, 0, 1) + Decisions(2, 0, 1, 0)
    assert total == Decisions(10, 1, 1, 1) and total.wrong == pytest.approx(0.3)


def test_a_fifth_of_the_people_are_disturbed_in_two_ways():
    body, stranger = person_at(PIXELS), person_at(PIXELS + 150.0)
    people = [[(body,), (body,), (), None] for _ in range(500)]
    result, done = disturb(people, [stranger], 0.2, np.random.default_rng(3))
    assert (done[:, :2] != AS_FOUND).mean() == pytest.approx(0.2, abs=0.03) and (done[:, 2:] == AS_FOUND).all()
    assert (done == EXCHANGED).sum() == pytest.approx((done == REPLACED).sum(), rel=0.3)
    for row, what in zip(result, done, strict=True):
        for found, each in zip(row[:2], what, strict=False):
            expected = {AS_FOUND: body, EXCHANGED: mirrored(body), REPLACED: stranger}[each]
            np.testing.assert_array_equal(found[0].pixels, expected.pixels)
        assert row[2:] == [(), None]
