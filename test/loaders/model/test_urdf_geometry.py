"""Shapes and colors of a link of a robot description, and what is refused."""

import numpy as np
import pytest

from tracker_node.errors import FileFormatError
from tracker_node.loaders.model.urdf import read_materials, read_shapes
from tracker_node.loaders.model.urdf_xml import read_robot
from tracker_node.model.shapes.primitives import Box, Ellipsoid, TruncatedCone

COLLADA = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>{unit}<up_axis>{up}</up_axis></asset>
<library_effects><effect id="paint"><profile_COMMON><technique sid="common"><lambert>
<diffuse><color>1 0 0 1</color></diffuse></lambert></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="red"><instance_effect url="#paint"/></material></library_materials>
<library_geometries><geometry id="tip"><mesh>
<source id="places"><float_array id="numbers" count="12">0 0 0 100 0 0 0 200 0 0 0 300</float_array><technique_common>
<accessor source="#numbers" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<source id="ways"><float_array id="more" count="12">0 0 -1 1 0 0 0 1 0 0 0 1</float_array><technique_common>
<accessor source="#more" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="corners"><input semantic="POSITION" source="#places"/></vertices>
<triangles count="4" material="m"><input semantic="VERTEX" source="#corners" offset="0"/>
<input semantic="NORMAL" source="#ways" offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="all"><node><instance_geometry url="#tip"><bind_material><technique_common>
<instance_material symbol="m" target="#red"/></technique_common></bind_material></instance_geometry></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#all"/></scene></COLLADA>"""
STEEL = '<material name="steel"><color rgba="0.2 0.4 0.6 1"/></material>'
GRAY = (180, 180, 180)
BOX = '<box size="1 2 3"/>'


def shapes(folder, inside: str, outside: str = STEEL, kind: str = "visual"):
    path = folder / "arm.urdf"
    path.write_text(f'<robot name="arm">{outside}<link name="base">{inside}</link></robot>')
    robot = read_robot(path)
    return read_shapes(robot.all("link")[0], kind, read_materials(robot))


def visual(geometry: str, more: str = "", name: str = "") -> str:
    return f"<visual{name}><geometry>{geometry}</geometry>{more}</visual>"


def test_simple_shapes(tmp_path):
    box, ball, egg, tube = shapes(
        tmp_path,
        visual(BOX, '<origin xyz="1 2 3"/>')
        + visual('<sphere radius="0.5"/>', name=' name="ball"')
        + visual('<ellipsoid radii="1 2 3"/>')
        + visual('<cylinder radius="0.5" length="4"/>'),
    )
    assert (box.name, ball.name, tube.name, box.link) == ("base", "ball", "base", "base")
    assert box.primitive == Box((1.0, 2.0, 3.0)) and box.T_link_shape[:3, 3].tolist() == [1.0, 2.0, 3.0]
    assert ball.primitive == Ellipsoid((0.5, 0.5, 0.5)) and egg.primitive == Ellipsoid((1.0, 2.0, 3.0))
    assert tube.primitive == TruncatedCone(0.5, 0.5, 0.0, -2.0, 2.0) and np.array_equal(tube.T_link_shape, np.eye(4))


def test_a_capsule_is_a_tube_with_two_balls(tmp_path):
    found = shapes(tmp_path, visual('<capsule radius="0.5" length="4"/>', '<origin xyz="1 0 0"/>', ' name="arm"'))
    assert [shape.name for shape in found] == ["arm", "arm_top", "arm_bottom"]
    assert [shape.T_link_shape[:3, 3].tolist() for shape in found] == [[1, 0, 0], [1, 0, 2], [1, 0, -2]]
    assert found[0].primitive == TruncatedCone(0.5, 0.5, 0.0, -2.0, 2.0)
    assert found[1].primitive == found[2].primitive == Ellipsoid((0.5, 0.5, 0.5))


def test_colors(tmp_path):
    paint = '<material name="paint"><color rgba="1 0 0.5 0"/></material>'
    textured = '<material name="photo"><texture filename="a.png"/></material>'
    materials = ('<material name="steel"/>', "", paint, '<material name="paint"/>', textured)
    found = shapes(tmp_path, "".join(visual(BOX, material) for material in materials))
    assert [shape.color_rgb for shape in found] == [(51, 102, 153), GRAY, (255, 0, 128), (255, 0, 128), GRAY]


def test_visible_and_solid_shapes_are_told_apart(tmp_path):
    inside = visual(BOX) + '<collision><geometry><sphere radius="9"/></geometry></collision>'
    assert [type(shape.primitive) for shape in shapes(tmp_path, inside)] == [Box]
    assert [type(shape.primitive) for shape in shapes(tmp_path, inside, kind="collision")] == [Ellipsoid]


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        (visual('<box size="1 0 3"/>'), r"box.size': expected 3 positive numbers \(meters\), got '1 0 3'"),
        (visual('<ellipsoid radii="1 2 0"/>'), r"ellipsoid.radii': expected 3 positive numbers \(meters\), got '1 2 0'"),
        (visual('<sphere radius="0"/>'), r"sphere.radius': expected a positive number"),
        (visual('<cylinder radius="1" length="0"/>'), r"cylinder.length': expected a positive number"),
        (visual('<mesh filename="a.stl" scale="1 0 1"/>'), r"mesh.scale': expected 3 numbers other than zero, got '1 0 1'"),
        (visual(""), r"geometry': expected one of <box>, <cylinder>, .*, got 'nothing'"),
        (visual(BOX + BOX), r"geometry': expected one of .*, got '<box>, <box>'"),
        (visual(BOX + "<cone/>"), r"geometry': expected one of .*, got '<box>, <cone>'"),
        (visual(BOX, '<material name="gold"/>'), r"material': expected a material with a color, one of \['steel'\], got 'gold'"),
        (visual(BOX, '<material><color rgba="1 1.1 0 1"/></material>'), r"rgba': expected 4 numbers of 0..1, got '1 1.1 0 1'"),
        (visual(BOX, '<material><color rgba="0 -0.1 0 1"/></material>'), r"rgba': expected 4 numbers of 0..1"),
        (visual('<mesh filename="http://a/b.stl"/>'), r"mesh.filename': expected a path, file:// or package://"),
        (visual('<mesh filename="package://none/b.stl"/>'), r"mesh.filename': expected a file of the package 'none', beside"),
    ],
)
def test_refusals(tmp_path, inside, said):
    with pytest.raises(FileFormatError, match=said):
        shapes(tmp_path, inside)


def test_meshes_scaled_and_in_a_mirror(tmp_path):
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    (tmp_path / "a.off").write_text("OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n")
    for name in ("a.off", f"file://{tmp_path}/a.off", f"package://{tmp_path.name}/a.off", f"model://{tmp_path.name}/a.off"):
        plain, mirrored, two = (
            shapes(tmp_path, visual(f'<mesh filename="{name}" {scale}/>'))[0].primitive
            for scale in ("", 'scale="2 3 -4"', 'scale="-1 -1 1"')
        )
        assert plain.vertices == pytest.approx(corners) and np.array_equal(plain.faces, faces)
        assert mirrored.vertices == pytest.approx(corners * [2.0, 3.0, -4.0]) and np.array_equal(mirrored.faces, faces[:, ::-1])
        assert np.array_equal(two.faces, faces)


@pytest.mark.parametrize(("unit", "scale"), [('<unit name="millimeter" meter="0.001"/>', 0.001), ("", 1.0)])
@pytest.mark.parametrize("up", ["Y_UP", "Z_UP"])
def test_collada_in_its_unit_and_as_robots_use_it_whatever_is_up(tmp_path, unit, scale, up):
    (tmp_path / "tip.dae").write_text(COLLADA.format(unit=unit, up=up))
    found = shapes(tmp_path, visual('<mesh filename="tip.dae"/>'))[0].primitive
    corners = scale * np.array([[0.0, 0, 0], [100, 0, 0], [0, 200, 0], [0, 0, 300]])
    assert np.unique(found.vertices, axis=0) == pytest.approx(np.unique(corners, axis=0))
    tip = np.argmax(found.vertices[:, 2])
    assert found.normals is not None and found.normals[tip] == pytest.approx([0.0, 0.0, 1.0])
    assert found.vertex_colors_rgb is not None and found.vertex_colors_rgb[0].tolist() == [255, 0, 0]
