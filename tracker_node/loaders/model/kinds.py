"""Which kind of file a body is in: a robot description or a model.yaml; those of other programs are refused by what they are."""

from __future__ import annotations

import re
from pathlib import Path

from ...errors import WrongKindOfFileError
from ..whole_file import MEDIA_BYTES, check_regular, read_text

_MESHES = (".obj", ".stl", ".ply", ".glb", ".gltf", ".dae", ".off", ".3mf")
_BEGINNINGS = {
    "<mujoco": "a MuJoCo model", "<sdf": "an SDF model", "<OpenSimDocument": "an OpenSim model", "HIERARCHY": "a BVH file",
}  # fmt: skip
_BEFORE_ROOT = re.compile(r"(?:\s|\ufeff|<\?.*?\?>|<!--.*?-->|<!DOCTYPE[^>]*>)*", re.DOTALL)


def is_robot(path: str | Path) -> bool:
    """True for a robot description (URDF), by suffix or content.

    Raises
    ------
    WrongKindOfFileError : a mesh, or a model of another program.
    FileFormatError : a file that cannot be read.
    """
    file = Path(path)
    if file.suffix.lower() in (".urdf", ".xacro"):
        return True
    if file.suffix.lower() in _MESHES:
        check_regular(path, MEDIA_BYTES)
        body = f"a body; in a model.yaml it belongs under shapes, as `type: mesh, file: {file.name}`"
        raise WrongKindOfFileError(path, "a mesh", body)
    text = read_text(path)
    start = text[_BEFORE_ROOT.match(text).end() :]  # type: ignore[union-attr]
    for beginning, kind in _BEGINNINGS.items():
        if start.startswith(beginning):
            raise WrongKindOfFileError(path, kind, "a body (a model.yaml or a URDF)")
    return start.startswith("<robot")
