"""A clip of a clothed person, read back: cameras, body, image sets, true joints, and which limbs the cameras can see."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from tracker_node.calibration.body import scale_to_trial, targets_of
from tracker_node.calibration.pose import fit_state_to_landmarks
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import FileFormatError, SourceError
from tracker_node.evaluation.truth.files import LIMBS, PAIRED, SIDES
from tracker_node.loaders.motion.trc import load_trc
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.render.raycast.raycaster import render_view
from tracker_node.tracking.limbs.tree import limbs_of

RATE_HZ = 30.0
ROTATIONS = "rotations.npz"  # of the segments, as `_clip` writes them
JOINTS = tuple(f"{side}_{joint}" for joint in PAIRED for side in SIDES)
ENDS = tuple(JOINTS.index(end) for end in LIMBS.values())  # of the limbs, in the order of `LIMBS`
LIMB_NAMES = tuple(f"{side}_{'hand' if 'arm' in limb else 'foot'}" for limb in LIMBS for side in [limb.split()[0]])
"""What the tracker calls these limbs."""
CHAINS = tuple(
    tuple(JOINTS.index(f"{limb.split()[0]}_{joint}") for joint in (PAIRED[:3] if "arm" in limb else PAIRED[3:])) for limb in LIMBS
)
"""The three joints of each limb, from the trunk on."""
_SAMPLES = 5  # points on each of a limb's two bones, at which it is asked whether a camera sees it


@dataclass(frozen=True, eq=False)
class ClothedClip:
    """A recording with exact truth.

    Attributes
    ----------
    name : of its folder.
    rig, model : cameras, and the body scaled to ``static.trc``.
    truth_m : (n, 12, 3) world, joints in the order of `JOINTS`.
    targets : landmark -> place (3,) in each image set, of all that the truth has.
    rotations : segment -> ``R_world_segment`` (n, 3, 3), of clips that have them.
    """

    name: str
    folder: Path
    rig: CameraRig
    model: ArticulatedModel
    truth_m: np.ndarray
    targets: list[dict[str, np.ndarray]]
    rotations: dict[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.truth_m)

    def seen_by(self, *cameras: str) -> ClothedClip:
        """The clip by some of its cameras alone."""
        return replace(self, rig=self.rig.subset(cameras))

    def start(self, row: int = 0) -> State:
        """The state whose landmarks are nearest to the truth."""
        return fit_state_to_landmarks(self.model, self.targets[row]).state

    def image_set(self, row: int) -> ImageSet:
        """The images of one set.

        Raises
        ------
        SourceError : one is missing.
        """
        stamp_ns, images = round(row * 1e9 / RATE_HZ), []
        for camera in self.rig:
            path = self.folder / camera.name / f"{row:04d}.jpg"
            pixels = cv2.imread(str(path), cv2.IMREAD_COLOR)
            if pixels is None:
                raise SourceError(path, "cannot be read as an image")
            images.append(CameraImage(camera.name, stamp_ns, pixels))
        return ImageSet(stamp_ns, tuple(images))

    def sets(self, first: int = 0, end: int | None = None) -> Iterator[ImageSet]:
        """Image sets ``first`` to ``end`` (not included)."""
        return map(self.image_set, range(first, min(len(self) if end is None else end, len(self))))


def load_clip(folder: Path, body: ArticulatedModel | None = None) -> ClothedClip:
    """The clip of a folder.

    Parameters
    ----------
    folder : of the clip.
    body : to be scaled to its static trial; None: the human with ankles.

    Returns
    -------
    The clip.

    Raises
    ------
    FileFormatError : a joint is missing in its truth.
    SourceError : it is no folder.
    """
    if not folder.is_dir():
        raise SourceError(folder, "no such folder")
    model = scale_to_trial(body or human_model(ankles=True), load_trc(folder / "static.trc")).model
    markers = load_trc(folder / "truth.trc")
    targets = [targets_of(model, markers, row) for row in range(len(markers))]
    missing = [joint for joint in JOINTS if any(joint not in row for row in targets)]
    if missing:
        raise FileFormatError(folder / "truth.trc", missing[0], "a place in every row", "none")
    truth = np.array([[row[joint] for joint in JOINTS] for row in targets])
    rotations = _rotations(folder / ROTATIONS)
    _add_hands(model, targets, rotations)
    return ClothedClip(folder.name, folder, load_rig(folder / "rig.yaml"), model, truth, targets, rotations)


def _rotations(path: Path) -> dict[str, np.ndarray]:
    if not path.is_file():
        return {}
    with np.load(path, allow_pickle=False) as arrays:
        return dict(zip(arrays["names"].tolist(), np.swapaxes(arrays["rotations"], 0, 1), strict=True))


def _add_hands(model: ArticulatedModel, targets: list[dict[str, np.ndarray]], rotations: dict[str, np.ndarray]) -> None:
    """Targets for what a body has on its hands: about the true wrist, turned as the true hand is."""
    for mark in model.landmarks:
        side, _, link = mark.link.partition("_")
        if link == "hand" and mark.link in rotations:
            for row, R in zip(targets, rotations[mark.link], strict=True):
                row[mark.name] = row[f"{side}_wrist"] + R @ mark.position


def default_folders(drawn: Path) -> list[Path]:
    """``jump`` and ``box`` beside the other recordings that TRACKER_SHARED_DATA names, and clips of seeds 1 to 8 in ``drawn``."""
    named = os.environ.get("TRACKER_SHARED_DATA")
    shared = [Path(named) / "clothed_people" / name for name in ("jump", "box")] if named else []
    return [folder for folder in (*shared, *(drawn / f"clip_{seed}" for seed in range(1, 9))) if folder.is_dir()]


Cover = tuple[int, int, int, int]
"""Part of an image that something hides: left, top, right, bottom (not included)."""


def limbs_shown(clip: ClothedClip, rows: Sequence[int], covers: Sequence[Sequence[Cover | None]] = ()) -> np.ndarray:
    """How much of each limb the cameras see by the true pose; what others hide is not known, but for ``covers``.

    Parameters
    ----------
    clip : its body and truth.
    rows : image sets.
    covers : by row and camera what is hidden; empty: nothing.

    Returns
    -------
    (len(rows), 4) fraction of the limb's points, over all cameras, before which the body has no other part.
    """
    of_limbs = {limb.name: limb.shapes for limb in limbs_of(clip.model)}
    own = [np.flatnonzero(of_limbs[name]) + 1 for name in LIMB_NAMES]
    shown, state = np.zeros((len(rows), len(own))), None
    for i, row in enumerate(rows):
        state = fit_state_to_landmarks(clip.model, clip.targets[row], state).state
        hidden = covers[i] if covers else [None] * len(clip.rig)
        views = [render_view(Configuration(clip.model, state), camera).labels for camera in clip.rig]
        for k, (chain, labels) in enumerate(zip(CHAINS, own, strict=True)):
            points = _along(clip.truth_m[row, list(chain)])
            seen = [_seen(*each, points, labels) for each in zip(clip.rig, views, hidden, strict=True)]
            shown[i, k] = np.mean(seen)
    return shown


def _along(chain: np.ndarray) -> np.ndarray:
    """Points on two bones (3, 3), without the first joint."""
    steps = np.linspace(0.2, 1.0, _SAMPLES)[:, None]
    return np.vstack([a + steps * (b - a) for a, b in pairwise(chain)])


def _seen(camera: Camera, view: np.ndarray, cover: Cover | None, points: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """(n,) whether the limb's own parts, or nothing, are in front where its points are in the image."""
    pixels, valid = camera.project(points)
    height, width = view.shape
    u, v = np.round(np.where(valid[:, None], pixels, -1.0)).astype(int).T
    inside = valid & (u >= 0) & (u < width) & (v >= 0) & (v < height)
    front = view[np.clip(v, 0, height - 1), np.clip(u, 0, width - 1)]
    shown = inside & (np.isin(front, labels) | (front == 0))
    if cover is not None:
        left, top, right, bottom = cover
        shown &= ~((u >= left) & (u < right) & (v >= top) & (v < bottom))
    return shown
