"""Boxes, meshes and end caps in the objective of silhouette distances: gradients, and a box that finds its silhouette."""

import cv2
import numpy as np
import pytest
import trimesh

from helpers.bodies.two_links import cameras
from tracker_node.geometry import se3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box, Mesh, TruncatedCone
from tracker_node.objective.chamfer.correspondences import ContourBody, ContourCorrespondences, ContourOptions, EvidenceMaps
from tracker_node.optimize.levenberg_marquardt import LevenbergMarquardtOptions, minimize
from tracker_node.render.raycast.raycaster import render_mask


def ring():
    made = trimesh.creation.torus(0.2, 0.07, major_sections=24, minor_sections=12)
    return Mesh(made.vertices, made.faces)


SHAPES = {"box": Box((0.5, 0.3, 0.2)), "ring": ring(), "cylinder": TruncatedCone(0.2, 0.2, 0.0, -0.1, 0.1)}


def model_of(name):
    return ArticulatedModel("m", KinematicChain(("body",), ()), (Shape("s", "body", SHAPES[name]),))


def contours_of(model, maps, options, state):
    return ContourCorrespondences(ContourBody.of(model, cameras()), maps, options, state)


def ramp_maps(seed):
    """Ramps: bilinear interpolation is exact on them, so finite differences are too."""
    slopes = np.random.default_rng(seed).uniform(0.4, 1.0, (2, 2))
    v, u = np.mgrid[0:480, 0:640]
    maps = [((u - 320) * a + (v - 240) * b).astype(np.float32) for a, b in slopes]
    return EvidenceMaps((0, 0), *maps, np.zeros((0, 4), dtype=np.float32))


@pytest.mark.parametrize("name", SHAPES)
def test_gradient_matches_finite_differences(name):
    model, state = model_of(name), State(se3.exp([0.02, 0.05, 0.2, 0.4, 0.2, 0.3]), np.zeros(0))
    options = ContourOptions(robust_scale_px=30.0, alignment=-2.0)
    contours = contours_of(model, [ramp_maps(1), ramp_maps(2)], options, state)
    equations = contours.linearize(state)
    assert equations.count > 50
    step = 1e-6
    numeric = np.array([
        (contours.linearize(state.retract(d)).cost - contours.linearize(state.retract(-d)).cost) / (2 * step)
        for d in np.eye(6) * step
    ])  # fmt: skip
    np.testing.assert_allclose(2 * equations.g, numeric, rtol=2e-3, atol=5e-4 * np.abs(numeric).max())


def silhouette_maps(mask):
    """Signed distance to the boundary of a mask; no edges within."""
    outside = cv2.distanceTransform((mask == 0).astype(np.uint8), cv2.DIST_L2, 5)
    inside = cv2.distanceTransform((mask > 0).astype(np.uint8), cv2.DIST_L2, 5)
    signed = np.where(mask > 0, 0.5 - inside, outside - 0.5).astype(np.float32)
    return EvidenceMaps((0, 0), signed, np.full_like(signed, 16.0), np.zeros((0, 4), dtype=np.float32))


def test_a_box_finds_its_silhouettes():
    model, truth = model_of("box"), State(se3.exp([0.02, 0.05, 0.2, 0.4, 0.2, 0.3]), np.zeros(0))
    maps = [silhouette_maps(render_mask(Configuration(model, truth), camera)) for camera in cameras()]
    state = truth.retract(np.array([0.01, -0.015, 0.01, 0.03, -0.04, 0.03]))
    for _ in range(6):
        contours = contours_of(model, maps, ContourOptions(inner_weight=0.0, boundary_weight=0.0), state)
        state = minimize(contours, state, model.chain, LevenbergMarquardtOptions(max_iterations=5)).state
    off = state.difference(truth)
    assert np.linalg.norm(off[:3]) < 0.002
    assert np.degrees(np.linalg.norm(off[3:])) < 0.5
