"""Each change does to the images what its name says, and what became of a track is counted as it was."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmark.contour.box import box_model, box_rig, box_states
from benchmark.world.disturbed import (
    BEFORE,
    DISTURBANCES,
    DISTURBED,
    FROZEN_SETS,
    TROUBLES,
    Scene,
    changes,
    disturbed,
    judged,
    troubled,
)
from tracker_node.model.configuration import State
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.tracking.estimate import Status

N = BEFORE + DISTURBED
MODEL, RIG = box_model(), box_rig()
STATES = box_states(MODEL, N, 1)


def shown(k: int, i: int) -> CameraImage:
    return CameraImage(RIG.names[i], k, np.random.default_rng((k, i)).integers(20, 160, (6, 8, 3), dtype=np.uint8))


def scene() -> Scene:
    sets = [ImageSet(k, tuple(shown(k, i) for i in range(len(RIG)))) for k in range(N)]
    middles = np.array([s.T_world_root[None, :3, 3] for s in STATES])
    headings = np.array([s.T_world_root[:3, :3] for s in STATES])
    return Scene("box", RIG, MODEL, STATES[0], sets, middles, headings, lambda s: s.T_world_root[None, :3, 3], 20.0)


def brightness(name: str) -> np.ndarray:
    """(n, n_cameras) of the changed images against what was there."""
    given = scene()
    pairs = zip(disturbed(given, changes(given, 3)[name]), given.sets, strict=True)
    return np.array([[a.pixels.mean() / b.pixels.mean() for a, b in zip(x.images, y.images, strict=True)] for x, y in pairs])


@pytest.mark.parametrize("name", DISTURBANCES)
def test_nothing_happens_before_the_change_and_stamps_stay(name):
    given = scene()
    found = list(disturbed(given, changes(given, 3)[name]))
    assert found[:BEFORE] == given.sets[:BEFORE] and [one.stamp_ns for one in found] == list(range(N))
    assert all(one.cameras == RIG.names for one in found)


def test_light_changes_in_all_cameras_or_in_one():
    np.testing.assert_allclose(brightness("light_step")[BEFORE:], 0.6, atol=0.01)
    flicker = brightness("flicker")[BEFORE:]
    assert np.ptp(flicker, axis=1).max() < 0.05 and flicker[:, 0].min() < 0.7 and flicker[:, 0].max() > 1.3
    one_dark = np.round(brightness("one_dark")[BEFORE:], 1)
    assert sorted(one_dark.mean(axis=0)) == [0.5, *[1.0] * (len(RIG) - 1)]


def test_one_camera_repeats_its_image_for_ten_sets():
    given = scene()
    found = list(disturbed(given, changes(given, 3)["frozen"]))
    stuck = [[a is not b for a, b in zip(x.images, y.images, strict=True)] for x, y in zip(found, given.sets, strict=True)]
    sets, cameras = np.nonzero(stuck)
    assert sets.tolist() == list(range(BEFORE + 1, BEFORE + 1 + FROZEN_SETS)) and len(set(cameras)) == 1
    i = cameras[0]
    assert all(found[k].images[i].pixels is given.sets[BEFORE].images[i].pixels for k in sets)


@pytest.mark.parametrize("name", TROUBLES)
def test_one_camera_is_in_trouble(name):
    given = scene()
    found = list(disturbed(given, changes(given, 3)[name], 5))
    changed = np.array([[not np.array_equal(a.pixels, b.pixels) for a, b in zip(x.images, y.images, strict=True)]
                        for x, y in zip(found, given.sets, strict=True)])  # fmt: skip
    assert np.flatnonzero(changed.any(axis=0)).tolist() == [troubled(given, 3)]
    assert not changed[:5].any() and (name == "frozen" or changed[5:].any(axis=1).all())


def test_an_image_upside_down_is_turned_by_half_a_turn():
    given = scene()
    found = next(disturbed(given, changes(given, 3)["upside_down"], 0))
    i = troubled(given, 3)
    np.testing.assert_array_equal(found.images[i].pixels[::-1, ::-1], given.sets[0].images[i].pixels)


def test_sets_are_counted_that_are_lost_said_or_not_and_turned():
    def estimate(k: int, off_m: float = 0.0, status: Status = Status.TRACKING, turned: bool = False, *named: str):
        T = STATES[k].T_world_root.copy()
        T[0, 3] += off_m
        if turned:
            T[:3, 0] *= -1.0
        faults = tuple(SimpleNamespace(camera=name) for name in named)
        return SimpleNamespace(state=State.neutral(MODEL, T), status=status, faults=faults)

    run = [estimate(k) for k in range(N)]
    nothing = {"lost": 0, "unsaid": 0, "turned": 0, "worst_mm": 0.0, "settled_mm": 0.0, "named": np.inf, "others": 0}
    assert judged(scene(), run, RIG.names[1]) == nothing
    run[3] = estimate(3, 1.0)  # before the change: not counted
    run[BEFORE + 4] = estimate(BEFORE + 4, 0.03, Status.TRACKING, False, RIG.names[1])
    run[BEFORE + 5] = estimate(BEFORE + 5, 0.0, Status.TRACKING, False, RIG.names[0])
    run[BEFORE + 6] = estimate(BEFORE + 6, 0.01, Status.LOST)
    run[BEFORE + 7] = estimate(BEFORE + 7, turned=True)
    found = judged(scene(), run, RIG.names[1])
    assert found == {"lost": 2, "unsaid": 1, "turned": 1, "worst_mm": pytest.approx(30.0), "settled_mm": 0.0,
                     "named": 4.0, "others": 1}  # fmt: skip
