#!/usr/bin/env python3
"""How well round cones fill the meshes that they stand for when parts must not run into each other.

For meshes of known solids and the 18 segments of the measured body: the volume of the round cones as a fraction of the mesh's,
that of its convex hull likewise, how deep a vertex of the mesh is within a round cone (they should not stick out), how many there
are, and milliseconds to find them (once for a model). `capsules.body.*` are the mean and the worst of the segments.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull

from tracker_node.model.humans.segments18 import nurbs_human
from tracker_node.model.shapes.capsules import capsules_in_mesh
from tracker_node.model.shapes.primitives import Box, Ellipsoid, Mesh, Primitive, TruncatedCone, point_gaps
from tracker_node.render.opengl.tessellation import tessellate
from tracker_node.report.metrics_file import report_metrics

SOLIDS: dict[str, Primitive] = {
    "ball": Ellipsoid((0.1, 0.1, 0.1)),
    "hand": Ellipsoid((0.02, 0.05, 0.1)),
    "tube": TruncatedCone(0.05, 0.05, 0.0, -0.2, 0.3),
    "thigh": TruncatedCone(0.09, 0.08, -0.8, 0.0, 0.42),
    "trunk": TruncatedCone(0.1, 0.17, 0.5, -0.1, 0.4),
    "cube": Box((0.2, 0.2, 0.2)),
    "beam": Box((1.0, 0.1, 0.1)),
    "board": Box((0.5, 0.02, 0.3)),
}


def measure(points: int) -> dict[str, float]:
    """All figures, volumes counted with so many random points."""
    capsules_in_mesh(_mesh(SOLIDS["ball"]))  # compile
    metrics: dict[str, float] = {}
    for name, solid in SOLIDS.items():
        metrics |= {f"capsules.{name}.{key}": value for key, value in _figures(_mesh(solid), points).items()}
    rows = [_figures(shape.primitive, points) for shape in nurbs_human().shapes if isinstance(shape.primitive, Mesh)]
    for key, worst in (("share", min), ("hull_share", max), ("protrusion_mm", max), ("count", max), ("ms", max)):
        values = [row[key] for row in rows]
        metrics[f"capsules.body.{key}"] = float(np.mean(values))
        metrics[f"capsules.body.{key}_worst"] = float(worst(values))
    return metrics


def _mesh(solid: Primitive) -> Mesh:
    vertices, faces, count = [], [], 0
    for patch in tessellate(solid, (0, 0, 0)):
        vertices.append(patch.vertices)
        faces.append(patch.faces + count)
        count += len(patch.vertices)
    return Mesh(np.concatenate(vertices), np.concatenate(faces))


def _figures(mesh: Mesh, points: int) -> dict[str, float]:
    began = time.perf_counter()
    capsules = capsules_in_mesh(mesh)
    ms = 1e3 * (time.perf_counter() - began)
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    inside = (_gaps(capsules, np.random.default_rng(0).uniform(low, high, (points, 3))) < 0.0).mean()
    return {
        "share": float(inside * np.prod(high - low) / volume),
        "hull_share": float(ConvexHull(mesh.vertices).volume / volume),
        "protrusion_mm": 1e3 * max(0.0, -float(_gaps(capsules, mesh.vertices).min())),
        "count": float(len(capsules)),
        "ms": ms,
    }


def _gaps(capsules: np.ndarray, points: np.ndarray) -> np.ndarray:
    gaps = np.empty(len(points))
    point_gaps(capsules, np.ascontiguousarray(points), gaps)
    return gaps


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="example: python benchmark/mesh_capsules.py --json out/mesh_capsules.json",
    )  # fmt: skip
    parser.add_argument("--quick", action="store_true", help="volumes counted with few points: shows that it runs")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there too")
    args = parser.parse_args(arguments)
    report_metrics(measure(2_000 if args.quick else 200_000), args.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
