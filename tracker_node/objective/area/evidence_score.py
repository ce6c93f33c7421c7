"""How well poses of a body cover what speaks for it in the images, many poses at a time and on small images.

Meshes count as their bounding boxes: this is for finding where a body is, not for how exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...camera.rig import Camera
from ...geometry import se3
from ...model.articulated import ArticulatedModel
from ...model.shapes.primitives import Box, Mesh
from ...render.ray_table import ray_table
from ...render.raycast.coefficients import BOX
from ...render.raycast.kernels import LABEL_BITS
from ...render.shape_arrays import ShapeArrays
from .evidence_kernels import place_shapes, score_poses

_CHUNK = 32  # states that one thread takes at a time


class EvidenceScore:
    """Sums of maps of evidence under a posed body.

    Parameters
    ----------
    cameras : as large as the maps are.
    parallel : maps a function over a list, on several threads.
    """

    def __init__(self, model: ArticulatedModel, cameras: Sequence[Camera], parallel: Callable[[Callable, list], list]):
        if len(model.shapes) > LABEL_BITS:
            raise ValueError(f"expected at most {LABEL_BITS} shapes, got {len(model.shapes)}")
        self.model, self.cameras, self._parallel = model, tuple(cameras), parallel
        chain = model.chain
        self._chain = (chain.parents, chain.offsets, chain.axis_start, chain.axis_count, chain.directions)
        self._shapes = packed_shapes(model)
        self._views = [
            (c.model.params, ray_table(c.model).limits, c.T_cam_world, (c.model.width, c.model.height)) for c in self.cameras
        ]
        self._map_of_shape = np.zeros(len(model.shapes), dtype=np.int64)
        self._maps: list[np.ndarray | None] = [None] * len(self.cameras)

    def set_maps(self, maps: Sequence[np.ndarray | None], map_of_shape: np.ndarray | None = None) -> None:
        """Log-odds (h, w), or (n_maps, h, w) of which shape s reads number ``map_of_shape[s]``; None for a camera without."""
        self._maps = [None if m is None else np.ascontiguousarray(m if m.ndim == 3 else m[None], dtype=np.float32) for m in maps]
        self._map_of_shape = np.zeros(len(self.model.shapes), dtype=np.int64) if map_of_shape is None else map_of_shape

    def totals(self, roots: np.ndarray, joints: np.ndarray) -> np.ndarray:
        """Sum of the maps under the body, and its pixels: (n_states, n_cameras, 2), zeros for cameras without maps.

        ``roots`` (n_states, 4, 4) and ``joints`` (n_states, n_axes) are those of the states.
        """
        n = len(roots)
        totals = np.zeros((len(self.cameras), n, 2))
        seen = [i for i, m in enumerate(self._maps) if m is not None]
        kinds, dims, links, places = self._shapes

        def run(first: int) -> None:
            part = slice(first, first + _CHUNK)
            placed = np.empty((len(roots[part]), len(kinds), 4, 4))
            place_shapes(self._chain, links, places, roots[part], joints[part], placed)
            for i in seen:
                table = ray_table(self.cameras[i].model)
                score_poses(
                    kinds, dims, placed, self._views[i], (table.xs, table.ys), self._maps[i], self._map_of_shape,
                    np.zeros(table.xs.shape, dtype=np.int32), totals[i, part],
                )  # fmt: skip

        self._parallel(run, list(range(0, n, _CHUNK)))
        return np.swapaxes(totals, 0, 1)

    def scores(self, roots: np.ndarray, joints: np.ndarray) -> np.ndarray:
        """(n_states,) sums over all cameras."""
        return self.totals(roots, joints)[:, :, 0].sum(axis=1)


def packed_shapes(model: ArticulatedModel) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Kinds, dims, links and places of the shapes as the kernel draws them."""
    arrays = ShapeArrays.from_model(model)
    kinds, dims, places = arrays.kinds.copy(), arrays.dims.copy(), model.Ts_link_shape.copy()
    for i, shape in enumerate(model.shapes):
        primitive = shape.primitive
        if isinstance(primitive, Box):
            kinds[i], dims[i, :3] = BOX, primitive.size
        elif isinstance(primitive, Mesh):
            low, high = primitive.vertices.min(axis=0), primitive.vertices.max(axis=0)
            kinds[i], dims[i, :3] = BOX, np.maximum(high - low, 1e-6)
            places[i] = places[i] @ se3.from_rotation_translation(np.eye(3), 0.5 * (low + high))
    return kinds, dims, arrays.links, places
