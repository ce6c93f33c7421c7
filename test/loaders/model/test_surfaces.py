"""Colors, pictures and lofted shapes of model files: they arrive, come back from a dump, and are missed by name."""

import cv2
import numpy as np
import pytest
import trimesh

from tracker_node.errors import FileFormatError
from tracker_node.loaders.model.model_yaml import dump_model, load_model
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.nurbs import Loft, LoftedSolid, Section, loft_mesh
from tracker_node.model.shapes.primitives import BOX_FACES, Box, Ellipsoid, Mesh

RNG = np.random.default_rng(0)
VERTICES = RNG.normal(size=(6, 3))
FACES = np.array([[0, 1, 2], [2, 3, 4], [4, 5, 0]])
NORMALS = VERTICES / np.linalg.norm(VERTICES, axis=1, keepdims=True)
PICTURE = RNG.integers(0, 256, (3, 5, 3), dtype=np.uint8)
SURFACES = {
    "plain": {},
    "vertex colors": {"vertex_colors_rgb": RNG.integers(0, 256, (6, 3))},
    "face colors": {"face_colors_rgb": RNG.integers(0, 256, (3, 3))},
    "texture": {"texture": PICTURE, "uv": RNG.random((3, 3, 2))},
}
BODY = "name: thing\nlinks: [base]\nshapes:\n  part: {link: base, %s}\n"
LOFT = (
    "type: lofted, sections: [{z: 0, half_x: 0.1, half_y: 0.2}, {z: 0.3, half_x: 0.2, half_y: 0.1, x: 0.01}], domes: [0.05, 0.1]"
)


def single(primitive, color=(1, 2, 3)):
    return ArticulatedModel("thing", KinematicChain(("base",), ()), (Shape("part", "base", primitive, np.eye(4), color),))


def there_and_back(primitive, folder):
    dump_model(single(primitive), folder / "m.yaml")
    return load_model(folder / "m.yaml").shapes[0].primitive


def load_part(folder, part):
    (folder / "m.yaml").write_text(BODY % part)
    return load_model(folder / "m.yaml").shapes[0]


def refused(folder, part, match):
    with pytest.raises(FileFormatError, match=match) as error:
        load_part(folder, part)
    assert str(folder / "m.yaml") in str(error.value)
    return error.value.field.removeprefix("shapes.part.")


@pytest.mark.parametrize("normals", [None, NORMALS], ids=["flat", "smooth"])
@pytest.mark.parametrize("kind", SURFACES)
def test_meshes_come_back_with_their_surface(tmp_path, kind, normals):
    mesh = Mesh(VERTICES, FACES, normals=normals, **SURFACES[kind])
    again = there_and_back(mesh, tmp_path)
    # Corner by corner: with a texture, vertices are split where faces of different coordinates meet.
    assert np.array_equal(again.vertices[again.faces], mesh.vertices[mesh.faces])
    for name in ("face_colors_rgb", "uv", "texture"):
        assert (getattr(again, name) is None) == (name not in SURFACES[kind])
        assert getattr(again, name) is None or np.array_equal(getattr(again, name), getattr(mesh, name))
    assert (again.vertex_colors_rgb is None) == (kind != "vertex colors")
    if kind == "vertex colors":
        assert np.array_equal(again.vertex_colors_rgb[again.faces], mesh.vertex_colors_rgb[mesh.faces])
    assert (again.normals is None) == (normals is None)
    if normals is not None:
        assert np.allclose(again.normals[again.faces], normals[FACES], atol=1e-12)


def test_boxes_come_back_with_colors_and_pictures(tmp_path):
    colors = RNG.integers(0, 256, (6, 3))
    box = Box((0.1, 0.2, 0.3), colors, (None, PICTURE, None, None, PICTURE[:2, :2], None))
    again = there_and_back(box, tmp_path)
    assert again == box
    assert np.array_equal(again.face_colors_rgb, colors)
    for picture, expected in zip(again.textures, box.textures, strict=True):
        assert np.array_equal(picture, expected) if expected is not None else picture is None


@pytest.mark.parametrize("fineness", [(), (20, 0.05)], ids=["default", "coarse"])
def test_lofted_solids_come_back(tmp_path, fineness):
    solid = loft_mesh(Loft((Section(-0.2, 0.05, 0.08), Section(0.1, 1 / 30, 0.04, 0.02, -0.01)), (0.02, 0.03)), *fineness)
    again = there_and_back(solid, tmp_path)
    assert isinstance(again, LoftedSolid)
    assert again.loft == solid.loft
    assert np.array_equal(again.vertices, solid.vertices)
    assert list(tmp_path.iterdir()) == [tmp_path / "m.yaml"]  # nothing beside the file


def test_faces_that_are_left_out_have_the_color_of_the_shape(tmp_path):
    part = load_part(tmp_path, 'type: box, size: [1, 2, 3], color_rgb: [9, 8, 7], face_colors_rgb: {"-y": [1, 2, 3]}')
    expected = np.tile([9, 8, 7], (6, 1))
    expected[BOX_FACES.index("-y")] = 1, 2, 3
    assert np.array_equal(part.primitive.face_colors_rgb, expected)


def test_pictures_are_red_green_blue_and_gray_ones_are_gray(tmp_path):
    cv2.imwrite(str(tmp_path / "red.png"), np.full((2, 2, 3), (0, 0, 255), np.uint8))
    cv2.imwrite(str(tmp_path / "gray.png"), np.full((2, 2), 77, np.uint8))
    part = load_part(tmp_path, 'type: box, size: [1, 2, 3], textures: {"+x": red.png, "+z": gray.png}')
    assert part.primitive.textures[0].tolist() == [[[255, 0, 0]] * 2] * 2
    assert part.primitive.textures[4].tolist() == [[[77, 77, 77]] * 2] * 2
    assert part.primitive.textures[1] is None


@pytest.mark.parametrize("suffix", ["ply", "glb", "obj"])
def test_colors_of_other_programs_files_arrive(tmp_path, suffix):
    """trimesh writes, we read."""
    colors = np.column_stack([RNG.integers(0, 256, (6, 3)), np.full(6, 255)]).astype(np.uint8)
    trimesh.Trimesh(VERTICES, FACES, vertex_colors=colors, process=False).export(tmp_path / f"a.{suffix}")
    mesh = load_part(tmp_path, f"type: mesh, file: a.{suffix}, scale: 2.0").primitive
    assert np.allclose(mesh.vertices[mesh.faces], 2.0 * VERTICES[FACES], atol=1e-5)
    assert np.array_equal(mesh.vertex_colors_rgb[mesh.faces], colors[FACES][..., :3])


def test_a_texture_in_a_glb_lies_as_in_the_picture(tmp_path):
    """Left to right is red to green, bottom to top dark to light; glTF counts v downward, a mesh of ours upward."""
    from PIL import Image

    picture = np.zeros((8, 8, 3), np.uint8)
    picture[:, 4:, 0], picture[:4, :, 1] = 255, 255  # right half red, upper half green
    visual = trimesh.visual.TextureVisuals(uv=np.array([[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]]), image=Image.fromarray(picture))
    trimesh.Trimesh(VERTICES[:3], FACES[:1], visual=visual, process=False).export(tmp_path / "a.glb")
    mesh = load_part(tmp_path, "type: mesh, file: a.glb").primitive
    seen = {}
    for corner, (u, v) in zip(mesh.vertices[mesh.faces[0]], mesh.uv[0], strict=True):
        height, width, _ = mesh.texture.shape
        pixel = mesh.texture[int((1.0 - v) * height), int(u * width)]
        seen[int(np.argmin(np.linalg.norm(VERTICES[:3] - corner, axis=1)))] = pixel.tolist()
    assert seen == {0: [0, 0, 0], 1: [255, 0, 0], 2: [0, 255, 0]}


def test_a_texture_may_be_put_in_the_place_of_the_files_own(tmp_path):
    dump_model(single(Mesh(VERTICES, FACES, **SURFACES["texture"])), tmp_path / "m.yaml")
    (tmp_path / "m_part.png").unlink()
    cv2.imwrite(str(tmp_path / "other.png"), np.full((4, 4, 3), (0, 0, 255), np.uint8))
    mesh = load_part(tmp_path, "type: mesh, file: m_part.obj, texture: other.png").primitive
    assert np.array_equal(mesh.texture, np.full((4, 4, 3), (255, 0, 0)))
    assert np.allclose(mesh.uv, SURFACES["texture"]["uv"])


def test_a_mesh_of_several_parts_keeps_its_normals(tmp_path):
    scene = trimesh.Scene()
    turned = np.array([[0, -1, 0, 1], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    for T in (np.eye(4), turned):
        scene.add_geometry(trimesh.Trimesh(VERTICES, FACES, vertex_normals=NORMALS, process=False), transform=T)
    scene.export(tmp_path / "a.glb", include_normals=True)
    mesh = load_part(tmp_path, "type: mesh, file: a.glb").primitive
    expected = [NORMALS, NORMALS @ turned[:3, :3].T]
    if not np.allclose(mesh.vertices[:6], VERTICES, atol=1e-6):  # a scene has no order
        expected.reverse()
    assert np.allclose(mesh.normals, np.vstack(expected), atol=1e-6)


PICTURES = {
    "none.png": None,
    "empty.png": b"",
    "text.png": b"no picture",
    "alpha.png": cv2.imencode(".png", np.zeros((4, 4, 4), np.uint8))[1].tobytes(),
    "deep.png": cv2.imencode(".png", np.zeros((4, 4, 3), np.uint16))[1].tobytes(),
}


@pytest.mark.parametrize("file", PICTURES)
def test_pictures_that_cannot_be_used_are_named(tmp_path, file):
    if PICTURES[file] is not None:
        (tmp_path / file).write_bytes(PICTURES[file])
    assert refused(tmp_path, f'type: box, size: [1, 2, 3], textures: {{"-z": {file}}}', file) == "textures.-z"


@pytest.mark.parametrize("gone", ["m_part.mtl", "m_part.png"])
def test_a_texture_that_an_obj_misses_is_named(tmp_path, gone):
    dump_model(single(Mesh(VERTICES, FACES, **SURFACES["texture"])), tmp_path / "m.yaml")
    (tmp_path / gone).unlink()
    with pytest.raises(FileFormatError, match=gone) as error:
        load_model(tmp_path / "m.yaml")
    assert error.value.field == "shapes.part.file"


def test_a_texture_for_a_mesh_without_coordinates_is_refused(tmp_path):
    dump_model(single(Mesh(VERTICES, FACES)), tmp_path / "m.yaml")
    cv2.imwrite(str(tmp_path / "a.png"), PICTURE)
    assert refused(tmp_path, "type: mesh, file: m_part.obj, texture: a.png", "texture coordinates") == "file"


@pytest.mark.parametrize(("part", "field", "match"), [
    ('type: box, size: [1, 2, 3], face_colors_rgb: {"x": [1, 2, 3]}', "face_colors_rgb", "face"),
    ('type: box, size: [1, 2, 3], face_colors_rgb: {"+x": [1, 2, 333]}', "face_colors_rgb.+x", "0..255"),
    ('type: box, size: [1, 2, 3], textures: {"top": a.png}', "textures", "face"),
    (LOFT.replace("half_y: 0.2", "half_y: 0"), "sections.0.half_y", "positive"),
    (LOFT.replace("z: 0.3", "z: 0"), "sections.1.z", "above the one before"),
    (LOFT.replace("domes: [0.05, 0.1]", "domes: [0.05]"), "domes", "2 positive"),
    (LOFT.replace(", domes: [0.05, 0.1]", ""), "domes", "a value"),
    (LOFT.replace("z: 0.3, ", "z: 0.3, q: 1, "), "sections.1.q", "one of"),
    (LOFT + ", vertices_around: 3", "vertices_around", "8"),
    (LOFT + ", ring_spacing: 0", "ring_spacing", "0.001"),
    (LOFT.replace("z: 0.3", "z: 1e12").replace("0.2", "1e-9").replace("0.1", "1e-9"), "sections", "a surface can go through"),
])  # fmt: skip
def test_shapes_that_make_no_sense_are_named(tmp_path, part, field, match):
    assert refused(tmp_path, part, match) == field


def test_bodies_whose_colors_nobody_stated_are_told_apart(tmp_path):
    assert not load_part(tmp_path, "type: ellipsoid, radii: [1, 1, 1]").has_color
    assert load_part(tmp_path, "type: ellipsoid, radii: [1, 1, 1], color_rgb: [1, 2, 3]").has_color
    assert load_part(tmp_path, 'type: box, size: [1, 1, 1], face_colors_rgb: {"+x": [1, 2, 3]}').has_color
    gray = Shape("gray", "base", Ellipsoid((1.0, 1.0, 1.0)))
    textured = Shape("mesh", "base", Mesh(VERTICES, FACES, **SURFACES["texture"]))
    chain = KinematicChain(("base",), ())
    assert not ArticulatedModel("a", chain, (gray, gray)).has_colors
    assert ArticulatedModel("a", chain, (gray, textured)).has_colors
