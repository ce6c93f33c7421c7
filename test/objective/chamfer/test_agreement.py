"""How much of outline and silhouette agree: all of it in the truth, less the farther off the body is."""

import numpy as np
import pytest

from helpers.bodies.two_links import cameras, two_links
from tracker_node.geometry import se3
from tracker_node.model.configuration import Configuration, State
from tracker_node.objective.chamfer.agreement import BOUNDARY, ON_BOUNDARY, ON_OUTLINE, OUTLINE
from tracker_node.objective.chamfer.objective import CameraSlot, ContourObjective, ContourOptions, EvidenceMaps
from tracker_node.observation.chamfer.boundary import boundary_points
from tracker_node.observation.chamfer.distance_transform import signed_distance
from tracker_node.render.raycast.raycaster import render_mask
from tracker_node.render.shape_arrays import ShapeArrays

STATE = State(se3.exp([0.02, 0.05, -0.1, 0.1, 0.2, 0.3]), np.array([0.6, 0.4]))


@pytest.fixture
def objective() -> ContourObjective:
    model, maps = two_links(), []
    for camera in cameras():
        mask = (render_mask(Configuration(model, STATE), camera) > 0).astype(np.uint8)
        distance = signed_distance(mask, 40.0)
        points = boundary_points(mask, distance, np.ones_like(mask), 1)
        maps.append(EvidenceMaps((0, 0), distance, np.full_like(distance, 40.0), points))
    slots = [CameraSlot(camera, model, 25) for camera in cameras()]
    return ContourObjective(model, ShapeArrays.from_model(model), slots, maps, ContourOptions())


def shares(objective: ContourObjective, state: State, close_px: float = 3.0) -> np.ndarray:
    """(n_cameras, 2): of the outline, of the boundary."""
    objective.restart(objective.options)
    objective.linearize(state)
    objective.count_agreement(state, close_px)
    counts = np.array([slot.agreement for slot in objective.slots])
    return np.stack([counts[:, ON_BOUNDARY] / counts[:, OUTLINE], counts[:, ON_OUTLINE] / counts[:, BOUNDARY]], axis=1)


def test_in_the_truth_nearly_everything_agrees(objective):
    found = shares(objective, STATE)
    assert found.min() > 0.85  # the ends of the cones have no samples
    counts = np.array([slot.agreement for slot in objective.slots])
    assert (counts[:, OUTLINE] > 50).all() and (counts[:, BOUNDARY] > 50).all()


def test_agreement_falls_with_the_distance(objective):
    found = [shares(objective, STATE.retract(np.array([0, 0, dz, 0, 0, 0, 0, 0.0]))).mean() for dz in (0.0, 0.01, 0.03, 0.3)]
    assert found == sorted(found, reverse=True)
    assert found[0] - found[3] > 0.7


def test_a_wrong_part_costs_its_share(objective):
    bent = shares(objective, STATE.retract(np.array([0, 0, 0, 0, 0, 0, -0.9, 0.0]))).mean()
    assert 0.2 < bent < 0.75


def test_counting_again_gives_the_same(objective):
    first = shares(objective, STATE)
    np.testing.assert_array_equal(shares(objective, STATE), first)
