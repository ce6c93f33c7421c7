"""The room of synthetic scenes: closed, furnished along its walls, seen from inside, the same for the same seed."""

import numpy as np
import pytest

from tracker_node.synthesis.scenes.room import HALF_SIZE, HEIGHT, meshes, quad

ROOM = meshes(3)
FLOOR, CEILING, WALLS, FURNITURE = ROOM[0], ROOM[1], ROOM[2:6], ROOM[6:]


def normal_of(mesh):
    """Of its first face, by the right hand."""
    a, b, c = mesh.vertices[mesh.faces[0]]
    normal = np.cross(b - a, c - a)
    return normal / np.linalg.norm(normal)


def test_floor_ceiling_and_walls_close_the_room():
    s = HALF_SIZE
    for mesh, z in ((FLOOR, 0.0), (CEILING, HEIGHT)):
        assert np.all(mesh.vertices[:, 2] == z)
        assert sorted(map(tuple, mesh.vertices[:, :2].tolist())) == [(-s, -s), (-s, s), (s, -s), (s, s)]
    middles = {tuple(np.round(wall.vertices.mean(axis=0), 9).tolist()) for wall in WALLS}
    assert middles == {(s, 0.0, HEIGHT / 2), (-s, 0.0, HEIGHT / 2), (0.0, s, HEIGHT / 2), (0.0, -s, HEIGHT / 2)}
    for wall in WALLS:
        assert np.ptp(wall.vertices[:, 2]) == HEIGHT


def test_everything_faces_inside_but_furniture_outside():
    inside = np.array([0.0, 0.0, HEIGHT / 2])
    for mesh in (FLOOR, CEILING, *WALLS):
        assert normal_of(mesh) @ (inside - mesh.vertices.mean(axis=0)) > 0.0
    for i in range(0, len(FURNITURE), 5):
        box = FURNITURE[i : i + 5]  # four sides and the top
        middle = np.concatenate([side.vertices for side in box]).mean(axis=0)
        for side in box:
            assert normal_of(side) @ (side.vertices.mean(axis=0) - middle) > 0.0
        assert normal_of(box[4])[2] == pytest.approx(1.0)


def test_furniture_stands_on_the_floor_along_the_walls():
    assert len(FURNITURE) == 5 * 8
    for i in range(0, len(FURNITURE), 5):
        corners = np.concatenate([side.vertices for side in FURNITURE[i : i + 5]])
        low, high = corners.min(axis=0), corners.max(axis=0)
        assert low[2] == 0.0
        assert 0.5 < high[2] < HEIGHT
        assert np.all(np.abs(corners[:, :2]) < HALF_SIZE)
        assert np.abs(0.5 * (low + high)[:2]).max() == pytest.approx(5.0)  # its middle, near a wall
        assert 0.4 < (high - low)[:2].min() <= (high - low)[:2].max() < 2.1


def test_a_quad_has_its_texture_upright():
    mesh = quad([(0, 0, 0), (2, 0, 0), (2, 0, 1), (0, 0, 1)], np.zeros((4, 4, 3), np.uint8))
    assert mesh.uv.tolist() == [[0, 0], [1, 0], [1, 1], [0, 1]]
    faces = mesh.vertices[mesh.faces]
    areas = 0.5 * np.linalg.norm(np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]), axis=1)
    assert areas.tolist() == [1.0, 1.0]


def test_textures_look_like_wood_plaster_and_walls():
    assert FLOOR.texture.reshape(-1, 3).mean(axis=0) == pytest.approx([160, 125, 88], abs=6)
    assert CEILING.texture.reshape(-1, 3).mean(axis=0) == pytest.approx([236, 234, 228], abs=2)
    assert 3.0 < CEILING.texture.std(axis=(0, 1)).mean() < 6.0
    for wall in WALLS:
        board = wall.texture[-34:]  # eleven centimeters of 3.2 meters
        assert (np.all(board == (120, 104, 88), axis=2).mean() > 0.8)
        assert not np.all(wall.texture[:-36] == (120, 104, 88), axis=2).any()


def test_walls_have_windows_and_doors_in_turn():
    """In meters of the wall: two windows, 1.7 by 1.5; a door, 1 by 2.1."""
    size = HALF_SIZE * 2.0 * HEIGHT
    for i, wall in enumerate(WALLS):
        frame = np.all(wall.texture == (240, 240, 236), axis=2).mean() * size
        panes = sum(np.all(wall.texture == color, axis=2).mean() for color in ((176, 200, 222), (168, 194, 220))) * size
        door = sum(np.all(wall.texture == color, axis=2).mean() for color in ((112, 84, 62), (140, 106, 78))) * size
        if i % 2 == 0:
            assert door == 0.0
            assert 0.6 < panes <= 4 * 0.75 * 1.36 + 0.1  # less what pictures hide
            assert 0.0 < frame <= 2 * (1.7 * 1.5 - 2 * 0.75 * 1.36) + 0.1
        else:
            assert frame == panes == 0.0
            assert 0.8 < door <= 2.15


def test_the_seed_makes_the_room():
    again, other = meshes(3), meshes(4)
    assert all(np.array_equal(a.texture, b.texture) for a, b in zip(ROOM, again, strict=True))
    assert not np.array_equal(ROOM[0].texture, other[0].texture)
    assert all(np.array_equal(a.vertices, b.vertices) for a, b in zip(ROOM, other, strict=True))
