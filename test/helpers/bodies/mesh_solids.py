"""Triangle meshes of known solids, and brute force to tell what is inside of one."""

import numpy as np
import trimesh

from tracker_node.model.shapes.primitives import Mesh


def joined(*parts: trimesh.Trimesh) -> Mesh:
    """One mesh of closed parts that may run through each other, as those of robots do."""
    whole = trimesh.util.concatenate(parts)
    return Mesh(whole.vertices, whole.faces)


def box(size, at=(0.0, 0.0, 0.0), longest: float = 0.05) -> trimesh.Trimesh:
    """A box whose triangles are no longer than ``longest``."""
    made = trimesh.creation.box(size).subdivide_to_size(longest)
    return made.apply_translation(at)


def rod(radius: float, start, end, longest: float = 0.07) -> trimesh.Trimesh:
    """A cylinder from point to point."""
    return trimesh.creation.cylinder(radius, segment=np.array([start, end]), sections=20).subdivide_to_size(longest)


def ball(radii, subdivisions: int = 3) -> trimesh.Trimesh:
    made = trimesh.creation.icosphere(subdivisions=subdivisions)
    return made.apply_scale(radii)


def cone(radius: float, top_radius: float, height: float) -> trimesh.Trimesh:
    outline = [[0.0, 0.0], [radius, 0.0], [top_radius, height], [0.0, height]]
    return trimesh.creation.revolve(outline, sections=24).subdivide_to_size(0.08)


def solid_angles(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """Of all triangles as seen from each point (van Oosterom & Strackee 1983): 4 pi within each closed part, 0 outside."""
    result = np.empty(len(points))
    for at in range(0, len(points), 200):
        a, b, c = (mesh.vertices[mesh.faces[:, i]] - points[at : at + 200, None] for i in range(3))
        la, lb, lc = (np.linalg.norm(x, axis=2) for x in (a, b, c))
        ab, bc, ca = (np.einsum("pfi,pfi->pf", x, y) for x, y in ((a, b), (b, c), (c, a)))
        triple = np.einsum("pfi,pfi->pf", a, np.cross(b, c))
        result[at : at + 200] = 2.0 * np.arctan2(triple, la * lb * lc + ab * lc + bc * la + ca * lb).sum(axis=1)
    return result


def is_inside(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    return solid_angles(mesh, points) > 2.0 * np.pi


def outer_vertices(mesh: Mesh) -> np.ndarray:
    """Vertices (n, 3) that are not within another part of the mesh."""
    return mesh.vertices[solid_angles(mesh, mesh.vertices) < 3.5 * np.pi]
