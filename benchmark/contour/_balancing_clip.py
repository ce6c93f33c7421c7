"""The Balancing clip in memory at the size that it is tracked at, its reference silhouettes, and a run held against both.

Decoding videos and making masks takes longer than tracking; both are kept in a cache, made anew when what they come from changes.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from tracker_node.calibration.balancing import write_masks
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.cli.sample import prepare
from tracker_node.errors import SourceError
from tracker_node.evaluation.evaluate import Evaluation, EvaluationOptions, SilhouetteScores, evaluate
from tracker_node.evaluation.masks import reference
from tracker_node.evaluation.masks.reference import CameraMasks, load_reference_masks, read_still
from tracker_node.evaluation.metrics import intersection_over_union
from tracker_node.evaluation.truth.files import load_truth
from tracker_node.loaders.fetched_files import data_file
from tracker_node.loaders.images.source import load_backgrounds, open_camera_source, resized_backgrounds
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.motion.trajectory_file import Trajectories
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.render.raycast.raycaster import render_mask
from tracker_node.runs.data import RunData
from tracker_node.tracking.estimate import TrackEstimate
from tracker_node.tracking.tracker import Tracker

SIZE = (544, 960)
DRAWN_MASKS = "config/balancing_masks.json"


@dataclass(frozen=True, eq=False)
class Clip:
    """What a run needs and is judged by; ``full`` has the cameras of the masks' size, ``rig`` those of the images."""

    rig: CameraRig
    full: CameraRig
    model: ArticulatedModel
    start: State
    truth: Trajectories
    sets: list[ImageSet]
    masks: dict[str, dict[int, np.ndarray]]
    backgrounds: dict

    def with_cameras(self, names: Sequence[str]) -> Clip:
        """The same with some of the cameras."""
        sets = [ImageSet(s.stamp_ns, tuple(image for image in s.images if image.camera in names)) for s in self.sets]
        return replace(self, rig=self.rig.subset(tuple(names)), sets=sets)


@dataclass(frozen=True, eq=False)
class Run:
    """Estimates, and how long each image set took."""

    estimates: list[TrackEstimate]
    times_ms: np.ndarray

    @property
    def states(self) -> list[State]:
        return [estimate.state for estimate in self.estimates]


def load_clip(
    sample: Path, cache: Path, *, rig: Path | None = None, model: Path | None = None, start: Path | None = None
) -> Clip:
    """The clip of ``sample`` (made if it is not there), with other files than the sample's where named."""
    if not (sample / "initial_state.yaml").exists():
        prepare(sample)
    full, person = load_rig(rig or sample / "rig_refined.yaml"), load_model(model or sample / "person.yaml")
    small = replace(full, cameras=tuple(replace(camera, model=camera.model.resized(*SIZE)) for camera in full))
    drawn = data_file(DRAWN_MASKS)
    masks = load_reference_masks(write_masks(sample, drawn))
    key = _fingerprint(full, [drawn, Path(reference.__file__)])
    with ThreadPoolExecutor(2) as pool:
        parts = list(pool.map(lambda camera: _camera_part(camera, masks[camera.name], cache, key), full))
    stamps = parts[0].stamps_ns
    sets = [
        ImageSet(
            int(stamp), tuple(CameraImage(c.name, int(p.stamps_ns[i]), p.images[i]) for c, p in zip(small, parts, strict=True))
        )
        for i, stamp in enumerate(stamps)
    ]
    return Clip(
        small,
        full,
        person,
        load_state(start or sample / "initial_state.yaml", person),
        load_truth(sample / "truth.trc"),
        sets,
        {camera.name: part.masks for camera, part in zip(full, parts, strict=True)},
        resized_backgrounds(load_backgrounds(full), small),
    )


def track(tracker: Tracker, sets: Sequence[ImageSet]) -> Run:
    """Step through the sets."""
    estimates, times = [], []
    for image_set in sets:
        began = time.perf_counter()
        estimates.append(tracker.step(image_set))
        times.append(1e3 * (time.perf_counter() - began))
    return Run(estimates, np.array(times))


def judge(clip: Clip, run: Run, name: str, lag_images: float | None) -> Evaluation:
    """Errors against the joints triangulated from 2D detections; the lag counts sets of the run, None estimates it."""
    estimates = run.estimates
    data = RunData.of_estimates(Path(name), clip.model, clip.rig, estimates)
    options = EvaluationOptions(name, lag_images, "first", image_sets=len(estimates))
    return evaluate(data, clip.model, clip.truth, options, own_time=True)


def silhouettes(clip: Clip, run: Run) -> SilhouetteScores:
    """Intersection over union with the reference masks, at their own size, as ``tracker_node evaluate`` has it."""
    scores = SilhouetteScores()
    for name, masks in clip.masks.items():
        numbers = [number for number in masks if number < len(run.estimates)]
        ious = [
            intersection_over_union(render_mask(Configuration(clip.model, run.states[number]), clip.full[name]), masks[number])
            for number in numbers
        ]
        scores.numbers[name], scores.ious[name] = numbers, ious
    return scores


@dataclass(frozen=True, eq=False)
class _CameraPart:
    stamps_ns: np.ndarray
    images: list[np.ndarray]
    masks: dict[int, np.ndarray]


def _fingerprint(rig: CameraRig, files: Sequence[Path]) -> str:
    """Of everything that images and masks are made from but the lenses, which they do not depend on."""
    digest = hashlib.sha256(repr(SIZE).encode())
    for file in files:
        digest.update(file.read_bytes())
    for camera in rig:
        assert camera.source is not None
        digest.update(f"{camera.source} {Path(camera.source).stat().st_size}".encode())
    return digest.hexdigest()[:12]


def _camera_part(camera: Camera, masks: CameraMasks, cache: Path, key: str) -> _CameraPart:
    """Images (h, w, 3) of the tracked size and masks of the camera's own; from the cache, made if it is not there."""
    images_file, rest_file = cache / f"{camera.name}_{key}.npy", cache / f"{camera.name}_{key}.npz"
    if not (images_file.exists() and rest_file.exists()):
        _make_part(camera, masks, images_file, rest_file)
    # Copy on write: pages are shared between processes, and kernels get arrays that count as writable.
    images = np.asarray(np.load(images_file, mmap_mode="c", allow_pickle=False))
    with np.load(rest_file, allow_pickle=False) as rest:
        numbers, shape, packed, stamps = rest["numbers"], tuple(rest["shape"]), rest["masks"], rest["stamps_ns"]
    unpacked = {
        int(number): np.unpackbits(bits, count=shape[0] * shape[1]).reshape(shape)
        for number, bits in zip(numbers, packed, strict=True)
    }
    return _CameraPart(stamps, list(images), unpacked)


def _make_part(camera: Camera, masks: CameraMasks, images_file: Path, rest_file: Path) -> None:
    source = open_camera_source(camera)
    if source.n_images < 1:
        raise SourceError(source.path, "no images")
    height, width = camera.model.height, camera.model.width
    still = read_still(masks.still, width, height) if masks.still else None
    wanted = set(masks.image_numbers(source.n_images))
    images, stamps, found = [], [], {}
    for number, (stamp_ns, image) in enumerate(source):
        images.append(cv2.resize(image, SIZE, interpolation=cv2.INTER_AREA))
        stamps.append(stamp_ns)
        if number in wanted:
            found[number] = cv2.resize(masks.mask(number, image, still), (width, height), interpolation=cv2.INTER_NEAREST) > 0
    images_file.parent.mkdir(parents=True, exist_ok=True)
    np.save(images_file, np.array(images))
    packed = np.array([np.packbits(mask) for mask in found.values()])
    np.savez(rest_file, numbers=np.array(list(found)), shape=np.array([height, width]), masks=packed, stamps_ns=np.array(stamps))
