"""A recorded folder reads back through the same loaders as a real recording."""

import json

import cv2
import numpy as np
import pytest

from tracker_node.loaders.images.source import open_camera_source
from tracker_node.loaders.motion.trajectory_file import read_joints
from tracker_node.loaders.motion.trc import load_trc
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.synthesis.dataset import describe, is_recorded, mannequin_sequence, record
from tracker_node.synthesis.motions.deepmimic import load_motion
from tracker_node.synthesis.scenes.scene import SceneConfig, make_rig
from tracker_node.synthesis.subjects.mannequin import LANDMARKS, MannequinSubject

SCENE = SceneConfig(n_cameras=2, width=320, height=240, focal_px=290.0)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("synthetic")
    done = []
    sequence = mannequin_sequence(load_motion("swing", 30.0, 3))
    record(sequence, SCENE, folder, progress=lambda i, n: done.append((i, n)))
    assert done == [(1, 3), (2, 3), (3, 3)]
    return folder


def test_rig_and_images_read_back(recorded):
    rig, made = load_rig(recorded / "rig.yaml"), make_rig(SCENE)
    for camera, original in zip(rig, made, strict=True):
        np.testing.assert_array_equal(camera.model.K, original.model.K)
        np.testing.assert_array_equal(camera.T_world_cam, original.T_world_cam)
        images = list(open_camera_source(camera))
        assert [stamp for stamp, _ in images] == read_joints(recorded / "truth.csv").stamps_ns.tolist()
        assert images[0][1].shape == (240, 320, 3)


def test_truth_lies_on_the_person_in_the_pictures(recorded):
    """Every joint center falls on a pixel that differs from the empty plate."""
    rig, truth = load_rig(recorded / "rig.yaml"), read_joints(recorded / "truth.csv")
    assert truth.names == LANDMARKS and truth.valid.all()
    inner = [truth.names.index(name) for name in LANDMARKS if name != "head"]  # the crown is on the outline itself
    for camera in rig:
        plate = cv2.imread(camera.background)
        for points, (_, image) in zip(truth.positions_m, open_camera_source(camera), strict=True):
            silhouette = np.abs(image.astype(int) - plate).max(axis=2) > 12
            silhouette = cv2.morphologyEx(silhouette.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5)))
            pixels, valid = camera.project(points[inner])
            assert valid.all()
            hit = [silhouette[round(v), round(u)] for u, v in pixels]
            assert np.mean(hit) > 0.9


def test_plates_are_the_mean_of_noisy_empty_images(recorded):
    for name in ("cam01", "cam02"):
        single = [cv2.imread(str(p)).astype(float) for p in sorted((recorded / "backgrounds" / name).glob("*.jpg"))]
        assert len(single) == 10
        noise = (single[0] - single[1]).std() / np.sqrt(2.0)
        assert 1.0 < noise < 4.0
        mean = cv2.imread(str(recorded / "backgrounds" / f"{name}.png"))
        assert np.abs(np.mean(single, axis=0) - mean).mean() < 1.0


def test_the_static_trial_is_the_t_pose(recorded):
    markers = load_trc(recorded / "static.trc")
    assert markers.names == LANDMARKS and markers.valid.all()
    np.testing.assert_allclose(markers.positions_m[0], MannequinSubject().t_pose().landmarks, atol=1e-9)


def test_a_complete_folder_is_known_and_not_made_again(recorded):
    same = describe(mannequin_sequence(load_motion("swing", 30.0, 3)), SCENE)
    assert is_recorded(recorded, same)
    assert not is_recorded(recorded, describe(mannequin_sequence(load_motion("swing", 30.0, 4)), SCENE))
    assert not is_recorded(recorded, describe(mannequin_sequence(load_motion("swing", 31.0, 3)), SCENE))
    assert not is_recorded(recorded, describe(mannequin_sequence(load_motion("swing", 30.0, 3), 1.9), SCENE))
    assert not is_recorded(recorded, {**same, "code": "other"})
    assert not is_recorded(recorded / "nowhere", same)
    assert json.loads((recorded / "synthetic.json").read_text())["scene"]["n_cameras"] == 2
