"""Names of parameters in version 0.1, and what they are called now."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..errors import FileFormatError

_BACKGROUND = {"scene_sigma": "sigma", "shadow": "shadow", "scene_rate": "learning_rate", "body_margin_px": "body_margin_px"}
_EVIDENCE = (
    "silhouette", "distances", "threshold", "smoothing_px", "color_rate", "learn_every", "reach_px", "truncation_px",
    "edge_truncation_px", "boundary_step_px", "refine_boundary", "canny_low", "canny_high", "margin_px",
)  # fmt: skip
_OPTIMIZER = (
    "max_iterations", "first_iterations", "tolerance", "robust_scale_px", "fine_robust_scale_px", "samples_per_line", "sliding",
    "inner_weight", "boundary_weight", "boundary_scale_px", "coarse_iterations",
)  # fmt: skip
_CHAMFER_STATUS = (
    "degraded_residual_px", "lost_residual_px", "agreement_px", "agreement_m", "degraded_agreement", "lost_agreement",
    "residual_sigma_px", "correlation",
)  # fmt: skip
_REGION = {
    "clamp": "max_log_ratio", "sharpness": "pixel_independence", "close_px": "inlier_px", "guard_px": "margin_px",
    "around_px": "background_ring_px", "learn_room": "learn_background",
}  # fmt: skip
_LIMB_SEARCH = {"limb_tries": "poses", "limb_fits": "fits", "limb_pause": "interval_sets", "limb_seed": "seed"}
_START = {
    "enabled": "enabled", "min_cameras": "min_cameras", "after_lost": "after_lost_sets", "every": "interval_sets",
    "watch": "watch_sets", "size_px": "size_px", "hypotheses": "hypotheses", "keep": "candidates",
    "repair": "repaired_candidates", "hold": "tracked_candidates", "hold_sets": "tracked_sets", "min_score": "min_score",
    "seed": "seed",
}  # fmt: skip

RENAMED: dict[str, str] = {
    **{f"evidence.{old}": f"background.{new}" for old, new in _BACKGROUND.items()},
    **{f"evidence.{name}": f"chamfer.{name}" for name in _EVIDENCE},
    **{f"optimizer.{name}": f"chamfer.{name}" for name in _OPTIMIZER},
    "optimizer.alignment": "chamfer.min_alignment",
    **{f"status.{name}": f"chamfer.{name}" for name in _CHAMFER_STATUS},
    **{f"status.{name}": f"region.{name}" for name in ("covariance_scale", "line_correlation_px", "body_shift_px")},
    **{f"status.{old}": f"limb_search.{new}" for old, new in _LIMB_SEARCH.items()},
    **{f"region.{old}": f"region.{new}" for old, new in _REGION.items()},
    **{f"motion.{name}_memory_s": f"motion.{name}_time_constant_s" for name in ("root_position", "root_angle", "joint")},
    **{f"start.{old}": f"initialization.{new}" for old, new in _START.items()},
    **{f"together.{name}": f"joint.{name}" for name in ("passes", "iterations", "color_scale")},
}
"""Dotted name in version 0.1 -> dotted name now."""

CHOICES = ("engine", "evidence.kind")  # these and the representations below are `modalities` now
REPRESENTATIONS = {"affine": "texture", "scene": "color_over_background"}


def refuse_renamed(values: Mapping[str, Any], source: str) -> None:
    """Refuse parameters of version 0.1.

    Parameters
    ----------
    values : mapping, nested or dotted.
    source : named in the message.

    Raises
    ------
    FileFormatError : naming the present name.
    """
    for name, value in flat(values).items():
        if name in RENAMED:
            raise FileFormatError(
                source, name, f"its present name, {RENAMED[name]} (`tracker_node migrate` rewrites files)", value
            )
        if name in CHOICES or (name == "color.representation" and value in REPRESENTATIONS):
            raise FileFormatError(
                source,
                name,
                "modalities, a list that says what images are compared by (`tracker_node migrate` rewrites files)",
                value,
            )


def flat(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Dotted name -> value.

    Parameters
    ----------
    values : mapping, nested or dotted.
    prefix : of all names.

    Returns
    -------
    dict[str, object].
    """
    result: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            result.update(flat(value, f"{prefix}{key}."))
        else:
            result[f"{prefix}{key}"] = value
    return result
