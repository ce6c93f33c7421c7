"""Recordings with true joints, rendered once and kept or the real sample, tracked from their first pose and evaluated."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

import numpy as np

from ...camera.rig import CameraRig
from ...errors import SourceError, TrackerError
from ...evaluation.evaluate import Evaluation, EvaluationOptions, evaluate
from ...evaluation.truth.files import load_truth
from ...loaders.images.source import SourceOptions, load_backgrounds, resized_backgrounds
from ...loaders.model.model_yaml import load_model
from ...loaders.model.state_yaml import load_state
from ...loaders.motion.trajectory_file import Trajectories
from ...loaders.recording_yaml import load_recording
from ...loaders.rig.rig_yaml import load_rig
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...observation.image_set import ImageSet
from ...report.progress import say
from ...runs.config_file import load_config
from ...runs.data import RunData
from ...runs.image_sets import SourceStream, resampled_rig
from ...synthesis.recording import Request, produce, show_progress
from ...synthesis.scenes.scene import SceneConfig
from ...tracking.config import TrackerConfig
from ...tracking.estimate import TrackEstimate
from ...tracking.tracker import Tracker

_SMALL_SCENE = SceneConfig(n_cameras=3, width=320, height=240, focal_px=290.0)
_SMALL_IMAGES = 6
_CONES_IMAGES, _SWING_IMAGES = 60, 60
_BALANCING_LAG_IMAGES = 0.9  # of the images behind the joints, as runs on the whole clip find it


@dataclass(frozen=True, eq=False)
class Clip:
    """What a run on a recording needs, and what it is judged by.

    Parameters
    ----------
    name : prefix of its figures.
    folder : where it is, for messages.
    sources : the rig with the sources of the images, in their own size.
    model, start : the body, and its state in the first image set.
    backgrounds : images of the empty scene by camera, in the size of the images as they are tracked.
    truth : joints over time.
    images : which images of the sources, and in which size.
    config : parameters of the tracker that the recording asks for.
    lag_images : how far the images are behind the truth; None: it is estimated.
    align : see `EvaluationOptions`.
    """

    name: str
    folder: Path
    sources: CameraRig
    model: ArticulatedModel
    start: State
    backgrounds: Mapping[str, np.ndarray]
    truth: Trajectories
    images: SourceOptions = field(default_factory=SourceOptions)
    config: TrackerConfig = field(default_factory=TrackerConfig)
    lag_images: float | None = 0.0
    align: str = "stamp"

    @property
    def rig(self) -> CameraRig:
        """Cameras of the images as they are tracked."""
        return resampled_rig(self.sources, self.images)

    def stream(self) -> SourceStream:
        """Its image sets; each stream can be gone through once."""
        return SourceStream(self.sources, self.config.synchronizer, self.images)

    def sets_at(self, numbers: Sequence[int]) -> list[ImageSet]:
        """Some of its image sets, by their numbers, which increase."""
        first = islice(self.stream(), max(numbers) + 1)
        return [image_set for i, image_set in enumerate(first) if i in numbers]


@dataclass(frozen=True, eq=False)
class TrackedClip:
    """Estimates of all image sets of a clip, and how far they are from its truth."""

    estimates: tuple[TrackEstimate, ...]
    evaluation: Evaluation


def synthetic_clip(folder: str | Path, name: str) -> Clip:
    """A recording that ``tracker_node synthesize`` has made.

    Parameters
    ----------
    folder : of the recording.
    name : prefix of its metrics.

    Returns
    -------
    The clip.

    Raises
    ------
    TrackerError : a file of it that is not there, or is wrong.
    """
    folder = Path(folder)
    rig, model = load_rig(folder / "rig.yaml"), load_model(folder / "person.yaml")
    start, truth = load_state(folder / "state.yaml", model), load_truth(folder / "truth.csv")
    return Clip(name, folder, rig, model, start, load_backgrounds(rig), truth, SourceOptions())


def track_clip(
    clip: Clip, config: TrackerConfig, progress: Callable[[int, int], None] = lambda done, total: None
) -> TrackedClip:  # fmt: skip
    """Track a clip from its first pose.

    Parameters
    ----------
    clip : the recording.
    config : parameters of the tracker.
    progress : called with the image sets done and all of them.

    Returns
    -------
    Estimates, and their evaluation against the truth.

    Raises
    ------
    TrackerError : an image that cannot be read, or no image set at all.
    """
    rig, stream = clip.rig, clip.stream()
    tracker = Tracker(rig, clip.model, config, clip.backgrounds, clip.start)
    total, estimates = int(stream.n_expected or 0), []
    for image_set in stream:
        estimates.append(tracker.step(image_set))
        progress(len(estimates), total)
    if stream.errors:
        raise TrackerError(f"{clip.folder}: {'; '.join(map(str, stream.errors))}")
    if not estimates:
        raise SourceError(clip.folder, "no image set could be formed")
    run = RunData.of_estimates(clip.folder, clip.model, rig, estimates)
    options = EvaluationOptions(clip.name, clip.lag_images, clip.align, image_sets=total)
    return TrackedClip(tuple(estimates), evaluate(run, clip.model, clip.truth, options))


def rendered(name: str, request: Request, cache: Path) -> Path:
    """Render a recording, unless it is there.

    Parameters
    ----------
    name : of its folder.
    request : what is rendered.
    cache : folder of the recordings.

    Returns
    -------
    The recording's folder.
    """
    count = "" if request.n_images is None else f"-{request.n_images}"
    folder = cache / f"{name}{count}"
    made = produce(request, folder, progress=show_progress)
    say(f"{name}: {'rendered into' if made else 'found in'} {folder}")
    return folder


def cones_clip(cache: Path, small: bool = False) -> Clip:
    """The tracker's own model in motion.

    Parameters
    ----------
    cache : folder of the recordings.
    small : few small images.

    Returns
    -------
    The clip.
    """
    return _synthetic("cones", Request(subject="model", motion="waves", n_images=_CONES_IMAGES), cache, small)


def mannequin_clip(cache: Path, motions: str | None, small: bool = False) -> Clip:
    """A dressed body that is not the tracker's, in a kick with a spin; swinging its limbs where there are no captured motions.

    Parameters
    ----------
    cache : folder of the recordings.
    motions : folder of captured motions, or None.
    small : few small images, of the swing.

    Returns
    -------
    The clip.
    """
    if motions is None or small:
        return _synthetic("mannequin_swing", Request(motion="swing", n_images=_SWING_IMAGES), cache, small)
    return _synthetic("mannequin_spinkick", Request(motion="spinkick", motions=motions), cache, small)


def _synthetic(name: str, request: Request, cache: Path, small: bool) -> Clip:
    if small:
        request = replace(request, n_images=_SMALL_IMAGES, scene=_SMALL_SCENE)
    return synthetic_clip(rendered(f"small_{name}" if small else name, request, cache), name)


def balancing_clip(folder: Path, small: bool = False) -> Clip:
    """The Balancing sample, in the size that it is tracked in.

    Parameters
    ----------
    folder : the prepared sample.
    small : only its first images.

    Returns
    -------
    The clip, with backgrounds made of its own images.
    """
    rig, model = load_rig(folder / "rig_refined.yaml"), load_model(folder / "person.yaml")
    size = load_recording(folder / "recording.yaml").images.resize
    images = SourceOptions(size=size, end=_SMALL_IMAGES if small else None)
    return Clip(
        "balancing", folder, rig, model, load_state(folder / "initial_state.yaml", model),
        resized_backgrounds(load_backgrounds(rig), resampled_rig(rig, images)), load_truth(folder / "truth.trc"),
        images, load_config(folder / "tracker.yaml"), _BALANCING_LAG_IMAGES, "first",
    )  # fmt: skip
