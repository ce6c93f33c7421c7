"""Strides of a walk that is known."""

import numpy as np
import pytest

from tracker_node.evaluation.motion.gait import N_PARTS, Gait, Strides, find_gait, foot_contacts

RATE_HZ, STRIDE_S, SPEED, STANCE = 60.0, 1.1, 1.3, 0.62
SWING_M = 0.32


def walk(seconds: float = 8.0, heading: float = 0.0, speed: float = SPEED, stance=(STANCE, STANCE), first_s: float = 0.4):
    """Times, landmarks and angles of somebody whose left heel comes down at ``first_s``, and then every stride."""
    times = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    ahead, left = np.array([np.cos(heading), np.sin(heading), 0.0]), np.array([-np.sin(heading), np.cos(heading), 0.0])
    pelvis = np.outer(speed * times, ahead) + np.array([0.3, -2.0, 0.95])
    points, angles = {}, {"torso_turn_left": np.zeros(len(times))}
    for side, sign, late, part in (("left", 1.0, 0.0, stance[0]), ("right", -1.0, 0.5, stance[1])):
        phase = 2.0 * np.pi * ((times - first_s) / STRIDE_S - late)
        points[f"{side}_hip"] = pelvis + sign * 0.1 * left
        foot = pelvis - np.array([0.0, 0.0, 0.9])
        points[f"{side}_heel"] = foot + np.outer(SWING_M * np.cos(phase), ahead)
        points[f"{side}_big_toe"] = foot + np.outer(0.2 - SWING_M * np.cos(phase - 2.0 * np.pi * part), ahead)
        angles[f"{side}_knee_flexion"] = 30.0 + 30.0 * np.cos(phase)
    return times, points, angles


@pytest.mark.parametrize("heading", [0.0, 2.0, -2.5])
def test_events_and_measures_are_those_of_the_walk(heading):
    gait = find_gait(*walk(heading=heading), RATE_HZ)
    left = gait.strides["left"]
    n = len(left.starts_s)
    assert n >= 5 and left.starts_s == pytest.approx(left.starts_s[0] + STRIDE_S * np.arange(n), abs=2e-3)
    assert abs((left.starts_s[0] - 0.4 + 0.5 * STRIDE_S) % STRIDE_S - 0.5 * STRIDE_S) < 2e-3
    assert left.stance == pytest.approx(STANCE, abs=3e-3) and left.steps_s == pytest.approx(0.5 * STRIDE_S, abs=3e-3)
    assert left.lengths_m == pytest.approx(SPEED * STRIDE_S, abs=2e-3) and gait.speed_m_s == pytest.approx(SPEED, abs=1e-3)
    metrics = gait.metrics()
    assert metrics["cadence_per_min"] == pytest.approx(120.0 / STRIDE_S, rel=2e-3)
    assert metrics["stance_percent_right"] == pytest.approx(100.0 * STANCE, abs=0.3) and metrics["strides_left"] == n


def test_angles_run_over_the_stride():
    gait = find_gait(*walk(), RATE_HZ)
    for foot in gait.strides.values():
        curves = foot.angles["knee_flexion"]
        assert curves.shape == (len(foot.starts_s), N_PARTS)
        wanted = 30.0 + 30.0 * np.cos(2.0 * np.pi * np.linspace(0.0, 1.0, N_PARTS))
        assert curves == pytest.approx(np.tile(wanted, (len(curves), 1)), abs=0.6)
    assert "torso_turn_left" not in gait.strides["left"].angles and set(gait.strides["left"].angles) == {"knee_flexion"}


def test_sides_that_differ_are_told_apart():
    metrics = find_gait(*walk(stance=(0.70, 0.58)), RATE_HZ).metrics()
    assert metrics["stance_percent_left"] == pytest.approx(70.0, abs=0.4)
    assert metrics["stance_percent_right"] == pytest.approx(58.0, abs=0.4)


def test_a_treadmill_is_no_matter_but_for_the_way():
    gait = find_gait(*walk(speed=0.0), RATE_HZ)
    assert gait.speed_m_s == pytest.approx(0.0, abs=1e-3) and gait.strides["left"].times_s == pytest.approx(STRIDE_S, abs=3e-3)
    assert np.isnan(gait.strides["left"].lengths_m).all() and np.isnan(gait.metrics()["stride_length_m_left"])


def test_ankles_stand_in_for_feet():
    times, points, angles = walk()
    points = {name.replace("heel", "ankle"): value for name, value in points.items() if "toe" not in name}
    gait = find_gait(times, points, angles, RATE_HZ)
    assert gait.strides["right"].times_s == pytest.approx(STRIDE_S, abs=3e-3)


def test_a_stride_with_a_gap_is_left_out():
    times, points, angles = walk()
    whole = find_gait(times, points, angles, RATE_HZ)
    points["left_heel"] = points["left_heel"].copy()
    points["left_heel"][(times > 3.0) & (times < 3.2)] = np.nan
    found = find_gait(times, points, angles, RATE_HZ)
    assert len(found.strides["left"].starts_s) < len(whole.strides["left"].starts_s)
    for start, end in zip(found.strides["left"].starts_s, found.strides["left"].ends_s, strict=True):
        assert not start < 3.1 < end


def test_who_stands_or_lacks_feet_does_not_walk():
    times, points, angles = walk()
    still = {name: np.tile(value[:1], (len(times), 1)) for name, value in points.items()}
    assert find_gait(times, still, angles, RATE_HZ) is None
    assert find_gait(times, {"left_hip": points["left_hip"]}, angles, RATE_HZ) is None
    assert find_gait(*walk(seconds=1.5), RATE_HZ) is None
    assert find_gait(*walk(stance=(0.4, 0.4)), RATE_HZ) is None  # who swings the legs in the air


def test_contacts_are_those_of_strides_and_others_before_between_and_after_them():
    """Two strides from 1 to 3 s, feet that stand again until 3.6 s and from 4 s on; contacts come some hundredths later."""
    rate_hz = 100.0
    t = np.arange(600) / rate_hz
    up = ((t > 0.7) & (t < 1.0)) | ((t > 1.6) & (t < 2.04)) | ((t > 2.65) & (t < 3.05)) | ((t > 3.6) & (t < 4.0))
    height = np.where(up, 0.2, 0.0)
    foot = np.column_stack([np.zeros_like(t), np.zeros_like(t), height])
    points = {f"{side}_{end}": foot for side in ("left", "right") for end in ("heel", "big_toe")}
    times = np.array([1.0, 2.0]), np.array([1.62, 2.62]), np.array([2.0, 3.0])
    strides = Strides(*times, np.full(2, np.nan), np.full(2, np.nan), {})
    found = foot_contacts(t, points, Gait({"left": strides, "right": strides}, 1.0))["left"].contacts
    assert [(c.comes, c.leaves) for c in found] == [(False, True), (True, True), (True, True), (True, True), (True, False)]
    starts, ends = np.array([(c.start_s, c.end_s) for c in found]).T
    assert starts == pytest.approx([0.0, 1.0, 2.0, 3.0, 4.0], abs=0.011)
    assert ends == pytest.approx([0.7, 1.62, 2.62, 3.6, t[-1]], abs=0.011)
    alone = foot_contacts(t, points, None)["left"].contacts
    assert [c.start_s for c in alone][1:4] == pytest.approx([1.0, 2.04, 3.05], abs=0.011)
