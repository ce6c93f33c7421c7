"""What the color kernels take of a body, a rig and its lights, and that no state changes."""

from __future__ import annotations

import numpy as np

from ...camera.light import AMBIENT, COS_OUTER, DIRECTIONAL, INTENSITY, KIND, POINT, SPOT, pack_lights
from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...render.shape_arrays import OTHER, ShapeArrays

REPRESENTATIONS = ("raw", "normalized", "blend")


class ColorConstants:
    """Packed shapes, colors and lights.

    Attributes
    ----------
    kinds, dims, links : of `ShapeArrays`.
    colors_rgb : (n_cameras, n_shapes, 3); ``recolored`` when they were given and do not come from the model.
    lights : (n, .) of `pack_lights`, all of them; ``directed`` those with a direction, float32, directional ones first.
    base : (n_cameras, 4) float32, the light that every pixel gets before those, and 1 / gamma.
    weights : of the raw and of the normalized difference.
    smooth, vectorized : all shapes are ellipsoids or cones; and there is no gamma that bends what directed lights do.
    """

    def __init__(
        self,
        model: ArticulatedModel,
        rig: CameraRig,
        representation: str = "raw",
        normalized_weight: float = 0.5,
        colors_rgb: np.ndarray | None = None,
    ):
        if representation not in REPRESENTATIONS:
            raise ValueError(f"expected a representation, one of {REPRESENTATIONS}, got {representation!r}")
        arrays = ShapeArrays.from_model(model)
        self.kinds, self.dims, self.links = arrays.kinds, arrays.dims, arrays.links
        self.smooth = OTHER not in arrays.kinds
        self.weights = {"raw": (1.0, 0.0), "normalized": (0.0, 1.0)}.get(
            representation, (1.0 - normalized_weight, normalized_weight)
        )
        self.lights = pack_lights(rig.lights)
        lights = self.lights.astype(np.float32)
        kinds = lights[:, KIND].astype(int)
        ambient = lights[kinds == AMBIENT, INTENSITY : INTENSITY + 3].sum(axis=0)
        suns, spots = lights[kinds == DIRECTIONAL], lights[(kinds == SPOT) | (kinds == POINT)]
        spots[spots[:, KIND] == POINT, COS_OUTER] = -3.0  # every direction is well within the cone
        tinted = np.ptp(lights[:, INTENSITY : INTENSITY + 3], axis=1).any()
        if self.weights[0] == 0.0 and not tinted:  # shading by white light cancels
            suns, spots, ambient = suns[:0], spots[:0], np.ones(3)
        self.n_directional, self.n_spots, self.directed = len(suns), len(spots), np.concatenate([suns, spots])
        self.gain, gamma = np.array([camera.gain for camera in rig]), np.array([camera.gamma for camera in rig])
        self.bent = len(self.directed) > 0 and bool((gamma != 1.0).any())
        self.vectorized = self.smooth and not self.bent
        base = self.gain * ambient
        if len(self.directed) == 0:
            base = base ** (1.0 / gamma[:, None])
        self.base = np.column_stack([base, 1.0 / gamma]).astype(np.float32)
        self.Ts_cam_world = np.stack([camera.T_cam_world for camera in rig])
        self.set_colors(model, rig, colors_rgb)

    def set_colors(self, model: ArticulatedModel, rig: CameraRig, colors_rgb: np.ndarray | None) -> None:
        """Take other colors.

        Parameters
        ----------
        model, rig : body and cameras.
        colors_rgb : (n_cameras, n_shapes, 3) in 0..255; None: the shapes' own in every camera.
        """
        self.recolored = colors_rgb is not None
        if colors_rgb is None:
            of_model = np.array([shape.color_rgb for shape in model.shapes], dtype=np.float64)
            self.colors_rgb = np.tile(of_model, (len(rig), 1, 1))
            return
        shape = (len(rig), len(model.shapes), 3)
        if np.shape(colors_rgb) != shape:
            raise ValueError(f"expected colors {shape}: one of each shape by camera, got {np.shape(colors_rgb)}")
        self.colors_rgb = np.array(colors_rgb, dtype=np.float64)
