"""A run compared with truth and with its images, all from files, as ``tracker_node evaluate`` and a recording name them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from glob import glob, has_magic
from pathlib import Path
from typing import Any

import numpy as np

from ..camera.rig import CameraRig
from ..errors import FileFormatError, TrackerError
from ..loaders.model.model_yaml import load_model
from ..loaders.recording_yaml import EvaluateEntry
from ..loaders.rig.rig_yaml import load_rig
from ..model.articulated import ArticulatedModel
from ..model.humans.measures import unused_markers
from ..runs.data import RunData
from ..runs.images import file_of, first_image_of, rig_of_run
from ..runs.load import body_of_run, is_run, load_run
from .consistency import landmark_sds
from .evaluate import EvaluationOptions
from .masks.reference import CameraMasks, load_reference_masks
from .masks.silhouettes import ImageReview, ReviewOptions, review_images
from .motion.inverse_kinematics import InverseKinematics, inverse_kinematics
from .report.summary import parse_target
from .review import Review, review
from .truth.files import truth_of

_MOST_UNOBSERVABLE = 5
_LASTING = 0.1  # fraction of the sets, below which a degree of freedom gets no sentence of its own


@dataclass(frozen=True)
class RunFiles:
    """What is compared.

    Parameters
    ----------
    run : folder of a run, or a bag; ``topic`` of its states, where a bag has several.
    model, rig : files; None: those that run.json names. Without a rig there are no silhouettes and no pictures.
    truth : files, at most one of positions and one of degrees of freedom; ``y_up``: see `truth.files.truth_of`.
    masks : camera -> reference masks.
    pictures : time steps on the contact sheets.
    options : ``first_image`` None: the one that run.json says, or 0.
    opensim : model of OpenSim (.osim), for its inverse kinematics.
    """

    run: str
    model: str | None = None
    rig: str | None = None
    topic: str | None = None
    truth: Sequence[str] = ()
    y_up: bool | None = None
    masks: Mapping[str, CameraMasks] = field(default_factory=dict)
    pictures: int = 6
    options: EvaluationOptions = field(default_factory=EvaluationOptions)
    first_image: int | None = None
    opensim: str | None = None


def review_run(files: RunFiles, tell: Callable[[str], None]) -> Review:
    """Compare a run with truth, and its silhouettes with masks.

    Parameters
    ----------
    files : what is compared, and how.
    tell : called with a line on what is being done.

    Returns
    -------
    review : with pictures, and a sentence for each problem.

    Raises
    ------
    TrackerError : no body model is named, or it is not that of the run.
    FileFormatError : a file that cannot be used.
    MissingExtraError : a model of OpenSim where its package is not installed.
    """
    tracked = load_run(files.run, files.topic)
    first_image = first_image_of(tracked.info) if files.first_image is None else files.first_image
    model_path, rig_path = files.model or file_of(tracked.info, "model"), files.rig or file_of(tracked.info, "rig")
    if not model_path:
        raise TrackerError(f"{files.run} does not name its body model; give --model FILE")
    model = load_model(model_path)
    tracked.check_model(model, model_path)
    tell(f"{files.options.name}: {len(tracked)} states of {files.run}")
    truth = ", ".join(files.truth) or "none"
    sources = {"run": files.run, "truth": truth, "model": model_path, "rig": rig_path or "not given"}
    options = replace(files.options, first_image=first_image)
    known = truth_of(files.truth, files.y_up, model)
    if known.joints is not None and (said := unused_markers(known.joints.names, model.landmark_names)):
        tell(f"{files.options.name}: {said}")
    found = review(tracked, model, known, options, sources)
    for doubt in found.problems:
        tell(f"{files.options.name}: {doubt}")
    shown = ReviewOptions(files.pictures, first_image=first_image)
    seen = model if files.model is not None else body_of_run(Path(files.run), model)
    rig = None
    if rig_path:
        rig = rig_of_run(load_rig(rig_path), tracked.info, other_file=rig_path != file_of(tracked.info, "rig"))
    images = _images(files, tracked, seen, rig, shown, found.period_s * 1e9, tell)
    met = [f"The run met an error: {error}." for error in tracked.info.get("errors") or []]
    problems = [*met, *found.problems, *_contradicted(tracked.info), *unobservable_text(tracked.info), *images.problems]
    joints = None if found.joints is None else replace(found.joints, silhouettes=images.scores)
    solved = _opensim(files.opensim, found, tell) if files.opensim else None
    return replace(
        found, joints=joints, silhouettes=images.scores, pictures=images.pictures, problems=problems, rig=rig, opensim=solved
    )


def _opensim(path: str, found: Review, tell: Callable[[str], None]) -> InverseKinematics:
    """Of the sets that are not lost, with the landmarks' covariances where the run has them."""
    points = np.where(found.said_lost[:, None, None], np.nan, found.landmarks_m)
    sds = landmark_sds(found.run, found.model)
    return inverse_kinematics(path, found.run.stamps_ns, found.model.landmark_names, points, sds, tell)


def runs_in(folder: str | Path) -> list[Path]:
    """The run that a folder is, or those in it, such as ``batch`` leaves.

    Parameters
    ----------
    folder : a run, a bag, a folder of runs, or a pattern (``day1/*/anna``).

    Returns
    -------
    In the order of their names.

    Raises
    ------
    FileFormatError : neither.
    """
    folder = Path(folder)
    is_pattern = has_magic(str(folder)) and not folder.exists()
    if not is_pattern and (not folder.is_dir() or is_run(folder)):
        return [folder]
    found = sorted(path for path in (map(Path, glob(str(folder))) if is_pattern else folder.iterdir()) if is_run(path))
    if not found:
        raise FileFormatError(folder, "(path)", "a run, or a folder with runs in it, of several bodies 'DAY/*/NAME'", "no run")
    return found


def _images(
    files: RunFiles,
    tracked: RunData,
    model: ArticulatedModel,
    rig: CameraRig | None,
    options: ReviewOptions,
    period_ns: float,
    tell: Callable[[str], None],
) -> ImageReview:
    if rig is None:
        asked = bool(files.pictures or files.masks)
        return ImageReview(problems=["Without a rig there are no silhouettes and no pictures (--rig FILE)."] * asked)
    return review_images(tracked, model, rig, files.masks, period_ns, options, tell)


def _contradicted(info: Mapping[str, Any]) -> list[str]:
    """A sentence for each camera that the others have contradicted during the run."""
    found = info.get("contradicted_cameras") or []
    return [f"{entry['said']}; so it was found after {entry['sets']} of the image sets." for entry in found]


def unobservable_text(info: Mapping[str, Any]) -> list[str]:
    """A sentence on the degrees of freedom that the images do not show, from ``run.json``, or none; the most lasting first."""
    found = sorted(info.get("unobservable") or [], key=lambda entry: -entry["sets"])
    if not found:
        return []
    least = _LASTING * info.get("image_sets", 0)
    shown = [entry for entry in found if entry["sets"] >= least][:_MOST_UNOBSERVABLE]
    said = [f"{entry['what']} ({entry['sets']} set{'s' * (entry['sets'] != 1)})" for entry in shown]
    if more := len(found) - len(shown):
        said.append("one other degree of freedom" if more == 1 else f"{more} other degrees of freedom")
    listed = " and ".join([", ".join(said[:-1]), said[-1]] if len(said) > 1 else said)
    return [f"The images do not always tell {listed}: there they are guessed."]


def check_evaluation(where: str | Path, entry: EvaluateEntry, model: ArticulatedModel | None) -> None:
    """Report mistakes that would else come up when the run is there.

    Parameters
    ----------
    where, entry : the recording, as a message names it, and what it says of its evaluation.
    model : the body; None where no truth is named.

    Raises
    ------
    TrackerError : a truth or masks that cannot be read, a target that is none.
    """
    for target in entry.targets:
        try:
            parse_target(target)
        except ValueError:
            raise FileFormatError(where, "evaluate.targets", "KEY<=NUMBER or KEY>=NUMBER", target) from None
    truth_of(entry.truth, entry.y_up, model)
    if entry.masks is not None:
        load_reference_masks(entry.masks)
