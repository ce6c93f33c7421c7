"""The recordings that contours are measured on: rendered once and kept, and the real sample."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ...calibration.balancing import has_plates
from ...errors import TrackerError
from ...evaluation.truth.files import load_truth
from ...experiments.contour.tracked_clip import Clip, synthetic_clip
from ...loaders.images.source import SourceOptions, load_plates, resized_plates
from ...loaders.model.model_yaml import load_model
from ...loaders.model.state_yaml import load_state
from ...loaders.recording_yaml import load_recording
from ...loaders.rig.rig_yaml import load_rig
from ...report.progress import say
from ...runs.config_file import load_config
from ...runs.image_sets import resampled_rig
from ...synthesis.scenes.scene import SceneConfig
from ..sample import prepare
from ..synthesize import Request, produce, show_progress

_SMALL_SCENE = SceneConfig(n_cameras=3, width=320, height=240, focal_px=290.0)
_SMALL_IMAGES = 6
_CONES_IMAGES, _SWING_IMAGES = 60, 60
_BALANCING_FILES = ("rig_refined.yaml", "person.yaml", "initial_state.yaml", "truth.trc", "tracker.yaml", "recording.yaml")
_BALANCING_LAG_IMAGES = 0.9  # of the images behind the joints, as runs on the whole clip find it


def rendered(name: str, request: Request, cache: Path) -> Path:
    """Folder of the recording that ``request`` asks for, rendered if it is not there."""
    count = "" if request.n_images is None else f"-{request.n_images}"
    folder = cache / f"{name}{count}"
    made = produce(request, folder, progress=show_progress)
    say(f"{name}: {'rendered into' if made else 'found in'} {folder}")
    return folder


def cones_clip(cache: Path, small: bool = False) -> Clip:
    """The tracker's own model in motion."""
    return _synthetic("cones", Request(subject="model", motion="waves", n_images=_CONES_IMAGES), cache, small)


def mannequin_clip(cache: Path, motions: str | None, small: bool = False) -> Clip:
    """A dressed body that is not the tracker's, in a kick with a spin; swinging its limbs where there are no captured motions."""
    if motions is None or small:
        return _synthetic("mannequin_swing", Request(motion="swing", n_images=_SWING_IMAGES), cache, small)
    return _synthetic("mannequin_spinkick", Request(motion="spinkick", motions=motions), cache, small)


def _synthetic(name: str, request: Request, cache: Path, small: bool) -> Clip:
    if small:
        request = replace(request, n_images=_SMALL_IMAGES, scene=_SMALL_SCENE)
    return synthetic_clip(rendered(f"small_{name}" if small else name, request, cache), name)


def balancing_clip(folder: Path, small: bool = False) -> Clip:
    """The Balancing sample in the size that it is tracked in, with the plates that are made of it.

    Raises
    ------
    TrackerError : it is not there, and cannot be fetched.
    """
    whole = has_plates(folder) and all((folder / name).exists() for name in _BALANCING_FILES)
    if not whole and prepare(folder) != 0:
        raise TrackerError(f"{folder}: the Balancing sample could not be prepared")
    rig, model = load_rig(folder / "rig_refined.yaml"), load_model(folder / "person.yaml")
    size = load_recording(folder / "recording.yaml").images.resize
    images = SourceOptions(size=size, end=_SMALL_IMAGES if small else None)
    return Clip(
        "balancing", folder, rig, model, load_state(folder / "initial_state.yaml", model),
        resized_plates(load_plates(rig), resampled_rig(rig, images)), load_truth(folder / "truth.trc"),
        images, load_config(folder / "tracker.yaml"), _BALANCING_LAG_IMAGES, "first",
    )  # fmt: skip
