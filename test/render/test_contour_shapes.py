"""Contours of boxes, meshes and end caps: against masks drawn with OpenGL, and against each other."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import trimesh

from helpers.bodies.contours import contour_points
from helpers.cameras.render_scenes import icosahedron, look_at, single_shape, tetrahedron
from tracker_node.camera.model import CameraModel
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid, Mesh, TruncatedCone
from tracker_node.objective.per_camera import camera_constants
from tracker_node.render.contour import generators as contour
from tracker_node.render.contour.generators import INNER, OUTER
from tracker_node.render.contour.samples import (
    BEYOND,
    CLASS,
    N_INFO_COLUMNS,
    N_PIXEL_COLUMNS,
    SHAPE,
    U,
    V,
    chords_px,
    collect_samples,
    most_samples,
)
from tracker_node.render.shape_arrays import ShapeArrays
from tracker_node.render.solids import NO_HIT, box_mesh, solid_hit, solid_of

LENS = CameraModel(320, 240, np.array([[400.0, 0.0, 160.0], [0.0, 400.0, 120.0], [0.0, 0.0, 1.0]]))
FINER = 4  # the masks have that many pixels in one of the lens


def torus(major=0.12, minor=0.045):
    made = trimesh.creation.torus(major, minor, major_sections=40, minor_sections=20)
    return Mesh(made.vertices, made.faces)


def half_pipe():
    """An open surface: half of the mantle of a cylinder."""
    angles = np.linspace(0.0, np.pi, 25)
    rim = np.column_stack([0.1 * np.cos(angles), 0.1 * np.sin(angles)])
    vertices = np.vstack([np.column_stack([rim, np.full(25, z)]) for z in (-0.12, 0.12)])
    i = np.arange(24)
    faces = np.vstack([np.column_stack([i, i + 1, i + 26]), np.column_stack([i, i + 26, i + 25])])
    return Mesh(vertices, faces)


def round_mesh(radii, subdivisions=4):
    made = trimesh.creation.icosphere(subdivisions)
    return Mesh(made.vertices * radii, made.faces)


SHAPES = {
    "box": Box((0.2, 0.12, 0.08)),
    "cone": TruncatedCone(0.08, 0.05, -1.2, -0.1, 0.15),
    "flat cone": TruncatedCone(0.1, 0.14, -6.0, -0.02, 0.05),
    "tetrahedron": tetrahedron(0.1),
    "icosahedron": icosahedron(0.12),
    "torus": torus(),
    "half pipe": half_pipe(),
}


def samples_of(configuration, camera, n_samples=25, caps=True):
    """(rows, pixels, info) of all that the camera sees."""
    arrays = ShapeArrays.from_model(configuration.model, caps)
    Ts = configuration.Ts_world_shape
    spheres = np.empty((len(Ts), 4))
    contour.world_spheres(Ts, arrays.bounds, spheres)
    n = most_samples(arrays.packed, n_samples)
    rows, pixels = np.zeros((n, contour.N_COLUMNS)), np.zeros((n, N_PIXEL_COLUMNS))
    info = np.zeros((n, N_INFO_COLUMNS), dtype=np.int32)
    packed = camera_constants(camera)
    n = collect_samples(arrays.packed, Ts, spheres, packed, n_samples, 1.0, rows, pixels, info)
    return rows[:n], pixels[:n], info[:n]


def outline_of(renderer, configuration, camera):
    """(n, 2) points of the boundary of the mask in the pixels of ``camera``."""
    lens = camera.model
    large = replace(camera, model=lens.resized(FINER * lens.width, FINER * lens.height))
    mask = (renderer.render_view(configuration, large).labels > 0).astype(np.uint8)
    inner = mask - cv2.erode(mask, np.ones((3, 3), np.uint8))
    v, u = np.nonzero(inner)
    # The boundary runs half a fine pixel outside of the last pixels of the mask
    return (np.column_stack([u, v]) + 0.5) / FINER - 0.5


def distances(points, others):
    return np.sqrt(((points[:, None] - others[None]) ** 2).sum(axis=2)).min(axis=1)


def random_pose(rng, size=0.08):
    return se3.from_rotation_translation(so3.exp(rng.normal(size=3)), rng.uniform(-size, size, 3))


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("lens", [LENS, replace(LENS, distortion_model="plumb_bob", distortion=np.array([-0.25, 0.1, 0, 0]))])
def test_outline_is_the_boundary_of_the_mask(renderer, name, seed, lens):
    rng = np.random.default_rng([seed, len(name)])
    configuration = single_shape(SHAPES[name], random_pose(rng))
    camera = look_at((0.7, -0.3, 0.4 * seed), (0.0, 0.0, 0.0), lens)
    _, pixels, info = samples_of(configuration, camera)
    seen = pixels[info[:, CLASS] == OUTER][:, [U, V]]
    boundary = outline_of(renderer, configuration, camera)
    assert len(seen) > 20
    # Where an open surface is seen almost along itself, its border is taken for outline within a pixel of it
    assert distances(seen, boundary).max() < (1.0 if name == "half pipe" else 0.5)
    spacing = len(boundary) / FINER / len(seen)
    assert distances(boundary, seen).max() < 1.0 + 3.0 * spacing


@pytest.mark.parametrize("name", SHAPES)
def test_normals_lead_out_of_the_mask(renderer, name):
    rng = np.random.default_rng(len(name))
    configuration = single_shape(SHAPES[name], random_pose(rng))
    camera = look_at((0.5, 0.5, 0.3), (0.0, 0.0, 0.0), LENS)
    rows, pixels, info = samples_of(configuration, camera)
    mask = renderer.render_view(configuration, camera).labels > 0
    sight = rows[:, :3] - camera.center
    assert np.abs(np.einsum("ij,ij->i", sight, rows[:, 3:6])).max() < 1e-9
    pixels = pixels[info[:, CLASS] == OUTER]
    for distance, covered in ((2.0, False), (-2.0, True)):
        u, v = np.rint(pixels[:, [0, 1]] + distance * pixels[:, [3, 4]]).astype(int).T
        assert (mask[v, u] == covered).mean() > 0.9  # near a corner the other side is near, too


@pytest.mark.parametrize("name", ["box", "cone", "icosahedron", "torus"])
def test_normal_displacement_against_a_contour_drawn_anew(name):
    """The outline's distance to a sample, along its normal, when the body moves by a twist and its contour is drawn anew."""
    primitive, rng = SHAPES[name], np.random.default_rng(5)
    T, center = random_pose(rng), np.array([0.6, 0.4, 0.3])
    arrays = single_shape(primitive).model
    arrays = ShapeArrays.from_model(arrays)
    camera = look_at(center, (0.0, 0.0, 0.0), LENS)

    def points(twist, n):
        return contour_points(arrays, (se3.exp(twist) @ T)[None], 0, center, n)

    rows, pixels, info = samples_of(single_shape(primitive, T), camera, 10)
    rows, pixels = rows[info[:, CLASS] == OUTER], pixels[info[:, CLASS] == OUTER]
    d, m = rows[:, contour.SLIDE : contour.SLIDE + 3], rows[:, contour.M : contour.M + 3]
    R = camera.T_cam_world[:3, :3]
    for direction in np.eye(6):
        step = 2e-4 * direction
        moved = points(step, 4000)
        moved_pixels = camera.model.project(moved[:, :3] @ R.T + camera.T_cam_world[:3, 3])[0]
        v, w = step[:3], step[3:]
        speed = v + np.cross(w, rows[:, :3]) + d * (m @ (v + np.cross(w, center)))[:, None]
        J = pixels[:, 5:11].reshape(-1, 2, 3) @ R
        predicted = np.einsum("nij,nj,ni->n", J, speed, pixels[:, 3:5])
        offset = moved_pixels[None] - pixels[:, None, :2]
        across = np.einsum("nkj,nj->nk", offset, pixels[:, 3:5])
        along = np.abs(offset[..., 0] * -pixels[:, None, 4] + offset[..., 1] * pixels[:, None, 3])
        near = np.where((along < 0.3) & (np.abs(across) < 2.0), np.abs(across - predicted[:, None]), np.inf)
        best = near.min(axis=1)
        assert np.median(best) < 0.02
        assert (best < 0.1).mean() > 0.9  # at corners the outline turns


def test_the_mesh_of_a_box_is_the_box():
    box = SHAPES["box"]
    T = random_pose(np.random.default_rng(2))
    camera = look_at((0.6, 0.5, 0.3), (0.0, 0.0, 0.0), LENS)
    ours, other = (samples_of(single_shape(shape, T), camera) for shape in (box, box_mesh(box)))
    for a, b in zip(ours, other, strict=True):
        assert np.allclose(a, b, atol=1e-12)


def test_a_fine_mesh_of_an_ellipsoid_approaches_the_ellipsoid():
    radii, camera = np.array([0.06, 0.1, 0.14]), look_at((0.6, 0.5, 0.3), (0.0, 0.0, 0.0), LENS)
    T = random_pose(np.random.default_rng(4))
    exact = samples_of(single_shape(Ellipsoid(tuple(radii)), T), camera, 20_000)[1][:, :2]
    errors = []
    for subdivisions in (2, 3, 4):
        pixels = samples_of(single_shape(round_mesh(radii, subdivisions), T), camera)[1]
        errors.append(distances(pixels[:, :2], exact).max())
    assert errors[0] > 3.0 * errors[1] > 9.0 * errors[2]
    assert errors[2] < 0.1


def two_shapes(first, second, T):
    model = ArticulatedModel(
        "two", KinematicChain(("base",), ()), (Shape("a", "base", first), Shape("b", "base", second, T))
    )  # fmt: skip
    return Configuration(model, State.neutral(model))


@pytest.mark.parametrize("front", ["box", "torus", "cone", "half pipe"])
@pytest.mark.parametrize("back", ["box", "cone", "torus"])
def test_shapes_hide_each_other_as_in_depth_images(renderer, front, back):
    """A sample that is seen shows its own shape within two pixels inwards; one of the outline has background outwards."""
    rng = np.random.default_rng(3)
    T = random_pose(rng, 0.0)
    T[:3, 3] = 0.3, 0.05, -0.02
    configuration = two_shapes(SHAPES[back], SHAPES[front], T)
    camera = look_at((0.9, 0.1, 0.2), (0.0, 0.0, 0.0), LENS)
    labels = renderer.render_view(configuration, camera).labels
    _, pixels, info = samples_of(configuration, camera)

    def shown(distance, who):
        u, v = np.rint(pixels[who, :2] + distance * pixels[who, 3:5]).astype(int).T
        inside = (u >= 0) & (v >= 0) & (u < 320) & (v < 240)
        return labels[v[inside], u[inside]], who[inside]

    who = np.arange(len(pixels))
    inwards, kept = shown(-1.5, who[info[:, BEYOND] != info[:, SHAPE]])
    assert (inwards == info[kept, SHAPE] + 1).mean() > 0.93
    outwards, kept = shown(1.5, who[info[:, CLASS] == OUTER])
    assert (outwards == 0).mean() > 0.93
    outwards, kept = shown(1.5, who[(info[:, CLASS] == INNER) & (info[:, BEYOND] != info[:, SHAPE])])
    if len(kept) > 10:
        assert (outwards == info[kept, BEYOND] + 1).mean() > 0.8
    assert (info[:, SHAPE] == 1).sum() > 30


def naive_first_hit(mesh, origin, direction):
    """Every triangle in turn, by solving for the barycentric coordinates."""
    found = [NO_HIT]
    for a, b, c in mesh.vertices[mesh.faces]:
        system = np.column_stack([b - a, c - a, -direction])
        if abs(np.linalg.det(system)) > 1e-15:
            u, v, t = np.linalg.solve(system, origin - a)
            if min(u, v, 1.0 - u - v) >= 0.0 and t > 0.0:
                found.append(t)
    return min(found)


@pytest.mark.parametrize("name", ["box", "torus", "half pipe", "icosahedron"])
def test_lines_of_sight_meet_a_solid_where_they_meet_its_first_triangle(name):
    shape, rng = SHAPES[name], np.random.default_rng(8)
    mesh = box_mesh(shape) if isinstance(shape, Box) else shape
    surfaces = ShapeArrays.from_model(single_shape(shape).model).surfaces
    hits = 0
    for _ in range(12):
        T, center = random_pose(rng), rng.normal(size=3) + np.array([0.0, 0.0, 1.0])
        direction = T[:3, 3] + rng.normal(size=3) * 0.06 - center
        t = solid_hit(surfaces, 0, T, center, *direction, NO_HIT, False)
        expected = naive_first_hit(mesh, se3.apply(se3.inverse(T), center[None])[0], direction @ T[:3, :3])
        hits += expected < NO_HIT
        assert t == pytest.approx(expected, rel=1e-6)
    assert hits >= 4


def test_solids_know_what_they_are():
    box = solid_of(SHAPES["box"])
    assert (len(box.edges), box.closed, box.convex) == (12, True, True)
    ring = solid_of(torus())
    assert ring.closed and not ring.convex
    pipe = solid_of(half_pipe())
    assert not pipe.closed and not pipe.convex
    inside_out = icosahedron(0.1)
    solid = solid_of(Mesh(inside_out.vertices, inside_out.faces[:, ::-1]))
    assert solid.closed and solid.convex and len(solid.edges) == 30


def test_a_closed_mesh_may_come_in_pieces_as_from_stl():
    whole = icosahedron(0.1)
    loose = Mesh(whole.vertices[whole.faces].reshape(-1, 3), np.arange(60).reshape(20, 3))
    assert np.allclose(np.sort(solid_of(loose).edges, axis=0), np.sort(solid_of(whole).edges, axis=0), atol=1e-8)


def test_no_contour_from_inside_a_box():
    rows = contour_points(ShapeArrays.from_model(single_shape(SHAPES["box"]).model), np.eye(4)[None], 0, np.zeros(3), 5)
    assert len(rows) == 0



@pytest.mark.parametrize("name", ["box", "cone", "icosahedron"])
def test_chords_end_at_the_other_side_of_the_mask(renderer, name):
    configuration = single_shape(SHAPES[name], random_pose(np.random.default_rng(1)))
    camera = look_at((0.5, 0.5, 0.3), (0.0, 0.0, 0.0), LENS)
    rows, pixels, info = samples_of(configuration, camera)
    mask = renderer.render_view(configuration, camera).labels > 0
    packed = camera_constants(camera)
    shapes, reach, off = ShapeArrays.from_model(configuration.model).packed, 64.0, []
    chords = np.empty((len(rows), 2))
    chords_px(shapes, configuration.Ts_world_shape, packed, rows, pixels, info, len(rows), reach, chords)
    for pixel, chord in zip(pixels[info[:, CLASS] == OUTER], chords[info[:, CLASS] == OUTER, 0], strict=True):
        t = np.arange(2.0, reach, 0.25)
        u, v = np.rint(pixel[:2] - t[:, None] * pixel[3:5]).astype(int).T
        beyond = ~mask[v, u]
        off.append(chord - (t[np.argmax(beyond)] if beyond.any() else reach))
    assert np.median(np.abs(off)) < reach / 16 and np.quantile(np.abs(off), 0.9) < reach / 8
