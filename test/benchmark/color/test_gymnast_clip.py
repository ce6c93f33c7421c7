"""The gymnast's clip is what it claims to be: two turns in a free flight, fields in time order, a camera that is late."""

import cv2
import numpy as np
import pytest

from benchmark.color import _gymnast_clip as clip
from benchmark.color.articulated import SUIT_RGB
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.humans.human import human_model
from tracker_node.observation.deinterlace import separate_fields
from tracker_node.synthesis.subjects.mannequin import LANDMARKS

ANKLES = [LANDMARKS.index(f"{side}_ankle") for side in ("left", "right")]


@pytest.fixture(scope="module", params=[1, 2])
def routine(request) -> clip.DoubleSomersault:
    return clip.DoubleSomersault(request.param, SUIT_RGB)


def test_the_trunk_turns_twice_about_the_lateral_axis(routine):
    times = np.linspace(0.0, routine.end_s, 300)
    rotations = np.array([routine.rotations(t)["pelvis"] for t in times])
    steps = np.einsum("nji,njk->nik", rotations[:-1], rotations[1:])
    angles = np.arctan2(steps[:, 0, 2] - steps[:, 2, 0], steps[:, 0, 0] + steps[:, 2, 2])
    assert np.abs(angles).max() < np.deg2rad(20.0)  # none is taken for its supplement
    assert angles.sum() == pytest.approx(routine.traits.direction * 4.0 * np.pi, abs=0.01)
    in_air = (times[:-1] > routine.takeoff_s) & (times[1:] < routine.landing_s)
    assert abs(angles[in_air].sum()) > 0.95 * 4.0 * np.pi
    np.testing.assert_allclose(rotations[0], rotations[-1], atol=1e-2)


def test_the_mass_center_flies_freely_and_feet_stand(routine):
    times = np.linspace(routine.takeoff_s, routine.landing_s, 12)[1:-1]
    bodies = [routine.pose(t) for t in times]
    centers = np.array([clip.mass_center(routine.subject, body) for body in bodies])
    acceleration = np.diff(centers, 2, axis=0) / (times[1] - times[0]) ** 2
    np.testing.assert_allclose(acceleration, np.tile([0.0, 0.0, -9.81], (len(acceleration), 1)), atol=1e-4)
    assert min(body.vertices[:, 2].min() for body in bodies[3:-3]) > 0.5
    for begin, end in ((0.0, routine.takeoff_s), (routine.landing_s, routine.end_s)):
        ankles = np.array([routine.pose(t).landmarks[ANKLES] for t in np.linspace(begin, end, 6)])
        assert np.ptp(ankles, axis=0).max() < 0.03


def test_nothing_jumps_at_take_off_and_landing(routine):
    for t in (routine.takeoff_s, routine.landing_s):
        before, after = (routine.pose(t + dt).landmarks for dt in (-1e-4, 1e-4))
        assert np.linalg.norm(after - before, axis=1).max() < 5e-3


def test_fields_are_woven_in_time_and_the_late_camera_is_late(routine, tmp_path, monkeypatch):
    exposed = []

    class Studio:
        def __init__(self, rig, scene):
            self.rig = rig

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def images(self, mesh, number):
            exposed.append((self.rig.names, mesh.vertices.mean(axis=0)))
            return [np.full((8, 8, 3), 10 * number, np.uint8)] * len(self.rig)

    monkeypatch.setattr(clip, "Studio", Studio)
    monkeypatch.setattr(clip, "record", lambda image, faults, rng: image)
    monkeypatch.setattr(clip.DoubleSomersault, "n_fields", 4)
    clip.film(routine, human_model(), tmp_path)
    for name in ("cam01", clip.LATE_CAMERA):
        for number in (0, 1):
            earlier, later = separate_fields(cv2.imread(str(tmp_path / name / f"{number:06d}.png")), "top_first")
            assert abs(int(earlier.mean()) - 20 * number) <= 2 and abs(int(later.mean()) - 20 * number - 10) <= 2
    rig = load_rig(tmp_path / "rig.yaml")
    assert [camera.time_offset_ns for camera in rig] == [0, 0, 11_000_000]
    assert all(camera.interlaced == "top_first" for camera in rig)
    late = [place for names, place in exposed if clip.LATE_CAMERA in names]
    at = [routine.pose(clip.FIELD_S * field + clip.LATE_S).vertices.mean(axis=0) for field in range(4)]
    np.testing.assert_allclose(late, at)
