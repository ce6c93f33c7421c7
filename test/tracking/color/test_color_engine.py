"""The engine of colors on pictures of another renderer: where it says the body is, and what it says when it cannot know."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers.cameras.render_scenes import LENSES, look_at
from helpers.cameras.small_clip import Clip, make_clip
from helpers.numeric.naive import render_color
from helpers.studio.small_studio import Recording, assert_same_bits, changed, recording
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import CalibrationError, ModelError
from tracker_node.geometry import se3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.estimate import Status, TrackEstimate
from tracker_node.tracking.tracker import Tracker

LEARNT = {"modalities": ["color"], "color.learn_colors": True, "color.first_passes": 2}
N_SETS = 4


@pytest.fixture(scope="module")
def clip() -> Recording:
    """Every part in a color of its own."""
    return recording()


def track(clip: Recording, sets=None, state=None, model=None, **options) -> list[TrackEstimate]:
    tracker = Tracker(clip.rig, model or clip.model, from_dict(LEARNT | options), clip.backgrounds, state or clip.states[0])
    return [tracker.step(image_set) for image_set in (clip.sets[:N_SETS] if sets is None else sets)]


@pytest.fixture(scope="module")
def tracked(clip: Recording) -> list[TrackEstimate]:
    return track(clip)


def test_the_body_is_followed(clip, tracked):
    """A pixel is 14 mm wide at the body."""
    errors = clip.errors_mm(tracked)
    assert errors.mean() < 22.0
    assert np.median(errors) < 15.0
    assert [e.status for e in tracked] == [Status.TRACKING] * N_SETS
    assert all(report.samples > 100 and report.stamp_ns == e.stamp_ns for e in tracked for report in e.cameras)


def test_contours_take_over_from_colors(clip, tracked):
    found = track(clip, modalities=["color", "chamfer"], combination="sequential")
    assert clip.errors_mm(found).mean() < 8.0
    assert [e.status for e in found] == [Status.TRACKING] * N_SETS
    assert max(e.residual for e in found) < 1.0  # in pixels, as of contours


@pytest.fixture(scope="module")
def arm(tmp_path_factory) -> tuple[Clip, list[ImageSet]]:
    """A trunk with an arm, small and quick."""
    made = make_clip(tmp_path_factory.mktemp("arm"), 3)
    sets = []
    for i in range(3):
        images = [CameraImage(c.name, i, cv2.imread(str(made.folder / c.name / f"{i:04d}.png"))) for c in made.rig]
        sets.append(ImageSet(i, tuple(images)))
    return made, sets


# A simplex of all variables at once needs too many scores
@pytest.mark.parametrize(
    ("optimizer", "hierarchical"),
    [("alignment", True), ("alignment", False), ("stepping", True), ("stepping", False), ("simplex", True)],
)
def test_every_optimizer_finds_the_state_from_one_that_is_off(arm, optimizer, hierarchical):
    """3 cm and 6 degrees; a pixel is 10 mm wide."""
    made, sets = arm
    start = made.states[0].retract(np.array([0.02, -0.02, 0.01, 0.05, -0.05, 0.05, 0.1, -0.1, 0.1]))
    config = from_dict(
        {"modalities": ["color"], "color.optimizer": optimizer, "color.hierarchical": hierarchical, "color.levels": 3}
    )
    tracker = Tracker(made.rig, made.model, config, None, start)
    estimate = [tracker.step(s) for s in sets][-1]
    tips = [Configuration(made.model, s).landmarks_world for s in (estimate.state, made.states[2])]
    assert np.linalg.norm(tips[0] - tips[1], axis=1).max() < 0.02
    assert estimate.status is Status.TRACKING, estimate.status_reason
    lower, upper = made.model.chain.lower, made.model.chain.upper
    assert (estimate.state.joint_positions >= lower).all() and (estimate.state.joint_positions <= upper).all()


def test_the_same_images_give_the_same_bits_whatever_the_number_of_threads(clip, tracked):
    assert_same_bits(track(clip, clip.sets[:2], threads=3), tracked[:2])


def test_a_lost_limb_is_found_again_the_same_way_with_the_same_seed(arm):
    """The arm is looked for 75 degrees from where it is; the trunk is in its place."""
    made, sets = arm
    start = made.states[0].retract(np.append(np.zeros(6), [0.0, 1.3, 0.3]))
    runs = []
    for options in ({"color.search_states": 0}, {}, {}):
        tracker = Tracker(made.rig, made.model, from_dict({"modalities": ["color"]} | options), None, start)
        runs.append([tracker.step(s) for s in sets])
    wrist = made.model.landmark_index("wrist")
    wrists = [Configuration(made.model, run[-1].state).landmarks_world[wrist] for run in runs]
    errors = np.linalg.norm(np.array(wrists) - Configuration(made.model, made.states[2]).landmarks_world[wrist], axis=1)
    assert errors[0] > 0.1 and runs[0][-1].status is not Status.TRACKING
    assert errors[1] < 0.02 and runs[1][-1].status is Status.TRACKING
    assert_same_bits(runs[1], runs[2])


def test_a_covered_camera_is_named_and_the_others_go_on(clip):
    sets = [clip.sets[0], *(changed(s, ("cam03",), np.zeros_like) for s in clip.sets[1:3])]
    for estimate in track(clip, sets)[1:]:
        assert estimate.status is Status.DEGRADED
        assert "cam03" in estimate.status_reason and "cam01" not in estimate.status_reason


def test_a_camera_that_gives_no_image_is_said(clip):
    found = track(clip, [clip.sets[0], changed(clip.sets[1], ("cam02",), None)])
    assert (found[1].status, found[1].status_reason) == (Status.DEGRADED, "3 of 4 cameras")
    assert (found[1].cameras[1].samples, found[1].cameras[1].stamp_ns) == (0, 0)


def test_when_the_body_goes_it_is_lost_with_the_reason(clip):
    def empty(image_set: ImageSet) -> ImageSet:
        return replace(image_set, images=tuple(replace(i, pixels=clip.backgrounds[i.camera]) for i in image_set.images))

    found = track(clip, [*clip.sets[:2], *(empty(s) for s in clip.sets[2:4])])
    assert [e.status for e in found[2:]] == [Status.LOST] * 2
    assert all("agree" in e.status_reason for e in found[2:])


def test_a_body_that_no_camera_sees_is_lost_with_the_reason(clip):
    away = clip.states[0].retract(np.append([0.0, 0.0, 60.0], np.zeros(clip.model.n_dof - 3)))
    (estimate,) = track(clip, clip.sets[:1], state=away, **{"color.learn_colors": False})
    assert (estimate.status, estimate.status_reason) == (Status.LOST, "no camera sees where the body is expected")
    assert np.isfinite(estimate.covariance).all()


def test_a_small_mask_lowers_the_status(clip):
    (estimate,) = track(clip, clip.sets[:1], **{"color.few_pixels": 10**6})
    assert estimate.status is Status.DEGRADED
    assert "covers only" in estimate.status_reason
    (estimate,) = track(clip, clip.sets[:1], **{"color.min_pixels": 10**6})
    assert estimate.status is Status.LOST


def test_without_a_state_it_waits(clip):
    tracker = Tracker(clip.rig, clip.model, from_dict(LEARNT))
    for more in ({}, {"modalities": ["color", "region"], "combination": "sequential"}):
        tracker = Tracker(clip.rig, clip.model, from_dict(LEARNT | more | {"initialization.enabled": False}))
        estimate = tracker.step(clip.sets[0])
        assert (estimate.status, estimate.status_reason) == (Status.INITIALIZING, "no initial state has been given")
        assert estimate.covariance[0, 0] > 1.0  # m^2: anywhere
        assert [(r.samples, r.stamp_ns) for r in estimate.cameras] == [(0, clip.sets[0].stamp_ns)] * 4


def test_the_covariance_is_one_and_shrinks_with_cameras(clip, tracked):
    deviations = []
    for cameras in (("cam01",), ("cam01", "cam02"), clip.rig.names):
        others = [name for name in clip.rig.names if name not in cameras]
        (estimate,) = track(clip, [changed(clip.sets[0], others, None)])
        np.testing.assert_array_equal(estimate.covariance, estimate.covariance.T)
        assert np.linalg.eigvalsh(estimate.covariance).min() > 0.0
        deviations.append(np.sqrt(np.diag(estimate.covariance)[:3].sum()))
    assert deviations[0] > deviations[1] > deviations[2] > 0.0
    errors = np.array([e.state.T_world_root[:3, 3] - s.T_world_root[:3, 3] for e, s in zip(tracked, clip.states, strict=False)])
    assert np.linalg.norm(errors, axis=1).max() < 6.0 * deviations[2]


def test_a_model_without_colors_is_refused_unless_they_are_learnt(clip):
    plain = replace(clip.model, shapes=tuple(replace(s, color_rgb=(180, 180, 180)) for s in clip.model.shapes))
    with pytest.raises(ModelError, match=r"model 'human' has no colors: expected color_rgb .*color\.learn_colors"):
        track(clip, clip.sets[:1], model=plain, **{"color.learn_colors": False})
    (estimate,) = track(clip, clip.sets[:1], model=plain)
    assert estimate.status is not Status.LOST


@pytest.mark.parametrize("modalities", [["color"], ["color", "region"]])
def test_a_grey_image_among_colored_ones_is_refused_by_the_name_of_its_camera(clip, modalities):
    def gray(image: CameraImage) -> CameraImage:
        return replace(image, pixels=image.pixels.mean(axis=2).astype(np.uint8), encoding="mono8")

    images = tuple(gray(i) if i.camera == "cam02" else i for i in clip.sets[0].images)
    with pytest.raises(CalibrationError, match="camera 'cam02': expected color images for the modality color, got mono8"):
        track(clip, [replace(clip.sets[0], images=images)], modalities=modalities)


def test_a_rigid_body_is_found_from_far_off():
    """200 mm and 20 degrees, among cameras that see it some 60 pixels wide, drawn by brute force; faces keep their own colors."""
    faces = [(200, 40, 40), (40, 40, 200), (40, 180, 60), (220, 200, 40), (180, 40, 180), (40, 180, 190)]
    shapes = (
        Shape("beam", "base", Box((0.8, 0.2, 0.12), face_colors_rgb=np.array(faces)), color_rgb=(1, 2, 3)),
        Shape("ball", "base", Ellipsoid((0.15, 0.15, 0.15)), se3.exp(np.array([0.2, 0.0, 0.2, 0.0, 0.0, 0.0])), (240, 120, 20)),
    )
    model = ArticulatedModel("beam", KinematicChain(("base",), ()), shapes)
    eyes = ((2.5, 0.5, 0.6), (-0.5, 2.4, 0.9), (-1.8, -1.7, 0.5))
    rig = CameraRig(tuple(look_at(eye, (0.0, 0.0, 0.0), LENSES["plain"], f"cam{i}") for i, eye in enumerate(eyes)))
    truth = State.neutral(model, se3.exp(np.array([0.02, -0.03, 0.01, 0.2, 0.1, -0.3])))
    images = []
    for camera in rig:
        labels, _, rgb = render_color(Configuration(model, truth), camera)
        pixels = np.rint(np.where(labels[:, :, None] > 0, rgb, (120.0, 115.0, 110.0))[:, :, ::-1]).astype(np.uint8)
        images.append(CameraImage(camera.name, 5, pixels))
    start = truth.retract(np.concatenate([[0.12, -0.12, 0.106], np.deg2rad(20.0) * np.array([0.6, 0.0, 0.8])]))
    estimate = Tracker(rig, model, from_dict({"modalities": ["color"]}), None, start).step(ImageSet(5, tuple(images)))
    off = estimate.state.difference(truth)
    assert np.linalg.norm(off[:3]) < 0.005 and np.linalg.norm(off[3:]) < np.deg2rad(1.0)
    assert estimate.status is Status.TRACKING, estimate.status_reason


@pytest.mark.parametrize("optimizer", ["alignment", "stepping"])
def test_a_body_of_known_colors_is_found_in_light_that_nobody_knows(arm, optimizer):
    """Images of half the levels, one camera's in other colors."""
    made, sets = arm
    factors = {"cam01": 0.5, "cam02": (0.45, 0.5, 0.57), "cam03": 0.6}

    def dim(image: CameraImage) -> CameraImage:
        return replace(image, pixels=np.rint(image.pixels * np.asarray(factors[image.camera])).astype(np.uint8))

    start = made.states[0].retract(np.array([0.02, -0.02, 0.01, 0.05, -0.05, 0.05, 0.1, -0.1, 0.1]))
    off = {}
    for fit_gain in (True, False):
        values = {"color.optimizer": optimizer, "color.levels": 3, "color.fit_gain": fit_gain, "color.representation": "raw"}
        tracker = Tracker(made.rig, made.model, from_dict({"modalities": ["color"]} | values), None, start)
        found = [tracker.step(replace(s, images=tuple(map(dim, s.images)))) for s in sets][-1]
        tips = [Configuration(made.model, s).landmarks_world for s in (found.state, made.states[2])]
        off[fit_gain] = np.linalg.norm(tips[0] - tips[1], axis=1).max()
    assert off[True] < 0.02 and off[True] < off[False] and found.status is not Status.TRACKING
