"""Two people in a real recording, `Demo_MultiPerson` of Pose2Sim: the man of the Balancing clip, and a woman who was put into it.

What the files do not say, and comparisons with the Balancing clip show:

- The videos are those of the Balancing clip, one image later, each scaled and moved by some pixels: ``PIXEL_MAPS``.
- The woman is rendered, with the poses of the calibration but with lenses that have no distortion and look through the middle of
  the image. So no rig is right for both: through the man's, her points miss each other by 17 px (median, at the videos' size),
  through hers by 8 px.
- She is drawn over everything, also over the man where he stands before her (cam03, cam04).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from benchmark.clothed._people import KeptPeople
from benchmark.contour._balancing_clip import SIZE
from tracker_node.calibration.balancing import named_rig
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.cli.sample import prepare
from tracker_node.evaluation.masks.reference import load_reference_masks
from tracker_node.evaluation.truth.files import load_truth
from tracker_node.loaders.fetched_files import Member, Wheel, fetch
from tracker_node.loaders.images.source import open_camera_source
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.motion.trajectory_file import Trajectories
from tracker_node.loaders.rig.qualisys_xml import load_qualisys
from tracker_node.loaders.rig.rig_yaml import RigFile, build_rig, rig_file_of
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import State
from tracker_node.model.humans.human import human_model
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.observation.keypoints.crop import Crop
from tracker_node.observation.keypoints.people import People
from tracker_node.tracking.keypoints.body_from_points import BodyFromPoints, body_from_points

HERE = Path(__file__).resolve().parent
WOMAN, WOMAN_MASKS = HERE / "woman.yaml", HERE / "woman_masks.json"
LAG_IMAGES = 1.9  # of the images behind the man's joints: an image more than the Balancing clip
MASKED = (0, 24, 48, 72, 96)  # images with masks of the woman
BODY_SETS = (0, 12, 24, 36, 48, 60, 72, 84, 96)
HEELS_M, CROWN_M = (0.25, -0.39, 0.0), (0.17, -0.38, 1.45)  # of the woman, world; she does not walk
# Scale, u and v of calibration pixels of a pixel of the videos: fitted to the Balancing clip (3000 points a camera) to 0.3 px.
PIXEL_MAPS = {
    "cam01": (1.0038, -0.57, -0.39),
    "cam02": (1.0083, 0.60, -7.72),
    "cam03": (0.9962, 1.82, 12.15),
    "cam04": (1.0000, 0.67, -0.57),
}
_FILE_SIZE = (1088, 1920)
_WHEEL = Wheel("pose2sim==0.10.49", "403e0dc4065898ba6a595e72a8970950310979253d60e24c2e00b16b36bf21e1")
_VIDEOS = {
    "cam01": "543cee6a4c2c2b52dc9eac9137ee63d14f1f84e706a9a7264769edcb11e5ea53",
    "cam02": "8895092a7cf26359205a427b7ac2f4a935c2e0bd36d9b7a5140cb33faa468a6b",
    "cam03": "d3daf48cdf9f5603868ddb99166ddaf9b12279e7ce968922926560d5fd3f0c99",
    "cam04": "1490149dc40e7301fa5ceae23862b044ba5c398a8b2a40df21ed894702728c09",
}


_CALIBRATION = Member(
    _WHEEL,
    "Pose2Sim/Demo_MultiPerson/calibration/Calib.qca.txt",
    "calibration",
    "fd90e4bbae3278ef1dc0cdd42a34ee06bf88286f628a02c00a29407aa39e34c5",
)


@dataclass(frozen=True, eq=False)
class TwoPeople:
    """The clip, and what its people are judged by.

    Attributes
    ----------
    rig, full : cameras as the calibration beside the videos has them, of the images' size and of the videos'.
    woman_rig, woman_full : as the woman is seen.
    man, woman : bodies.
    man_start : in the first image set, to a few centimeters.
    man_truth : joints; ``LAG_IMAGES`` ahead of the images.
    sets : images of the tracked size.
    woman_masks : camera -> number -> (h, w) bool of the videos' size.
    """

    rig: CameraRig
    full: CameraRig
    woman_rig: CameraRig
    woman_full: CameraRig
    man: ArticulatedModel
    woman: ArticulatedModel
    man_start: State
    man_truth: Trajectories
    sets: list[ImageSet]
    woman_masks: dict[str, dict[int, np.ndarray]]


def fetch_videos(cache: Path | None = None) -> dict[str, Path]:
    """Camera -> video; fetched by pip where the cache does not have them."""
    members = [Member(_WHEEL, f"Pose2Sim/Demo_MultiPerson/videos/{name}.mp4", name, digest) for name, digest in _VIDEOS.items()]
    return fetch(members, cache)


def load_two_people(sample: Path, cache: Path | None = None) -> TwoPeople:
    """The clip.

    Parameters
    ----------
    sample : folder of the Balancing clip, whose cameras, man and joints it takes; made if it is not there.
    cache : folder of the videos; None: that of all samples.

    Returns
    -------
    With cameras ``cam01`` to ``cam04``.
    """
    if not (sample / "initial_state.yaml").exists():
        prepare(sample)
    videos = fetch_videos(cache)
    full = _with_sources(load_qualisys(fetch([_CALIBRATION], cache)[_CALIBRATION.name]), videos)
    woman_full = _mapped(rig_file_of(_seen_through_the_middle(named_rig(sample / "calibration.toml"))), videos)
    man = load_model(sample / "person.yaml")
    masks = load_reference_masks(WOMAN_MASKS)
    return TwoPeople(
        _small(full),
        full,
        _small(woman_full),
        woman_full,
        man,
        load_model(WOMAN) if WOMAN.exists() else human_model(ankles=True),
        load_state(sample / "initial_state.yaml", man),
        load_truth(sample / "truth.trc"),
        _image_sets(full),
        {name: {number: of_one.mask(number) > 0 for number in MASKED} for name, of_one in masks.items()},
    )


def woman_from_points(clip: TwoPeople, people: KeptPeople, rows: Sequence[int] = BODY_SETS) -> BodyFromPoints:
    """The woman's body from a network's points in some image sets; its ``rows`` count these.

    Parameters
    ----------
    clip, people : the clip; the network.
    rows : numbers of the image sets.

    Returns
    -------
    The body, as seen through ``woman_rig``.
    """
    seen = [woman_points(clip, people, row) for row in rows]
    place = 0.5 * (np.array(HEELS_M) + CROWN_M)
    return body_from_points(human_model(ankles=True), clip.woman_rig, seen, near=place)


def woman_points(clip: TwoPeople, people: KeptPeople, row: int) -> list[People]:
    """Whom the network finds where the woman stands, by camera.

    Parameters
    ----------
    clip, people : the clip; the network.
    row : number of the image set.

    Returns
    -------
    One person each: in the whole image it takes her back for her front, or the man for her.
    """
    images = zip(clip.sets[row].images, clip.woman_rig, strict=True)
    return [people.find(np.ascontiguousarray(image.bgr), _woman_crop(camera)).people for image, camera in images]


def _woman_crop(camera: Camera) -> Crop:
    (heels, crown), _ = camera.project(np.array([HEELS_M, CROWN_M]))
    up, center = crown - heels, 0.5 * (heels + crown)
    return Crop((float(center[0]), float(center[1])), 1.25 * float(np.linalg.norm(up)), float(np.arctan2(up[0], -up[1])))


def _seen_through_the_middle(rig: CameraRig) -> CameraRig:
    """The cameras without distortion, their principal points in the middle of the image."""
    cameras = []
    for camera in rig:
        K = camera.model.K.copy()
        K[:2, 2] = 0.5 * (camera.model.width - 1), 0.5 * (camera.model.height - 1)
        lens = replace(camera.model, K=K, distortion_model="none", distortion=np.zeros(0))
        cameras.append(replace(camera, model=lens))
    return replace(rig, cameras=tuple(cameras))


def _with_sources(rig: CameraRig, videos: dict[str, Path]) -> CameraRig:
    return replace(rig, cameras=tuple(replace(camera, source=str(videos[camera.name])) for camera in rig))


def _mapped(rig_file: RigFile, videos: dict[str, Path]) -> CameraRig:
    """The rig for pixels of the videos."""
    changes = {}
    for name in rig_file.cameras:
        scale, u, v = PIXEL_MAPS[name]
        pixel_map = ((scale, 0.0, u), (0.0, scale, v))
        source = str(videos[name])
        changes[name] = {"source": source, "background": None, "pixel_map": pixel_map, "file_image_size": _FILE_SIZE}
    return build_rig(rig_file.with_cameras(changes), Path("/"))


def _small(rig: CameraRig) -> CameraRig:
    return replace(rig, cameras=tuple(replace(camera, model=camera.model.resized(*SIZE)) for camera in rig))


def _image_sets(rig: CameraRig) -> list[ImageSet]:
    """All images at the tracked size; those of a set were exposed together."""
    sources = [open_camera_source(camera) for camera in rig]
    sets = []
    for images in zip(*sources, strict=True):
        small = [cv2.resize(image, SIZE, interpolation=cv2.INTER_AREA) for _, image in images]
        seen = (CameraImage(camera.name, stamp, bgr) for camera, (stamp, _), bgr in zip(rig, images, small, strict=True))
        sets.append(ImageSet(images[0][0], tuple(seen)))
    return sets
