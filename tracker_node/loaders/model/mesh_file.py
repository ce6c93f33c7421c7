"""Triangle meshes with their colors and textures, from and to files (what trimesh reads: STL, PLY, OBJ, glTF, COLLADA ...)."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ...errors import FileFormatError
from ...model.shapes.primitives import Mesh
from ..decoding import decoded
from ..whole_file import MEDIA_BYTES, check_regular, read_bytes


def read_texture(file: str | Path, referrer: str | Path, field: str) -> np.ndarray:
    """Texture of a file; a gray one is read as gray RGB.

    Parameters
    ----------
    file, referrer, field : texture; file and field that ask for it, for messages.

    Returns
    -------
    (h, w, 3) uint8 RGB.

    Raises
    ------
    FileFormatError : naming ``referrer`` and ``field``.
    """
    file = Path(file)
    if not os.path.isfile(file):  # Path.is_file raises for a name that is too long
        raise FileFormatError(referrer, field, "an existing texture", str(file))
    picture = decoded(read_bytes(file, MEDIA_BYTES), cv2.IMREAD_UNCHANGED)
    if picture is None:
        raise FileFormatError(referrer, field, "a readable texture (PNG, JPEG, ...)", str(file))
    if picture.ndim == 2:
        picture = np.repeat(picture[:, :, None], 3, axis=2)
    if picture.dtype != np.uint8 or picture.shape[2] != 3:
        got = f"{picture.shape[2]} channels of {8 * picture.dtype.itemsize} bits in {file}"
        raise FileFormatError(referrer, field, "a texture of 1 or 3 channels of 8 bits", got)
    return np.ascontiguousarray(picture[:, :, ::-1])


def write_texture(picture: np.ndarray, file: str | Path) -> None:
    """Write a texture without loss, as PNG.

    Parameters
    ----------
    picture, file : (h, w, 3) uint8 RGB; PNG file.
    """
    ok, encoded = cv2.imencode(".png", np.ascontiguousarray(picture[:, :, ::-1]))
    if not ok:
        raise ValueError(f"expected a texture that PNG can hold, got {picture.shape}")
    Path(file).write_bytes(encoded.tobytes())


def read_mesh(file: str | Path, scale: float, referrer: str | Path, field: str, texture: np.ndarray | None = None) -> Mesh:
    """Mesh of a file, with colors of faces or vertices, texture and normals where the file has them.

    Parameters
    ----------
    file, scale : mesh; factor to meters (0.001 for a file in millimeters; COLLADA tells its own unit).
    referrer, field : file and field that ask for it, for messages.
    texture : (h, w, 3) uint8 RGB to put in the place of the file's own; the file must have texture coordinates.

    Returns
    -------
    Mesh in meters.

    Raises
    ------
    FileFormatError : naming ``referrer`` and ``field``.
    """
    import trimesh  # slow to import, and few models have meshes

    file = Path(file)
    if not os.path.isfile(file):  # Path.is_file raises for a name that is too long
        raise FileFormatError(referrer, field, "an existing mesh file", str(file))
    check_regular(file, MEDIA_BYTES)
    if file.suffix.lower() == ".obj" and texture is None:
        _check_materials(file, referrer, field)
    try:
        # process=False keeps the vertices as they are
        scene: Any = trimesh.load_scene(file, process=False)
        if file.suffix.lower() == ".dae":  # tells its unit; what is up in it does not count for robots
            scale *= trimesh.units.unit_conversion(scene.units, "meters")
        loaded: Any = scene.to_mesh()
    except Exception as error:  # trimesh's readers raise whatever their parsers do
        told = str(error) if isinstance(error, (ValueError, OSError)) else f"its reader fails ({type(error).__name__}: {error})"
        raise FileFormatError(referrer, field, "a readable mesh", f"{file}: {told}") from None
    faces = np.asarray(getattr(loaded, "faces", np.zeros((0, 3))))
    if len(faces) == 0:
        raise FileFormatError(referrer, field, "a mesh with triangles", str(file))
    vertices = np.asarray(loaded.vertices, dtype=np.float64) * scale
    if not np.all(np.isfinite(vertices)):
        raise FileFormatError(referrer, field, "finite vertices", str(file))
    surface = _surface(loaded, faces, texture) | _normals(scene, len(vertices))
    if texture is not None and "texture" not in surface:
        raise FileFormatError(referrer, field, "a mesh with texture coordinates, for its texture", str(file))
    try:
        mesh = Mesh(vertices, faces, **surface)
    except ValueError as error:  # corners with two coordinates, faces of corners that are not there
        raise FileFormatError(referrer, field, "a consistent mesh", f"{file}: {error}") from None
    if not _has_area(mesh):
        raise FileFormatError(referrer, field, "a mesh whose triangles have an area", f"only lines and points in {file}")
    return mesh


def _has_area(mesh: Mesh) -> bool:
    """Whether the corners of some triangle do not lie on one line, but for rounding."""
    extent = np.ptp(mesh.vertices, axis=0).max() or 1.0
    first, second = np.moveaxis(np.diff(mesh.vertices[mesh.faces] / extent, axis=1), 1, 0)
    return bool(np.abs(np.cross(first, second)).max() > 1e-9)


def _surface(loaded: Any, faces: np.ndarray, texture: np.ndarray | None) -> dict[str, np.ndarray]:
    """Fields of `Mesh` for what the file says of the surface."""
    surface: dict[str, np.ndarray] = {}
    visual = loaded.visual
    if visual.kind == "vertex":
        surface["vertex_colors_rgb"] = np.asarray(visual.vertex_colors)[:, :3]
    elif visual.kind == "face":
        surface["face_colors_rgb"] = np.asarray(visual.face_colors)[:, :3]
    elif visual.kind == "texture":
        picture = texture if texture is not None else _texture_of(visual.material)
        if picture is not None and visual.uv is not None and np.all(np.isfinite(visual.uv)):
            surface["texture"] = picture
            surface["uv"] = np.asarray(visual.uv, dtype=np.float64)[faces]
        elif picture is None:
            surface["vertex_colors_rgb"] = np.tile(np.asarray(visual.material.main_color)[:3], (len(loaded.vertices), 1))
    return surface


def _normals(scene: Any, n_vertices: int) -> dict[str, np.ndarray]:
    """Normals that the file gives for every vertex. trimesh forgets them when it joins the parts of a scene."""
    placed = (scene.graph[node] for node in scene.graph.nodes_geometry)
    parts = [(T, scene.geometry[name]) for T, name in placed if hasattr(scene.geometry[name], "faces")]
    # It would compute them on demand; those that a file has given lie where it would keep the computed ones.
    given = [(T, part._cache.cache.get("vertex_normals")) for T, part in parts]
    if any(normals is None for _, normals in given):
        return {}
    normals = np.concatenate([normals @ np.linalg.inv(T[:3, :3]) for T, normals in given])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    if len(normals) != n_vertices or not np.all(lengths > 0.0):
        return {}
    return {"normals": normals / lengths}


def _texture_of(material: Any) -> np.ndarray | None:
    picture = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    return None if picture is None else np.asarray(picture.convert("RGB"))


def _check_materials(file: Path, referrer: str | Path, field: str) -> None:
    """trimesh goes on without the material files and textures that an OBJ file names; we do not."""
    for library in _named_in(file, "mtllib"):
        if not os.path.isfile(library):
            raise FileFormatError(referrer, field, f"the material file that {file} names", f"no {library}")
        for picture in _named_in(library, "map_Kd"):
            if not os.path.isfile(picture):
                raise FileFormatError(referrer, field, f"the texture that {library} names", f"no {picture}")


def _named_in(file: Path, keyword: str) -> list[Path]:
    """Files named after ``keyword`` at the start of a line; options before the name are skipped."""
    lines = [line.split() for line in file.read_text(encoding="utf-8", errors="replace").splitlines()]
    return [file.parent / words[-1] for words in lines if len(words) > 1 and words[0] == keyword]


def write_mesh(mesh: Mesh, stem: Path) -> Path:
    """Write a mesh with every digit of its vertices.

    OBJ with colors of vertices or, beside it, material and texture; colors of faces go to a PLY file, since OBJ has none.

    Parameters
    ----------
    mesh, stem : in meters; path without its suffix.

    Returns
    -------
    Path of the file.
    """
    stem.parent.mkdir(parents=True, exist_ok=True)
    as_ply = mesh.face_colors_rgb is not None and mesh.texture is None and mesh.vertex_colors_rgb is None
    file = stem.with_name(stem.name + (".ply" if as_ply else ".obj"))
    lines = _ply_lines(mesh) if as_ply else _obj_lines(mesh, file)
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


def _obj_lines(mesh: Mesh, file: Path) -> list[str]:
    textured = mesh.texture is not None and mesh.uv is not None
    rows = mesh.vertices
    if mesh.vertex_colors_rgb is not None and not textured:
        rows = np.hstack([rows, mesh.vertex_colors_rgb / 255.0])
    lines = [_row("v", row) for row in rows]
    if mesh.normals is not None:
        lines += [_row("vn", row) for row in mesh.normals]
    if textured:
        picture = file.with_suffix(".png")
        write_texture(mesh.texture, picture)  # type: ignore[arg-type]
        file.with_suffix(".mtl").write_text(f"newmtl surface\nKd 1 1 1\nmap_Kd {picture.name}\n", encoding="utf-8")
        lines = [f"mtllib {file.with_suffix('.mtl').name}", *lines, *(_row("vt", row) for row in mesh.uv.reshape(-1, 2))]  # type: ignore[union-attr]
        lines.append("usemtl surface")
    for i, face in enumerate(mesh.faces + 1):
        corners = []
        for j, vertex in enumerate(face):
            uv = f"{3 * i + j + 1}" if textured else ""
            normal = f"/{vertex}" if mesh.normals is not None else ""
            corners.append(f"{vertex}/{uv}{normal}" if uv or normal else f"{vertex}")
        lines.append("f " + " ".join(corners))
    return lines


def _ply_lines(mesh: Mesh) -> list[str]:
    rows, names = mesh.vertices, ["x", "y", "z"]
    if mesh.normals is not None:
        rows, names = np.hstack([rows, mesh.normals]), [*names, "nx", "ny", "nz"]
    header = ["ply", "format ascii 1.0", f"element vertex {len(rows)}", *(f"property double {name}" for name in names)]
    header += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices"]
    header += [*(f"property uchar {name}" for name in ("red", "green", "blue")), "end_header"]
    faces = np.hstack([mesh.faces, mesh.face_colors_rgb])  # type: ignore[list-item]
    return header + [_row("", row).strip() for row in rows] + ["3 " + " ".join(str(v) for v in row) for row in faces.tolist()]


def _row(keyword: str, values: np.ndarray) -> str:
    return " ".join((keyword, *(repr(value) for value in values.tolist())))
