"""What a start leaves uncovered: a person has come from elsewhere, one arm of the start is wrong."""

import cv2
import numpy as np
import pytest

from helpers.cameras.start_scenes import scene, standing
from tracker_node.model.configuration import Configuration, State
from tracker_node.observation.small_view import SmallView
from tracker_node.render.raycast.raycaster import render_mask
from tracker_node.tracking.assessment import Assessment
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.initialization.evidence import StartCoverage, StartEvidence
from tracker_node.tracking.initialization.initializer import Trial

SCENE = scene()
ARM = "left_shoulder_elevation_front"
VIEWS = [SmallView(camera, 0.7) for camera in SCENE.rig]
CAMERAS = [view.camera for view in VIEWS]


def posed(x: float, arm_deg: float = 80.0) -> State:
    return standing(SCENE.model, x, -0.1, 0.7, **{ARM: arm_deg})


HERE = posed(0.1)


def small(images: list[np.ndarray]) -> list[np.ndarray]:
    return [view.shrink(image) for view, image in zip(VIEWS, images, strict=True)]


def masks(state: State) -> list[np.ndarray]:
    return [render_mask(Configuration(SCENE.model, state), camera) > 0 for camera in CAMERAS]


def evidence(xs: list[float], backgrounds: bool = False) -> StartEvidence:
    """Of a person who goes along ``xs``, and is ``HERE`` at last; colors are learnt there, but for those of the arm's place."""
    empty = zip(SCENE.backgrounds, small(list(SCENE.backgrounds.values())), strict=True)
    found = StartEvidence(CAMERAS, {name: [image] for name, image in empty} if backgrounds else {})
    for i, x in enumerate(xs):
        found.watch(small(SCENE.images(posed(x), i)))
    found.watch(small(SCENE.images(HERE, 99)))
    inside = [mask.astype(np.float64) for mask in masks(posed(0.1, -30.0))]
    found.learn(inside, [1.0 - mask for mask in masks(HERE)])
    return found


@pytest.mark.parametrize("backgrounds", [False, True])
def test_an_arm_that_is_elsewhere_leaves_its_true_place_uncovered(backgrounds):
    coverage = StartCoverage(SCENE.model, CAMERAS, evidence([-0.6, -0.45, -0.3, -0.1, 0.05], backgrounds).sure())
    right, wrong = coverage.uncovered(HERE), coverage.uncovered(posed(0.1, -30.0))
    assert right < 0.01
    assert wrong > right + 0.01


def test_the_place_that_a_body_has_left_is_not_surely_of_it():
    found = evidence([-0.6, -0.45, -0.3, -0.1, 0.05])
    sure = found.sure()
    found.forget_colors()  # what has merely changed
    here, left = [], []
    for was, now, new, changed in zip(masks(posed(-0.3)), masks(HERE), sure, found.maps(), strict=True):
        about = cv2.dilate(now.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0  # pixels that show both
        here.append(new[now])
        left.append(np.stack([new, changed > 0.0])[:, was & ~about])
    assert np.concatenate(here).mean() > 0.4
    still_sure, merely_changed = np.concatenate(left, axis=1).mean(axis=1)
    assert still_sure < 0.05
    assert merely_changed > 0.5


def test_nothing_is_uncovered_where_nothing_moves_or_nothing_has_been_learnt():
    still = evidence([0.1] * 5)
    assert StartCoverage(SCENE.model, CAMERAS, still.sure()).uncovered(posed(0.1, -30.0)) < 0.002
    moving = evidence([-0.6, -0.45, -0.3, -0.1, 0.05])
    moving.forget_colors()
    assert StartCoverage(SCENE.model, CAMERAS, moving.sure()).uncovered(posed(0.1, -30.0)) == 0.0


def test_a_camera_without_an_image_counts_for_nothing():
    found = evidence([-0.6, -0.45, -0.3, -0.1, 0.05])
    found.watch([None, *small(SCENE.images(HERE, 5))[1:]])
    assert found.sure()[0] is None
    assert StartCoverage(SCENE.model, CAMERAS, found.sure()).uncovered(HERE) < 0.01


def test_what_is_left_uncovered_lowers_a_standing_and_never_raises_it():
    def stands(log_ratio: float, uncovered: float) -> float:
        return Trial(HERE, Assessment(Status.TRACKING, "", log_ratio=log_ratio), uncovered).standing

    assert stands(100.0, 0.0) == 100.0
    assert stands(100.0, 0.1) == pytest.approx(81.0)
    assert stands(100.0, 3.0) == 0.0
    assert stands(-100.0, 0.5) == -100.0
