"""Section `dlt` of the calibration benchmark: cameras from 20 control points, by eleven parameters and by seven."""

from __future__ import annotations

import numpy as np

from tracker_node.calibration.points.dlt import calibrate, object_errors_m
from tracker_node.experiments.cross.throw import IMAGE_SIZE, MIDDLE, VOLUME, control_points, cross_rig, digitized
from tracker_node.loaders.rig.control_points import ControlPoints

SIGMA_PX, N_TEST = 1.0, 300
CONSTRAINTS = {"refined": "none", "polished": "centered"}  # as the keys call them


def dlt_section(quick: bool = False) -> dict[str, float | int]:
    """Median and worst over the trials of what cameras make of points all over the volume of 2 m.

    ``object_rms_mm``: points in other places than the control points, seen exactly, so that it is the cameras' error.
    ``clicked_rms_mm``: the same points, clicked on with one pixel of noise; with the true cameras it is ``true.clicked_rms_mm``.
    """
    rig, names, trials = cross_rig(), tuple(map(str, range(N_TEST))), 2 if quick else 10
    found: dict[str, list[float]] = {}
    for seed in range(trials):
        rng = np.random.default_rng(seed)
        points = control_points(rng)
        clicks = {camera.name: digitized(camera, points, SIGMA_PX, rng) for camera in rig}
        test = MIDDLE + rng.uniform(-0.45 * VOLUME, 0.45 * VOLUME, (N_TEST, 3))
        exact = {camera.name: camera.project(test)[0] for camera in rig}
        noise = SIGMA_PX * rng.standard_normal((N_TEST, len(rig), 2))
        clicked = {name: pixels + noise[:, i] for i, (name, pixels) in enumerate(exact.items())}
        seen = [{name: ControlPoints(names, test, pixels) for name, pixels in each.items()} for each in (exact, clicked)]
        for key, constraint in CONSTRAINTS.items():
            fits = [calibrate(name, points, pixels, IMAGE_SIZE, constraint) for name, pixels in clicks.items()]
            for what, each in zip(("object_rms_mm", "clicked_rms_mm"), seen, strict=True):
                found.setdefault(f"dlt.{key}.{what}", []).append(_rms_mm(object_errors_m([fit.camera for fit in fits], each)))
            found.setdefault(f"dlt.{key}.rms_px", []).append(float(np.mean([fit.rms_px for fit in fits])))
        found.setdefault("dlt.true.clicked_rms_mm", []).append(_rms_mm(object_errors_m(list(rig), seen[1])))
    figures = {"dlt.trials": trials} | {key: float(np.median(values)) for key, values in found.items()}
    last = found["dlt.polished.object_rms_mm"]
    return figures | {"dlt.object_rms_mm": float(np.median(last)), "dlt.object_rms_mm_worst_trial": float(np.max(last))}


def _rms_mm(errors_m: np.ndarray) -> float:
    return 1e3 * float(np.sqrt(np.mean(errors_m**2)))
