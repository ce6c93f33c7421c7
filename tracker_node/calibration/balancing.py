"""Makes the ``balancing`` sample ready to be tracked: rigs, backgrounds, and what is wrong with the recording put right.

What the files do not say, and images of them show: the videos of cam01 and cam02 (in the static trial of cam03 and cam04) were
resampled to 1080 pixels a row with black bars above and below, while calibration, stills and 2D joints are for 1088 x 1920.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from ..camera.rig import CameraRig
from ..errors import FileFormatError, SourceError
from ..loaders.rig.calibration_toml import load_pose2sim
from ..loaders.rig.rig_yaml import RigFile, rig_file_of, write_rig_file
from ..loaders.whole_file import write_whole
from .background import build_background, spread_images, write_image
from .points.rig_refinement import Refinement, load_joints, refine_rig

# Calibration pixels of a pixel of the narrow videos: fitted to the stills (affine image registration), to about 0.3 px.
NARROW_MAP = ((1.0074, 0.0, 0.0), (0.0, 1.0074, -7.2))
NARROW_SIZE = (1080, 1920)
_FILES = ("rig_refined.yaml", "person.yaml", "initial_state.yaml", "truth.trc", "tracker.yaml", "recording.yaml")
NARROW_CAMERAS = {"videos": ("cam01", "cam02"), "static": ("cam03", "cam04")}


def copy_files(files: Mapping[str, Path], output: Path) -> None:
    """Copy the sample's files; what is there already, unchanged in size, stays.

    Parameters
    ----------
    files : name in the folder -> file.
    output : the folder; it is made.

    Raises
    ------
    SourceError : when a file cannot be written.
    """
    for name, source in files.items():
        target = output / name
        if target.exists() and target.stat().st_size == source.stat().st_size:
            continue
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
        except OSError as error:
            raise SourceError(target, f"cannot be written: {error.strerror}") from error


def write_rigs(folder: Path) -> Refinement:
    """Write rig.yaml, rig_refined.yaml and rig_static.yaml (refined, for the static trial) into the sample's folder."""
    rig = named_rig(folder / "calibration.toml")
    original = rig_file(rig, "videos")
    write_rig_file(original, folder / "rig.yaml")
    refinement = refine_rig(rig, load_joints(folder / "points2d.zip", rig))
    places = {camera.name: camera.T_world_cam for camera in refinement.rig}
    write_rig_file(rig_file(rig, "static").with_extrinsics(places), folder / "rig_static.yaml")
    write_rig_file(original.with_extrinsics(places), folder / "rig_refined.yaml")
    return refinement


def named_rig(toml: Path) -> CameraRig:
    """The calibration with the cameras' names as the videos have them (``cam_01`` is ``cam01``)."""
    rig = load_pose2sim(toml)
    return replace(rig, cameras=tuple(replace(camera, name=camera.name.replace("_", "")) for camera in rig))


def rig_file(rig: CameraRig, trial: str) -> RigFile:
    """Rig of one trial.

    Parameters
    ----------
    rig : cameras with the names of the videos.
    trial : ``videos`` or ``static``.

    Returns
    -------
    The rig with sources, backgrounds, and the map of the narrow videos' pixels.
    """
    changes: dict[str, dict[str, object]] = {}
    for name in rig.names:
        changes[name] = {"source": f"{trial}/{name}.mp4"}
        if trial == "videos":
            changes[name]["background"] = f"backgrounds/{name}.png"
        if name in NARROW_CAMERAS[trial]:
            changes[name] |= {"pixel_map": NARROW_MAP, "file_image_size": NARROW_SIZE}
    return rig_file_of(rig).with_cameras(changes)


def has_backgrounds(folder: Path) -> bool:
    """True when every background has been written."""
    return all((folder / f"backgrounds/{still.stem}.png").exists() for still in (folder / "stills").glob("*.png"))


def is_prepared(folder: Path) -> bool:
    """True when the sample is there as a whole, ready to be tracked."""
    return has_backgrounds(folder) and all((folder / name).exists() for name in _FILES)


def write_backgrounds(folder: Path, names: tuple[str, ...] = ()) -> None:
    """Write backgrounds/camNN.png in the pixels of the videos, from the videos and the stills.

    The stills alone will not do: their exposure differs, and on those of cam01 and cam02 a person stands in mid-scene.

    Parameters
    ----------
    folder : of the sample.
    names : of cameras; none: all.

    Raises
    ------
    FileFormatError : for a still that is no image.
    SourceError : for a video that cannot be read.
    """
    cameras = rig_file(named_rig(folder / "calibration.toml"), "videos").cameras
    for name in names or tuple(cameras):
        entry = cameras[name]
        image = cv2.imread(str(folder / "stills" / f"{name}.png"))
        if image is None:
            raise FileFormatError(folder / "stills" / f"{name}.png", "(file)", "an image", "something else")
        if entry.pixel_map is not None and entry.file_image_size is not None:
            # WARP_INVERSE_MAP: the map says where a pixel of the result comes from, which is what the pixel map does.
            flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
            image = cv2.warpAffine(image, np.array(entry.pixel_map), entry.file_image_size, flags=flags)
        images = spread_images(folder / "videos" / f"{name}.mp4")
        write_image(folder / "backgrounds" / f"{name}.png", build_background(images, image).image)


def write_masks(folder: Path, drawn: Path | None = None) -> Path:
    """Write masks.json: reference silhouettes of cam03 and cam04, by difference to their stills.

    On these, nobody stands behind the man.

    Parameters
    ----------
    folder : of the sample.
    drawn : masks.json with outlines drawn by hand for other cameras, taken over.

    Returns
    -------
    The path of masks.json.
    """
    cameras: dict[str, object] = {}
    if drawn is not None:
        cameras |= json.loads(drawn.read_text(encoding="utf-8"))["cameras"]
    for name, entry in rig_file(named_rig(folder / "calibration.toml"), "videos").cameras.items():
        if name in ("cam03", "cam04"):
            cameras[name] = {"image_size": list(entry.image_size), "still": f"stills/{name}.png"}
    path = folder / "masks.json"
    write_whole(path, json.dumps({"cameras": cameras}, indent=1) + "\n")
    return path
