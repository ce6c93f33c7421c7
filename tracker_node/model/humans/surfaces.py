"""Where the surface of a clothed person is beside the shapes of the human.

The shapes are those of an average body without clothes, and its joints not quite where those of a skeleton are: on eight rendered
people in clothes contours lay so far outside of each shape, and beside it in the axes of its link
(`benchmark/clothed/_fit.py`). Meters, of a body of the default size; spreads are a quarter larger than measured.
"""

from __future__ import annotations

import numpy as np

from ..articulated import ArticulatedModel

# Part, of either side (the left one's axes): means and standard deviations of: outside, forward, left, up
_SURFACES: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "pelvis": ((0.021, 0.040, 0.000, 0.008), (0.021, 0.016, 0.006, 0.037)),
    "abdomen": ((0.020, 0.045, 0.000, -0.022), (0.023, 0.028, 0.006, 0.029)),
    "torso": ((0.028, 0.034, 0.000, 0.005), (0.022, 0.014, 0.010, 0.026)),
    "neck": ((0.016, 0.001, 0.000, 0.000), (0.008, 0.009, 0.006, 0.010)),
    "head": ((0.014, 0.000, 0.000, 0.025), (0.008, 0.008, 0.009, 0.018)),
    "clavicle": ((0.032, -0.006, -0.011, -0.003), (0.018, 0.010, 0.020, 0.016)),
    "upper_arm": ((0.018, -0.002, -0.017, 0.011), (0.020, 0.010, 0.014, 0.011)),
    "forearm": ((0.001, 0.004, 0.000, -0.009), (0.008, 0.008, 0.006, 0.025)),
    "hand": ((0.004, 0.009, -0.024, 0.011), (0.008, 0.008, 0.009, 0.010)),
    "thigh": ((0.016, 0.016, -0.016, -0.007), (0.020, 0.008, 0.008, 0.020)),
    "shank": ((0.008, -0.012, 0.005, 0.016), (0.008, 0.008, 0.006, 0.023)),
    "foot": ((-0.001, -0.004, 0.008, -0.006), (0.008, 0.010, 0.007, 0.011)),
    "hips": ((0.021, 0.037, 0.000, 0.002), (0.019, 0.018, 0.006, 0.018)),
    # Of hands and feet in several parts; of thumb and heel, which lie before others, spreads are our own
    "palm": ((0.006, 0.007, -0.016, -0.009), (0.008, 0.008, 0.007, 0.012)),
    "fingers": ((0.005, 0.006, -0.032, 0.028), (0.008, 0.008, 0.009, 0.008)),
    "thumb": ((0.007, -0.007, -0.010, 0.012), (0.010, 0.010, 0.010, 0.010)),
    "midfoot": ((0.003, 0.020, 0.008, -0.009), (0.008, 0.008, 0.009, 0.008)),
    "heel": ((0.006, 0.010, 0.002, 0.003), (0.010, 0.012, 0.010, 0.010)),
    "toes": ((0.001, -0.014, 0.015, 0.001), (0.008, 0.010, 0.013, 0.010)),
}
_OF_OTHERS = (0.010, 0.0, 0.0, 0.0), (0.020, 0.012, 0.012, 0.012)  # of a part that is none of these


def expected_surfaces(model: ArticulatedModel) -> tuple[np.ndarray, np.ndarray]:
    """Means and standard deviations of the surfaces of a body's parts.

    Parameters
    ----------
    model : the human, or another body.

    Returns
    -------
    (n_shapes, 4) meters each: outside of the shape, and shifted in the axes of its link; of a body of the default size.
    """
    means, sigmas = np.empty((len(model.shapes), 4)), np.empty((len(model.shapes), 4))
    for i, shape in enumerate(model.shapes):
        side, _, part = shape.name.partition("_")
        known = _SURFACES.get(part if side in ("left", "right") else shape.name, _OF_OTHERS)
        means[i], sigmas[i] = known
        means[i, 2] *= -1.0 if side == "right" else 1.0
    return means, sigmas
