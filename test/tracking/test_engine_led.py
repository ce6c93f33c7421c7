"""Contours led by textures: better than either where both see, where the picture is where they disagree."""

from collections.abc import Sequence

import numpy as np
import pytest

from helpers.bodies import textured_plate
from tracker_node.geometry import se3
from tracker_node.model.configuration import State
from tracker_node.tracking.config import describe, from_dict
from tracker_node.tracking.estimate import LimbStatus, Status, TrackEstimate
from tracker_node.tracking.tracker import Tracker

TWISTS = np.cumsum(np.random.default_rng(2).normal(0.0, 1.0, (8, 6)) * [0.01, 0.01, 0.01, 0.06, 0.06, 0.06], axis=0)
STATES = [State(textured_plate.TRUE.T_world_root @ se3.exp(twist), np.zeros(0)) for twist in TWISTS]


def followed(modalities: Sequence[str], start: State = STATES[0], **values: object) -> list[TrackEstimate]:
    """Noise and clutter are new in each set: what is behind the plate says nothing."""
    config = from_dict({"modalities": list(modalities), **values})
    tracker = Tracker(textured_plate.rig(), textured_plate.MODEL, config, None, start)
    return [tracker.step(textured_plate.image_set(n * 10**8, textured_plate.film(s, n))) for n, s in enumerate(STATES)]


def off(estimates: Sequence[TrackEstimate]) -> np.ndarray:
    """(n, 6) tangents from the truth."""
    return np.array([state.difference(e.state) for e, state in zip(estimates, STATES, strict=True)])


@pytest.fixture(scope="module")
def led() -> list[TrackEstimate]:
    return followed(["region", "texture"])


def test_the_plate_is_tracked_where_contours_alone_lose_it(led):
    alone = off(followed(["region"]))
    assert np.linalg.norm(off(led)[:, :3], axis=1).max() < 2e-3
    assert np.linalg.norm(alone[-1, :3]) > 5.0 * np.linalg.norm(off(led)[-1, :3])
    assert all(e.status is Status.TRACKING for e in led[1:])
    assert all(limb.status is LimbStatus.TRACKING for e in led[1:] for limb in e.limbs)


def test_its_covariance_is_in_pixels_and_bears_out_the_errors(led):
    assert {e.residual_unit for e in led} == {"px"}
    """The film halves a pixel less exactly than the textures are compared, by a tenth of a millimeter here."""
    there = np.diag([1e-8] * 3 + [4e-8] * 3)
    squares = [o @ np.linalg.solve(e.covariance + there, o) for o, e in zip(off(led), led, strict=True)]
    assert 0.2 * 6.0 < np.mean(squares) < 2.5 * 6.0
    assert all(np.sqrt(np.linalg.eigvalsh(e.covariance)[-1]) < 0.05 for e in led)


def test_it_is_as_near_as_by_texture_alone(led):
    by_texture = np.linalg.norm(off(followed(["texture"]))[:, :3], axis=1)
    assert np.linalg.norm(off(led)[:, :3], axis=1).mean() < 1.2 * by_texture.mean() + 1e-4


def test_a_plate_that_its_texture_does_not_find_is_left_to_the_contours():
    wrong = {"texture.lost_agreement": 1.0, "texture.degraded_agreement": 1.0, "texture.search_states": 0}
    together, alone = followed(["region", "texture"], **wrong), followed(["region"])
    for a, b in zip(together, alone, strict=True):
        np.testing.assert_array_equal(a.state.to_values(), b.state.to_values())


def test_parameters_are_those_of_both_without_the_sum_of_colors():
    names = set(describe(from_dict({"modalities": ["region", "texture"]})))
    assert {"region.scales", "texture.search_radius", "combination"} <= names
    assert not any(name.startswith("joint.") for name in names)
