"""Meshes written and read again: which format, and every line of it."""

import cv2
import numpy as np
import pytest

from tracker_node.errors import FileFormatError
from tracker_node.loaders.model.mesh_file import read_mesh, read_texture, write_mesh, write_texture
from tracker_node.model.shapes.primitives import Mesh

VERTICES = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 1.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3]])
VERTEX_COLORS = np.array([[255, 0, 51], [0, 0, 0], [255, 255, 255], [102, 0, 0]])
FACE_COLORS = np.array([[1, 2, 3], [4, 5, 6]])
UV = np.arange(12.0).reshape(2, 3, 2) / 16.0
TEXTURE = np.zeros((4, 4, 3), np.uint8)
NORMALS = np.tile([0.0, 0.0, 1.0], (4, 1))


def mesh(**fields):
    return Mesh(VERTICES, FACES, **fields)


@pytest.mark.parametrize(
    ("fields", "suffix"),
    [
        ({}, ".obj"), ({"face_colors_rgb": FACE_COLORS}, ".ply"), ({"vertex_colors_rgb": VERTEX_COLORS}, ".obj"),
        ({"face_colors_rgb": FACE_COLORS, "vertex_colors_rgb": VERTEX_COLORS}, ".obj"),
        ({"face_colors_rgb": FACE_COLORS, "uv": UV, "texture": TEXTURE}, ".obj"), ({"uv": UV, "texture": TEXTURE}, ".obj"),
    ],
)  # fmt: skip
def test_only_colors_of_faces_alone_need_another_format(tmp_path, fields, suffix):
    assert write_mesh(mesh(**fields), tmp_path / "new/a.b") == tmp_path / f"new/a.b{suffix}"


def test_plain_meshes_have_vertices_and_faces_from_one_on(tmp_path):
    lines = write_mesh(mesh(), tmp_path / "a").read_text().splitlines()
    assert lines == ["v 0.0 0.0 0.0", "v 1.0 0.0 0.0", "v 0.0 0.1 0.0", "v 0.0 0.0 1.0", "f 1 3 2", "f 1 2 4"]


def test_colors_of_vertices_are_shares_of_one(tmp_path):
    lines = write_mesh(mesh(vertex_colors_rgb=VERTEX_COLORS), tmp_path / "a").read_text().splitlines()
    assert lines[0] == "v 0.0 0.0 0.0 1.0 0.0 0.2"
    assert lines[3] == "v 0.0 0.0 1.0 0.4 0.0 0.0"


def test_textures_have_a_material_and_corners_of_their_own(tmp_path):
    textured = mesh(uv=UV, texture=TEXTURE, vertex_colors_rgb=VERTEX_COLORS)
    lines = write_mesh(textured, tmp_path / "a").read_text().splitlines()
    assert lines[:2] == ["mtllib a.mtl", "v 0.0 0.0 0.0"]
    assert [line for line in lines if line.startswith("vt")] == [f"vt {u!r} {v!r}" for u, v in UV.reshape(-1, 2).tolist()]
    assert lines[-3:] == ["usemtl surface", "f 1/1 3/2 2/3", "f 1/4 2/5 4/6"]
    assert (tmp_path / "a.mtl").read_text() == "newmtl surface\nKd 1 1 1\nmap_Kd a.png\n"
    assert (tmp_path / "a.png").exists()


def test_normals_are_by_vertex(tmp_path):
    lines = write_mesh(mesh(normals=NORMALS), tmp_path / "a").read_text().splitlines()
    assert lines[4:8] == ["vn 0.0 0.0 1.0"] * 4
    assert lines[-1] == "f 1//1 2//2 4//4"
    both = write_mesh(mesh(normals=NORMALS, uv=UV, texture=TEXTURE), tmp_path / "b").read_text().splitlines()
    assert both[-1] == "f 1/4/1 2/5/2 4/6/4"


def test_colors_of_faces_are_in_a_ply(tmp_path):
    lines = write_mesh(mesh(face_colors_rgb=FACE_COLORS, normals=NORMALS), tmp_path / "a").read_text().splitlines()
    end = lines.index("end_header")
    names = [line.split()[-1] for line in lines[:end] if line.startswith("property")]
    assert names == ["x", "y", "z", "nx", "ny", "nz", "vertex_indices", "red", "green", "blue"]
    assert "element vertex 4" in lines
    assert "element face 2" in lines
    assert lines[end + 2] == "1.0 0.0 0.0 0.0 0.0 1.0"
    assert lines[end + 5 :] == ["3 0 2 1 1 2 3", "3 0 1 3 4 5 6"]


PICTURE = np.random.default_rng(0).integers(0, 256, (4, 6, 3), dtype=np.uint8)


@pytest.mark.parametrize("end", ["2 0 0", "0.1 0.1 0.1"])
def test_triangles_without_an_area_are_no_mesh(tmp_path, end):
    """A body of them was LOST throughout, and nothing said why."""
    file = tmp_path / "line.obj"
    file.write_text(f"v 0 0 0\nv {end}\nv {' '.join(str(float(v) / 3) for v in end.split())}\nf 1 2 3\n")
    with pytest.raises(FileFormatError, match=r"'shapes\.rod\.file'.*an area, got 'only lines and points in .*line\.obj'"):
        read_mesh(file, 1.0, "model.yaml", "shapes.rod.file")
    file.write_text("v 0 0 0\nv 1 0 0\nv 0.5 0.00001 0\nf 1 2 3\nf 1 1 2\n")
    assert len(read_mesh(file, 0.001, "model.yaml", "shapes.rod.file").faces) == 2


def test_a_picture_is_there_and_back(tmp_path):
    write_texture(PICTURE, tmp_path / "a.png")
    np.testing.assert_array_equal(read_texture(tmp_path / "a.png", "m.yaml", "texture"), PICTURE)
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / "a.png"))[..., ::-1], PICTURE)  # red first, blue last


def test_gray_is_read_as_three_alike(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), PICTURE[..., 0])
    found = read_texture(tmp_path / "a.png", "m.yaml", "texture")
    assert found.shape == (4, 6, 3)
    for channel in range(3):
        np.testing.assert_array_equal(found[..., channel], PICTURE[..., 0])


@pytest.mark.parametrize(
    ("picture", "got"),
    [(np.zeros((3, 4, 4), np.uint8), "4 channels of 8 bits"), (np.zeros((3, 4, 3), np.uint16), "3 channels of 16 bits"),
     (np.zeros((3, 4), np.uint16), "3 channels of 16 bits")],
)  # fmt: skip
def test_other_pictures_are_refused(tmp_path, picture, got):
    cv2.imwrite(str(tmp_path / "a.png"), picture)
    with pytest.raises(FileFormatError, match=f"m.yaml.*texture.*{got}"):
        read_texture(tmp_path / "a.png", "m.yaml", "texture")


def test_files_that_are_none(tmp_path):
    with pytest.raises(FileFormatError, match="an existing texture"):
        read_texture(tmp_path / "a.png", "m.yaml", "texture")
    (tmp_path / "a.png").write_text("no texture")
    with pytest.raises(FileFormatError, match="a readable texture"):
        read_texture(tmp_path / "a.png", "m.yaml", "texture")
