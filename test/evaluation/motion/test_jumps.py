"""Jumps whose velocity at take-off is known, one that was captured, and motions without any."""

import numpy as np
import pytest

from helpers.bodies.stick_person import Motion
from helpers.motion import known_motions as known
from tracker_node.calibration.body import scale_to_trial, targets_of
from tracker_node.calibration.pose import fit_state_to_landmarks
from tracker_node.evaluation.motion.jumps import (
    GRAVITY,
    Contact,
    FootContacts,
    Jump,
    contact_metrics,
    find_contacts,
    find_jumps,
    jump_metrics,
)
from tracker_node.loaders.motion.trc import load_trc
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.masses import mass_center
from tracker_node.synthesis.motions.deepmimic import load_motion
from tracker_node.synthesis.subjects.mannequin import LANDMARKS, MannequinSubject


def jumps_of(motion, moved: np.ndarray | None = None) -> list[Jump]:
    points = motion.landmarks_m
    if moved is not None:
        points = np.where(moved[:, None, None], np.nan, points)
    names = motion.model.landmark_names
    named = dict(zip(names, np.swapaxes(points, 0, 1), strict=True))
    return find_jumps(motion.stamps_ns * 1e-9, named, mass_center(names, points))


@pytest.mark.parametrize(("velocity", "rate_hz"), [(2.6, 30.0), (2.6, 60.0), (2.6, 200.0), (1.8, 60.0)])
def test_three_ways_come_to_the_height_of_the_jump(velocity, rate_hz):
    height, air = velocity**2 / (2.0 * GRAVITY), 2.0 * velocity / GRAVITY
    found = jumps_of(known.jump(velocity, rate_hz, times=2))
    assert len(found) == 2
    for jump, start in zip(found, (0.78, 0.78 + 0.78 + known.PUSH_S + air), strict=True):
        assert jump.take_off_s == pytest.approx(start, abs=0.5 / rate_hz)
        assert jump.landing_s - jump.take_off_s == pytest.approx(air, abs=1.0 / rate_hz)
        for value, sd in (jump.rise_m, jump.take_off_m, jump.air_m):
            assert abs(value - height) < 1.5 * sd and sd < 0.8 / rate_hz
        assert abs(jump.velocity_m_s[0] - velocity) < 1.5 * jump.velocity_m_s[1]
        assert jump.fall_m_s2[0] == pytest.approx(GRAVITY, rel=1e-3)


def test_what_is_said_of_the_uncertainty_holds_over_many_jumps():
    """Jumps at other phases of the images, with noise: errors of one standard deviation as it should be."""
    height = 2.4**2 / (2.0 * GRAVITY)
    off: dict[str, list[float]] = {"rise_m": [], "take_off_m": [], "air_m": []}
    for seed in range(12):
        motion = known.jump(2.4, 50.0 + 1.7 * seed, noise_m=0.004, seed=seed)
        (jump,) = jumps_of(motion)
        for way in off:
            value, sd = getattr(jump, way)
            off[way].append((value - height) / sd)
    for way, errors in off.items():
        assert 0.4 < np.sqrt(np.mean(np.square(errors))) < 1.5, (way, errors)


def captured(clip: str, folder) -> list[Jump]:
    motion = load_motion(clip, 60.0, None, folder)
    points = np.array([body.landmarks for body in MannequinSubject().follow(motion)])
    names = list(LANDMARKS)
    n_own = len(names)
    for side in ("left", "right"):  # the mannequin has no feet: for its mass, ankles stand in, which rise before it takes off
        ankle = points[:, [names.index(f"{side}_ankle")]]
        points, names = np.concatenate([points, ankle, ankle], axis=1), [*names, f"{side}_heel", f"{side}_big_toe"]
    named = dict(zip(names[:n_own], np.swapaxes(points, 0, 1), strict=False))
    return find_jumps(np.arange(len(points)) / 60.0, named, mass_center(names, points))


def test_a_jump_of_somebody_in_clothes(shared_data):
    """From joints that are known, whose center falls at 10.7 m/s²; both feet are off the floor in the 13 images from 61 on."""
    folder = shared_data / "clothed_people" / "jump"
    model = scale_to_trial(human_model(ankles=True), load_trc(folder / "static.trc")).model
    markers = load_trc(folder / "truth.trc")
    states = [fit_state_to_landmarks(model, targets_of(model, markers, row)).state for row in range(len(markers))]
    (jump,) = jumps_of(Motion(model, np.arange(len(markers)) * 1_000_000_000 // 30, tuple(states)))
    assert jump.landing_s - jump.take_off_s == pytest.approx(12.5 / 30.0, abs=1.0 / 30.0)
    for height, sd in (jump.rise_m, jump.take_off_m, jump.air_m):
        assert height == pytest.approx(0.21, abs=0.02) and abs(height - 0.21) < 2.0 * sd


@pytest.mark.parametrize("scale", [0.9, 1.1, 1.15])
@pytest.mark.parametrize("parts", ["ankles", "feet"])
def test_a_body_that_is_taken_too_small_or_too_large_is_as_long_in_the_air(scale, parts):
    """Its center falls at another rate than g: the parabola ends with the jump all the same."""
    air = 2.0 * 2.2 / GRAVITY
    for seed in range(4):
        motion = known.jump(2.2, 30.0 + seed, noise_m=0.0012, seed=seed)
        names, points = motion.model.landmark_names, scale * motion.landmarks_m
        kept = [m for m, name in enumerate(names) if parts == "feet" or not name.endswith(("_heel", "_big_toe"))]
        named = {names[m]: points[:, m] for m in kept}
        (jump,) = find_jumps(motion.stamps_ns * 1e-9, named, mass_center(names, points))
        assert jump.landing_s - jump.take_off_s == pytest.approx(air, abs=0.045)
        assert abs(jump.air_m[0] - GRAVITY * air**2 / 8.0) < 2.5 * jump.air_m[1]
        assert abs(jump.velocity_m_s[0] - 2.2) < 2.5 * jump.velocity_m_s[1]
        assert jump.fall_m_s2[0] == pytest.approx(scale * GRAVITY, rel=0.05)


def test_where_the_parabola_alone_tells_the_take_off_it_is_less_sure(shared_data):
    """Ankles rise long before the captured jump."""
    (jump,) = captured("jump", shared_data / "bullet_motions")
    (own,) = jumps_of(known.jump(2.2, 60.0))
    assert jump.air_m[1] > 1.5 * own.air_m[1] and jump.velocity_m_s[1] > 1.5 * own.velocity_m_s[1]


@pytest.mark.parametrize("velocity", [0.6, 0.8])
def test_a_small_hop_is_no_jump(velocity):
    assert jumps_of(known.jump(velocity, 60.0)) == []


@pytest.mark.parametrize("seconds", [0.3, 0.6, 1.2])
def test_who_rises_on_tiptoe_does_not_jump(seconds):
    """All of him rises, the toes least, as those of feet without a joint there do."""
    jump = known.jump(2.4, 60.0)
    t, names = jump.stamps_ns * 1e-9, jump.model.landmark_names
    points = np.tile(jump.landmarks_m[:1], (len(t), 1, 1))
    rises = np.where([name.endswith("_big_toe") for name in names], 0.04, 0.08)
    points[..., 2] += rises * (np.sin(np.pi * np.clip((t - 0.4) / seconds, 0.0, 1.0)) ** 2)[:, None]
    assert find_jumps(t, dict(zip(names, np.swapaxes(points, 0, 1), strict=True)), mass_center(names, points)) == []


def test_a_captured_jump(shared_data):
    (jump,) = captured("jump", shared_data / "bullet_motions")
    heights = [value for value, _ in (jump.rise_m, jump.take_off_m, jump.air_m)]
    assert heights == pytest.approx([0.25] * 3, abs=0.015) and max(heights) - min(heights) < 0.015
    assert jump.fall_m_s2[0] == pytest.approx(GRAVITY, rel=0.05)


@pytest.mark.parametrize("clip", ["walk", "run", "kick"])
def test_who_walks_runs_or_kicks_does_not_jump(shared_data, clip):
    assert captured(clip, shared_data / "bullet_motions") == []


def test_a_walk_and_a_crouch_are_no_jumps():
    assert jumps_of(known.walk(seconds=3.0)) == []
    jump = known.jump(2.4, 60.0)
    low = type(jump)(jump.model, jump.stamps_ns[:40], jump.states[:40])
    assert jumps_of(low) == []


def test_a_lift_is_not_a_fall():
    """Somebody who is lifted and put down slowly leaves the floor, too."""
    jump = known.jump(2.4, 60.0)
    t = jump.stamps_ns * 1e-9
    points = np.tile(jump.landmarks_m[:1], (len(t), 1, 1))
    points[..., 2] += 0.3 * np.clip(np.sin(np.pi * (t - 0.4) / 1.2), 0.0, None)[:, None] ** 2
    named = dict(zip(jump.model.landmark_names, np.swapaxes(points, 0, 1), strict=True))
    assert find_jumps(t, named, mass_center(jump.model.landmark_names, points)) == []


def test_a_jump_with_a_gap_in_it_or_without_feet_is_not_measured():
    jump = known.jump(2.4, 60.0)
    t = jump.stamps_ns * 1e-9
    assert len(jumps_of(jump)) == 1
    assert jumps_of(jump, (t > 0.76) & (t < 0.82)) == []
    names, points = jump.model.landmark_names, jump.landmarks_m
    rest = {name: points[:, m] for m, name in enumerate(names) if not name.startswith("left_")}
    assert find_jumps(t, rest, mass_center(names, points)) == [] == find_jumps(t, rest, None)


def test_metrics_are_means_over_jumps():
    found = jumps_of(known.jump(2.4, 100.0, times=2))
    figures = jump_metrics(found)
    assert figures["jumps"] == 2 and figures["jump_height_rise_m"] == pytest.approx(np.mean([j.rise_m[0] for j in found]))
    assert figures["jump_height_air_m"] == pytest.approx(2.4**2 / 2.0 / GRAVITY, abs=0.01) and jump_metrics([]) == {}


STAND_S, SWING_S, STEP_M = 0.6, 0.4, 0.7


def steps(rate_hz: float, noise_m: float = 0.0) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Three times a left foot stands, then swings, its toes 15 mm above the floor; the right one stands."""
    rng, t = np.random.default_rng(3), np.arange(round(3.0 * (STAND_S + SWING_S) * rate_hz)) / rate_hz
    n, since = np.divmod(t, STAND_S + SWING_S)
    part = np.clip((since - STAND_S) / SWING_S, 0.0, 1.0)
    swing, still, ahead = np.sin(np.pi * part), np.zeros_like(t), STEP_M * (n + part)
    points = {
        "left_heel": np.column_stack([ahead, still, 0.03 + 0.12 * swing]),
        "left_big_toe": np.column_stack([ahead + 0.2, still, 0.02 + 0.015 * swing]),
        "right_heel": np.tile([0.0, -0.2, 0.03], (len(t), 1)),
        "right_big_toe": np.tile([0.2, -0.2, 0.02], (len(t), 1)),
    }
    return t, {name: at + noise_m * rng.standard_normal(at.shape) for name, at in points.items()}


@pytest.mark.parametrize(("rate_hz", "noise_m"), [(60.0, 0.0), (30.0, 0.003), (200.0, 0.003)])
def test_a_foot_is_on_the_floor_while_it_stands_not_while_it_swings_close_above(rate_hz, noise_m):
    found = find_contacts(*steps(rate_hz, noise_m))
    near = pytest.approx
    (whole,) = found["right"].contacts
    assert not whole.comes and not whole.leaves
    left = found["left"].contacts
    assert [(c.comes, c.leaves) for c in left] == [(False, True), (True, True), (True, True)]
    for k, contact in enumerate(left):  # a speed takes 0.05 s to be seen
        assert contact.end_s == near(k * (STAND_S + SWING_S) + STAND_S, abs=0.06)
        assert k == 0 or contact.start_s == near(k * (STAND_S + SWING_S), abs=0.06)


def test_feet_leave_the_floor_in_a_jump():
    motion = known.jump(2.6, 60.0)
    named = dict(zip(motion.model.landmark_names, np.swapaxes(motion.landmarks_m, 0, 1), strict=True))
    (jump,) = jumps_of(motion)
    for foot in find_contacts(motion.stamps_ns * 1e-9, named).values():
        first, second = foot.contacts
        assert (first.comes, first.leaves, second.comes, second.leaves) == (False, True, True, False)
        assert first.end_s == pytest.approx(jump.take_off_s, abs=0.06)
        assert second.start_s == pytest.approx(jump.landing_s, abs=0.06)


def test_a_foot_that_is_held_up_is_not_on_the_floor():
    t, points = steps(60.0)
    for name in ("left_heel", "left_big_toe"):
        points[name] = np.tile(points[name][0] + np.array([0.0, 0.0, 0.4]), (len(t), 1))
    found = find_contacts(t, points)
    assert found["left"].contacts == () and len(found["right"].contacts) == 1
    assert contact_metrics(found)["contact_percent_left"] == 0.0


def test_gaps_end_contacts_that_nobody_sees_end():
    t, points = steps(60.0)
    points["right_heel"][60:80] = np.nan
    found = find_contacts(t, points)["right"]
    first, second = found.contacts
    assert not (first.comes or first.leaves or second.comes or second.leaves)
    assert (first.end_s, second.start_s) == (pytest.approx(t[59]), pytest.approx(t[80]))
    assert found.seen_s == pytest.approx((len(t) - 20) / 60.0)
    assert contact_metrics({"right": found})["contact_percent_right"] == pytest.approx(100.0, abs=3.0)


def test_beside_a_gap_in_its_swing_a_foot_is_not_on_the_floor():
    t, points = steps(60.0)
    swing = (t > STAND_S + 0.15) & (t < STAND_S + 0.25)
    whole = find_contacts(t, points)["left"].contacts
    for name in ("left_heel", "left_big_toe"):
        points[name][swing] = np.nan
    assert find_contacts(t, points)["left"].contacts == whole
    points["left_heel"][:] = points["left_heel"][:1]  # beside toes that swing, for an instant seen alone
    points["left_heel"][:, 2] += 1.0
    alone = np.flatnonzero(swing)[2]
    points["left_heel"][alone], points["left_big_toe"][alone] = [0.0, 0.0, 1.0], [0.0, 0.0, 0.02]
    assert not any(c.start_s <= t[alone] <= c.end_s for c in find_contacts(t, points)["left"].contacts)


def test_without_feet_there_are_no_contacts_and_ankles_stand_in_for_heels():
    t, points = steps(60.0)
    assert find_contacts(t, {"left_heel": points["left_heel"]}) == {}
    assert find_contacts(t[:3], {name: at[:3] for name, at in points.items()}) == {}
    ankles = {name.replace("heel", "ankle"): at + np.array([0.0, 0.0, 0.06]) for name, at in points.items() if "heel" in name}
    assert find_contacts(t, ankles).keys() == {"left", "right"}
    one = {name: np.full_like(at, np.nan) if "left" in name else at for name, at in points.items()}
    assert find_contacts(t, one).keys() == {"right"}
    assert contact_metrics(find_contacts(t, {name: np.full_like(at, np.nan) for name, at in points.items()})) == {}


def test_metrics_of_contacts():
    left = FootContacts((Contact(0.0, 1.0), Contact(2.0, 2.5)), 3.0)
    found = contact_metrics({"left": left, "right": FootContacts((), 3.0)})
    assert found == {"contacts_left": 2, "contact_percent_left": 50.0, "contacts_right": 0, "contact_percent_right": 0.0}
