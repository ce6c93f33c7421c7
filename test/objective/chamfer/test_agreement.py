"""How much of outline and silhouette agree: all of it in the truth, less the farther off the body is."""

import numpy as np
import pytest

from helpers.bodies.two_links import cameras, two_links
from tracker_node.geometry import se3
from tracker_node.model.configuration import Configuration, State
from tracker_node.objective.chamfer.correspondences import (
    BOUNDARY,
    ON_BOUNDARY,
    ON_OUTLINE,
    OUTLINE,
    ContourBody,
    ContourCorrespondences,
    ContourOptions,
    EvidenceMaps,
)
from tracker_node.observation.chamfer.boundary import boundary_points
from tracker_node.observation.chamfer.distance_transform import signed_distance
from tracker_node.render.raycast.raycaster import render_mask

STATE = State(se3.exp([0.02, 0.05, -0.1, 0.1, 0.2, 0.3]), np.array([0.6, 0.4]))


@pytest.fixture
def maps() -> list[EvidenceMaps]:
    model, result = two_links(), []
    for camera in cameras():
        mask = (render_mask(Configuration(model, STATE), camera) > 0).astype(np.uint8)
        distance = signed_distance(mask, 40.0)
        points = boundary_points(mask, distance, np.ones_like(mask), 1)
        result.append(EvidenceMaps((0, 0), distance, np.full_like(distance, 40.0), points))
    return result


def counts_of(maps: list[EvidenceMaps], state: State, close_px: float = 3.0) -> np.ndarray:
    contours = ContourCorrespondences(ContourBody.of(two_links(), cameras()), maps, ContourOptions(), state)
    return contours.agreement(state, close_px)


def shares(maps: list[EvidenceMaps], state: State) -> np.ndarray:
    """(n_cameras, 2): of the outline, of the boundary."""
    counts = counts_of(maps, state)
    return np.stack([counts[:, ON_BOUNDARY] / counts[:, OUTLINE], counts[:, ON_OUTLINE] / counts[:, BOUNDARY]], axis=1)


def test_in_the_truth_nearly_everything_agrees(maps):
    found, counts = shares(maps, STATE), counts_of(maps, STATE)
    assert found.min() > 0.85  # the ends of the cones have no samples
    assert (counts[:, OUTLINE] > 50).all() and (counts[:, BOUNDARY] > 50).all()


def test_agreement_falls_with_the_distance(maps):
    found = [shares(maps, STATE.retract(np.array([0, 0, dz, 0, 0, 0, 0, 0.0]))).mean() for dz in (0.0, 0.01, 0.03, 0.3)]
    assert found == sorted(found, reverse=True)
    assert found[0] - found[3] > 0.7


def test_a_wrong_part_costs_its_share(maps):
    bent = shares(maps, STATE.retract(np.array([0, 0, 0, 0, 0, 0, -0.9, 0.0]))).mean()
    assert 0.2 < bent < 0.75


def test_counting_again_gives_the_same(maps):
    """Of the same contours, and of others."""
    contours = ContourCorrespondences(ContourBody.of(two_links(), cameras()), maps, ContourOptions(), STATE)
    first = contours.agreement(STATE, 3.0)
    np.testing.assert_array_equal(contours.agreement(STATE, 3.0), first)
    np.testing.assert_array_equal(counts_of(maps, STATE), first)
