"""Whether a calibration that comes from outside can be one of a real lens."""

from __future__ import annotations

from .model import CameraModel

SHORTEST, LONGEST = 0.01, 1000.0  # focal lengths, in image sides
FARTHEST = 10.0  # the principal point beyond the image, in image sides
LARGEST_COEFFICIENT = 1e6


def plausible(model: CameraModel) -> CameraModel:
    """The lens itself.

    Raises
    ------
    ValueError : naming the value that no lens has, what is expected and what came; numbers that are not finite, too.
    """
    side = float(max(model.width, model.height))
    K = model.K
    _refuse_outside("fx", K[0, 0], SHORTEST * side, LONGEST * side)
    _refuse_outside("fy", K[1, 1], SHORTEST * side, LONGEST * side)
    _refuse_outside("skew", K[0, 1], -LONGEST * side, LONGEST * side)
    _refuse_outside("cx", K[0, 2], -FARTHEST * side, FARTHEST * side)
    _refuse_outside("cy", K[1, 2], -FARTHEST * side, FARTHEST * side)
    for i, coefficient in enumerate(model.distortion):
        _refuse_outside(f"distortion coefficient {i + 1}", coefficient, -LARGEST_COEFFICIENT, LARGEST_COEFFICIENT)
    return model


def _refuse_outside(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError(f"{name}: expected {low:g} to {high:g}, got {float(value):g}")
