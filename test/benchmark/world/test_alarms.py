"""Bars have the color of a limb, a crate hides one, and limbs are counted by what is said of those that are right."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmark.world import alarms
from tracker_node.model.configuration import Configuration, State
from tracker_node.tracking.estimate import LimbStatus, Status


def test_bars_are_as_wide_as_the_gaps_between_them_and_of_the_color():
    background = np.full((20, 400, 3), 255, dtype=np.uint8)
    image = alarms.barred(background, (40, 80, 160), np.random.default_rng(1))
    barred = (image != 255).all(axis=(0, 2))
    edges = np.flatnonzero(np.diff(barred.astype(int)))
    assert set(np.diff(edges)) == {alarms.BAR_PX} and 0.35 < barred.mean() < 0.65
    tones = image[0, barred].astype(float) / (160, 80, 40)
    assert tones.min() > 0.8 and tones.max() < 1.2
    np.testing.assert_array_equal(background, 255)


@pytest.mark.parametrize("kind", alarms.KINDS)
def test_every_seed_has_another_motion(kind):
    first, other = (alarms.drawn(kind, "figure", seed) for seed in (1, 2))
    assert len(first.states) == alarms.SETS and (first.hidden is not None) == (kind == "hidden")
    assert np.abs(first.states[5].to_values() - other.states[5].to_values()).max() > 1e-3


def test_a_crate_covers_the_last_part_of_the_limb_and_is_there_while_it_is_hidden():
    scene = alarms.drawn("hidden", "figure", 3)
    body = Configuration(scene.model, scene.states[alarms.HIDDEN[0]])
    corners = alarms._corners(body, scene.hidden)
    end = (body.Ts_world_link[scene.hidden.end] @ np.append(scene.hidden.tip, 1.0))[:3]
    assert (corners.min(axis=0) < end).all() and (end < corners.max(axis=0)).all()
    for number, one in enumerate(scene.sets()):
        if number >= alarms.HIDDEN[0] - 1:
            colors = [np.abs(i.pixels.astype(int) - alarms.CRATE_BGR).max(axis=2) < 25 for i in one.images]
            shown = min(float(c.mean()) for c in colors)
            if number == alarms.HIDDEN[0] - 1:
                before = shown
            else:
                assert shown > before + 0.002
                break


def test_limbs_are_counted_that_are_right_and_called_lost():
    scene = alarms.drawn("hidden", "figure", 1)
    limbs = alarms.limbs_of(scene.model)
    hidden = next(i for i, limb in enumerate(limbs) if limb.name == scene.hidden.name)

    def estimate(state: State, status: Status = Status.TRACKING, **said: LimbStatus) -> SimpleNamespace:
        reports = [SimpleNamespace(status=said.get(f"limb{i}", LimbStatus.TRACKING)) for i in range(len(limbs))]
        return SimpleNamespace(state=state, status=status, limbs=tuple(reports))

    states = scene.states[: alarms.HIDDEN[0] + 1]
    away = State(states[2].T_world_root.copy(), states[2].joint_positions)
    away.T_world_root[0, 3] += 1.0
    run = [estimate(state) for state in states]
    run[0] = estimate(states[0], Status.LOST, limb1=LimbStatus.LOST, limb2=LimbStatus.DEGRADED)
    run[2] = estimate(away, Status.LOST, limb1=LimbStatus.LOST)
    run[-1] = estimate(states[-1], Status.TRACKING, **{f"limb{hidden}": LimbStatus.LOST})
    n = len(limbs)
    short = alarms.Scene(scene.rig, scene.model, states, scene.backgrounds, scene.hidden)
    assert alarms.counted(short, run) == {
        "right": n * (len(states) - 1) - 1, "lost": 1, "degraded": 1, "sets": len(states) - 1, "body_lost": 1, "wrong": n,
    }  # fmt: skip
    figures = alarms.figures_of("x", [alarms.counted(short, run)])
    assert figures["x.false_fraction"] == pytest.approx(1.0 / figures["x.limb_sets"])


def test_a_limb_before_bars_of_its_color_is_not_called_lost_where_it_is_right():
    scene = alarms.drawn("bars", "figure", 13)
    tracker, said = alarms.Tracker(scene.rig, scene.model, alarms.TrackerConfig(), None, scene.states[0]), []
    for _, one in zip(range(5), scene.sets(), strict=False):
        said.append({limb.name: limb.status for limb in tracker.step(one).limbs})
    assert said[4]["left_shank"] is LimbStatus.DEGRADED  # little tells it from the bars
    assert all(status is not LimbStatus.LOST for each in said for status in each.values())
