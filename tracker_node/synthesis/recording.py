"""Synthetic recordings as they are asked for: rendered into a folder, with the tracker's model and its first pose."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass, field
from pathlib import Path

from ..calibration.body import ScalingOptions, scale_to_trial
from ..calibration.pose import fit_state_to_landmarks
from ..loaders.model.model_yaml import dump_model, load_model
from ..loaders.model.state_yaml import dump_state
from ..loaders.motion.trajectory_file import read_joints
from ..loaders.motion.trc import load_trc
from ..model.humans.human import human_model
from .dataset import describe, is_recorded, mannequin_sequence, model_sequence, record
from .motions.deepmimic import load_motion
from .scenes.scene import SceneConfig
from .subjects.cones import waves
from .subjects.figure import figure_model, figure_motion
from .subjects.mannequin import LANDMARKS, MannequinSubject

SUBJECTS = ("mannequin", "model", "figure")
COLORS = ("clothes", "parts")
WAVES = "waves"
DEFAULT_IMAGES, FIGURE_IMAGES = 60, 100  # of motions that have no end


@dataclass(frozen=True)
class Request:
    """What to synthesize; ``motions`` is the folder of captured clips, ``n_images`` None takes the whole clip."""
    subject: str = "mannequin"
    motion: str = "swing"
    n_images: int | None = None
    rate_hz: float = 30.0
    stature: float = 1.75
    motions: str | None = None
    model: str | None = None
    colors: str = "clothes"
    scene: SceneConfig = field(default_factory=SceneConfig)


def default_motions() -> str | None:
    """Folder of captured clips beside the other recordings that TRACKER_SHARED_DATA names, if there is one."""
    named = os.environ.get("TRACKER_SHARED_DATA")
    folder = Path(named) / "bullet_motions" if named else None
    return str(folder) if folder is not None and folder.is_dir() else None


def show_progress(done: int, total: int) -> None:
    """Print the number of image sets on stderr: a line that rewrites itself, or a line every tenth when that is a file.

    Parameters
    ----------
    done, total : image sets.
    """
    if sys.stderr.isatty():
        print(f"\rrendering: image set {done} of {total}", end="\n" if done == total else "", file=sys.stderr, flush=True)
    elif 10 * done // total > 10 * (done - 1) // total:
        print(f"rendering: image set {done} of {total}", file=sys.stderr, flush=True)


def produce(request: Request, folder: str | Path, force: bool = False, progress=lambda done, total: None) -> bool:
    """Make a recording, unless the folder holds it already.

    Besides what `synthesis.dataset.record` writes there are ``person.yaml``, the tracker's model scaled to the subject by its
    static trial, and ``state.yaml``, the pose in the first image set.

    Parameters
    ----------
    request : subject, motion and scene.
    folder : of the recording.
    force : make it again.
    progress : called with the number of sets done and of all.

    Returns
    -------
    made : False where the folder holds it.
    """
    make = {"mannequin": _mannequin, "model": _own_model, "figure": _figure}[request.subject]
    sequence, body = make(request)
    folder = Path(folder)
    if not force and is_recorded(folder, describe(sequence, request.scene)) and (folder / "state.yaml").exists():
        return False
    record(sequence, request.scene, folder, progress)
    model, state = body(folder)
    dump_model(model, folder / "person.yaml", comment="The tracker's model of the subject of this recording.")
    dump_state(state, model, folder / "state.yaml", comment="Pose in the first image set.")
    return True


def _load_model(path: str | None):

    return load_model(path) if path else human_model()


def _mannequin(request: Request):
    """The recording to be made, and what gives the model and its first pose from the recorded folder."""
    motion = load_motion(request.motion, request.rate_hz, request.n_images, request.motions)
    colors = {shape.name: shape.color_rgb for shape in _load_model(request.model).shapes} if request.colors == "parts" else None

    def body(folder: Path):
        exact = ScalingOptions(joint_sigma_m=0.0, symmetric=False)  # the trial's joints are the subject's own
        model = scale_to_trial(_load_model(request.model), load_trc(folder / "static.trc"), exact).model
        truth = read_joints(folder / "truth.csv")
        targets = dict(zip(truth.names, truth.positions_m[0], strict=True))
        return model, fit_state_to_landmarks(model, targets).state

    return mannequin_sequence(motion, request.stature, colors), body


def _own_model(request: Request):
    """As `_mannequin`; the subject is the model, so nothing has to be fitted."""
    model = _load_model(request.model)
    if request.motion == WAVES:
        states = waves(model, request.rate_hz, request.n_images or DEFAULT_IMAGES)
    else:
        states = _imitated(model, request)
    return model_sequence(model, states, request.rate_hz), lambda folder: (model, states[0])


def _figure(request: Request):
    """As `_own_model`, of the figure of ten cones in its own motion."""
    model, states = figure_model(), figure_motion(request.rate_hz, request.n_images or FIGURE_IMAGES)
    return model_sequence(model, states, request.rate_hz, "figure"), lambda folder: (model, states[0])


def _imitated(model, request: Request) -> list:
    """States in which the model does what the mannequin does in a motion."""
    motion = load_motion(request.motion, request.rate_hz, request.n_images, request.motions)
    states: list = []
    for body in MannequinSubject(request.stature).follow(motion):
        targets = {name: p for name, p in zip(LANDMARKS, body.landmarks, strict=True) if name in model.landmark_names}
        states.append(fit_state_to_landmarks(model, targets, states[-1] if states else None).state)
    return states
