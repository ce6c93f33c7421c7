"""The body of a synthetic person from images of a recording, as a user would make it: track, choose sets, fit."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmark.contour._runs import Clip, track
from tracker_node.calibration.pose import fit_state_to_landmarks
from tracker_node.calibration.tracked_body.body_fit import BodyFitOptions, fit_body
from tracker_node.calibration.tracked_body.lines import RegionEvidence, SilhouetteEvidence
from tracker_node.loaders.model.model_yaml import dump_model, load_model
from tracker_node.loaders.motion.trajectory_file import read_joints
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.tracking.config import TrackerConfig

N_SETS = 16
FITTED_FILE = "fitted.yaml"


def fitted_body(clip: Clip, config: TrackerConfig, file: Path | None = None, refit: bool = False) -> ArticulatedModel:
    """The body in ``file``; without one that of an earlier fit in the clip's folder, or of a fit made now.

    Truth has no part in it but for the first pose.
    """
    kept = file or clip.folder / FITTED_FILE
    if kept.exists() and not refit:
        print(f"body: found in {kept}", file=sys.stderr)
        return load_model(kept)
    sets = list(clip.sets())
    run = track(clip, config, sets)
    chosen = np.unique(np.linspace(0, len(sets) - 1, N_SETS).round().astype(int))
    used, states = [sets[i] for i in chosen], [run.estimates[i].state for i in chosen]
    plain = config.modalities == ("chamfer",)
    evidence = SilhouetteEvidence(used, config) if plain else RegionEvidence(used, config)
    fit = fit_body(clip.model, clip.rig, used, states, BodyFitOptions(config=config), evidence=evidence)
    dump_model(fit.model, clip.folder / FITTED_FILE, comment="Fitted to images of this recording.")
    before, after = fit.report.overall
    print(f"body: contours rms {before.rms_px:.2f} -> {after.rms_px:.2f} px in {len(used)} image sets", file=sys.stderr)
    return fit.model


def with_body(clip: Clip, body: ArticulatedModel) -> Clip:
    """The clip with another body, in the pose that its true joints give in the first image set."""
    truth = read_joints(clip.folder / "truth.csv")
    targets = dict(zip(truth.names, truth.positions_m[0], strict=True))
    return replace(clip, model=body, start=fit_state_to_landmarks(body, targets).state)
