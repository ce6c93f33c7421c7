"""Scores of poses: best where the body is, and none where nothing is seen."""

import cv2
import numpy as np
import pytest

from helpers.cameras.small_clip import make_clip
from tracker_node.loaders.images.source import load_backgrounds
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.configuration import State
from tracker_node.studio.pose.bench import ColorScore, ContourScore
from tracker_node.tracking.config import TrackerConfig


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return make_clip(tmp_path_factory.mktemp("clip"), n_images=2)


@pytest.fixture(scope="module")
def images(clip):
    return {camera.name: cv2.imread(str(clip.folder / camera.name / "0001.png")) for camera in clip.rig}


@pytest.fixture(scope="module", params=["contour", "color"])
def scorer(request, clip):
    rig = load_rig(clip.rig_file)
    if request.param == "color":
        return ColorScore(rig, clip.model, TrackerConfig())
    return ContourScore(rig, clip.model, TrackerConfig(), load_backgrounds(rig))


def test_the_true_pose_scores_best(clip, images, scorer):
    truth = clip.states[1]
    best = scorer.score(truth, images)
    assert best.total > 0.8 and min(camera.value for camera in best.cameras) > 0.6
    for dof, by in ((0, 0.04), (1, -0.04), (2, 0.04), (3, 0.2), (6, 0.4), (8, 0.5)):
        step = np.zeros(clip.model.n_dof)
        step[dof] = by
        worse = scorer.score(truth.retract(step), images)
        assert worse.total < best.total, clip.model.chain.dof_names[dof]
    step = np.zeros(clip.model.n_dof)
    step[8] = 0.8  # the forearm elsewhere: its own score falls, the trunk's does not
    bent = scorer.score(truth.retract(step), images)
    assert bent.parts[2] < best.parts[2] - 0.2 and bent.parts[0] > best.parts[0] - 0.1


def test_a_pose_has_one_score(clip, images, scorer):
    first = scorer.score(clip.states[1], images)
    away = State(clip.states[1].T_world_root, clip.states[1].joint_positions + 0.3)
    scorer.score(away, images)
    assert scorer.score(clip.states[1], images) == first


def test_a_camera_without_an_image_says_nothing(clip, images, scorer):
    score = scorer.score(clip.states[1], {"cam02": images["cam02"]})
    assert [camera.value is None for camera in score.cameras] == [True, False, True]
    T = clip.states[1].T_world_root.copy()
    T[:3, 3] = (0.0, 0.0, 50.0)
    nowhere = scorer.score(State(T, clip.states[1].joint_positions), images)
    assert nowhere.total is None and set(nowhere.parts) == {None}
