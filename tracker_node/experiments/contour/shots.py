"""The pictures of `reproduce contours` that show bodies over images."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...camera.rig import Camera
from ...model.configuration import Configuration
from ...observation.image_set import ImageSet
from ...report.page import Section
from ..plots import save
from .errors import TITLES, by_method
from .pictures import Shot, cameras_figure, evidence_figure, sequence_figure, shoot
from .tracked_clip import Clip, TrackedClip

PICTURED = "split"  # the method whose poses are drawn: those of the paper lose a quick body
_INSTANTS = 6


def evidence_pictures(folder: Path, clip: Clip, run: TrackedClip) -> list[Section]:
    """Figs 4 and 5, of the image set in the middle of the clip."""
    middle = len(run.estimates) // 2
    (image_set,) = clip.sets_at([middle])
    shots = [shot for camera in clip.rig if (shot := _shot(clip, run, camera, middle, image_set)) is not None]
    if not shots:
        return []
    evidence, cameras = folder / "fig4_evidence.png", folder / "fig5_cameras.png"
    save(evidence_figure(shots[0]), evidence)
    save(cameras_figure(shots), cameras)
    return [
        Section("What is made of an image (Fig. 4)", f"{clip.name}, camera {shots[0].camera.name}.", picture=evidence),
        Section("Contours in all cameras (Fig. 5)", f"{clip.name}; outline yellow, contours within it orange.", picture=cameras),
    ]


def sequence_pictures(folder: Path, clip: Clip, run: TrackedClip) -> list[Section]:
    """Fig. 6, of instants over the whole clip, in its first camera."""
    n, camera = len(run.estimates), clip.rig.cameras[0]
    numbers = sorted({round(i) for i in np.linspace(n / (2 * _INSTANTS), n - 1, _INSTANTS)})
    shots, titles = _sequence(clip, run, camera, numbers)
    if not shots:
        return []
    path = folder / f"fig6_{clip.name}.png"
    save(sequence_figure(shots, titles), path)
    text = f"{clip.name}, camera {camera.name}, by {TITLES[PICTURED]}: contours of the pose before, what was seen, the pose."
    return [Section("A sequence (Fig. 6)", text, picture=path)]


def _sequence(clip: Clip, run: TrackedClip, camera: Camera, numbers: Sequence[int]) -> tuple[list[Shot], list[str]]:
    shots, titles = [], []
    for number, image_set in zip(numbers, clip.sets_at(numbers), strict=True):
        shot = _shot(clip, run, camera, number, image_set)
        if shot is not None:
            shots.append(shot)
            titles.append(f"image {number + 1}")
    return shots, titles


def _shot(clip: Clip, run: TrackedClip, camera: Camera, number: int, image_set: ImageSet) -> Shot | None:
    image, plate = image_set.get(camera.name), clip.plates.get(camera.name)
    if image is None or plate is None:
        return None
    before, found = (Configuration(clip.model, run.estimates[i].state) for i in (max(number - 1, 0), number))
    config = by_method(clip.config, PICTURED)
    return shoot(camera, image.bgr, before, found, plate, config, config.chamfer.margin_px)
