"""Triangle meshes from and to files (every format that trimesh reads: STL, PLY, OBJ, OFF, glTF ...)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileFormatError
from ..model.primitives import Mesh


def read_mesh(file: str | Path, scale: float, referrer: str | Path, field: str) -> Mesh:
    """Mesh of a file, its coordinates times ``scale`` (1 for a file in metres, 0.001 for one in millimetres).

    Raises
    ------
    FileFormatError : naming ``referrer`` and ``field``, where the file is asked for.
    """
    import trimesh  # slow to import, and few models have meshes

    file = Path(file)
    if not file.is_file():
        raise FileFormatError(referrer, field, "an existing mesh file", str(file))
    try:
        # force="mesh" joins the parts of a scene; process=False keeps the vertices as they are
        loaded: Any = trimesh.load(file, force="mesh", process=False)
    except Exception as error:  # trimesh's readers raise whatever their parsers do
        raise FileFormatError(referrer, field, "a readable mesh", f"{file}: {error}") from None
    faces = np.asarray(getattr(loaded, "faces", np.zeros((0, 3))))
    if len(faces) == 0:
        raise FileFormatError(referrer, field, "a mesh with triangles", str(file))
    vertices = np.asarray(loaded.vertices, dtype=np.float64) * scale
    if not np.all(np.isfinite(vertices)):
        raise FileFormatError(referrer, field, "finite vertices", str(file))
    return Mesh(vertices, faces)


def write_mesh(mesh: Mesh, file: str | Path) -> None:
    """Write an OBJ file with every digit of the vertices (metres)."""
    lines = [f"v {float(x)!r} {float(y)!r} {float(z)!r}" for x, y, z in mesh.vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces]
    file = Path(file)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
