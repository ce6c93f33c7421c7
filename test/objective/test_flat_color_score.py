"""Labels and a table of errors give the score that drawing in color gives."""

import math
from dataclasses import replace

import numpy as np
import pytest
from wooden_cross import cross

from tracker_node.camera.camera_rig import CameraRig
from tracker_node.camera.light import Light
from tracker_node.model.articulated_model import ArticulatedModel
from tracker_node.model.primitives import Box
from tracker_node.objective.color_score import ColorObjective, ColorOptions, Verdict
from tracker_node.objective.flat_color_score import FlatColorObjective
from tracker_node.synthesis.cross import cross_rig, side_somersault

FULL = cross_rig()
RIG = CameraRig(tuple(replace(c, model=c.model.resized(192, 144)) for c in FULL), lights=FULL.lights)
NORMALIZED = ColorOptions("normalized")
STATE = side_somersault(cross()).state(9)


def two_colors() -> ArticulatedModel:
    model = cross()
    shapes = (model.shapes[0], replace(model.shapes[1], color_rgb=(40, 160, 90)))
    return ArticulatedModel("two", model.chain, shapes, model.landmarks)


def noise_images() -> list[np.ndarray]:
    return [np.random.default_rng(i).integers(0, 256, (144, 192, 3), dtype=np.uint8) for i in range(3)]


def both(model, options=NORMALIZED, images=None):
    result = []
    for kind in (ColorObjective, FlatColorObjective):
        result.append(kind(model, RIG, options))
        result[-1].set_images(noise_images() if images is None else images)
    return result


@pytest.mark.parametrize("model", [cross(), two_colors()], ids=["one color", "two colors"])
@pytest.mark.parametrize("column_step", [1, 3])
def test_it_is_the_score_of_drawn_colors(model, column_step):
    images = noise_images()
    images[1] = None
    drawn, flat = both(model, images=images)
    for change in np.random.default_rng(0).normal(size=(5, 6)) * 0.05:
        state = STATE.retract(change)
        expected, got = (o.at_column_step(column_step).evaluate(state) for o in (drawn, flat))
        np.testing.assert_array_equal(got.camera_pixels, expected.camera_pixels)
        # Drawn colors are clipped at 255, which shifts their hue a little; the flat ones are not
        np.testing.assert_allclose(got.camera_rms, expected.camera_rms, rtol=5e-3)
        assert got.rms == pytest.approx(expected.rms, rel=5e-3)
        assert flat.at_column_step(column_step).score(state) == got.rms == flat.at_column_step(column_step).scores([state])[0]


def test_without_lights_nothing_is_clipped_and_the_scores_are_equal():
    dark = replace(RIG, lights=(), cameras=tuple(replace(c, gain=(0.9, 0.8, 0.7)) for c in RIG))
    scores = []
    for kind in (ColorObjective, FlatColorObjective):
        objective = kind(two_colors(), dark, NORMALIZED)
        objective.set_images(noise_images())
        scores.append(objective.score(STATE))
    assert scores[0] == pytest.approx(scores[1], rel=1e-5)


def test_colors_as_each_camera_shows_them():
    """Every camera alone, with a body painted as that camera shows it."""
    colors = np.random.default_rng(0).integers(20, 180, (3, 2, 3))
    flat = FlatColorObjective(cross(), RIG, NORMALIZED, colors)
    flat.set_images(noise_images())
    seen = flat.evaluate(STATE)
    for i, name in enumerate(RIG.names):
        model = cross()
        shapes = tuple(replace(s, color_rgb=tuple(int(v) for v in c)) for s, c in zip(model.shapes, colors[i], strict=True))
        alone = ColorObjective(ArticulatedModel("painted", model.chain, shapes, ()), RIG.subset([name]), NORMALIZED)
        alone.set_images([noise_images()[i]])
        assert seen.camera_rms[i] == pytest.approx(alone.score(STATE), rel=5e-3)


def test_what_cannot_be_scored_is_infinite():
    _, flat = both(cross())
    aside = flat.evaluate(STATE.retract(np.array([0.0, 20.0, 40.0, 0.0, 0.0, 0.0])))
    assert math.isinf(aside.rms) and aside.verdict in (Verdict.EMPTY_MASK, Verdict.BEHIND_CAMERA)
    behind = flat.evaluate(STATE.retract(np.array([0.0, -30.0, 0.0, 0.0, 0.0, 0.0])))
    assert math.isinf(behind.rms) and behind.verdict == Verdict.BEHIND_CAMERA
    few = both(cross(), options=replace(NORMALIZED, min_pixels=10**6))[1].evaluate(STATE)
    assert math.isinf(few.rms) and few.verdict == Verdict.EMPTY_MASK


def test_what_it_cannot_do_is_refused():
    with pytest.raises(ValueError, match="normalized representation"):
        FlatColorObjective(cross(), RIG, ColorOptions("raw"))
    with pytest.raises(ValueError, match="white lights"):
        FlatColorObjective(cross(), replace(RIG, lights=(Light("ambient", (1.0, 0.9, 0.8)),)))
    model = cross()
    painted = replace(model.shapes[0], primitive=Box((0.05, 0.05, 1.0), np.zeros((6, 3), dtype=np.uint8)))
    with pytest.raises(ValueError, match="'stick' with several"):
        FlatColorObjective(ArticulatedModel("p", model.chain, (painted,), ()), RIG)
    with pytest.raises(ValueError, match="'left': expected an image"):
        both(cross())[1].set_images([np.zeros((5, 5, 3), np.uint8), None, None])
