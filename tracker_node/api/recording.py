"""A recording: cameras, body, parameters and images, ready to be tracked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..camera.rig import CameraRig
from ..errors import without_password
from ..loaders.images.source import SourceOptions
from ..loaders.model.model_yaml import load_model
from ..loaders.model.state_yaml import load_state
from ..loaders.recording_yaml import FILES, load_recording
from ..loaders.rig.rig_yaml import load_rig
from ..model.articulated import ArticulatedModel
from ..model.configuration import State
from ..runs.config_file import load_config
from ..runs.image_sets import ImageSetStream, SourceStream
from ..runs.people.detection import DetectionOptions
from ..runs.people.recorded import PointFiles
from ..tracking.config import TrackerConfig


@dataclass(frozen=True, eq=False)
class Recording:
    """What `track` needs.

    Parameters
    ----------
    rig : cameras with their lenses, places and sources (videos, image folders, bags).
    model : body to track.
    config : parameters of the tracker.
    initial_state : where the body is in the first images; None: it is searched for in them.
    occluders : fixed things that may hide the body, in world axes.
    images : which images of the sources, at which rate and size.
    detection : how people are found in the images, where `keypoints` is among the modalities.
    points : files with the points of another detector, in whose place; None: none.
    person : (3,) meters, world: of several people, the one there; None: the one nearest to where the cameras look.
    masks : record the body's silhouette in every camera, too.
    masked_images : record the images where the body is, the rest black, too.
    output : folder that ``recording.yaml`` names; None: none.
    files : name -> path of the files that the recording was read from, for ``run.json``.

    Examples
    --------
    >>> rig, model = load_rig("rig.yaml"), load_model("person.yaml")  # doctest: +SKIP
    >>> recording = Recording(rig, model, initial_state=load_state("start.yaml", model))  # doctest: +SKIP
    """

    rig: CameraRig
    model: ArticulatedModel
    config: TrackerConfig = field(default_factory=TrackerConfig)
    initial_state: State | None = None
    occluders: ArticulatedModel | None = None
    images: SourceOptions = field(default_factory=SourceOptions)
    detection: DetectionOptions = field(default_factory=DetectionOptions)
    points: PointFiles | None = None
    person: np.ndarray | None = None
    masks: bool = False
    masked_images: bool = False
    output: Path | None = None
    files: Mapping[str, str] = field(default_factory=dict)

    def image_sets(self) -> ImageSetStream:
        """The image sets of the sources, in the order of their stamps; iterate over them once.

        Raises
        ------
        SourceError : not a single source can be opened.
        """
        return SourceStream(self.rig, self.config.synchronizer, self.images)

    def named_options(self) -> dict[str, Any]:
        """Content of ``options`` in ``run.json``, by the names that the command line uses."""
        size = self.images.size
        return {
            **dict(self.files),
            "cameras": list(self.rig.names),
            "source": [[camera.name, without_password(camera.source)] for camera in self.rig if camera.source],
            "start": self.images.start,
            "end": self.images.end,
            "rate": self.images.rate_hz,
            "resize": None if size is None else list(size),
            "shrink": self.images.shrink,
            "base_stamp_ns": self.images.base_stamp_ns,
            "keypoints_weights": None if self.detection.weights is None else str(self.detection.weights),
            "keypoints_every": self.detection.every_sets,
            "keypoints": None if self.points is None else str(self.points.path.resolve()),
            "keypoints_table": None if self.points is None or self.points.table is None else str(self.points.table.resolve()),
            "keypoints_first": 0 if self.points is None else self.points.first,
            "person": None if self.person is None else list(map(float, self.person)),
            "masks": self.masks,
            "masked_images": self.masked_images,
        }


def open_recording(path: str | Path) -> Recording:
    """Read ``recording.yaml`` and the files that it names.

    Parameters
    ----------
    path : the file; paths in it are relative to its folder.

    Returns
    -------
    The recording. Its images are read by `track`, or by iterating over ``recording.image_sets()``.

    Raises
    ------
    FileFormatError : naming file and field; also a file that is missing.

    Examples
    --------
    >>> recording = open_recording("recording.yaml")  # doctest: +SKIP
    >>> run = track(recording)  # doctest: +SKIP
    """
    file = load_recording(path)
    rig, model = load_rig(file.rig), load_model(file.model)
    rig = with_sources(rig, file.sources_of(rig.names))
    images, points = file.images, file.keypoints
    return Recording(
        rig=rig.subset(file.cameras) if file.cameras else rig,
        model=model,
        config=load_config(file.config) if file.config else TrackerConfig(),
        initial_state=load_state(file.initial_state, model) if file.initial_state else None,
        occluders=load_model(file.occluders) if file.occluders else None,
        images=SourceOptions(images.start, images.end, rate_hz=images.rate_hz, size=images.resize, shrink=images.shrink),
        detection=DetectionOptions(_path(points.weights), points.every_sets),
        points=None if points.files is None else PointFiles(Path(points.files), _path(points.table), points.first),
        person=None if file.person is None else np.array(file.person),
        masks=file.record.masks,
        masked_images=file.record.masked_images,
        output=Path(file.output),
        files={name: str(Path(getattr(file, name)).resolve()) for name in FILES if getattr(file, name)},
    )


def _path(name: str | None) -> Path | None:
    return None if name is None else Path(name)


def with_sources(rig: CameraRig, sources: Mapping[str, str]) -> CameraRig:
    """The rig with other sources for some cameras.

    Parameters
    ----------
    rig : cameras.
    sources : camera name -> video, image folder, or pattern.

    Returns
    -------
    The same cameras in the same order.

    Raises
    ------
    UnknownNameError : a camera that the rig does not have.
    """
    named = {name: replace(rig[name], source=source) for name, source in sources.items()}
    return CameraRig(tuple(named.get(camera.name, camera) for camera in rig), rig.world_frame, rig.lights)
