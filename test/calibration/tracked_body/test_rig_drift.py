"""Drift from the delays of stretches: the line, its sigmas, and what is too short."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from tracker_node.calibration.tracked_body import rig_drift
from tracker_node.calibration.tracked_body.rig_drift import fit_clocks, fit_drift, stretches, with_drift
from tracker_node.calibration.tracked_body.rig_fit import RigFitOptions
from tracker_node.errors import CalibrationError
from tracker_node.loaders.rig.rig_yaml import CameraEntry, RigFile

STAMPS_S = list(100.0 + np.linspace(0.0, 116.0, 30))
SIGMA_S = 0.0004


def found(later_s: dict[str, float]):
    return SimpleNamespace(cameras={n: SimpleNamespace(later_s=v, later_sigma_s=SIGMA_S) for n, v in later_s.items()})


def clocks(seed: int, drift: float = 80e-6, later_s: float = 0.012):
    """Of a camera with this drift and this delay in the middle of the recording, and of a true one, as noisy fits see them."""
    rng = np.random.default_rng(seed)

    def fit(rows):
        middle = np.mean(np.array(STAMPS_S)[rows]) - 158.0
        return found({"off": later_s + drift * middle + rng.normal(0.0, SIGMA_S), "true": rng.normal(0.0, SIGMA_S)})

    return fit_drift(STAMPS_S, stretches(STAMPS_S), fit)


def test_stretches_cover_the_recording():
    parts = stretches(STAMPS_S)
    assert np.array_equal(np.concatenate(parts), np.arange(30)) and [len(p) for p in parts] == [10, 10, 10]
    with pytest.raises(CalibrationError, match=r"drift needs a run of 15 s.*here 12.0 s"):
        stretches(list(np.linspace(0.0, 12.0, 31)))
    with pytest.raises(CalibrationError, match="1 in one"):
        stretches([0.0, 1.0, 2.0, 3.0, 50.0, 98.0, 99.0, 100.0])


def test_drift_is_found_within_its_sigma():
    errors = np.array([[(c["off"].drift - 80e-6) / c["off"].drift_sigma, (c["off"].later_s - 0.012) / c["off"].later_sigma_s]
                       for c in map(clocks, range(60))])  # fmt: skip
    assert np.all(np.abs(np.median(errors, axis=0)) < 0.5) and np.all(np.sqrt(np.mean(errors**2, axis=0)) < 1.3)
    assert clocks(0)["off"].drift_sigma < 10e-6 and clocks(0)["off"].middle_s == pytest.approx(158.0)


def test_what_is_not_surely_drift_is_none():
    values = [c["true"] for c in map(clocks, range(40))]
    assert sum(c.drift == 0.0 for c in values) >= 38 and sum(c.later_s == 0.0 for c in values) >= 36
    small = clocks(1, drift=0.0)["off"]
    assert small.drift == 0.0 and small.later_s == pytest.approx(0.012, abs=0.001)


def test_the_rig_gets_offset_and_drift_from_its_first_image_on():
    entry = CameraEntry(
        image_size=(64, 48), K=[[50, 0, 32], [0, 50, 24], [0, 0, 1]], T_world_cam=np.eye(4).tolist(), time_offset_s=0.25
    )
    both = RigFile(cameras={"off": entry, "true": entry})
    clock = clocks(2)
    written = with_drift(both, found({"off": 0.25, "true": 0.25}), clock, begins_s=100.0).cameras["off"]
    own_s = 158.0 - 100.0  # since the first image, in the middle
    in_the_middle = written.time_offset_s + 1e-6 * written.time_drift_ppm * own_s
    assert in_the_middle == pytest.approx(clock["off"].later_s, abs=1e-7)


def test_stretches_are_fitted_for_their_times_alone_with_the_cameras_of_the_whole_run(monkeypatch):
    @dataclass(frozen=True)
    class Images:
        sets: tuple
        states: tuple
        model: object = None
        velocities: tuple = ()

        def subset(self, rows):
            return Images(tuple(self.sets[i] for i in rows), tuple(self.states[i] for i in rows))

    calls = []

    def fit_rig(model, rig, sets, states, velocities, options, progress, evidence):
        calls.append((rig, states, options, evidence))
        return found({"off": 0.01 + 80e-6 * (1e-9 * np.mean([each.stamp_ns for each in sets]) - 158.0)})

    monkeypatch.setattr(rig_drift, "fit_rig", fit_rig)
    images = Images(tuple(SimpleNamespace(stamp_ns=round(1e9 * s)) for s in STAMPS_S), ("not fitted",) * 30)
    whole = SimpleNamespace(rig="fitted rig", states=tuple(range(30)))
    clock = fit_clocks(images, whole, RigFitOptions(focal=True), lambda part: len(part.sets))["off"]
    assert clock.drift == pytest.approx(80e-6) and clock.later_s == pytest.approx(0.01)
    assert [states for _, states, _, _ in calls] == [tuple(range(k, k + 10)) for k in (0, 10, 20)]
    for rig, _, options, evidence in calls:
        assert (rig, evidence) == ("fitted rig", 10)
        assert (options.places, options.focal, options.times, options.sure_sigmas) == (False, False, True, 0.0)
