"""The first seconds of each camera's images, for the doctor: from the rig's own sources, other files, or a bag."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import dropwhile, islice
from pathlib import Path

from ..camera.rig import Camera, CameraRig
from ..errors import SourceError, TrackerError, UnknownNameError
from ..loaders.bag.metadata import STORAGE_SUFFIXES
from ..loaders.images.source import ImageSource, open_camera_source_of_any_size
from .recording import CameraRecording

DEFAULT_SECONDS = 4.0


def with_inputs(rig: CameraRig, inputs: Sequence[str]) -> CameraRig:
    """The rig with other sources.

    Parameters
    ----------
    rig : the cameras.
    inputs : none, for the rig's own; one bag; one video, folder or other source per camera in the order of the rig; or
        ``camera=source`` for some of them.

    Returns
    -------
    The rig with these sources.

    Raises
    ------
    SourceError : neither one for each camera nor a bag.
    UnknownNameError : a camera that is not in the rig.
    """
    if not inputs:
        return rig
    if all("=" in text for text in inputs):
        named = dict(text.split("=", 1) for text in inputs)
    elif len(inputs) == 1 and _is_bag(inputs[0]):
        named = {name: f"bag:{inputs[0].removeprefix('bag:')}" for name in rig.names}
    elif len(inputs) == len(rig):
        named = dict(zip(rig.names, inputs, strict=True))
    else:
        names = ", ".join(rig.names)
        problem = f"expected a bag, one source for each of {names}, or camera=source; got {len(inputs)} sources"
        raise SourceError(" ".join(inputs), problem)
    for name in named:
        if name not in rig.names:
            raise UnknownNameError("camera", name, rig.names)
    cameras = tuple(replace(c, source=named[c.name]) if c.name in named else c for c in rig)
    return replace(rig, cameras=cameras)


def record(
    rig: CameraRig, seconds: float = DEFAULT_SECONDS, progress: Callable[[str], None] = lambda camera: None
) -> dict[str, CameraRecording]:
    """Read the first images of every camera, from the moment on at which the last of them begins.

    A camera that ends before that moment is read from its own beginning. What cannot be read is told in the recording's
    ``problems``.

    Parameters
    ----------
    rig : cameras with sources.
    seconds : how much is read.
    progress : called with the name of each camera before it is read.

    Returns
    -------
    Camera -> its images. What cannot be read is in the recording's ``problems``.
    """
    opened = {camera.name: _opened(camera) for camera in rig}
    first_ns = max((o.stamp_ns(o.options.start) for o in opened.values() if isinstance(o, ImageSource)), default=0)
    recordings = {}
    for name, source in opened.items():
        progress(name)
        if isinstance(source, ImageSource):
            recordings[name] = _recorded(name, source, seconds, first_ns)
        else:
            recordings[name] = CameraRecording(name, 0, 1.0, problems=[str(source)])
    return recordings


def _opened(camera: Camera) -> ImageSource | TrackerError:
    """The source, or why it cannot be opened."""
    try:
        source = open_camera_source_of_any_size(camera)
        source.stamp_ns(source.options.start)  # which has to be read from a bag
        return source
    except TrackerError as error:
        return error


def _recorded(name: str, source: ImageSource, seconds: float, first_ns: int) -> CameraRecording:
    early = round(1e-9 * (first_ns - source.stamp_ns(source.options.start)) * source.rate_hz)
    if early >= source.n_images:  # over before the others begin
        early, first_ns = 0, source.stamp_ns(source.options.start)
    n = min(source.n_images - early, max(2, round(seconds * source.rate_hz)))
    recording = CameraRecording(name, n, source.rate_hz, notes=[source.note] if source.note else [])
    try:
        for stamp_ns, bgr in islice(dropwhile(lambda image: image[0] < first_ns, source), n):
            recording.add(stamp_ns, bgr)
    except TrackerError as error:
        recording.problems.append(str(error))
    recording.problems += source.counts.problems
    return recording


def _is_bag(text: str) -> bool:
    path = Path(text.removeprefix("bag:"))
    return text.startswith("bag:") or path.suffix in STORAGE_SUFFIXES or (path / "metadata.yaml").exists()
