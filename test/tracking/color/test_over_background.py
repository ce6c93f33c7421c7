"""Parts of one color over plates, on pictures that another renderer drew."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.studio.small_studio import Recording, recording
from tracker_node.errors import ModelError
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.estimate import Status, TrackEstimate
from tracker_node.tracking.tracker import Tracker

CONFIG = from_dict(
    {"modalities": ["color_over_background"], "color_over_background": {"learn_colors": True, "search_states": 80}}
)
N_SETS = 3


@pytest.fixture(scope="module")
def clip() -> Recording:
    return recording()


def track(clip: Recording, sets, state=None) -> list[TrackEstimate]:
    tracker = Tracker(clip.rig, clip.model, CONFIG, clip.backgrounds, state or clip.states[0])
    return [tracker.step(image_set) for image_set in sets]


def test_the_body_is_followed(clip):
    """A pixel is 14 mm wide at the body, and the start is not exact."""
    near = clip.states[0].retract(0.04 * np.random.default_rng(1).normal(size=clip.model.n_dof))
    estimates = track(clip, clip.sets[:N_SETS], near)
    assert clip.errors_mm(estimates).mean() < 25.0
    assert all(estimate.status is not Status.LOST for estimate in estimates)
    assert all(np.linalg.eigvalsh(estimate.covariance).min() > 0.0 for estimate in estimates)


def test_the_same_images_give_the_same_bits(clip):
    one, two = (track(clip, clip.sets[:1]) for _ in range(2))
    for a, b in zip(one, two, strict=True):
        assert a.state.to_values().tobytes() == b.state.to_values().tobytes()
        assert (a.status, a.status_reason) == (b.status, b.status_reason)


def test_a_body_that_leaves_the_scene_is_lost(clip):
    empty = [replace(i, pixels=clip.backgrounds[i.camera]) for i in clip.sets[1].images]
    estimates = track(clip, [clip.sets[0], replace(clip.sets[1], images=tuple(empty))])
    assert estimates[-1].status is Status.LOST


def test_colors_learnt_beside_the_body_do_not_deceive(clip):
    aside = np.zeros(clip.model.n_dof)
    aside[1] = 0.6
    estimate = track(clip, clip.sets[:1], clip.states[0].retract(aside))[0]
    assert estimate.status in (Status.LOST, Status.DEGRADED)
    assert "explains" in estimate.status_reason or "colors" in estimate.status_reason


def test_without_plates_it_says_what_it_needs(clip):
    with pytest.raises(ModelError, match="images of the background"):
        Tracker(clip.rig, clip.model, CONFIG, {}, clip.states[0])
