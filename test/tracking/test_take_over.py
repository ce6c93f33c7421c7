"""A tracker that takes the place of another one goes on where that has left the body."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.studio.small_studio import Recording, recording
from tracker_node.errors import CalibrationError
from tracker_node.tracking.config import TrackerConfig, from_dict
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.tracker import Tracker

N_BEFORE = 4


@pytest.fixture(scope="module")
def clip() -> Recording:
    return recording()


@pytest.fixture(scope="module")
def old(clip: Recording) -> Tracker:
    tracker = Tracker(clip.rig, clip.model, None, clip.backgrounds, clip.states[0])
    for image_set in clip.sets[:N_BEFORE]:
        assert tracker.step(image_set).status is Status.TRACKING
    return tracker


@pytest.mark.parametrize("changes", [{"region.robust_sigmas": 2.0}, {"modalities": ["chamfer"]}, {"cameras": 2}], ids=str)
def test_the_body_is_followed_without_a_break(clip, old, changes):
    """In the first image set already, by a fit as of any other image set: nothing is looked for."""
    changes = dict(changes)
    rig = clip.rig.subset(clip.rig.names[: changes.pop("cameras", None)])
    new = Tracker(rig, clip.model, from_dict(changes), {name: clip.backgrounds[name] for name in rig.names})
    new.take_over(old, clip.sets[N_BEFORE - 1])
    estimates = [new.step(image_set) for image_set in clip.sets[N_BEFORE:]]
    assert [e.status for e in estimates] == [Status.TRACKING] * len(estimates)
    true = clip.states[N_BEFORE : N_BEFORE + len(estimates)]
    off_m = [np.abs(e.state.difference(state)[:3]).max() for e, state in zip(estimates, true, strict=True)]
    assert off_m[0] < 0.03 and max(off_m) < 0.03
    assert estimates[0].iterations <= 2 * max(e.iterations for e in estimates[1:])


def test_the_velocity_is_known(clip, old):
    """What one expects of an image set the other does, and the old one is as it was."""
    new = Tracker(clip.rig, clip.model, TrackerConfig(), clip.backgrounds)
    new.take_over(old, clip.sets[N_BEFORE - 1])
    stamp_ns = clip.sets[N_BEFORE].stamp_ns
    expected, before = new._track.motion.predict(stamp_ns), old._track.motion.predict(stamp_ns)
    assert np.linalg.norm(before.velocity) > 0.1
    assert np.array_equal(expected.velocity, before.velocity)
    assert np.array_equal(expected.state.to_values(), before.state.to_values())
    new.step(clip.sets[N_BEFORE])
    assert np.array_equal(old._track.motion.predict(stamp_ns).velocity, before.velocity)


def test_images_of_another_size_are_refused(clip, old):
    small = replace(clip.rig, cameras=tuple(replace(c, model=c.model.resized(40, 30)) for c in clip.rig))
    with pytest.raises(CalibrationError, match="expected 40x30, got 320x240"):
        Tracker(small, clip.model, None).take_over(old, clip.sets[N_BEFORE - 1])
