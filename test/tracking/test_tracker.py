"""The whole core on pictures that another renderer drew: where it says the body is, and what it says when it cannot know."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.studio.small_studio import Recording, assert_same_bits, changed, recording
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import CalibrationError, ModelError
from tracker_node.model.configuration import State
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.tracking.config import TrackerConfig, from_dict
from tracker_node.tracking.estimate import Status, TrackEstimate
from tracker_node.tracking.tracker import Tracker


@pytest.fixture(scope="module")
def clip() -> Recording:
    return recording()


def tracker_of(
    clip: Recording, config: TrackerConfig | None = None, state: State | None = None, backgrounds: bool = True
) -> Tracker:
    return Tracker(clip.rig, clip.model, config, clip.backgrounds if backgrounds else None, state or clip.states[0])


def track(clip: Recording, sets=None, **options) -> list[TrackEstimate]:
    tracker = tracker_of(clip, **options)
    return [tracker.step(image_set) for image_set in (clip.sets if sets is None else sets)]


@pytest.fixture(scope="module")
def tracked(clip: Recording) -> list[TrackEstimate]:
    return track(clip)


def test_the_body_is_followed(clip, tracked):
    """A pixel is 14 mm wide at the body."""
    errors = clip.errors_mm(tracked)
    assert errors.mean() < 8.0
    assert errors.max() < 60.0
    assert [e.status for e in tracked] == [Status.TRACKING] * len(clip.sets)
    assert [e.status_reason for e in tracked] == [""] * len(clip.sets)
    assert max(e.residual for e in tracked) < 1.0
    assert all(report.samples > 100 and report.stamp_ns == e.stamp_ns for e in tracked for report in e.cameras)


def test_a_body_off_its_predicted_place_is_caught(clip):
    """Some six pixels and eight degrees off in the first set: less after it, and found again after a few."""
    rng = np.random.default_rng(3)
    start = clip.states[0].retract(np.append([0.05, -0.05, 0.04, 0.05, -0.05, 0.1], rng.normal(0.0, 0.08, clip.model.n_dof - 6)))
    errors = clip.errors_mm(track(clip, state=start)).mean(axis=1)
    assert errors[0] < 25.0
    assert errors[-1] < 12.0


def in_light(image_set: ImageSet, gain: float) -> ImageSet:
    images = (replace(i, pixels=np.clip(np.rint(gain * i.pixels), 0, 255).astype(np.uint8)) for i in image_set.images)
    return replace(image_set, images=tuple(images))


@pytest.mark.parametrize("gain", [0.6, 1.3])
def test_other_light_is_told_from_another_world(clip, tracked, gain):
    """Colors and backgrounds are compared in the light in which they were learned."""
    estimates = track(clip, [in_light(one, gain) if i >= 3 else one for i, one in enumerate(clip.sets)])
    assert [e.status for e in estimates] == [Status.TRACKING] * len(clip.sets)
    assert clip.errors_mm(estimates).mean() < clip.errors_mm(tracked).mean() + 1.0


def test_whatever_follows_a_found_body_sees_it_in_the_light_of_the_first_image(clip, monkeypatch):
    """A start that is compared later learns its colors in the same light as the tracker that takes it."""
    tracker = tracker_of(clip, from_dict({"modalities": ["region"]}))
    seen: list[ImageSet] = []
    monkeypatch.setattr(tracker._initializer, "find", lambda images, image_set, *more: seen.append(image_set))
    tracker._track.start = None
    for one in (clip.sets[0], in_light(clip.sets[1], 0.6)):
        tracker.step(one)
        tracker._track.start = None
    assert seen[0] is clip.sets[0]
    for image, true in zip(seen[1].images, clip.sets[1].images, strict=True):
        assert abs(np.median(image.pixels.astype(float) / np.maximum(true.pixels, 1)) - 1.0) < 0.03
        assert (image.camera, image.stamp_ns) == (true.camera, true.stamp_ns)


def test_light_is_taken_out_of_images_of_any_encoding(clip):
    gray = [[i.pixels.mean(axis=2).astype(np.uint8) for i in one.images] for one in clip.sets[:2]]
    for encoding, pixels in (("rgb8", [[i.pixels[:, :, ::-1] for i in one.images] for one in clip.sets[:2]]), ("mono8", gray)):
        tracker = tracker_of(clip, from_dict({"modalities": ["chamfer"]}))
        first, second = (
            replace(one, images=tuple(replace(i, pixels=p, encoding=encoding) for i, p in zip(one.images, row, strict=True)))
            for one, row in zip(clip.sets[:2], pixels, strict=True)
        )
        assert tracker._in_first_light(first)[0] is first
        dark, images = tracker._in_first_light(in_light(second, 0.6))
        for image, bgr, true in zip(dark.images, images, second.images, strict=True):
            assert image.bgr is bgr and abs(np.median(bgr.astype(float) / np.maximum(true.bgr, 1)) - 1.0) < 0.03


WAYS = ({"chamfer.silhouette": "background"}, {"chamfer.distances": "sum"}, {"chamfer.sliding": False})


@pytest.mark.parametrize("options", WAYS)
def test_other_ways_of_tracking_follow_too(clip, options):
    errors = clip.errors_mm(track(clip, config=from_dict({"modalities": ["chamfer"]} | options)))
    assert errors.mean() < 20.0


def test_joint_limits_hold(clip, tracked):
    angles = np.array([e.state.joint_positions for e in tracked])
    assert (angles >= clip.model.chain.lower).all() and (angles <= clip.model.chain.upper).all()


def test_the_same_images_give_the_same_bits_whatever_the_number_of_threads(clip, tracked):
    for threads in (1, 2, 3):
        assert_same_bits(track(clip, clip.sets[:6], config=TrackerConfig(threads=threads)), tracked[:6])


def test_who_learns_late_has_the_same_states(clip, tracked):
    """An estimate does not wait for what is learned from its images; nothing is learned twice, or left out."""
    tracker = tracker_of(clip)
    estimates = []
    for i, image_set in enumerate(clip.sets[:6]):
        estimates.append(tracker.estimate(image_set))
        for _ in range(i % 3):
            tracker.learn()
    assert_same_bits(estimates, tracked[:6])


def test_images_of_any_layout_give_the_same_bits(clip, tracked):
    """Other channel order, rows apart, read-only: what arrives through a message or a crop."""

    def rgb(image: CameraImage) -> CameraImage:
        pixels = np.ascontiguousarray(image.pixels[:, :, ::-1])
        pixels.flags.writeable = False
        return replace(image, pixels=pixels, encoding="rgb8")

    def strided(image: CameraImage) -> CameraImage:
        wide = np.zeros((image.pixels.shape[0], image.pixels.shape[1] + 7, 3), np.uint8)
        wide[:, 3:-4] = image.pixels
        return replace(image, pixels=wide[:, 3:-4])

    for layout in (rgb, strided):
        sets = [replace(s, images=tuple(layout(i) for i in s.images)) for s in clip.sets[:4]]
        assert_same_bits(track(clip, sets), tracked[:4])


def test_gray_images_are_tracked(clip):
    def gray(image: CameraImage) -> CameraImage:
        return replace(image, pixels=image.pixels.mean(axis=2).astype(np.uint8), encoding="mono8")

    sets = [replace(s, images=tuple(gray(i) for i in s.images)) for s in clip.sets[:6]]
    backgrounds = {name: background.mean(axis=2).astype(np.uint8) for name, background in clip.backgrounds.items()}
    backgrounds = {name: np.repeat(background[:, :, None], 3, axis=2) for name, background in backgrounds.items()}
    tracker = Tracker(clip.rig, clip.model, from_dict({"modalities": ["chamfer"]}), backgrounds, clip.states[0])
    found = [tracker.step(s) for s in sets]
    assert np.median(clip.errors_mm(found)) < 60.0  # clothes and walls of equal brightness look the same
    assert Status.LOST not in {e.status for e in found}


def test_reset_starts_all_over(clip, tracked):
    tracker = tracker_of(clip)
    for image_set in clip.sets[:5]:
        tracker.step(image_set)
    tracker.reset()
    assert_same_bits([tracker.step(s) for s in clip.sets[:5]], tracked[:5])


def test_without_a_state_and_a_search_it_waits_and_learns_nothing(clip, tracked):
    tracker = Tracker(clip.rig, clip.model, from_dict({"initialization.enabled": False}), clip.backgrounds)
    for image_set in clip.sets[:3]:
        estimate = tracker.step(image_set)
        assert estimate.status is Status.INITIALIZING
        assert "initial state" in estimate.status_reason
        assert estimate.covariance[0, 0] > 100.0  # m^2: anywhere
        assert not estimate.velocity.any()
        assert [(r.samples, r.stamp_ns) for r in estimate.cameras] == [(0, image_set.stamp_ns)] * 4
    tracker.set_state(clip.states[0])
    assert_same_bits([tracker.step(s) for s in clip.sets[:4]], tracked[:4])


def test_set_state_brings_a_lost_body_back(clip):
    tracker = tracker_of(clip)
    for image_set in clip.sets[:4]:
        tracker.step(image_set)
    aside = clip.states[4].retract(np.append([1.8, 1.2, 0.0], np.zeros(clip.model.n_dof - 3)))
    tracker.set_state(aside)
    lost = tracker.step(clip.sets[4])
    assert lost.status in (Status.DEGRADED, Status.LOST)
    tracker.set_state(clip.states[5])
    back = [tracker.step(s) for s in clip.sets[5:]]
    assert back[-1].status is Status.TRACKING
    assert np.linalg.norm(back[-1].state.T_world_root[:3, 3] - clip.states[-1].T_world_root[:3, 3]) < 0.02


def test_a_camera_that_gives_no_image_is_said(clip):
    sets = [*clip.sets[:3], *(changed(s, ("cam02",), None) for s in clip.sets[3:])]
    found = track(clip, sets)
    assert [e.status for e in found[:3]] == [Status.TRACKING] * 3
    assert {(e.status, e.status_reason) for e in found[3:]} == {(Status.DEGRADED, "3 of 4 cameras")}
    assert [(r.camera, r.stamp_ns, r.samples) for r in found[-1].cameras][1] == ("cam02", 0, 0)
    assert clip.errors_mm(found).mean() < 12.0


def test_a_camera_that_comes_later_is_used(clip):
    found = track(clip, [*(changed(s, ("cam02",), None) for s in clip.sets[:3]), *clip.sets[3:]])
    assert found[2].status is Status.DEGRADED
    assert found[-1].status is Status.TRACKING
    assert found[-1].cameras[1].samples > 100


def test_a_covered_camera_is_named_and_the_others_go_on(clip):
    sets = [*clip.sets[:3], *(changed(s, ("cam03",), np.zeros_like) for s in clip.sets[3:])]
    found = track(clip, sets)
    for estimate in found[3:]:
        assert estimate.status is Status.DEGRADED
        assert "cam03" in estimate.status_reason and "cam01" not in estimate.status_reason
    assert clip.errors_mm(found).mean() < 15.0


def test_when_all_cameras_are_covered_it_is_lost_and_stays_near(clip):
    sets = [*clip.sets[:4], *(changed(s, clip.rig.names, np.zeros_like) for s in clip.sets[4:])]
    sets += [replace(sets[-1], stamp_ns=sets[-1].stamp_ns + (i + 1) * 33_333_333) for i in range(12)]
    found = track(clip, sets, config=from_dict({"initialization.enabled": False}))  # which would look everywhere
    assert [e.status for e in found[4:]] == [Status.LOST] * (len(sets) - 4)
    assert all(e.status_reason for e in found[4:])
    assert np.linalg.norm(found[-1].state.T_world_root[:3, 3] - found[3].state.T_world_root[:3, 3]) < 0.5


def test_when_the_body_goes_it_is_lost_with_the_reason(clip):
    def empty(image_set: ImageSet) -> ImageSet:
        return replace(image_set, images=tuple(replace(i, pixels=clip.backgrounds[i.camera]) for i in image_set.images))

    found = track(clip, [*clip.sets[:4], *(empty(s) for s in clip.sets[4:])])
    assert [e.status for e in found[4:]] == [Status.LOST] * (len(clip.sets) - 4)
    assert all(e.status_reason for e in found[4:])
    assert np.isfinite(found[-1].covariance).all()


def test_a_body_out_of_all_views_is_lost(clip):
    tracker = tracker_of(clip)
    tracker.step(clip.sets[0])
    tracker.set_state(clip.states[0].retract(np.append([0.0, 0.0, 60.0], np.zeros(clip.model.n_dof - 3))))
    estimate = tracker.step(clip.sets[1])
    assert estimate.status is Status.LOST
    assert "no camera" in estimate.status_reason
    assert np.isfinite(estimate.state.to_values()).all()


def test_a_camera_that_looks_elsewhere_is_in_order(clip):
    """The body need not be in every view."""
    T = clip.rig.cameras[1].T_world_cam.copy()
    T[:3, :3] = T[:3, :3] @ np.diag([-1.0, 1.0, -1.0])
    cameras = [replace(c, T_world_cam=T) if i == 1 else c for i, c in enumerate(clip.rig)]
    tracker = Tracker(CameraRig(tuple(cameras)), clip.model, None, clip.backgrounds, clip.states[0])
    found = [tracker.step(s) for s in clip.sets[:4]]
    assert [(e.status, e.cameras[1].samples) for e in found] == [(Status.TRACKING, 0)] * 4


def test_an_image_of_another_size_contradicts_the_calibration(clip):
    sets = changed(clip.sets[0], ("cam04",), lambda pixels: pixels[::2, ::2])
    with pytest.raises(CalibrationError, match=r"camera 'cam04': image size .* expected 320x240, got 160x120"):
        tracker_of(clip).step(sets)


def test_plates_must_be_there_and_fit(clip):
    with pytest.raises(CalibrationError, match=r"camera 'cam01'.*empty scene"):
        tracker_of(clip, config=from_dict({"modalities": ["chamfer"], "chamfer.silhouette": "background"}), backgrounds=False)
    with pytest.raises(CalibrationError, match="camera 'cam02': expected a background image of 320x240, got 100x50"):
        Tracker(clip.rig, clip.model, None, {"cam02": np.zeros((50, 100, 3), np.uint8)})


def test_a_first_set_without_images_is_not_the_end(clip):
    """Nothing is learnt from it; the next one is the first."""
    empty = changed(clip.sets[0], clip.rig.names, None)
    estimates = track(clip, [empty, *clip.sets[1:4]])
    assert estimates[0].status is Status.LOST
    assert [estimate.status for estimate in estimates[1:]] == [Status.TRACKING] * 3


def test_the_covariance_is_one_and_shrinks_with_cameras(clip, tracked):
    for estimate in tracked:
        np.testing.assert_array_equal(estimate.covariance, estimate.covariance.T)
        assert np.linalg.eigvalsh(estimate.covariance).min() > 0.0
    deviations = []
    for cameras in (("cam01",), ("cam01", "cam02"), clip.rig.names):
        others = [name for name in clip.rig.names if name not in cameras]
        (estimate,) = track(clip, [changed(clip.sets[0], others, None)])
        deviations.append(np.sqrt(np.diag(estimate.covariance)[:3].sum()))
    assert deviations[0] > 1.3 * deviations[1] > 1.3**2 * deviations[2] > 0.0
    errors = np.array([e.state.T_world_root[:3, 3] - s.T_world_root[:3, 3] for e, s in zip(tracked, clip.states, strict=True)])
    assert np.linalg.norm(errors, axis=1).max() < 6.0 * deviations[2]


def test_a_body_without_shapes_is_refused(clip):
    with pytest.raises(ModelError, match="has no shapes, and nothing of it is seen"):
        Tracker(clip.rig, replace(clip.model, shapes=()), TrackerConfig())
