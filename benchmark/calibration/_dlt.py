"""Section `dlt` of the calibration benchmark: cameras from 20 control points, through all stages to seven parameters."""

from __future__ import annotations

import numpy as np

from tracker_node.calibration.points.dlt_stages import STAGES, calibrate_in_stages, object_errors_m
from tracker_node.experiments.cross.throw import IMAGE_SIZE, MIDDLE, VOLUME, control_points, cross_rig, digitized

SIGMA_PX, N_TEST = 1.0, 300


def dlt_section(quick: bool = False) -> dict[str, float | int]:
    """Median and worst over the trials of what every stage makes of points all over the volume of 2 m.

    ``object_rms_mm``: points in other places than the control points, seen exactly, so that it is the cameras' error.
    ``clicked_rms_mm``: the same points, clicked on with one pixel of noise; with the true cameras it is ``true.clicked_rms_mm``.
    """
    rig, found, trials = cross_rig(), [], 2 if quick else 10
    for seed in range(trials):
        rng = np.random.default_rng(seed)
        points = control_points(rng)
        stages = [calibrate_in_stages(c.name, points, digitized(c, points, SIGMA_PX, rng), IMAGE_SIZE, seed) for c in rig]
        test = MIDDLE + rng.uniform(-0.45 * VOLUME, 0.45 * VOLUME, (N_TEST, 3))
        exact = np.stack([camera.project(test)[0] for camera in rig], axis=1)
        clicked = exact + SIGMA_PX * rng.standard_normal(exact.shape)
        cameras = [[stage.camera for stage in column] for column in zip(*stages, strict=True)] + [list(rig)]
        weights = np.ones(exact.shape[:2])
        spatial = [[_rms_mm(object_errors_m(three, test, seen, weights)) for seen in (exact, clicked)] for three in cameras]
        image = [float(np.mean([stage.rms_px for stage in column])) for column in zip(*stages, strict=True)]
        found.append(np.column_stack([spatial, [*image, 0.0]]))
    figures: dict[str, float | int] = {"dlt.trials": trials}
    for k, stage in enumerate((*STAGES, "true")):
        for j, what in enumerate(("object_rms_mm", "clicked_rms_mm", "rms_px")):
            if stage != "true" or what == "clicked_rms_mm":
                figures[f"dlt.{stage}.{what}"] = float(np.median([trial[k, j] for trial in found]))
    last = [trial[len(STAGES) - 1, 0] for trial in found]
    return figures | {"dlt.object_rms_mm": float(np.median(last)), "dlt.object_rms_mm_worst_trial": float(np.max(last))}


def _rms_mm(errors_m: np.ndarray) -> float:
    return 1e3 * float(np.sqrt(np.mean(errors_m**2)))
