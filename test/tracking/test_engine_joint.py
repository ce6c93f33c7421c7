"""Colors and contours together, on pictures by another renderer: no worse than the better one alone, and surer than either."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.studio.small_studio import Recording, recording
from tracker_node.errors import FileFormatError
from tracker_node.objective.constraints.prior import SumObjective
from tracker_node.tracking.config import TrackerConfig, from_dict
from tracker_node.tracking.engines import make_engine
from tracker_node.tracking.estimate import Status, TrackEstimate
from tracker_node.tracking.tracker import Tracker

N = 6
ENGINES = ("contour", "color", "color_and_contour")


def configured(engine: str, contours: str = "chamfer", **color) -> TrackerConfig:
    if engine == "contour":
        return from_dict({"modalities": [contours]})
    colors = {"learn_colors": True, **color}
    if engine == "color":
        return from_dict({"modalities": ["color"], "color": colors})
    combination = "joint" if engine == "color_and_contour" else "sequential"
    return from_dict({"modalities": ["color", contours], "combination": combination, "color": colors})


@pytest.fixture(scope="module")
def clip() -> Recording:
    return recording()


def tracked(clip: Recording, config: TrackerConfig, n: int = N) -> list[TrackEstimate]:
    tracker = Tracker(clip.rig, clip.model, config, clip.backgrounds, clip.states[0])
    return [tracker.step(image_set) for image_set in clip.sets[:n]]


@pytest.fixture(scope="module")
def runs(clip: Recording) -> dict[str, list[TrackEstimate]]:
    return {engine: tracked(clip, configured(engine)) for engine in ENGINES}


def test_together_is_as_good_as_the_better_one(clip, runs):
    errors = {engine: clip.errors_mm(run)[2:].mean() for engine, run in runs.items()}
    assert errors["color_and_contour"] < 1.05 * min(errors["contour"], errors["color"]), errors
    assert all(estimate.status is Status.TRACKING for estimate in runs["color_and_contour"])


def test_the_covariance_shrinks_in_every_direction(clip):
    """At one state, of the same images: what both know is the sum of what each of them knows."""
    images = [image.bgr for image in clip.sets[0].images]
    contours, colors = (make_engine(clip.rig, clip.model, configured(name), clip.backgrounds) for name in ("contour", "color"))
    start = contours.begin(images, colors.begin(images, clip.states[0]))
    for engine in (colors, contours):
        engine.observe(images, start)
        fit = engine.fit(start, first=True)
        start = fit.state
    level, information = colors.modalities[0].information_at(start)
    alone = fit.objective.linearize(start).H
    both = SumObjective([fit.objective, level], [1.0, information]).linearize(start).H
    shrinkage = np.linalg.eigvalsh(np.linalg.inv(alone) - np.linalg.inv(both))
    assert shrinkage.min() > -1e-9 * shrinkage.max() and np.trace(np.linalg.inv(both)) < 0.9 * np.trace(np.linalg.inv(alone))
    assert np.allclose(both - alone, information * level.linearize(start).H)


def test_what_the_tracker_says_of_its_certainty_shrinks_too(runs):
    sigma = {engine: np.sqrt(np.diag(run[-1].covariance)) for engine, run in runs.items()}
    assert np.median(sigma["color_and_contour"] / sigma["contour"]) < 0.95


def test_lines_go_with_colors_as_well(clip):
    """Without images of the background. Hands and forearms are a few pixels wide here, too few for lines."""
    tracker = Tracker(clip.rig, clip.model, configured("color_and_contour", "region"), {}, clip.states[0])
    run = [tracker.step(image_set) for image_set in clip.sets[:3]]
    assert np.median(clip.errors_mm(run)) < 8.0


def test_a_body_that_colors_do_not_find_is_left_to_the_contours(clip):
    """Colors of another body: the result is that of contours from the same start, bit for bit."""
    wrong = {"learn_colors": False, "lost_agreement": 1.0}
    together = tracked(clip, configured("color_and_contour", **wrong), 2)
    led = tracked(clip, configured("color_then_contour", **wrong), 2)
    assert all(np.array_equal(a.state.to_values(), b.state.to_values()) for a, b in zip(together, led, strict=True))


def test_colors_of_one_cloth_leave_the_body_to_contours(clip):
    """All parts look alike but the head: states are those of contours alone, bit for bit, though colors do find the body."""
    assert make_engine(clip.rig, clip.model, configured("color_and_contour", learn_colors=False), {})._beside.leads
    one = replace(clip, model=replace(clip.model, shapes=tuple(
        shape if shape.link == "head" else replace(shape, color_rgb=(90, 130, 180)) for shape in clip.model.shapes
    )))  # fmt: skip
    assert not make_engine(one.rig, one.model, configured("color_and_contour", learn_colors=False), {})._beside.leads
    together, alone = tracked(one, configured("color_and_contour", learn_colors=False), 3), tracked(one, configured("contour"), 3)
    assert all(np.array_equal(a.state.to_values(), b.state.to_values()) for a, b in zip(together, alone, strict=True))


def test_colors_over_a_background_are_refused(clip):
    with pytest.raises(FileFormatError, match="only color and texture are fitted jointly with contours"):
        from_dict({"modalities": ["color_over_background", "region"]})
    config = TrackerConfig(modalities=("color_over_background", "region"))
    with pytest.raises(FileFormatError, match="only color and texture are fitted jointly with contours"):
        Tracker(clip.rig, clip.model, config, clip.backgrounds, clip.states[0])
