"""The measured body: joints and colors of the ellipsoid body, girths as measured, and a surface without gaps of its own."""

import numpy as np
import pytest

from helpers.bodies.bodies import assert_same_body, random_state
from helpers.cameras.render_scenes import LENSES, look_at
from tracker_node.camera.model import CameraModel
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans import segments18 as m
from tracker_node.model.humans.segments18 import body_lofts, ellipsoid_human, nurbs_human
from tracker_node.model.shapes.nurbs import LoftedSolid, loft_surface
from tracker_node.render.raycast.raycaster import render_mask

MODEL = nurbs_human()
ELLIPSOIDS = ellipsoid_human()


def girth(name, z):
    """Length of the outline of a segment across its axis at ``z``."""
    surface = loft_surface(body_lofts()[name][0])
    u, v = np.linspace(0.0, 1.0, 1001), np.linspace(0.0, 1.0, 257)
    grid = surface.evaluate(u, v)
    ring = grid[np.argmin(np.abs(grid[:, 0, 2] - z))]
    return float(np.linalg.norm(np.diff(ring, axis=0), axis=1).sum())


def test_joints_landmarks_and_colors_are_those_of_the_ellipsoid_body():
    assert MODEL.landmarks == ELLIPSOIDS.landmarks
    assert MODEL.chain.dof_names == ELLIPSOIDS.chain.dof_names
    assert np.array_equal(MODEL.chain.offsets, ELLIPSOIDS.chain.offsets)
    assert [(s.name, s.link, s.color_rgb) for s in MODEL.shapes] == [(s.name, s.link, s.color_rgb) for s in ELLIPSOIDS.shapes]


@pytest.mark.parametrize(("segment", "z", "measured"), [
    ("pelvis", -m.LOWEST_RIB, m.HIP_SECTION[0]), ("pelvis", m.UMBILICUS - m.LOWEST_RIB, m.UMBILICUS_SECTION[0]),
    ("torso", 0.0, m.RIB_SECTION[0]), ("torso", m.NIPPLE - m.LOWEST_RIB, m.NIPPLE_SECTION[0]), ("head", 0.02, m.NECK_GIRTH),
    ("head", m.NOSE, m.NOSE_GIRTH), ("head", m.ABOVE_EAR, m.EAR_GIRTH), ("left_upper_arm", -0.5 * m.ELBOW, m.MID_ARM_GIRTH),
    ("left_forearm", m.ELBOW - m.FOREARM_MAXIMUM, m.FOREARM_GIRTH), ("right_forearm", m.ELBOW - m.WRIST, m.WRIST_SECTION[0]),
    ("left_hand", -m.KNUCKLES, m.KNUCKLE_SECTION[0]), ("right_thigh", -m.MID_THIGH, m.MID_THIGH_GIRTH),
    ("left_shank", 0.0, m.KNEE_GIRTH), ("left_shank", m.KNEE - m.CALF_MAXIMUM, m.CALF_GIRTH),
    ("right_shank", m.KNEE - m.ANKLE, m.ANKLE_GIRTH),
])  # fmt: skip
def test_girths_are_the_measured_ones(segment, z, measured):
    assert np.isclose(girth(segment, z), measured, rtol=0.02)


def test_mirrored_sides_have_mirrored_surfaces():
    points = {}
    for shape, T in zip(MODEL.shapes, Configuration(MODEL, State.neutral(MODEL)).Ts_world_shape, strict=True):
        points[shape.name] = shape.primitive.vertices @ T[:3, :3].T + T[:3, 3]
    for name in points:
        if name.startswith("left_"):
            other = points["right_" + name.removeprefix("left_")] * [1, -1, 1]
            for vertex in points[name][::37]:
                assert np.linalg.norm(other - vertex, axis=1).min() < 1e-6


@pytest.mark.parametrize("seed", range(3))
def test_the_body_is_of_one_piece_in_the_image(seed):
    """No gaps: from a few directions its silhouette is connected, posed within a good part of its limits."""
    import cv2

    model = nurbs_human(24, 0.03)
    state = random_state(model, np.random.default_rng(seed), 0.5) if seed else State.neutral(model)
    state = State(np.eye(4), state.joint_positions)
    for eye in ((4.0, 0.0, -0.2), (0.0, 4.0, -0.2), (2.5, -2.5, 1.5)):
        mask = render_mask(Configuration(model, state), look_at(eye, (0.0, 0.0, -0.2), LENSES["plain"]))
        assert cv2.connectedComponents(mask)[0] == 2  # the ground and the body


def test_no_ray_passes_between_two_triangles():
    """A camera in the plane of symmetry, whose middle column of rays lies on the edges of all trunk segments."""
    import cv2

    lens = CameraModel(230, 560, np.array([[1120.0, 0.0, 115.0], [0.0, 1120.0, 280.0], [0.0, 0.0, 1.0]]))
    camera = look_at((4.3, 0.0, -0.28), (0.0, 0.0, -0.28), lens)
    mask = render_mask(Configuration(MODEL, State.neutral(MODEL)), camera)
    contours, hierarchy = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    assert len(contours) == 1, f"{np.count_nonzero(hierarchy[0, :, 3] >= 0)} holes"


def test_meshes_are_as_fine_as_asked_and_small():
    assert all(len(shape.primitive.vertices) < 2000 for shape in MODEL.shapes)
    coarse = nurbs_human(16, 0.05)
    assert sum(len(s.primitive.faces) for s in coarse.shapes) < 0.3 * sum(len(s.primitive.faces) for s in MODEL.shapes)


def test_the_file_that_comes_with_the_package_is_this_body(repository):
    shipped = load_model(repository / "config" / "models" / "nurbs_human.yaml")
    assert_same_body(shipped, MODEL)
    for a, b in zip(shipped.shapes, MODEL.shapes, strict=True):
        assert isinstance(a.primitive, LoftedSolid)
        assert a.primitive.loft == b.primitive.loft
        assert np.array_equal(a.primitive.vertices, b.primitive.vertices)
        assert np.array_equal(a.primitive.normals, b.primitive.normals)
