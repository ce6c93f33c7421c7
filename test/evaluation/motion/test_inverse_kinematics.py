"""OpenSim's own inverse kinematics of legs that are built in its interface, on a motion whose angles are known."""

from pathlib import Path

import numpy as np
import pytest

from helpers.motion import known_motions as known
from helpers.motion.opensim_legs import write_legs
from tracker_node.errors import FileFormatError
from tracker_node.evaluation.motion.inverse_kinematics import inverse_kinematics, write_coordinates
from tracker_node.loaders.motion.trc import load_table

TRUNK = ("left_hip", "right_hip", "left_shoulder", "right_shoulder")


@pytest.fixture(scope="module")
def walk():
    return known.walk(seconds=1.2)


@pytest.fixture(scope="module")
def legs(opensim, walk, tmp_path_factory) -> Path:
    return write_legs(opensim, walk.model, tmp_path_factory.mktemp("osim") / "legs.osim")


def still_trunk(walk):
    """Landmarks of the walk, those of the trunk and arms as they are while nothing turns there."""
    points = walk.landmarks_m.copy()
    names = walk.model.landmark_names
    neutral = known.walk(seconds=0.02).landmarks_m[0]
    for name in TRUNK:
        m = names.index(name)
        points[:, m] = neutral[m] + (points[:, names.index("left_hip")] - neutral[names.index("left_hip")])
    return points


def test_coordinates_are_the_angles_of_the_walk(legs, walk, tmp_path):
    found = inverse_kinematics(legs, walk.stamps_ns, walk.model.landmark_names, still_trunk(walk))
    assert set(found.markers) == {*TRUNK, "left_knee", "right_knee", "left_ankle", "right_ankle"} and not found.weighted
    assert np.nanmax(found.errors_m) < 1e-4
    t = walk.stamps_ns * 1e-9
    for side, late, k in (("left", 0.0, 0), ("right", 0.5, 1)):
        phase = 2.0 * np.pi * (t / known.STRIDE_S - late)
        hip = np.degrees(found.values[:, found.coordinates.index(f"hip_flexion_{side}")])
        knee = np.degrees(found.values[:, found.coordinates.index(f"knee_angle_{side}")])
        assert hip == pytest.approx(known.HIP_MEAN_DEG + known.HIP_DEG[k] * np.cos(phase), abs=0.1)
        assert -knee == pytest.approx(known.KNEE_MEAN_DEG + known.KNEE_DEG[k] * np.cos(phase + 2.0), abs=0.1)
    write_coordinates(found, tmp_path / "walk.mot")
    table = load_table(tmp_path / "walk.mot")
    column = table.names.index("hip_flexion_left")
    assert table.in_degrees and table.values[0, column] == pytest.approx(known.HIP_MEAN_DEG + known.HIP_DEG[0], abs=0.1)


def test_what_is_uncertain_weighs_little(legs, walk):
    """A knee is 3 cm off and said to be 5 cm unsure: the hip's angle stays, and the residual says what is wrong."""
    names, points = walk.model.landmark_names, still_trunk(walk)
    knee = names.index("left_knee")
    points[:, knee] += np.array([0.03, 0.0, 0.0])  # against what hip and ankle say
    exact = still_trunk(walk)
    sds = np.full(points.shape[:2], 0.005)
    sds[:, knee] = 0.05
    alike = inverse_kinematics(legs, walk.stamps_ns, names, points)
    weighted = inverse_kinematics(legs, walk.stamps_ns, names, points, sds)
    true = inverse_kinematics(legs, walk.stamps_ns, names, exact)
    column = alike.coordinates.index("hip_flexion_left")
    wrong = [np.abs(found.values[:, column] - true.values[:, column]).mean() for found in (alike, weighted)]
    assert weighted.weighted and wrong[1] < 0.3 * wrong[0] and wrong[0] > np.radians(0.3)
    m = weighted.markers.index("left_knee")
    assert weighted.errors_m[:, m].mean() > alike.errors_m[:, m].mean()
    metrics = weighted.metrics()
    assert metrics["opensim_marker_max_mm"] == pytest.approx(1e3 * weighted.errors_m.max())
    assert metrics["opensim_marker_rms_mm"] == pytest.approx(1e3 * weighted.rms_m.mean()) and metrics["opensim_sets"] == len(sds)


def test_sets_without_a_state_stay_empty(legs, walk):
    points = still_trunk(walk)
    points[10:14] = np.nan
    found = inverse_kinematics(legs, walk.stamps_ns, walk.model.landmark_names, points)
    assert np.isnan(found.values[10:14]).all() and np.isfinite(found.values[14:]).all() and np.nanmax(found.errors_m) < 1e-4
    points[:] = np.nan
    assert inverse_kinematics(legs, walk.stamps_ns, walk.model.landmark_names, points).metrics() == {"opensim_sets": 0}


def test_models_that_do_not_suit_are_refused(opensim, legs, walk, tmp_path):
    given = walk.stamps_ns, walk.model.landmark_names, walk.landmarks_m
    with pytest.raises(FileFormatError, match="nothing there"):
        inverse_kinematics(tmp_path / "none.osim", *given)
    (tmp_path / "text.osim").write_text("no model")
    with pytest.raises(FileFormatError, match="a model of OpenSim"):
        inverse_kinematics(tmp_path / "text.osim", *given)
    with pytest.raises(FileFormatError, match=r"field 'markers': expected at least 3 .* got .*left_hip"):
        inverse_kinematics(legs, walk.stamps_ns, ("tip",), walk.landmarks_m[:, :1])
